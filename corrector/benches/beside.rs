//! Times one correction in batches, for comparison with other libraries: `cargo xtask peers`.
//!
//! `beside arm` prints the arm and the poses that are evaluated: joints (count; each: axis, point,
//! mass, centre), tool (TCP, mass, centre), gravity, poses (count; each: its joints), SI. `beside
//! correct` reads commands from standard input, one per line: `look` (TCP and gravity torques of
//! each pose), `batch N` (mean time of N corrections, ns, and Newton steps of one).
#![expect(
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a program for one chore; its arm is sound"
)]

#[path = "../tests/support/mod.rs"]
mod support;

use corrector::{Solver, Task};
use glam::DVec3;
use physics::{Body, Inputs, JOINTS_MAX, Joints, Memories, Model};
use std::hint::black_box;
use std::io::BufRead;
use std::time::Instant;
use support::{load, pose, twenty};

/// Poses that are evaluated, around the nominal one, rad.
const POSES: usize = 64;
const ABOUT: f64 = 0.2;

fn poses() -> Vec<Joints> {
    let offset = |k: usize, i: usize| ABOUT * (1.7 * (k * (i + 2)) as f64).sin();
    let one = |k| {
        let mut q = pose();
        q[..6].iter_mut().enumerate().for_each(|(i, q)| *q += offset(k, i));
        q
    };
    (0..POSES).map(one).collect()
}

fn tell_arm(model: &Model, poses: &[Joints]) {
    let arm = &model.arm;
    let body = |body: &Option<Body>| body.map_or((0.0, DVec3::ZERO), |b| (b.mass, b.centre));
    let vector_text = |v: DVec3| format!("{:?} {:?} {:?}", v.x, v.y, v.z);
    println!("{}", arm.count());
    for joint in arm.joints() {
        let (mass, centre) = body(&joint.link);
        println!(
            "{} {} {mass:?} {}",
            vector_text(joint.axis),
            vector_text(joint.point),
            vector_text(centre)
        );
    }
    let (mass, centre) = body(&arm.tool.body);
    println!("{} {mass:?} {}", vector_text(arm.tool.tcp), vector_text(centre));
    println!("{}\n{}", vector_text(arm.gravity), poses.len());
    poses.iter().for_each(|q| println!("{}", numbers(&q[..arm.count()])));
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ")
}

fn evaluate_all(model: &Model, poses: &[Joints]) {
    for q in poses {
        let evaluation = model.evaluate(&Inputs::at_rest(*q), &Memories::default());
        let position = evaluation.nominal.base_from_tool.origin;
        let torques = &evaluation.loads.gravity_torque[..model.arm.count()];
        println!("{} {}", numbers(&position.to_array()), numbers(torques));
    }
}

fn batch(model: &Model, poses: &[Joints], times: usize) {
    let (memories, reach, task) = (Memories::default(), [0.02; JOINTS_MAX], Task::default());
    let loaded = |q: &Joints| Inputs { wrench_base: load(), ..Inputs::at_rest(*q) };
    let inputs: Vec<Inputs> = poses.iter().map(loaded).collect();
    let (mut solver, mut steps) = (Solver::default(), 0);
    let start = Instant::now();
    for inputs in inputs.iter().cycle().take(times) {
        let found = solver.solve(black_box(model), black_box(inputs), &memories, &task, &reach);
        steps += black_box(&found).steps;
        assert!(found.converged, "no solution at {:?}", inputs.q);
    }
    let took_ns = start.elapsed().as_secs_f64() * 1e9;
    println!("{:.3} {:.3}", took_ns / times as f64, f64::from(steps) / times as f64);
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (model, poses) = (twenty(), poses());
    match arguments.first().map(String::as_str) {
        Some("arm") => tell_arm(&model, &poses),
        Some("correct") => {
            for line in std::io::stdin().lock().lines() {
                let line = line.expect("an order");
                match line.strip_prefix("batch ").map(|times| times.trim().parse()) {
                    Some(Ok(times)) => batch(&model, &poses, times),
                    Some(Err(why)) => println!("batch: {why}, expected a count"),
                    None => evaluate_all(&model, &poses),
                }
            }
        }
        // Run by `cargo bench` without arguments: nothing to do.
        _ => {}
    }
}
