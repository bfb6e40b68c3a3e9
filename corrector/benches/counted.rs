//! Runs one stage of a correction a given number of times, for a tool that counts instructions:
//! `counted STAGE TIMES`; without arguments it lists the stages.
//!
//! `cargo xtask instructions` runs it under callgrind and compares with the stored counts; on a
//! shared machine times are too noisy to show a change of a few per cent.
#![expect(
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a program for one tool; its arm is sound"
)]

#[path = "../tests/support/mod.rs"]
mod support;

use corrector::{CycleInputs, Settings, Solver, Task, WrenchSample};
use physics::{Chain, Evaluation, Inputs, JOINTS_MAX, Memories};
use std::hint::black_box;
use support::{DT_NS, Run, envelope, load, pose, twenty};

/// The stages; the last two are whole cycles, of a robot at rest and of a moving one.
const STAGES: [&str; 5] = ["geometry", "evaluation", "correction", "cycle", "moving"];

fn run(stage: &str, times: u64) {
    let (model, q, inputs) = (twenty(), pose(), pose_under_load());
    let (memories, reach, task) = (Memories::default(), [0.02; JOINTS_MAX], Task::default());
    match stage {
        "geometry" => (0..times).for_each(|_| {
            black_box(Chain::nominal(black_box(&model.arm), black_box(&q)));
        }),
        "evaluation" => {
            let mut evaluation = Evaluation::default();
            (0..times).for_each(|_| {
                model.evaluate_into(black_box(&inputs), &memories, &mut evaluation);
                black_box(&evaluation.real.base_from_tool);
            });
        }
        "correction" => {
            let mut solver = Solver::default();
            (0..times).for_each(|_| {
                black_box(solver.solve(
                    black_box(&model),
                    black_box(&inputs),
                    &memories,
                    &task,
                    &reach,
                ));
            });
        }
        stage => {
            let way_rad = if stage == "moving" { 0.1 } else { 0.0 };
            let mut run = Run::new(model, Settings::with_envelope(envelope()));
            let sample =
                WrenchSample { wrench: load(), in_base: true, age_ns: DT_NS, faulty: false };
            run.world = CycleInputs { wrench: Some(sample), ..CycleInputs::default() };
            (0..times).for_each(|cycle| {
                // Oscillates at up to 0.5 rad/s, neighbouring joints in opposite directions.
                let turn = way_rad * (5e-9 * (cycle * DT_NS) as f64).sin();
                let q: [f64; 6] =
                    std::array::from_fn(|i| q[i] + if i % 2 == 0 { turn } else { -0.7 * turn });
                black_box(run.cycle(black_box(&q)));
            });
        }
    }
}

fn pose_under_load() -> Inputs {
    Inputs { wrench_base: load(), ..Inputs::at_rest(pose()) }
}

fn main() {
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    match (arguments.next(), arguments.next().and_then(|times| times.parse().ok())) {
        (Some(stage), Some(times)) if STAGES.contains(&stage.as_str()) => run(&stage, times),
        _ => STAGES.iter().for_each(|stage| println!("{stage}")),
    }
}
