//! The true robot, simulated at a fixed rate.
//!
//! Order (docs/reference/effects.md): command → delay → lag → errors of position, and backlash →
//! compliance. Delay and lag are those of the servos, equal for every joint, off by default. The
//! arm is quasi-static: speeds and accelerations are zero for the effects, valid at machining feeds
//! (mm/s), not at handling speeds.
//!
//! The same targets and wrenches give the same bits.

use libm::exp;
use physics::{Frame, Inputs, Joints, Memories, Model, Wrench};
use std::collections::VecDeque;

/// Response of the robot to its targets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// Time between two targets, s, above zero.
    pub dt_s: f64,
    /// Pure delay, in samples.
    pub delay_samples: usize,
    /// Time constant of the first-order lag behind the delay, s; 0 is none.
    pub lag_s: f64,
}

impl Servo {
    /// Servos without delay and lag.
    pub const fn ideal(dt_s: f64) -> Self {
        Self { dt_s, delay_samples: 0, lag_s: 0.0 }
    }
}

/// A robot in motion.
#[derive(Clone, Debug)]
pub struct Robot {
    model: Model,
    memories: Memories,
    servo: Servo,
    inputs: Inputs,
    waiting: VecDeque<Joints>,
}

impl Robot {
    /// A robot at rest at `q` (rad or m), settled there, in air of `ambient_celsius` (NaN where unknown).
    pub fn at_rest(model: &Model, servo: Servo, q: Joints, ambient_celsius: f64) -> Self {
        let inputs = Inputs { ambient_celsius, dt_s: servo.dt_s, ..Inputs::at_rest(q) };
        let mut memories = Memories::default();
        model.settle(&inputs, &mut memories);
        let waiting = VecDeque::from(vec![q; servo.delay_samples]);
        Self { model: *model, memories, servo, inputs, waiting }
    }

    /// Sets the next target (rad or m) and advances by one sample under `wrench_base`.
    pub fn follow(&mut self, target: &Joints, wrench_base: Wrench) {
        self.waiting.push_back(*target);
        let delayed = self.waiting.pop_front().unwrap_or(*target);
        let inputs = &mut self.inputs;
        inputs.q_before = inputs.q;
        for (i, target) in delayed.iter().enumerate() {
            let to_go = target - inputs.q[i];
            let share = if self.servo.lag_s > 0.0 {
                1.0 - exp(-self.servo.dt_s / self.servo.lag_s)
            } else {
                1.0
            };
            // The target itself, not `q + (target − q)`, which may differ by rounding.
            inputs.q[i] = if share == 1.0 { *target } else { inputs.q[i] + share * to_go };
            let moved = inputs.q[i] - inputs.q_before[i];
            if moved != 0.0 {
                inputs.direction[i] = moved.signum();
            }
        }
        inputs.wrench_base = wrench_base;
        inputs.time_s += self.servo.dt_s;
        self.model.advance(&self.inputs, &mut self.memories);
    }

    /// Actual pose of the tool, under the wrench of the last sample.
    pub fn base_from_tool(&self) -> Frame {
        self.model.evaluate(&self.inputs, &self.memories).real.base_from_tool
    }

    /// Actual pose of the tool under another wrench, everything else unchanged.
    pub fn base_from_tool_under(&self, wrench_base: Wrench) -> Frame {
        let inputs = Inputs { wrench_base, ..self.inputs };
        self.model.evaluate(&inputs, &self.memories).real.base_from_tool
    }

    /// Encoder positions: joint positions on the motors' side, rad or m.
    pub const fn encoders(&self) -> &Joints {
        &self.inputs.q
    }

    /// The inputs of the last sample.
    pub const fn inputs(&self) -> &Inputs {
        &self.inputs
    }
}

/// Pose of the tool on consecutive `rows` that begin settled: errors of position, backlash, loads,
/// temperature; no lag and no modes.
pub(crate) fn settled_path(model: &Model, rows: &[Inputs]) -> Vec<Frame> {
    let mut memories = Memories::default();
    let place = |(k, inputs): (usize, &Inputs)| {
        if k == 0 {
            model.settle(inputs, &mut memories);
        } else {
            model.advance(inputs, &mut memories);
        }
        model.evaluate(inputs, &memories).real.base_from_tool
    };
    rows.iter().enumerate().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_arm::{effect, irb1600};
    use physics::{Chain, JOINTS_MAX};

    fn pose(q2: f64) -> Joints {
        let mut q = [0.0; JOINTS_MAX];
        q[..6].copy_from_slice(&[0.1, q2, 0.3, 0.0, 1.2, 0.0]);
        q
    }

    #[test]
    fn a_robot_without_effects_goes_where_the_controller_believes() {
        let model = Model::nominal(irb1600());
        let mut robot = Robot::at_rest(&model, Servo::ideal(1e-3), pose(0.2), 20.0);
        robot.follow(&pose(0.21), Wrench::ZERO);
        assert_eq!(robot.base_from_tool(), Chain::nominal(&model.arm, &pose(0.21)).base_from_tool);
    }

    #[test]
    fn delay_and_lag_hold_the_encoders_back_as_configured() {
        let model = Model::nominal(irb1600());
        let servo = Servo { dt_s: 1e-3, delay_samples: 5, lag_s: 0.02 };
        let mut robot = Robot::at_rest(&model, servo, pose(0.0), 20.0);
        for _ in 0..5 {
            robot.follow(&pose(0.1), Wrench::ZERO);
            assert_eq!(robot.encoders()[1], 0.0);
        }
        for _ in 0..20 {
            robot.follow(&pose(0.1), Wrench::ZERO);
        }
        let expected = 0.1 * (1.0 - exp(-1.0));
        assert!((robot.encoders()[1] - expected).abs() < 1e-12, "one time constant later");
    }

    #[test]
    fn play_shows_on_the_way_back_and_a_load_bends_the_arm() {
        let arm = irb1600();
        let effects = [
            effect(&arm, "backlash", 1, "width", 2e-4),
            effect(&arm, "joint_compliance", 2, "compliance", 4e-6),
        ];
        let model = Model::new(arm, &effects).expect("room for two");
        let mut robot = Robot::at_rest(&model, Servo::ideal(1e-3), pose(0.0), 20.0);
        let mut there_and_back = [0.0; 2];
        for (height, turn) in there_and_back.iter_mut().zip([0.1, -0.1]) {
            robot.follow(&pose(turn), Wrench::ZERO);
            robot.follow(&pose(0.0), Wrench::ZERO);
            *height = robot.base_from_tool().origin.z;
        }
        assert!((there_and_back[0] - there_and_back[1]).abs() > 1e-5, "{there_and_back:?}");
        let push = Wrench { force: glam::DVec3::Z * 100.0, moment: glam::DVec3::ZERO };
        let lifted = robot.base_from_tool_under(push).origin.z - robot.base_from_tool().origin.z;
        assert!(lifted > 1e-5, "a force up lifts the tool, {lifted} m");
    }
}
