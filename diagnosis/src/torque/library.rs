//! Candidate dictionary of a torque diagnosis: every effect of the torque domain with the columns of its parameters.
//!
//! Signs and limits as in docs/reference/effects.md. An effect that these recordings cannot show is not a candidate, and the reason is listed.

use crate::engine::library::{Family, Form, Library, Sign};
use crate::engine::table::Column;
use physics::{Arm, JointKind};

use super::columns::{Law, lowest_speed, shortest_way, usual_speed, waves};
use super::known::{Open, Stated, moments};
use super::load::of_delay;
use super::motion::Motion;

/// Initial Stribeck velocities, as shares of the joint's RMS velocity.
const STRIBECK: [f64; 5] = [0.02, 0.05, 0.1, 0.2, 0.4];
/// Initial reversal distances of a hysteresis, as shares of the joint's span.
const REVERSALS: [f64; 4] = [0.002, 0.005, 0.015, 0.05];
/// Minimum range of temperature for a temperature dependence to be a candidate, K.
const STEADY_K: f64 = 1.0;

/// Range of a drive's relative gain error; a larger one has another cause.
pub(super) const GAIN: [f64; 2] = [-0.8, 1.0];

impl Library {
    /// Lists all effects of a joint that does not move as not testable.
    pub(super) fn skip_joint(&mut self, joint: usize) {
        let all = KINDS.iter().map(|kind| (*kind, Some(joint), "the joint does not move"));
        self.untested.extend(all);
    }

    /// Adds all candidate effects of one joint.
    pub(super) fn add_joint(&mut self, stated: &Stated<'_>, motion: &Motion, joint: usize) {
        let arm = &stated.model.arm;
        let [low, high] = motion.span(joint);
        let (span, usual) = (high - low, usual_speed(motion, joint));
        let is_angle = arm.joints()[joint].kind == JointKind::Revolute;
        let mut law = |law: Law| self.column(law.column(motion, joint));
        let direction = law(Law::Direction);
        let speed = law(Law::Speed);
        let one = law(Law::One);
        let growing = law(Law::AbsoluteSpeed);
        let acceleration = law(Law::Acceleration);
        let position = law(Law::Position);
        let turns = is_angle.then(|| [law(Law::Cosine), law(Law::Sine)]);
        let lowest = lowest_speed(motion, joint);
        let stribeck = STRIBECK.map(|share| (share * usual).max(lowest));
        let stribeck = stribeck.map(|speed| (speed, law(Law::Stribeck { speed })));
        let shortest = shortest_way(motion, joint);
        let memory = REVERSALS.map(|share| (share * span).max(shortest));
        let memory = memory.map(|distance| (distance, law(Law::Memory { distance })));
        let mut put = |kind, columns: &[usize], signs: &[Sign], form, settings: &[_]| {
            self.families.push(Family {
                kind,
                joint: Some(joint),
                recording: None,
                columns: columns.to_vec(),
                signs: signs.to_vec(),
                form,
                revises: stated.revises(kind, joint),
                settings: settings.to_vec(),
            });
        };
        let (any, up) = (Sign::Any, Sign::AtLeast(0.0));
        let beside = |kind| Sign::AtLeast(-stated.first(kind, joint));
        let [dry, viscous] = ["coulomb_friction", "viscous_friction"].map(beside);
        put("coulomb_friction", &[direction], &[dry], Form::Plain(&["level"]), &[]);
        put("viscous_friction", &[speed], &[viscous], Form::Plain(&["coefficient"]), &[]);
        put("friction_asymmetry", &[one], &[any], Form::Plain(&["offset"]), &[]);
        put("friction_asymmetry", &[growing], &[any], Form::Plain(&["coefficient"]), &[]);
        let both = Form::Plain(&["offset", "coefficient"]);
        put("friction_asymmetry", &[one, growing], &[any, any], both, &[]);
        let inertia = if is_angle { &["inertia"] } else { &["mass"] };
        put("inertia", &[acceleration], &[any], Form::Plain(inertia), &[]);
        put("spring", &[position, one], &[up, any], Form::Spring, &[]);
        if let Some([cosine, sine]) = turns {
            let form = Form::Plain(&["cos", "sin"]);
            put("gravity_torque", &[cosine, sine], &[any, any], form, &[]);
        }
        for (speed, column) in stribeck {
            let set = [("stribeck_speed", speed)];
            put("stribeck_friction", &[column], &[up], Form::Plain(&["level"]), &set);
        }
        for (distance, column) in memory {
            let set = [("reversal", distance)];
            put("hysteresis", &[column], &[up], Form::Loop, &set);
        }
        if stated.has_spring(joint) {
            self.add_hardening(joint, Law::Cube { rest: stated.rest(joint) }.column(motion, joint));
        }
        self.add_warmth(motion, joint);
    }

    /// A cubic stiffness added to a stated or found spring; `cube`: third power of the deflection from its rest position.
    pub(super) fn add_hardening(&mut self, joint: usize, cube: Column) {
        let family = Family {
            kind: "spring_hardening",
            joint: Some(joint),
            recording: None,
            columns: Vec::new(),
            signs: vec![Sign::Any],
            form: Form::Plain(&["cubic_stiffness"]),
            revises: false,
            settings: Vec::new(),
        };
        self.add(family, vec![cube]);
    }

    /// Gives a candidate that revises a stated parameter the same column as that parameter, so that two evaluations of one law do not give a spurious
    /// difference.
    pub(super) fn revise(&mut self, open: &[Open]) {
        let is_plain =
            |family: &&Family| matches!(family.form, Form::Plain(_)) && family.settings.is_empty();
        for family in self.families.iter().filter(is_plain) {
            let same = |one: &&Open| one.first_of == Some((family.kind, family.joint));
            if let (Some(one), [column]) = (open.iter().find(same), &family.columns[..]) {
                self.columns[*column] = one.column.clone();
            }
        }
    }

    /// Viscous friction that decreases with the joint's temperature.
    fn add_warmth(&mut self, motion: &Motion, joint: usize) {
        let kind = "friction_temperature";
        if temperatures(motion, joint) < STEADY_K {
            let why = "no temperature was recorded, or it did not change";
            self.untested.push((kind, Some(joint), why));
            return;
        }
        let family = Family {
            kind,
            joint: Some(joint),
            recording: None,
            columns: Vec::new(),
            signs: vec![Sign::Any],
            form: Form::Warmth,
            revises: false,
            settings: Vec::new(),
        };
        self.add(family, vec![Law::Warmth { per_kelvin: 0.0 }.column(motion, joint)]);
    }

    /// First moments of the bodies with stated masses, as corrections. An arm of one joint has them already as sine and cosine.
    pub(super) fn add_moments(&mut self, arm: &Arm, motion: &Motion) {
        if arm.count() == 1 {
            return;
        }
        for (joint, columns) in moments(arm, motion) {
            let family = Family {
                kind: "gravity_torque",
                joint: Some(joint),
                recording: None,
                columns: Vec::new(),
                signs: vec![Sign::Any; 3],
                form: Form::Moment,
                revises: false,
                settings: Vec::new(),
            };
            self.add(family, columns);
        }
    }

    /// A ripple of the given number of cycles per revolution, or rad/m for a prismatic joint.
    pub(super) fn ripple(&mut self, motion: &Motion, joint: usize, cycles: f64) {
        let columns = waves(motion, joint, cycles).into();
        let family = Family {
            kind: "torque_ripple",
            joint: Some(joint),
            recording: None,
            columns: Vec::new(),
            signs: vec![Sign::Any; 2],
            form: Form::Wave,
            revises: false,
            settings: vec![("cycles", cycles)],
        };
        self.add(family, columns);
    }

    /// Effects proportional to torque itself: each drive's gain error, on the torque that the model states, and a common delay of all torques, on the
    /// torque of the model fitted with all candidates.
    pub(super) fn of_torque(
        &mut self,
        motion: &Motion,
        stated: &[Vec<f64>],
        torques: &[(usize, Vec<f64>)],
    ) {
        let family = |kind, joint, stem, sign| Family {
            kind,
            joint,
            recording: None,
            columns: Vec::new(),
            signs: vec![sign],
            form: Form::Plain(stem),
            revises: false,
            settings: Vec::new(),
        };
        for (joint, _) in torques {
            let torque = &stated[*joint];
            if torque.iter().all(|torque| torque.abs() < 1e-9) {
                let why =
                    "the model states no masses, and a gain cannot be distinguished from them";
                self.untested.push(("drive_gain", Some(*joint), why));
                continue;
            }
            let column = Column { parts: vec![(*joint, torque.as_slice().into())] };
            let sign = Sign::Within(GAIN);
            self.add(family("drive_gain", Some(*joint), &["gain"], sign), vec![column]);
        }
        let late =
            |(joint, torque): &(usize, Vec<f64>)| (*joint, of_delay(motion, torque, 0.0).into());
        let column = Column { parts: torques.iter().map(late).collect() };
        self.add(family("torque_delay", None, &["delay"], Sign::Any), vec![column]);
    }
}

/// Effects that need a moving joint.
const KINDS: [&str; 12] = [
    "coulomb_friction",
    "viscous_friction",
    "stribeck_friction",
    "friction_asymmetry",
    "load_friction",
    "friction_temperature",
    "inertia",
    "gravity_torque",
    "torque_ripple",
    "spring",
    "hysteresis",
    "drive_gain",
];

/// Range of a joint's temperature, K.
fn temperatures(motion: &Motion, joint: usize) -> f64 {
    let all = motion.runs.iter().flat_map(|run| run.joints[joint].temperature.iter());
    let [low, high] =
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], t| [l.min(*t), h.max(*t)]);
    (high - low).max(0.0)
}
