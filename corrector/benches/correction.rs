//! Time of one cycle of the corrector, from command to limited correction: `cargo bench -p
//! corrector`.
#![expect(clippy::expect_used, reason = "the arms of the tests are sound")]

#[path = "../tests/support/mod.rs"]
mod support;

use corrector::{CycleInputs, Settings, Solver, Task, WrenchSample, solve};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use physics::{Chain, Evaluation, Inputs, JOINTS_MAX, Memories, Model, Wrench};
use std::hint::black_box;
use support::{DT_NS, Run, envelope, erring, load, pose, seven, six, twenty};

fn path(k: u64) -> [f64; 6] {
    let t_s = (k % 10_000) as f64 * 1e-3;
    std::array::from_fn(|i| 0.3 * (0.4 * t_s + i as f64).sin() + if i == 4 { 0.9 } else { 0.0 })
}

fn cycles(criterion: &mut Criterion, name: &str, model: Model, stiffness: Option<f64>) {
    let mut settings = Settings::with_envelope(envelope());
    settings.wrench.process_stiffness = stiffness;
    let mut run = Run::new(model, settings);
    let wrench = Wrench { force: DVec3::new(50.0, -20.0, 30.0), moment: DVec3::ZERO };
    let sample = WrenchSample { wrench, in_base: true, age_ns: DT_NS, faulty: false };
    run.world = CycleInputs { wrench: Some(sample), ..CycleInputs::default() };
    criterion.bench_function(name, |bencher| {
        bencher.iter(|| {
            let q = path(run.cycles);
            black_box(run.cycle(&q))
        });
    });
}

/// The parts of one correction with gravity and a wrench, at a pose in the middle of the arm's
/// range.
fn stages(criterion: &mut Criterion) {
    let (model, q) = (twenty(), pose());
    let inputs = Inputs { wrench_base: load(), ..Inputs::at_rest(q) };
    let (memories, reach, task) = (Memories::default(), [0.02; JOINTS_MAX], Task::default());
    criterion.bench_function("stage: geometry at a pose", |bencher| {
        bencher.iter(|| Chain::nominal(black_box(&model.arm), black_box(&q)));
    });
    let mut evaluation = Evaluation::default();
    criterion.bench_function("stage: geometry, loads, 20 effects, real geometry", |bencher| {
        bencher.iter(|| {
            model.evaluate_into(black_box(&inputs), &memories, &mut evaluation);
            black_box(&evaluation.real.base_from_tool);
        });
    });
    let mut solver = Solver::default();
    let found = solver.solve(&model, &inputs, &memories, &task, &reach);
    let name = format!("one correction, six joints, 20 effects, {} Newton steps", found.steps);
    criterion.bench_function(&name, |bencher| {
        bencher
            .iter(|| solver.solve(black_box(&model), black_box(&inputs), &memories, &task, &reach));
    });
}

fn benches(criterion: &mut Criterion) {
    stages(criterion);
    cycles(criterion, "cycle, six joints, no error", Model::nominal(six()), None);
    cycles(criterion, "cycle, six joints, 32 effects", erring(six()), None);
    cycles(criterion, "cycle, six joints, 32 effects, gate by stiffness", erring(six()), Some(1e5));
    for (name, arm) in [("solve, six joints", six()), ("solve, seven joints", seven())] {
        let model = erring(arm);
        let mut q = [0.0; JOINTS_MAX];
        q[..7].copy_from_slice(&[0.3, -0.4, 0.5, 0.7, -0.6, 0.4, 0.0]);
        let inputs = Inputs::at_rest(q);
        let (memories, reach) = (Memories::default(), [0.02; JOINTS_MAX]);
        criterion.bench_function(name, |bencher| {
            let task = Task::default();
            bencher.iter(|| solve(black_box(&model), black_box(&inputs), &memories, &task, &reach));
        });
    }
}

criterion_group!(correction, benches);
criterion_main!(correction);
