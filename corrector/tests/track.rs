//! A warm start finds the same solution as a start at the command.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

#[path = "support/random.rs"]
mod random;
mod support;

use corrector::{Solution, Solver, Task, solve};
use glam::DVec3;
use physics::{Arm, Inputs, JOINTS_MAX, JointKind, Joints, Memories, Model, Wrench};
use proptest::prelude::*;
use random::{Errors, erring, errors, places};
use support::{effect, first, load, pose, six, twenty};

const REACH: Joints = [0.02; JOINTS_MAX];
/// Largest difference between warm and cold solutions, rad or m: a tenth of the documented
/// accuracy.
const SAME: f64 = 1e-10;

/// A sequence of commands, and the memory of the effects.
struct Motion {
    model: Model,
    inputs: Inputs,
    memories: Memories,
    task: Task,
    solver: Solver,
}

/// Evaluations of the model that were taken, and that a start at the command takes.
#[derive(Default)]
struct Taken {
    tracked: u32,
    cold: u32,
}

impl Motion {
    fn new(model: Model, q: &[f64], task: Task) -> Self {
        let mut all = [0.0; JOINTS_MAX];
        all[..q.len()].copy_from_slice(q);
        let (inputs, mut memories) = (Inputs::at_rest(all), Memories::default());
        model.settle(&inputs, &mut memories);
        Self { model, inputs, memories, task, solver: Solver::default() }
    }

    fn go(&mut self, q: &Joints, wrench: Wrench, dt_s: f64) {
        let inputs = &mut self.inputs;
        (inputs.q_before, inputs.q, inputs.wrench_base) = (inputs.q, *q, wrench);
        (inputs.dt_s, inputs.time_s) = (dt_s, inputs.time_s + dt_s);
        for (i, direction) in inputs.direction.iter_mut().enumerate() {
            let moved = inputs.q[i] - inputs.q_before[i];
            *direction = if moved == 0.0 { *direction } else { moved.signum() };
        }
        self.model.follow(inputs, &mut self.memories);
    }

    /// The warm-started solution, and the one from the command.
    fn solved(&mut self) -> (Solution, Solution) {
        let Self { model, inputs, memories, task, solver } = self;
        (
            solver.track(model, inputs, memories, task, &REACH),
            solve(model, inputs, memories, task, &REACH),
        )
    }

    fn is_confirmed(&mut self, taken: &mut Taken) -> Result<(), TestCaseError> {
        let (tracked, cold) = self.solved();
        prop_assert_eq!(tracked.converged, cold.converged, "{:?} {:?}", tracked, cold);
        if cold.converged {
            for (i, (a, b)) in tracked.q.iter().zip(&cold.q).enumerate() {
                prop_assert!(
                    (a - b).abs() < SAME,
                    "joint {}: {} in {}, {}",
                    i,
                    a - b,
                    tracked.steps,
                    cold.steps
                );
            }
            let (a, b) = (tracked.residual, cold.residual);
            prop_assert!(
                (a.m - b.m).abs() < SAME && (a.rad - b.rad).abs() < SAME,
                "{:?} {:?}",
                a,
                b
            );
        }
        for (i, q) in tracked.q.iter().enumerate() {
            prop_assert!((q - self.inputs.q[i]).abs() <= REACH[i] + SAME);
        }
        taken.tracked += tracked.steps;
        taken.cold += cold.steps;
        Ok(())
    }
}

/// Effects with memory, effects that depend on the load by laws of their own, and optionally one
/// that provides no slope.
fn remembering(model: &mut Model, (joints, _): &Errors, with_untold: bool) {
    let arm = model.arm;
    for (i, [width, amplitude, ..]) in joints.iter().enumerate().take(arm.count()) {
        let mut push = |kind: &str, given: &[(&str, &[f64])]| {
            model.push(effect(&arm, kind, Some(i), given)).expect("room");
        };
        push("backlash", &[("width", &[1e-4 * width.abs()])]);
        let hysteresis: &[(&str, &[f64])] =
            &[("amplitude", &[1e-4 * amplitude.abs()]), ("reversal", &[2e-3])];
        push("hysteresis", hysteresis);
        if arm.joints()[i].kind == JointKind::Revolute {
            let sag: Vec<f64> =
                (i..arm.count()).flat_map(|_| [4e-4 * width, 4e-4 * amplitude, 2e-4]).collect();
            push("gravity_sag", &[("sag", &sag)]);
        }
        if with_untold {
            push("lost_motion", &[("width", &[1e-4 * width.abs()]), ("torque", &[20.0])]);
        }
    }
}

/// Six joints, three slides with a wrist, seven joints, or five.
fn arm(which: u8) -> Arm {
    if which == 3 { first(5) } else { random::arm(which) }
}

/// A smooth path, rad or m: each joint oscillates about its place at its own frequency.
fn on_path(centre: &Joints, swings: &[[f64; 2]], t_s: f64) -> Joints {
    let mut q = *centre;
    for (q, [width, pace]) in q.iter_mut().zip(swings) {
        let pace_per_s = 1.0 + 6.0 * pace;
        *q += 0.3 * width / pace_per_s * (pace_per_s * t_s).sin();
    }
    q
}

fn wrench_at(t_s: f64) -> Wrench {
    let force = DVec3::new(80.0, -40.0, 30.0) * (3.0 * t_s).sin();
    Wrench { force, moment: DVec3::new(1.0, 2.0, -3.0) * (5.0 * t_s).cos() }
}

fn swings() -> impl Strategy<Value = Vec<[f64; 2]>> {
    prop::collection::vec(prop::array::uniform2(0.0..1.0_f64), 7)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn on_smooth_paths_what_is_tracked_is_what_a_start_from_the_command_finds(
        (which, errors, places) in (0..4_u8, errors(), places()), swings in swings(), size in -1.0..1.0_f64,
        (rate, remembers, untold, free) in (0..4_usize, any::<bool>(), any::<bool>(), any::<bool>()),
    ) {
        let arm = arm(which);
        let mut model = erring(arm, &errors, 10.0_f64.powf(size));
        if remembers {
            remembering(&mut model, &errors, untold);
        }
        let task = Task { free_tool_axis: free && which == 3, ..Task::default() };
        let mut motion = Motion::new(model, &random::pose(&arm, &places), task);
        let (centre, dt_s) = (motion.inputs.q, [8e-6, 125e-6, 1e-3, 4e-3][rate]);
        let mut taken = Taken::default();
        for cycle in 1..=100 {
            let t_s = f64::from(cycle) * dt_s;
            motion.go(&on_path(&centre, &swings[..arm.count()], t_s), wrench_at(t_s), dt_s);
            motion.is_confirmed(&mut taken)?;
        }
        prop_assert!(taken.tracked <= taken.cold, "{} of {}", taken.tracked, taken.cold);
    }

    #[test]
    fn so_it_is_through_singular_poses_jumps_and_pauses(
        errors in errors(), places in places(), (pace, before) in (-6.0..-2.0_f64, 0.0..1.0_f64), sway in -1.0..1.0_f64,
        loads in prop::collection::vec((-1.0..1.0_f64, -6.0..2.0_f64), 300),
    ) {
        let arm = six();
        let mut motion = Motion::new(erring(arm, &errors, 1.0), &random::pose(&arm, &places), Task::default());
        let mut taken = Taken::default();
        let (mut q, step) = (motion.inputs.q, 10.0_f64.powf(pace));
        for (cycle, (share, exponent)) in loads.iter().enumerate() {
            // The wrist becomes straight in the middle of it, or nearly so.
            q[4] = step * (cycle as f64 - 300.0 * before) + if pace < -4.0 { 0.02 * sway } else { 0.0 };
            q[0] += step * sway;
            q[1] += if cycle % 97 == 96 { 0.01 * sway } else { 0.0 };
            let mut wrench = load();
            wrench.force += DVec3::new(0.6, 0.5, -0.6) * (share * 10.0_f64.powf(*exponent));
            motion.go(&q, wrench, if cycle % 61 == 60 { 1.0 } else { 1e-3 });
            motion.is_confirmed(&mut taken)?;
        }
    }
}

#[test]
fn an_even_motion_takes_one_evaluation_a_cycle() {
    for (dt_s, most) in [(8e-6, 1.02), (125e-6, 1.02), (1e-3, 1.05)] {
        let mut motion = Motion::new(twenty(), &pose()[..6], Task::default());
        let (centre, mut taken) = (pose(), Taken::default());
        for cycle in 1..=1000 {
            let t_s = f64::from(cycle) * dt_s;
            motion.go(&on_path(&centre, &[[1.0, 0.3]; 6], t_s), wrench_at(t_s), dt_s);
            motion.is_confirmed(&mut taken).expect("the same");
        }
        let each = f64::from(taken.tracked) / 1000.0;
        assert!(each < most, "{each} at {dt_s} s");
        assert!(taken.cold >= 2000);
    }
}

#[test]
fn a_load_that_comes_near_the_limit_of_a_hardening_joint_is_judged_at_the_command_too() {
    let arm = six();
    let mut model = Model::nominal(arm);
    let mut at_limit = Motion::new(Model::nominal(arm), &pose()[..6], Task::default());
    at_limit.go(&pose(), load(), 1e-3);
    let torque = at_limit.model.evaluate(&at_limit.inputs, &Memories::default()).loads.torque(1);
    let cubic = 2e-6 / (3.0 * torque * torque);
    for (kind, key, value) in
        [("joint_compliance", "compliance", 2e-6), ("stiffness_hardening", "cubic", cubic)]
    {
        model.push(effect(&arm, kind, Some(1), &[(key, &[value])])).expect("room");
    }
    let mut motion = Motion::new(model, &pose()[..6], Task::default());
    let (mut refused, mut solved) = (0, 0);
    for cycle in -2000..2000 {
        let mut q = pose();
        q[1] += 1e-6 * f64::from(cycle);
        motion.go(&q, load(), 1e-3);
        motion.is_confirmed(&mut Taken::default()).expect("the same");
        let count = if motion.solved().1.converged { &mut solved } else { &mut refused };
        *count += 1;
    }
    assert!(solved > 500 && refused > 500, "{solved} {refused}");
}

#[test]
fn a_robot_that_stands_still_gets_the_same_bits_again() {
    let mut motion = Motion::new(twenty(), &pose()[..6], Task::default());
    let mut cycle = || {
        motion.go(&pose(), load(), 1e-3);
        motion.solved().0.q
    };
    let settled = (0..5).map(|_| cycle()).last();
    for _ in 0..1000 {
        assert_eq!(Some(cycle()), settled);
    }
}

#[test]
fn what_is_tracked_is_told_by_the_inputs_alone() {
    let answers = || -> Vec<Solution> {
        let mut motion = Motion::new(twenty(), &pose()[..6], Task::default());
        (1..600)
            .map(|cycle| {
                let t_s = f64::from(cycle) * 1e-3;
                motion.go(&on_path(&pose(), &[[1.0, 0.5]; 6], t_s), wrench_at(t_s), 1e-3);
                motion.solved().0
            })
            .collect()
    };
    assert_eq!(answers(), answers());
}
