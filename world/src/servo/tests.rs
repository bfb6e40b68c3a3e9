//! Motions under a controller: effects of friction, energy balance.

use super::*;
use crate::drives;
use crate::test_arm::{effect, irb1600, slide};
use physics::AnyEffect;

const RATE_HZ: f64 = 500.0;

fn slider(effects: &[(&str, &str, f64)]) -> Model {
    let arm = slide(95.0);
    let effects: Vec<_> = effects.iter().map(|(k, s, v)| effect(&arm, k, 0, s, *v)).collect();
    Model::new(arm, &effects).expect("room")
}

/// Joints 1 to 3 oscillate at different frequencies, from rest.
fn swing(rows: usize, amplitude: f64) -> Vec<Inputs> {
    let row = |k: usize| {
        let time_s = k as f64 / RATE_HZ;
        let mut inputs = Inputs::at_rest(Joints::default());
        inputs.q[..3].copy_from_slice(
            &[1.0, 0.8, 1.3].map(|pace| amplitude * (1.0 - (pace * TAU * 0.5 * time_s).cos())),
        );
        inputs.time_s = time_s;
        inputs
    };
    (0..rows).map(row).collect()
}

fn followed(model: &Model, rows: &[Inputs]) -> Vec<MotorState> {
    path(model, &Dynamics::default(), rows).expect("an arm with masses")
}

/// Largest deviation of joint 1 from its command.
fn largest_error(followed: &[MotorState], rows: &[Inputs]) -> f64 {
    let errors = followed.iter().zip(rows).map(|(state, row)| (state.motor[0] - row.q[0]).abs());
    errors.fold(0.0, f64::max)
}

#[test]
fn dry_friction_shows_in_the_motion_and_rests_at_a_turn() {
    let rows = swing(2000, 0.05);
    let free = followed(&slider(&[]), &rows);
    let dry = followed(&slider(&[("coulomb_friction", "level", 60.0)]), &rows);
    let (free, stuck) = (largest_error(&free, &rows), largest_error(&dry, &rows));
    assert!(stuck > 2.0 * free, "{free} m without, {stuck} m with friction");
    // At the reversal at 1 s the linear axis is at rest until the controller has changed its force
    // by twice the friction.
    let pauses = dry[480..540].windows(2).filter(|pair| pair[0].motor[0] == pair[1].motor[0]);
    assert!(pauses.count() >= 3);
}

#[test]
fn friction_holds_a_slide_that_nobody_moves() {
    let model = slider(&[("coulomb_friction", "level", 60.0)]);
    let mut rows = swing(400, 0.0);
    rows.iter_mut().for_each(|row| row.wrench_base.force.x = 50.0);
    for (k, state) in followed(&model, &rows).iter().enumerate() {
        assert_eq!(state.motor[0], 0.0, "row {k}");
    }
}

#[test]
fn drive_energy_equals_kinetic_energy_plus_friction() {
    let rows = swing(1001, 0.1);
    let laws = [("coulomb_friction", "level", 60.0), ("viscous_friction", "coefficient", 200.0)];
    let states = followed(&slider(&laws), &rows);
    let (mut spent, mut rubbed) = (0.0, 0.0);
    for pair in states.windows(2) {
        let moved = pair[1].motor[0] - pair[0].motor[0];
        spent += 0.5 * (pair[0].torque[0] + pair[1].torque[0]) * moved;
        rubbed += 60.0 * moved.abs() + 200.0 * moved * moved * RATE_HZ;
    }
    let end = states.len() - 2;
    let speed = (states[end + 1].motor[0] - states[end - 1].motor[0]) * 0.5 * RATE_HZ;
    let kinetic = 0.5 * 95.0 * speed * speed;
    assert!((spent - rubbed - kinetic).abs() < 5e-3 * rubbed, "{spent} {rubbed} {kinetic}");
}

#[test]
fn what_is_recorded_is_what_the_motion_asks() {
    let arm = irb1600();
    let effects: Vec<AnyEffect> = (0..6)
        .flat_map(|i| {
            [
                effect(&arm, "viscous_friction", i, "coefficient", 15.0),
                effect(&arm, "inertia", i, "inertia", 2.0),
                effect(&arm, "load_friction", i, "coefficient", 0.05),
            ]
        })
        .collect();
    let model = Model::new(arm, &effects).expect("room");
    let rows = swing(1500, 0.2);
    let states = followed(&model, &rows);
    assert!(largest_error(&states, &rows) < 2e-3, "{}", largest_error(&states, &rows));
    let mut moved = rows.clone();
    moved.iter_mut().zip(&states).for_each(|(row, state)| row.q = state.motor);
    let predicted = drives::path(&model, &Dynamics::default(), &moved);
    for i in 0..6 {
        let (mut error, mut all) = (0.0, 0.0);
        for (state, predicted) in states.iter().zip(&predicted).take(1450).skip(50) {
            error += (state.torque[i] - predicted[i]).powi(2);
            all += predicted[i].powi(2);
        }
        assert!(error < 5e-4 * all, "joint {}: {error} of {all}", i + 1);
    }
    assert_eq!(states, followed(&model, &rows), "the same bits");
}

#[test]
fn a_gain_of_the_drive_is_in_the_record_and_not_in_the_motion() {
    let rows = swing(300, 0.05);
    let exact = followed(&slider(&[("coulomb_friction", "level", 60.0)]), &rows);
    let scaled = [("coulomb_friction", "level", 60.0), ("drive_gain", "gain", 0.1)];
    for (state, exact) in followed(&slider(&scaled), &rows).iter().zip(exact) {
        assert_eq!(state.motor, exact.motor);
        assert!((state.torque[0] - 1.1 * exact.torque[0]).abs() < 1e-9);
    }
}

#[test]
fn an_arm_without_masses_is_refused() {
    let arm = slide(95.0);
    let massless = physics::Joint { link: None, ..arm.joints()[0] };
    let arm = physics::Arm::new(&[massless], arm.tool, arm.gravity).expect("sound");
    let refused = path(&Model::nominal(arm), &Dynamics::default(), &swing(3, 0.1));
    assert_eq!(refused, Err(ServoError::Massless { joint: 1 }));
}
