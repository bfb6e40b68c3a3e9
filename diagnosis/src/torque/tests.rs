//! Torques of a slider and a pendulum with known physics and unknown noise.

mod load;
mod parameters;
mod selection;

use physics::{
    AnyEffect, Arm, Body, Inputs, JOINTS_MAX, Joint, JointKind, Memories, Model, ParameterValues,
    Tool,
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use recording::series::{Channel, Recording};

use super::case::Case;
use super::library::GAIN_RANGE;
use super::nonlinear_parameters;
use super::{Diagnosis, DiagnosisError, StatedModel, diagnose};
use crate::diagnose::Verdict;
use crate::engine::dictionary::ParameterBounds;
use crate::progress::{Progress, Stage, ignore};
use glam::{DMat3, DVec3};
use std::sync::Mutex;

const MASS: f64 = 90.0;

/// An arm of one joint, along base x (prismatic) or about base y (revolute).
fn arm(kind: JointKind, link: Option<Body>) -> Arm {
    let axis = if kind == JointKind::Prismatic { DVec3::X } else { DVec3::Y };
    let joint = Joint {
        kind,
        axis,
        point: DVec3::ZERO,
        limits: (-10.0, 10.0),
        max_speed: f64::INFINITY,
        link,
    };
    let tool = Tool { tcp: DVec3::ZERO, base_from_tool: DMat3::IDENTITY, body: None };
    Arm::new(&[joint], tool, DVec3::new(0.0, 0.0, -9.81)).unwrap()
}

/// Position, velocity, acceleration at a time: sum of three sines, with reversals at many positions and velocities.
fn motion(t: f64) -> [f64; 3] {
    let waves = [(0.12, 0.9, 0.0), (0.05, 2.3, 1.0), (0.02, 5.1, 2.0)];
    waves.iter().fold([0.0; 3], |[q, v, a], (size, rate, phase)| {
        let (s, c) = libm::sincos(rate * t + phase);
        [q + size * s, v + size * rate * c, a - size * rate * rate * s]
    })
}

pub(super) fn recording(
    kind: JointKind,
    noise: f64,
    torque: impl Fn([f64; 3]) -> f64,
) -> Recording {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let t_s: Vec<f64> = (0..20_000).map(|k| 2e-3 * f64::from(k)).collect();
    let states: Vec<[f64; 3]> = t_s.iter().map(|t| motion(*t)).collect();
    let mut made = Recording::new(t_s);
    made.set_joint_kind(0, kind);
    made.set(Channel::Motor(0), states.iter().map(|state| state[0]).collect());
    let mut noisy =
        |state: &[f64; 3]| torque(*state) + noise * rng.sample::<f64, _>(StandardNormal);
    let torques = states.iter().map(&mut noisy).collect();
    made.set(Channel::Torque(0), torques);
    made
}

pub(super) fn slider(link: bool) -> Arm {
    arm(JointKind::Prismatic, link.then(|| Body::point_mass(MASS, DVec3::ZERO)))
}

/// Diagnosis of a slider whose model states no effect.
fn case(arm: Arm, noise: f64, force: impl Fn([f64; 3]) -> f64) -> Case {
    let model = Model::new(arm, &[]).unwrap();
    let stated = StatedModel { model: &model, sigma: &[], delay_s: 0.0 };
    let mut case = Case::new(&stated, &[recording(JointKind::Prismatic, noise, force)], None, 1);
    case.estimate_noise();
    case
}

fn diagnosed(
    arm: &Arm,
    effects: &[AnyEffect],
    recording: Recording,
) -> Result<Diagnosis, DiagnosisError> {
    let model = Model::new(*arm, effects).unwrap();
    let sigma = vec![vec![0.0; 8]; effects.len()];
    let stated = StatedModel { model: &model, sigma: &sigma, delay_s: 0.0 };
    diagnose(&stated, &[recording], None, 1, &ignore)
}

pub(super) fn of(arm: &Arm, effects: &[AnyEffect], recording: Recording) -> Diagnosis {
    diagnosed(arm, effects, recording).unwrap()
}

fn number(diagnosis: &Diagnosis, kind: &str) -> Option<(f64, f64)> {
    let found = diagnosis.findings.iter().find(|finding| finding.kind == kind)?;
    Some((found.parameters[0].values[0], found.parameters[0].sigma[0]))
}

#[test]
fn friction_that_was_left_out_is_named_with_its_size() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 20.0 * v.signum() + 60.0 * v;
    let found = of(&slider(false), &[], recording(JointKind::Prismatic, 1.0, force));
    assert_eq!(found.verdict, Verdict::MissingPhysics);
    let kinds: Vec<&str> = found.findings.iter().map(|finding| finding.kind).collect();
    assert_eq!(kinds, ["coulomb_friction", "viscous_friction"]);
    for (kind, truth) in [("coulomb_friction", 20.0), ("viscous_friction", 60.0)] {
        let (value, sigma) = number(&found, kind).unwrap();
        assert!(
            (value - truth).abs() < 4.0 * sigma && sigma < 0.05 * truth,
            "{kind} {value} {sigma}"
        );
    }
    assert!(found.heldout[1] < 0.1 * found.heldout[0]);
}

#[test]
fn a_model_that_knows_its_friction_is_consistent() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 20.0 * v.signum();
    let arm = slider(true);
    let known = effect(&arm, "coulomb_friction", &[("level", &[20.0])]);
    let found = of(&arm, &[known], recording(JointKind::Prismatic, 1.0, force));
    assert_eq!(found.verdict, Verdict::Consistent, "{:?}", found.findings);
}

/// Position, velocity, acceleration at a time: moves of 0.6 s separated by stops of 0.1 s.
fn stopping(t: f64) -> [f64; 3] {
    let (takes, whole) = (0.6, 0.7);
    let number = libm::floor(t / whole);
    let place = |number: f64| 0.2 * libm::sin(2.3 * number * number);
    let (from, way) = (place(number), place(number + 1.0) - place(number));
    let u = (t - number * whole) / takes;
    if u >= 1.0 {
        return [from + way, 0.0, 0.0];
    }
    let [q, v, a] = [
        u * u * u * (10.0 - 15.0 * u + 6.0 * u * u),
        30.0 * u * u * (1.0 - u) * (1.0 - u),
        60.0 * u * (1.0 - 3.0 * u + 2.0 * u * u),
    ];
    [from + way * q, way * v / takes, way * a / (takes * takes)]
}

/// Recording of moves with stops: positions rounded to a micrometre; dry friction is zero at rest.
fn with_stops(noise: f64, force: impl Fn([f64; 3]) -> f64) -> Recording {
    let mut made = recording(JointKind::Prismatic, noise, |_| 0.0);
    let noise = made.column(Channel::Torque(0)).unwrap().to_vec();
    let states: Vec<[f64; 3]> = made.t_s.iter().map(|t| stopping(*t)).collect();
    let rounded = |[q, ..]: &[f64; 3]| libm::round(q * 1e6) * 1e-6;
    made.set(Channel::Motor(0), states.iter().map(rounded).collect());
    let torques = states.iter().zip(noise).map(|(state, noise)| force(*state) + noise);
    made.set(Channel::Torque(0), torques.collect());
    made
}

fn sign(v: f64) -> f64 {
    if v == 0.0 { 0.0 } else { v.signum() }
}

#[test]
fn short_stops_of_a_friction_that_is_known_make_no_name() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 40.0 * sign(v);
    let arm = slider(true);
    let known = effect(&arm, "coulomb_friction", &[("level", &[40.0])]);
    let found = of(&arm, &[known], with_stops(0.3, force));
    assert_eq!(found.verdict, Verdict::Consistent, "{:?}", found.findings);
}

#[test]
fn a_diagnosis_reports_its_stages_in_order() {
    let arm = slider(true);
    let model = Model::new(arm, &[]).unwrap();
    let stated = StatedModel { model: &model, sigma: &[], delay_s: 0.0 };
    let force = |[_, v, a]: [f64; 3]| MASS * a + 40.0 * sign(v);
    let received = Mutex::new(Vec::new());
    let listener = |stage, progress| received.lock().unwrap().push((stage, progress));
    diagnose(&stated, &[with_stops(0.3, force)], None, 1, &listener).unwrap();
    let received = received.into_inner().unwrap();
    let begun = received.iter().filter(|(_, progress)| *progress == Progress::Begun);
    assert!(begun.map(|(stage, _)| *stage).eq(Stage::TORQUES));
    let is_found = |(stage, progress): &(Stage, Progress)| {
        *stage == Stage::TorqueFirstSearch && matches!(progress, Progress::Selected(1..))
    };
    assert!(received.iter().any(is_found), "{received:?}");
}

#[test]
fn a_friction_off_within_its_doubt_is_no_finding_and_is_refitted() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 40.0 * sign(v) + 60.0 * v;
    let arm = slider(true);
    let dry = effect(&arm, "coulomb_friction", &[("level", &[37.0])]);
    let viscous = effect(&arm, "viscous_friction", &[("coefficient", &[60.0])]);
    let model = Model::new(arm, &[dry, viscous]).unwrap();
    let sigma = vec![vec![2.0], vec![0.0]];
    let stated = StatedModel { model: &model, sigma: &sigma, delay_s: 0.0 };
    let found = diagnose(&stated, &[with_stops(0.3, force)], None, 1, &ignore).unwrap();
    assert_eq!(found.verdict, Verdict::Consistent, "{:?}", found.findings);
    let [refit] = &found.refits[..] else { panic!("{:?}", found.refits) };
    assert_eq!(
        (refit.kind, refit.joint, refit.parameter.stem),
        ("coulomb_friction", Some(0), "level")
    );
    assert!((refit.parameter.values[0] - 3.0).abs() < 0.1, "{refit:?}");
    assert!(refit.parameter.sigma[0] < 0.2, "{refit:?}");
}

#[test]
fn torque_that_lags_motion_is_a_delay_and_no_friction() {
    let late = 2e-3;
    let force = |[_, v, a]: [f64; 3]| MASS * a + 60.0 * v;
    let mut made = recording(JointKind::Prismatic, 0.2, force);
    let t_s = made.t_s.clone();
    let torques = t_s.iter().map(|t| force(motion(t - late))).collect();
    made.set(Channel::Torque(0), torques);
    let found = of(&slider(false), &[], made);
    let (value, _) = number(&found, "torque_delay").unwrap();
    assert!((value - late).abs() < 0.05 * late, "{value}");
}

#[test]
fn a_hanging_mass_is_told_by_gravity_and_a_law_beyond_the_library_is_called_unknown() {
    let arm = arm(JointKind::Revolute, None);
    let weight = |[q, _, a]: [f64; 3]| 3.0 * a + 12.0 * libm::sin(q);
    let found = of(&arm, &[], recording(JointKind::Revolute, 0.05, weight));
    assert_eq!(found.verdict, Verdict::Consistent, "{:?}", found.findings);
    let strange = |[q, v, a]: [f64; 3]| 3.0 * a + 40.0 * v * v * v * q;
    let found = of(&arm, &[], recording(JointKind::Revolute, 0.05, strange));
    let law = found.unexplained.as_ref().unwrap();
    assert_eq!(found.verdict, Verdict::UnknownStructure, "{:?}", found.findings);
    assert!(law.depends_on.iter().any(|covariate| covariate == "v1"), "{law:?}");
}

#[test]
fn a_recording_without_motion_or_of_few_rows_is_a_doubt() {
    let force = |[_, _, a]: [f64; 3]| MASS * a;
    let mut still = recording(JointKind::Prismatic, 1.0, force);
    still.set(Channel::Motor(0), vec![0.5; still.len()]);
    assert!(diagnosed(&slider(true), &[], still).is_err());
    let mut short = Recording::new((0..50).map(|k| 1e-3 * f64::from(k)).collect());
    short.set(Channel::Motor(0), vec![0.0; 50]);
    short.set(Channel::Torque(0), vec![f64::NAN; 50]);
    assert!(diagnosed(&slider(true), &[], short).is_err());
}

#[test]
fn the_same_recording_gives_the_same_bits() {
    let force = |[_, v, a]: [f64; 3]| MASS * a + 20.0 * v.signum();
    let one = || of(&slider(false), &[], recording(JointKind::Prismatic, 1.0, force));
    assert_eq!(one().heldout, one().heldout);
}

fn effect(arm: &Arm, kind: &str, given: &[(&str, &[f64])]) -> AnyEffect {
    AnyEffect::build(kind, arm, Some(0), ParameterValues(given)).expect(kind)
}

fn assert_near(found: &Diagnosis, kind: &str, truth: f64, share: f64) {
    let (value, sigma) = number(found, kind).unwrap_or_else(|| panic!("{:?}", found.findings));
    assert!((value - truth).abs() < share * truth.abs() + 3.0 * sigma, "{kind} {value} {sigma}");
    assert!(sigma < 0.3 * truth.abs(), "{kind} {value} {sigma}");
}

#[test]
fn a_drive_that_is_recorded_too_large_leaves_its_friction_the_size_that_acts() {
    let arm = slider(true);
    // With mass alone, a gain error is indistinguishable from additional mass.
    let known = effect(&arm, "viscous_friction", &[("coefficient", &[150.0])]);
    let force = |[_, v, a]: [f64; 3]| 1.08 * (MASS * a + 20.0 * v.signum() + 150.0 * v);
    let found = of(&arm, &[known], recording(JointKind::Prismatic, 0.5, force));
    assert_near(&found, "drive_gain", 0.08, 0.02);
    assert_near(&found, "coulomb_friction", 20.0, 0.01);
}

#[test]
fn oil_that_thins_is_told_by_what_a_kelvin_takes_of_the_friction_that_is_known() {
    for per_kelvin in [0.02, -0.1] {
        let arm = slider(true);
        let viscous = effect(&arm, "viscous_friction", &[("coefficient", &[150.0])]);
        let mut made = recording(JointKind::Prismatic, 0.5, |_| 0.0);
        let warm = |t: f64| 20.0 + 15.0 * t / 40.0;
        let force = |t: f64| {
            let [_, v, a] = motion(t);
            MASS * a + 150.0 * v * libm::exp(-per_kelvin * (warm(t) - 20.0))
        };
        let noise = made.column(Channel::Torque(0)).unwrap().to_vec();
        let t_s = made.t_s.clone();
        made.set(Channel::Torque(0), t_s.iter().zip(noise).map(|(t, n)| force(*t) + n).collect());
        made.set(Channel::Ambient, t_s.iter().map(|t| warm(*t)).collect());
        assert_near(&of(&arm, &[viscous], made), "friction_temperature", per_kelvin, 0.03);
    }
}

#[test]
fn a_spring_that_hardens_does_so_from_where_it_rests() {
    let arm = slider(true);
    let spring = effect(&arm, "spring", &[("stiffness", &[1000.0]), ("rest_position", &[0.06])]);
    let force = |[q, _, a]: [f64; 3]| {
        MASS * a + 1000.0 * (q - 0.06) + 4e4 * (q - 0.06) * (q - 0.06) * (q - 0.06)
    };
    let found = of(&arm, &[spring], recording(JointKind::Prismatic, 0.5, force));
    assert_near(&found, "spring_hardening", 4e4, 0.02);
    assert_eq!(found.findings.len(), 1, "{:?}", found.findings);
}

#[test]
fn what_the_model_states_of_its_drives_is_no_finding_whatever_its_law() {
    let arm = slider(true);
    let ripple: &[(&str, &[f64])] =
        &[("amplitude", &[6.0]), ("cycles", &[200.0]), ("phase", &[0.4])];
    let loop_: &[(&str, &[f64])] = &[("amplitude_N", &[14.0]), ("reversal", &[4e-3])];
    let known = [effect(&arm, "torque_ripple", ripple), effect(&arm, "hysteresis", loop_)];
    let made = driven(&arm, &known, JointKind::Prismatic, 0.5);
    assert_eq!(of(&arm, &known, made.clone()).verdict, Verdict::Consistent);
    assert_ne!(of(&arm, &[], made).verdict, Verdict::Consistent);
}

/// Drive torques of a model over the motion, with noise.
fn driven(arm: &Arm, effects: &[AnyEffect], kind: JointKind, noise: f64) -> Recording {
    let model = Model::new(*arm, effects).unwrap();
    let mut made = recording(kind, noise, |_| 0.0);
    let noise = made.column(Channel::Torque(0)).unwrap().to_vec();
    let mut memories = Memories::default();
    let mut before = None;
    let t_s = made.t_s.clone();
    let row = |(t, noise): (&f64, f64)| {
        let [q, v, a] = motion(*t);
        let mut inputs = Inputs::at_rest([0.0; JOINTS_MAX]);
        (inputs.q[0], inputs.velocity[0], inputs.acceleration[0]) = (q, v, a);
        inputs.q_before[0] = before.unwrap_or(q);
        before = Some(q);
        model.advance(&inputs, &mut memories);
        model.drive(&inputs, &memories).recorded(0) + noise
    };
    let torques = t_s.iter().zip(noise).map(row).collect();
    made.set(Channel::Torque(0), torques);
    made
}

fn pendulum() -> Arm {
    let pendulum =
        arm(JointKind::Revolute, Some(Body::point_mass(5.0, DVec3::new(0.0, 0.0, -0.3))));
    let tool = Tool { tcp: DVec3::new(0.0, 0.0, -0.4), ..pendulum.tool };
    Arm::new(pendulum.joints(), tool, pendulum.gravity).unwrap()
}

#[test]
fn a_mass_that_hangs_far_from_the_tool_is_one_payload_and_no_sum_of_inertia_and_gravity() {
    let arm = pendulum();
    let given: &[(&str, &[f64])] = &[("mass", &[2.0]), ("com", &[0.1, 0.0, -0.5])];
    let hangs = AnyEffect::build("payload", &arm, None, ParameterValues(given)).unwrap();
    let found = of(&arm, &[], driven(&arm, &[hangs], JointKind::Revolute, 0.05));
    let kinds: Vec<&str> = found.findings.iter().map(|finding| finding.kind).collect();
    assert_eq!(kinds, ["payload"], "{:?}", found.findings);
    assert_near(&found, "payload", 2.0, 0.05);
    let com = &found.findings[0].parameters[1];
    assert!((com.values[0] - 0.1).abs() < 0.01 && (com.values[2] + 0.5).abs() < 0.02, "{com:?}");
}

#[test]
fn stated_masses_are_believed_where_a_name_explains_as_much_as_their_doubt() {
    let arm = pendulum();
    // A centre of mass displaced by 4 mm would give nearly the same torque.
    let pull = effect(&arm, "friction_asymmetry", &[("offset", &[0.2])]);
    let found = of(&arm, &[], driven(&arm, &[pull], JointKind::Revolute, 0.05));
    assert_eq!(found.verdict, Verdict::MissingPhysics, "{:?}", found.findings);
    assert_near(&found, "friction_asymmetry", 0.2, 0.02);
}

#[test]
fn a_drive_gain_stays_within_what_a_drive_can_be_off_by() {
    let [less, more] = [-0.5, 0.5].map(|gain| ParameterBounds::Within(GAIN_RANGE).admits(gain));
    assert!(less && more);
    assert!(
        ![-24.3, -1.0, 3.0]
            .into_iter()
            .any(|gain| ParameterBounds::Within(GAIN_RANGE).admits(gain))
    );
}

#[test]
fn dry_friction_that_comes_and_goes_along_the_way_is_no_dry_friction() {
    let place = |q: f64| libm::sin(q / 0.06);
    let force = |[q, v, a]: [f64; 3]| MASS * a + 4.0 * v.signum() * (0.5 + place(q));
    let found = of(&slider(true), &[], recording(JointKind::Prismatic, 1.0, force));
    assert_eq!(found.verdict, Verdict::UnknownStructure, "{:?}", found.findings);
    let law = found.unexplained.as_ref().unwrap();
    assert_eq!(law.depends_on, ["q1", "direction_1"]);
}

#[test]
fn what_a_still_joint_holds_is_a_set_and_no_claim() {
    let arm = pendulum();
    let [joint] = arm.joints() else { panic!() };
    let other = Joint { point: DVec3::new(0.0, 0.0, -0.2), ..*joint };
    let two = Arm::new(&[*joint, other], arm.tool, arm.gravity).unwrap();
    let model = Model::new(two, &[]).unwrap();
    let moving = recording(JointKind::Revolute, 0.05, |_| 0.0);
    let noise = moving.column(Channel::Torque(0)).unwrap().to_vec();
    let holds = |extra: f64, known: &[AnyEffect]| {
        let mut made = moving.clone();
        made.set(Channel::Motor(1), vec![0.3; made.len()]);
        let (mut first, mut second) = (Vec::new(), Vec::new());
        for (t, noise) in made.t_s.iter().zip(&noise) {
            let [q, v, a] = motion(*t);
            let mut inputs = Inputs::at_rest([0.0; JOINTS_MAX]);
            (inputs.q[0], inputs.velocity[0], inputs.acceleration[0]) = (q, v, a);
            inputs.q[1] = 0.3;
            let torque = model.drive(&inputs, &Memories::default());
            first.push(torque.recorded(0) + noise);
            second.push(torque.recorded(1) + extra - noise);
        }
        made.set(Channel::Torque(0), first);
        made.set(Channel::Torque(1), second);
        of(&two, known, made)
    };
    assert_eq!(holds(0.0, &[]).verdict, Verdict::Consistent);
    let found = holds(0.4, &[]);
    assert_eq!(found.verdict, Verdict::Undetermined, "{:?}", found.findings);
    let [set] = &found.findings[..] else { panic!("{:?}", found.findings) };
    assert_eq!(set.joint, Some(1));
    assert!((set.parameters[0].values[0] - 0.4).abs() < 0.02, "{set:?}");
    let rivals: Vec<&str> = set.alternatives.iter().map(|rival| rival.kind).collect();
    assert!(rivals.contains(&"coulomb_friction") && rivals.contains(&"spring"), "{rivals:?}");
    // Dry friction is zero at rest in the model, so stating it explains no torque: it remains in the set of explanations.
    let dry =
        AnyEffect::build("coulomb_friction", &two, Some(1), ParameterValues(&[("level", &[2.0])]));
    assert_eq!(holds(0.4, &[dry.unwrap()]).verdict, Verdict::Undetermined);
}
