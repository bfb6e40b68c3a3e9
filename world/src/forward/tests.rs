//! Paths and poses through a model: known limits, signs and orders.

use super::*;
use crate::dynamics::{Mode, Spike, VibratingPart};
use crate::test_arm::{effect, irb1600};

const RATE_HZ: f64 = 250.0;

/// Joint 2 oscillates, joint 3 is at rest.
fn swing(n: usize) -> Vec<Inputs> {
    (0..n)
        .map(|k| {
            let t = k as f64 / RATE_HZ;
            let mut q = Joints::default();
            q[..6].copy_from_slice(&[0.1, 0.4 * (2.0 * t).sin(), 0.3, 0.0, 1.2, 0.0]);
            Inputs { time_s: t, ..Inputs::at_rest(q) }
        })
        .collect()
}

fn arm_effects(list: &[(&str, &str, f64)]) -> Model {
    let arm = irb1600();
    let effects: Vec<_> = list.iter().map(|(k, s, v)| effect(&arm, k, 1, s, *v)).collect();
    Model::new(arm, &effects).expect("room")
}

#[test]
fn without_effects_the_tool_goes_where_the_controller_believes() {
    let model = Model::nominal(irb1600());
    for (state, row) in path(&model, &Dynamics::default(), &swing(200)).iter().zip(swing(200)) {
        assert_eq!(state.base_from_tool, Chain::nominal(&model.arm, &row.q).base_from_tool);
        assert_eq!((state.motor, state.link), (row.q, row.q));
    }
}

#[test]
fn play_follows_the_lagged_command_and_not_the_command() {
    let model = arm_effects(&[("backlash", "width", 4e-4)]);
    let lag = Dynamics { lags: vec![(1, 0.1)], ..Dynamics::default() };
    let rows = swing(1000);
    let states = path(&model, &lag, &rows);
    // The command reverses at t = π/4; the lagged motor atan(2 · 0.1)/2 later.
    let turn = std::f64::consts::FRAC_PI_4;
    let late = 0.2_f64.atan() / 2.0;
    let play = |t: f64| {
        let k = (t * RATE_HZ) as usize;
        states[k].link[1] - states[k].motor[1]
    };
    assert!((play(turn + 0.5 * late) + 2e-4).abs() < 1e-9, "still on the old side");
    assert!((play(turn + late + 0.2) - 2e-4).abs() < 1e-9, "on the new side");
}

#[test]
fn a_compliant_joint_feels_the_inertia_of_what_it_swings_and_one_at_rest_does_not() {
    let soft = arm_effects(&[("joint_compliance", "compliance", 2e-6)]);
    let slow: Vec<(Inputs, bool)> = swing(1000).into_iter().map(|row| (row, false)).collect();
    let (moving, resting) = (path(&soft, &Dynamics::default(), &swing(1000)), poses(&soft, &slow));
    let bend = |state: &ArmState| state.link[1] - state.motor[1];
    // At the reversal the motion is decelerated: inertia deflects the joint further in the previous
    // direction.
    let k = (std::f64::consts::FRAC_PI_4 * RATE_HZ) as usize;
    let inertial = bend(&moving[k]) - bend(&resting[k]);
    assert!(inertial > 1e-5, "{inertial} rad");
    let still: Vec<Inputs> = (0..50)
        .map(|k| Inputs { time_s: f64::from(k) * 0.01, ..Inputs::at_rest(swing(1)[0].q) })
        .collect();
    let states = path(&soft, &Dynamics::default(), &still);
    assert!((bend(&states[25]) - bend(&resting[0])).abs() < 1e-15);
}

#[test]
fn bearing_and_gravity_compliance_do_not_feel_inertia() {
    for kind in ["bearing_compliance", "gravity_compliance"] {
        let soft = arm_effects(&[(kind, "compliance", 2e-6)]);
        let slow: Vec<(Inputs, bool)> = swing(300).into_iter().map(|row| (row, false)).collect();
        let moving = path(&soft, &Dynamics::default(), &swing(300));
        for (a, b) in moving.iter().zip(poses(&soft, &slow)) {
            assert_eq!(a.base_from_tool, b.base_from_tool, "{kind}");
        }
    }
}

#[test]
fn modes_and_spikes_move_the_link_and_the_tool_but_not_the_motor() {
    let model = Model::nominal(irb1600());
    let mode = Mode {
        part: VibratingPart::Joint(1),
        frequency_hz: 9.0,
        damping_ratio: 0.03,
        participation: 1.0,
        compliance: 0.0,
    };
    let spike = Spike { joint: 1, amplitude: 1e-4, time_constant_s: 0.05 };
    for dynamics in [
        Dynamics { modes: vec![mode], ..Dynamics::default() },
        Dynamics { spikes: vec![spike], ..Dynamics::default() },
    ] {
        let rows = swing(600);
        let states = path(&model, &dynamics, &rows);
        assert!(states.iter().zip(&rows).all(|(state, row)| state.motor == row.q));
        let most = states.iter().map(|s| (s.link[1] - s.motor[1]).abs()).fold(0.0, f64::max);
        assert!(most > 5e-5, "{most}");
        for state in &states {
            let chain = Chain::nominal(&model.arm, &state.link);
            assert!((chain.base_from_tool.origin - state.base_from_tool.origin).length() < 1e-12);
        }
    }
}

#[test]
fn a_base_that_rocks_moves_the_tool_and_no_joint() {
    let model = Model::nominal(irb1600());
    let rocks = Mode {
        part: VibratingPart::Base(glam::DVec3::Y),
        frequency_hz: 8.0,
        damping_ratio: 0.05,
        participation: 1.0,
        compliance: 1e-6,
    };
    let dynamics = Dynamics { modes: vec![rocks], ..Dynamics::default() };
    let rows = swing(600);
    let states = path(&model, &dynamics, &rows);
    assert!(states.iter().zip(&rows).all(|(state, row)| state.link == row.q));
    let error = |(state, row): (&ArmState, &Inputs)| {
        let believed = Chain::nominal(&model.arm, &row.q).base_from_tool.origin;
        (state.base_from_tool.origin - believed).length()
    };
    assert!(states.iter().zip(&rows).map(error).fold(0.0, f64::max) > 1e-5);
}

#[test]
fn link_side_sensors_may_be_late_alone() {
    let model = Model::nominal(irb1600());
    let dynamics = Dynamics { link_delay_s: 4.0 / RATE_HZ, ..Dynamics::default() };
    let rows = swing(300);
    let states = path(&model, &dynamics, &rows);
    for k in 10..300 {
        assert!((states[k].link[1] - rows[k - 4].q[1]).abs() < 1e-9);
        assert_eq!(states[k].motor, rows[k].q);
    }
}

#[test]
fn play_seen_at_every_eighth_row_stands_where_it_stands_seen_at_each() {
    // 2 mrad take several rows to cross: the time of the reversal between rows affects all of them.
    let model = arm_effects(&[("backlash", "width", 2e-3)]);
    let rows = swing(2000);
    let all = path(&model, &Dynamics::default(), &rows);
    let few: Vec<Inputs> = rows.iter().step_by(8).copied().collect();
    let states = path(&model, &Dynamics::default(), &few);
    let differences = states
        .iter()
        .zip(all.iter().step_by(8))
        .map(|(one, same)| one.base_from_tool.origin.distance(same.base_from_tool.origin));
    // An eighth of the motion within a row at the reversal, 1.6 rad/s², is 5e-5 rad and more, at a
    // metre.
    let worst = differences.skip(20).fold(0.0, f64::max);
    assert!(worst < 5e-6, "{worst} m");
}
