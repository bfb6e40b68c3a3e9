//! Candidate dictionary of a torque diagnosis: every effect of the torque domain with the columns of its parameters.
//!
//! Signs and limits as in docs/reference/effects.md. An effect that these recordings cannot show is not a candidate, and the reason is listed.

use crate::engine::dictionary::{
    CandidateDictionary, CandidateTerm, CoefficientForm, ParameterBounds,
};
use crate::engine::regression_data::Regressor;
use physics::{Arm, JointKind};

use super::load_dependent::delay_quotient;
use super::motion::Motion;
use super::regressors::{
    TorqueTerm, lowest_velocity, rms_velocity, shortest_reversal, sine_and_cosine,
};
use super::stated_effects::{StatedModel, UncertainParameter, first_moment_columns};

/// Initial Stribeck velocities, as shares of the joint's RMS velocity.
const STRIBECK_SHARES: [f64; 5] = [0.02, 0.05, 0.1, 0.2, 0.4];
/// Initial reversal distances of a hysteresis, as shares of the joint's span.
const REVERSAL_SHARES: [f64; 4] = [0.002, 0.005, 0.015, 0.05];
/// Minimum range of temperature for a temperature dependence to be a candidate, K.
const TEMPERATURE_RANGE_LEAST_K: f64 = 1.0;

/// Range of a drive's relative gain error; a larger one has another cause.
pub(super) const GAIN_RANGE: [f64; 2] = [-0.8, 1.0];

impl CandidateDictionary {
    /// Lists all effects of a joint that does not move as not testable.
    pub(super) fn list_untested_joint(&mut self, joint: usize) {
        let all = JOINT_EFFECTS.iter().map(|kind| (*kind, Some(joint), "the joint does not move"));
        self.untested.extend(all);
    }

    /// Adds all candidate effects of one joint.
    pub(super) fn add_joint(&mut self, stated: &StatedModel<'_>, motion: &Motion, joint: usize) {
        use CoefficientForm::Plain;

        let arm = &stated.model.arm;
        let [low, high] = motion.span(joint);
        let (span, usual) = (high - low, rms_velocity(motion, joint));
        let is_angle = arm.joints()[joint].kind == JointKind::Revolute;
        let mut law = |law: TorqueTerm| self.column(law.column(motion, joint));
        let direction = law(TorqueTerm::VelocitySign);
        let speed = law(TorqueTerm::Velocity);
        let one = law(TorqueTerm::Constant);
        let growing = law(TorqueTerm::AbsoluteVelocity);
        let acceleration = law(TorqueTerm::Acceleration);
        let position = law(TorqueTerm::Position);
        let turns = is_angle.then(|| [law(TorqueTerm::Cosine), law(TorqueTerm::Sine)]);
        let lowest = lowest_velocity(motion, joint);
        let stribeck = STRIBECK_SHARES.map(|share| (share * usual).max(lowest));
        let stribeck = stribeck.map(|speed| (speed, law(TorqueTerm::Stribeck { speed })));
        let shortest = shortest_reversal(motion, joint);
        let memory = REVERSAL_SHARES.map(|share| (share * span).max(shortest));
        let memory = memory.map(|distance| (distance, law(TorqueTerm::Dahl { distance })));
        let mut put = |kind, columns: &[usize], signs: &[ParameterBounds], form, settings: &[_]| {
            self.terms.push(CandidateTerm {
                kind,
                joint: Some(joint),
                recording: None,
                columns: columns.to_vec(),
                signs: signs.to_vec(),
                form,
                corrects_stated: stated.has_uncertain_first(kind, joint),
                settings: settings.to_vec(),
            });
        };
        let (any, up) = (ParameterBounds::Any, ParameterBounds::AtLeast(0.0));
        let beside = |kind| ParameterBounds::AtLeast(-stated.first_value(kind, joint));
        let [dry, viscous] = ["coulomb_friction", "viscous_friction"].map(beside);
        put("coulomb_friction", &[direction], &[dry], Plain(&["level"]), &[]);
        put("viscous_friction", &[speed], &[viscous], Plain(&["coefficient"]), &[]);
        put("friction_asymmetry", &[one], &[any], Plain(&["offset"]), &[]);
        put("friction_asymmetry", &[growing], &[any], Plain(&["coefficient"]), &[]);
        let both = Plain(&["offset", "coefficient"]);
        put("friction_asymmetry", &[one, growing], &[any, any], both, &[]);
        let inertia = if is_angle { &["inertia"] } else { &["mass"] };
        put("inertia", &[acceleration], &[any], Plain(inertia), &[]);
        put("spring", &[position, one], &[up, any], CoefficientForm::Spring, &[]);
        if let Some([cosine, sine]) = turns {
            let form = Plain(&["cos", "sin"]);
            put("gravity_torque", &[cosine, sine], &[any, any], form, &[]);
        }
        for (speed, column) in stribeck {
            let set = [("stribeck_speed", speed)];
            put("stribeck_friction", &[column], &[up], Plain(&["level"]), &set);
        }
        for (distance, column) in memory {
            let set = [("reversal", distance)];
            put("hysteresis", &[column], &[up], CoefficientForm::Loop, &set);
        }
        if stated.has_spring(joint) {
            let rest = stated.spring_rest_position(joint);
            self.add_hardening(joint, TorqueTerm::CubedDeflection { rest }.column(motion, joint));
        }
        self.add_friction_temperature(motion, joint);
    }

    /// A cubic stiffness added to a stated or found spring; `cube`: third power of the deflection from its rest position.
    pub(super) fn add_hardening(&mut self, joint: usize, cube: Regressor) {
        let family = CandidateTerm {
            kind: "spring_hardening",
            joint: Some(joint),
            recording: None,
            columns: Vec::new(),
            signs: vec![ParameterBounds::Any],
            form: CoefficientForm::Plain(&["cubic_stiffness"]),
            corrects_stated: false,
            settings: Vec::new(),
        };
        self.add(family, vec![cube]);
    }

    /// Gives a candidate that revises a stated parameter the same column as that parameter, so that two evaluations of one law do not give a spurious
    /// difference.
    pub(super) fn share_stated_columns(&mut self, open: &[UncertainParameter]) {
        let is_plain = |family: &&CandidateTerm| {
            matches!(family.form, CoefficientForm::Plain(_)) && family.settings.is_empty()
        };
        for family in self.terms.iter().filter(is_plain) {
            let same = |one: &&UncertainParameter| {
                one.first_parameter_of == Some((family.kind, family.joint))
            };
            if let (Some(one), [column]) = (open.iter().find(same), &family.columns[..]) {
                self.columns[*column] = one.column.clone();
            }
        }
    }

    /// Viscous friction that decreases with the joint's temperature.
    fn add_friction_temperature(&mut self, motion: &Motion, joint: usize) {
        let kind = "friction_temperature";
        if temperature_range(motion, joint) < TEMPERATURE_RANGE_LEAST_K {
            let why = "no temperature was recorded, or it did not change";
            self.untested.push((kind, Some(joint), why));
            return;
        }
        let family = CandidateTerm {
            kind,
            joint: Some(joint),
            recording: None,
            columns: Vec::new(),
            signs: vec![ParameterBounds::Any],
            form: CoefficientForm::Warmth,
            corrects_stated: false,
            settings: Vec::new(),
        };
        self.add(
            family,
            vec![TorqueTerm::ThermalDecrease { per_kelvin: 0.0 }.column(motion, joint)],
        );
    }

    /// First moments of the bodies with stated masses, as corrections. An arm of one joint has them already as sine and cosine.
    pub(super) fn add_first_moments(&mut self, arm: &Arm, motion: &Motion) {
        if arm.count() == 1 {
            return;
        }
        for (joint, columns) in first_moment_columns(arm, motion) {
            let family = CandidateTerm {
                kind: "gravity_torque",
                joint: Some(joint),
                recording: None,
                columns: Vec::new(),
                signs: vec![ParameterBounds::Any; 3],
                form: CoefficientForm::Moment,
                corrects_stated: false,
                settings: Vec::new(),
            };
            self.add(family, columns);
        }
    }

    /// A ripple of the given number of cycles per revolution, or rad/m for a prismatic joint.
    pub(super) fn add_ripple(&mut self, motion: &Motion, joint: usize, cycles: f64) {
        let columns = sine_and_cosine(motion, joint, cycles).into();
        let family = CandidateTerm {
            kind: "torque_ripple",
            joint: Some(joint),
            recording: None,
            columns: Vec::new(),
            signs: vec![ParameterBounds::Any; 2],
            form: CoefficientForm::Wave,
            corrects_stated: false,
            settings: vec![("cycles", cycles)],
        };
        self.add(family, columns);
    }

    /// Effects proportional to torque itself: each drive's gain error, on the torque that the model states, and a common delay of all torques, on the
    /// torque of the model fitted with all candidates.
    pub(super) fn add_torque_proportional(
        &mut self,
        motion: &Motion,
        stated: &[Vec<f64>],
        torques: &[(usize, Vec<f64>)],
    ) {
        let family = |kind, joint, stem, sign| CandidateTerm {
            kind,
            joint,
            recording: None,
            columns: Vec::new(),
            signs: vec![sign],
            form: CoefficientForm::Plain(stem),
            corrects_stated: false,
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
            let column = Regressor { parts: vec![(*joint, torque.as_slice().into())] };
            let sign = ParameterBounds::Within(GAIN_RANGE);
            self.add(family("drive_gain", Some(*joint), &["gain"], sign), vec![column]);
        }
        let late = |(joint, torque): &(usize, Vec<f64>)| {
            (*joint, delay_quotient(motion, torque, 0.0).into())
        };
        let column = Regressor { parts: torques.iter().map(late).collect() };
        self.add(family("torque_delay", None, &["delay"], ParameterBounds::Any), vec![column]);
    }
}

/// Effects that need a moving joint.
const JOINT_EFFECTS: [&str; 12] = [
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
fn temperature_range(motion: &Motion, joint: usize) -> f64 {
    let all = motion.runs.iter().flat_map(|run| run.joints[joint].temperature.iter());
    let [low, high] =
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], t| [l.min(*t), h.max(*t)]);
    (high - low).max(0.0)
}
