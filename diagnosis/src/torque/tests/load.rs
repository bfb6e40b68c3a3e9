//! Effects that depend on the torque or its history: unstated load friction, delay, hysteresis.

use physics::JointKind;

use std::f64::consts::TAU;

use super::*;
use crate::torque::parameters::FittedParameter;
use crate::torque::regressors::{TorqueTerm, maxwell_slip, shortest_reversal};
use crate::torque::reinterpretation;

/// The pendulum, with its mass unstated.
fn unstated_pendulum() -> Arm {
    let whole = pendulum();
    let mut joint = whole.joints()[0];
    joint.link = None;
    Arm::new(&[joint], whole.tool, whole.gravity).unwrap()
}

#[test]
fn friction_that_is_stated_rubs_under_masses_that_nobody_stated() {
    let rubs = |coefficient: f64| {
        let arm = pendulum();
        let rub = effect(&arm, "load_friction", &[("coefficient", &[coefficient])]);
        let made = driven(&arm, &[rub], JointKind::Revolute, 0.05);
        let stated = effect(&unstated_pendulum(), "load_friction", &[("coefficient", &[0.1])]);
        of(&unstated_pendulum(), &[stated], made)
    };
    let same = rubs(0.1);
    assert!(same.findings.is_empty(), "{:?}", same.findings);
    let more = rubs(0.16);
    let [one] = &more.findings[..] else { panic!("{:?}", more.findings) };
    assert!(one.kind == "load_friction" && one.is_change, "{one:?}");
    assert_near(&more, "load_friction", 0.06, 0.05);
}

#[test]
fn a_delay_of_many_rows_is_told_as_long_as_it_is() {
    let late_s = 0.015;
    let mut made = recording(JointKind::Prismatic, 0.3, |_| 0.0);
    let noise = made.column(Channel::Torque(0)).unwrap().to_vec();
    let then = |(t, noise): (&f64, f64)| {
        let [_, v, a] = motion(t - late_s);
        MASS * a + 20.0 * v.signum() + noise
    };
    let torques = made.t_s.iter().zip(noise).map(then).collect();
    made.set(Channel::Torque(0), torques);
    let arm = slider(true);
    let dry = effect(&arm, "coulomb_friction", &[("level", &[20.0])]);
    let found = of(&arm, &[dry], made);
    // A first-order column would underestimate this delay by a tenth.
    assert_near(&found, "torque_delay", late_s, 0.01);
}

#[test]
fn a_memory_too_short_for_the_band_is_dry_friction_and_a_longer_one_is_not() {
    let selected_kind = |way: &dyn Fn(f64) -> f64| {
        let model = Model::new(slider(true), &[]).unwrap();
        let stated = StatedModel { model: &model, sigma: &[], delay_s: 0.0 };
        let made = recording(JointKind::Prismatic, 0.5, |[_, _, a]| MASS * a);
        let mut case = Case::new(&stated, &[made], None, 1);
        let shortest = shortest_reversal(&case.motion, 0);
        let law = |distance: f64| TorqueTerm::Dahl { distance }.column(&case.motion, 0);
        let acts = law(way(shortest)).parts[0].1.to_vec();
        let column = law(shortest);
        case.table.target[0].iter_mut().flatten().zip(acts).for_each(|(sum, x)| *sum += 20.0 * x);
        let mut families = case.library.terms.iter();
        let name = families.position(|family| family.kind == "hysteresis").unwrap();
        let place = case.library.terms[name].columns[0];
        case.library.columns[place] = column;
        case.library.terms[name].settings[0].1 = shortest;
        let names = reinterpretation::hysteresis_as_friction(&case, &[], vec![name]);
        case.library.terms[names[0]].kind
    };
    assert_eq!(selected_kind(&|shortest| 0.1 * shortest), "coulomb_friction");
    assert_eq!(selected_kind(&|shortest| 30.0 * shortest), "hysteresis");
}

#[test]
fn what_the_model_states_of_dry_friction_is_what_a_name_of_it_takes_off() {
    let arm = slider(true);
    let dry = effect(&arm, "coulomb_friction", &[("level", &[20.0])]);
    let model = Model::new(arm, &[dry]).unwrap();
    let stated = StatedModel { model: &model, sigma: &[vec![0.0]], delay_s: 0.0 };
    // At a low sampling rate, motion in the torque's own band would reverse too gradually.
    let mut made = recording(JointKind::Prismatic, 0.0, |_| 0.0);
    let rare: Vec<usize> = (0..made.t_s.len()).step_by(4).collect();
    let q = made.column(Channel::Motor(0)).unwrap().to_vec();
    made = Recording::new(rare.iter().map(|row| made.t_s[*row]).collect());
    made.set_joint_kind(0, JointKind::Prismatic);
    made.set(Channel::Motor(0), rare.iter().map(|row| q[*row]).collect());
    made.set(Channel::Torque(0), vec![0.0; rare.len()]);
    let case = Case::new(&stated, &[made], None, 1);
    let name = TorqueTerm::VelocitySign.column(&case.motion, 0).parts[0].1.to_vec();
    let both = case.stated_torque[0].iter().zip(&name).zip(&case.table.moves[0]);
    let rigid = physics_of(&case);
    let remaining = both.zip(rigid).filter(|((_, moves), _)| **moves);
    let remaining: Vec<f64> =
        remaining.map(|(((all, name), _), rigid)| all - rigid - 20.0 * name).collect();
    let rms = libm::sqrt(remaining.iter().map(|x| x * x).sum::<f64>() / remaining.len() as f64);
    assert!(rms < 0.1, "{rms}");
}

/// Inertial force of the slider, row by row, N.
fn physics_of(case: &Case) -> Vec<f64> {
    let runs = case.motion.runs.iter();
    runs.flat_map(|run| run.rows.iter().map(|row| MASS * run.joints[0].a[*row])).collect()
}

#[test]
fn a_loop_of_springs_that_slip_is_told_within_the_doubt_of_how_it_remembers() {
    let (height, way) = (30.0, 0.02);
    let mut made = recording(JointKind::Prismatic, 0.3, |[_, _, a]| MASS * a);
    let z = maxwell_slip(made.column(Channel::Motor(0)).unwrap(), way);
    let torques = made.column(Channel::Torque(0)).unwrap().iter().zip(z);
    let torques = torques.map(|(torque, z)| torque + 0.5 * height * z).collect();
    made.set(Channel::Torque(0), torques);
    let found = of(&slider(true), &[], made);
    let one = found.findings.iter().find(|finding| finding.kind == "hysteresis").unwrap();
    let FittedParameter { values, sigma, .. } = &one.parameters[0];
    assert!((values[0] - height).abs() < 2.5 * sigma[0], "{one:?}");
    assert!(sigma[0] < 0.05 * height, "{one:?}");
}

#[test]
fn friction_under_a_load_of_short_pushes_is_told_where_the_band_smooths_them() {
    // Forces that alternate within a period of the band edge: filtering removes their mean, but not their absolute value.
    let made = |effects: &[AnyEffect]| {
        let arm = slider(true);
        let model = Model::new(arm, effects).unwrap();
        let state = |t: f64| {
            let [q, v, a] = motion(t);
            let (s, c) = libm::sincos(TAU * 20.0 * t);
            [q + 2e-4 * s, v + 2e-4 * TAU * 20.0 * c, a - 2e-4 * (TAU * 20.0) * (TAU * 20.0) * s]
        };
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let t_s: Vec<f64> = (0..5000).map(|k| 8e-3 * f64::from(k)).collect();
        let force = |t: &f64| {
            let mut inputs = Inputs::at_rest([0.0; JOINTS_MAX]);
            [inputs.q[0], inputs.velocity[0], inputs.acceleration[0]] = state(*t);
            let noise: f64 = rng.sample(StandardNormal);
            model.drive(&inputs, &Memories::default()).recorded(0) + 2.0 * noise
        };
        let forces = t_s.iter().map(force).collect();
        let places = t_s.iter().map(|t| state(*t)[0]).collect();
        let mut made = Recording::new(t_s);
        made.set_joint_kind(0, JointKind::Prismatic);
        made.set(Channel::Motor(0), places);
        made.set(Channel::Torque(0), forces);
        of(&arm, &[], made)
    };
    let found = made(&[effect(&slider(true), "load_friction", &[("coefficient", &[0.05])])]);
    assert_near(&found, "load_friction", 0.05, 0.1);
}
