//! Torques on known motions, compared with independent laws.

use super::*;
use crate::test_arm::{effect, irb1600, slide};
use physics::inverse_dynamics;
use std::f64::consts::TAU;

const RATE_HZ: f64 = 1000.0;
const AMPLITUDE: f64 = 0.12;

/// `periods` oscillations of one second each of joint `joint` about `middle`, m or rad.
fn swing(joint: usize, middle: f64, periods: usize) -> Vec<Inputs> {
    let rows = periods * RATE_HZ as usize + 1;
    let row = |k: usize| {
        let time_s = k as f64 / RATE_HZ;
        let mut inputs = Inputs::at_rest(Joints::default());
        inputs.q[joint] = middle + AMPLITUDE * (TAU * time_s).cos();
        (inputs.direction[joint], inputs.time_s) = (1.0, time_s);
        inputs
    };
    (0..rows).map(row).collect()
}

fn slider(effects: &[(&str, &str, f64)]) -> Model {
    let arm = slide(95.0);
    let effects: Vec<_> = effects.iter().map(|(k, s, v)| effect(&arm, k, 0, s, *v)).collect();
    Model::new(arm, &effects).expect("room")
}

fn first(torques: &[Joints]) -> Vec<f64> {
    torques.iter().map(|all| all[0]).collect()
}

#[test]
fn at_a_reversal_the_force_of_a_slide_turns_by_twice_its_dry_friction() {
    let model =
        slider(&[("coulomb_friction", "level", 20.4), ("viscous_friction", "coefficient", 203.0)]);
    let force = first(&path(&model, &Dynamics::default(), &swing(0, 0.0, 2)));
    // The reversal at half a second is between rows 500 − 3 and 500 + 3; the acceleration is at its
    // maximum there.
    let jump = force[503] - force[497];
    let viscous = 203.0 * 2.0 * AMPLITUDE * TAU * (TAU * 3e-3).sin();
    assert!((jump - 40.8 - viscous).abs() < 0.05, "{jump} N, {viscous} N of them viscous");
    let inertia = 95.0 * AMPLITUDE * TAU * TAU;
    let mean = 0.5 * (force[503] + force[497]);
    assert!((mean - inertia).abs() < 0.01 * inertia, "{mean} N against {inertia} N");
}

#[test]
fn over_whole_swings_the_drive_spends_what_friction_takes() {
    let work = |effects: &[(&str, &str, f64)]| {
        let rows = swing(0, 0.0, 3);
        let force = first(&path(&slider(effects), &Dynamics::default(), &rows));
        let moved = rows.windows(2).map(|pair| pair[1].q[0] - pair[0].q[0]);
        let mean = force.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        mean.zip(moved).map(|(force, moved)| force * moved).sum::<f64>()
    };
    let dry = work(&[("coulomb_friction", "level", 20.4)]);
    let wanted = 3.0 * 4.0 * 20.4 * AMPLITUDE;
    assert!((dry / wanted - 1.0).abs() < 1e-3, "{dry} J against {wanted} J");
    let oil = work(&[("viscous_friction", "coefficient", 203.0)]);
    let wanted = 3.0 * TAU / 2.0 * 203.0 * TAU * AMPLITUDE * AMPLITUDE;
    assert!((oil / wanted - 1.0).abs() < 1e-3, "{oil} J against {wanted} J");
    let none = work(&[]);
    assert!(none.abs() < 1e-2, "{none} J");
}

#[test]
fn a_late_record_is_that_of_some_rows_before() {
    let model = slider(&[("coulomb_friction", "level", 20.4)]);
    let rows = swing(0, 0.0, 1);
    let exact = first(&path(&model, &Dynamics::default(), &rows));
    let dynamics = Dynamics { torque_delay_s: 5.0 / RATE_HZ, ..Dynamics::default() };
    let late = first(&path(&model, &dynamics, &rows));
    for k in 5..rows.len() {
        assert!((late[k] - exact[k - 5]).abs() < 1e-9, "row {k}");
    }
}

#[test]
fn an_arm_asks_its_inverse_dynamics_at_speeds_that_are_known() {
    let arm = irb1600();
    let rows = swing(1, 0.3, 1);
    let model = Model::nominal(arm);
    let torques = path(&model, &Dynamics::default(), &rows);
    for k in 20..rows.len() - 20 {
        let mut inputs = rows[k];
        let phase = TAU * inputs.time_s;
        inputs.velocity[1] = -AMPLITUDE * TAU * phase.sin();
        inputs.acceleration[1] = -AMPLITUDE * TAU * TAU * phase.cos();
        let wanted = inverse_dynamics(&arm, &inputs);
        let size = wanted.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        for i in 0..6 {
            assert!((torques[k][i] - wanted[i]).abs() < 1e-3 * size, "row {k}, joint {}", i + 1);
        }
    }
    let at_rest: Vec<(Inputs, bool)> = rows.iter().map(|row| (*row, false)).collect();
    for (torque, row) in poses(&model, &at_rest).iter().zip(&rows) {
        assert_eq!(*torque, inverse_dynamics(&arm, row));
    }
}
