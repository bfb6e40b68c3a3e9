//! A measuring program: all joints through their ranges and back, at different speeds, under loads from several sides, while the temperature rises.
//!
//! The motion is independent of the effect that is looked for: effects depend on position,
//! direction, load or temperature, and here none of these is correlated with another. It is slow
//! (minutes), so that the arm's own inertia is negligible.
//!
//! Joints stay within their limits; every joint reverses many times; between two rows no joint of
//! an arm like the IRB 1600 moves further than a reversal needs to build up. Deterministic, without
//! instrument.

use crate::robot::settled_path;
use core::f64::consts::TAU;
use glam::DVec3;
use libm::{cos, exp, sin, sqrt};
use physics::{Arm, Frame, Inputs, JOINTS_MAX, Model, Wrench};

/// Rows of the program.
const ROWS: usize = 1800;
/// Time between two rows, s: 45 minutes in total.
const ROW_S: f64 = 1.5;
/// Shares of a joint's range on each side of its middle, and the largest motion of a revolute
/// joint, rad.
const RANGE_FRACTION: f64 = 0.28;
const TURN_MAX: f64 = 2.0;
/// Number of oscillations of the first joint, and the increment for each further one.
const OSCILLATIONS: f64 = 2.6;
const OSCILLATIONS_INCREMENT: f64 = 1.1;
/// A smaller oscillation is superposed on each: its relative amplitude and frequency.
const SUPERPOSED_AMPLITUDE: f64 = 0.25;
const SUPERPOSED_FREQUENCY: f64 = 3.1;
/// Number of loads on the tool, of equal duration; their size, N, and lever arm from the TCP, m.
const LOADS: usize = 40;
const LOAD_N: f64 = 120.0;
const LEVER_M: f64 = 0.1;
/// Ambient temperature: initial value, rise, °C, and its time constant, s.
const COLD_CELSIUS: f64 = 19.0;
const WARM_UP_RISE: f64 = 9.0;
const WARM_UP_TIME_CONSTANT_S: f64 = 700.0;
/// A door that is opened occasionally: cooling, °C.
const DOOR_CELSIUS: f64 = 2.0;

/// Positions of the reflectors on the tool, m, tool frame.
pub const REFLECTORS_TOOL: [DVec3; 3] =
    [DVec3::new(0.12, 0.0, 0.04), DVec3::new(-0.06, 0.1, 0.05), DVec3::new(-0.06, -0.1, 0.0)];

/// The program of an arm: one segment, row by row.
#[must_use]
pub fn survey(arm: &Arm) -> Vec<Inputs> {
    let mut rows: Vec<Inputs> = Vec::with_capacity(ROWS);
    for row in 0..ROWS {
        let mut inputs = Inputs::at_rest([0.0; JOINTS_MAX]);
        let share = row as f64 / ROWS as f64;
        for (i, joint) in arm.joints().iter().enumerate() {
            let (low, high) = (joint.limits.0.max(-TURN_MAX), joint.limits.1.min(TURN_MAX));
            let swings = OSCILLATIONS + OSCILLATIONS_INCREMENT * i as f64;
            let swing = (1.0 - SUPERPOSED_AMPLITUDE) * sin(TAU * swings * share + i as f64)
                + SUPERPOSED_AMPLITUDE * sin(TAU * SUPERPOSED_FREQUENCY * swings * share);
            inputs.q[i] = 0.5 * (low + high) + RANGE_FRACTION * (high - low) * swing;
        }
        inputs.time_s = row as f64 * ROW_S;
        inputs.ambient_celsius = air_celsius(inputs.time_s);
        inputs.wrench_base = load(row * LOADS / ROWS);
        if let Some(before) = rows.last() {
            inputs.q_before = before.q;
            inputs.dt_s = ROW_S;
            for i in 0..arm.count() {
                let moved = inputs.q[i] - before.q[i];
                inputs.direction[i] =
                    if moved == 0.0 { before.direction[i] } else { moved.signum() };
            }
        }
        rows.push(inputs);
    }
    rows
}

/// Poses of the tool of `model` on `rows`, which begin settled.
#[must_use]
pub fn tool_poses(model: &Model, rows: &[Inputs]) -> Vec<Frame> {
    settled_path(model, rows)
}

/// Directions are distributed evenly (a golden spiral) in an order that is not correlated with
/// anything else; every third load is zero.
fn load(k: usize) -> Wrench {
    if k.is_multiple_of(3) {
        return Wrench::ZERO;
    }
    let place = (17 * k % LOADS) as f64;
    let up = 1.0 - (2.0 * place + 1.0) / LOADS as f64;
    let (around, turn) = (sqrt(1.0 - up * up), 2.4 * place);
    let share = 0.5 + 0.5 * (5 * k % LOADS) as f64 / LOADS as f64;
    let force = DVec3::new(around * cos(turn), around * sin(turn), up) * (LOAD_N * share);
    let lever = DVec3::new(sin(1.7 * place), cos(1.7 * place), 0.5) * LEVER_M;
    Wrench { force, moment: lever.cross(force) }
}

fn air_celsius(time_s: f64) -> f64 {
    let door = sin(TAU * time_s / 610.0).max(0.0);
    COLD_CELSIUS + WARM_UP_RISE * (1.0 - exp(-time_s / WARM_UP_TIME_CONSTANT_S))
        - DOOR_CELSIUS * door
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_arm::{irb1600, seven_joints};

    #[test]
    fn joints_keep_their_limits_and_turn_back_often() {
        for arm in [irb1600(), seven_joints()] {
            let rows = survey(&arm);
            assert!(rows.iter().all(|row| arm.within_limits(&row.q)));
            for i in 0..arm.count() {
                let turns =
                    rows.windows(2).filter(|two| two[0].direction[i] * two[1].direction[i] < 0.0);
                assert!(turns.count() >= 10, "joint {i}");
                let spread = |extreme: fn(f64, f64) -> f64| {
                    rows.iter().map(|row| row.q[i]).fold(0.0, extreme)
                };
                assert!(spread(f64::max) - spread(f64::min) > 1.0, "joint {i} goes far");
            }
        }
    }

    #[test]
    fn loads_and_warmth_follow_no_joint() {
        let rows = survey(&irb1600());
        let against = |quantity: &dyn Fn(&Inputs) -> f64, other: &dyn Fn(&Inputs) -> f64| {
            let n = rows.len() as f64;
            let mean =
                |quantity: &dyn Fn(&Inputs) -> f64| rows.iter().map(quantity).sum::<f64>() / n;
            let (a, b) = (mean(quantity), mean(other));
            let both = |x: &Inputs, y: &Inputs| (quantity(x) - a) * (other(y) - b);
            let sum: f64 = rows.iter().map(|row| both(row, row)).sum();
            let one: f64 = rows.iter().map(|row| (quantity(row) - a).powi(2)).sum();
            let two: f64 = rows.iter().map(|row| (other(row) - b).powi(2)).sum();
            (sum / sqrt(one * two)).abs()
        };
        for i in 0..6 {
            let q = move |row: &Inputs| row.q[i];
            assert!(against(&q, &|row| row.ambient_celsius) < 0.3, "joint {i} and warmth");
            for axis in 0..3 {
                let force = move |row: &Inputs| row.wrench_base.force[axis];
                assert!(against(&q, &force) < 0.4, "joint {i} and force {axis}");
            }
        }
    }
}
