//! Corrections of random poses of each preset with six or seven axes: `cargo run --release -p tests
//! --bin poses [COUNT]`.
//!
//! Each preset's arm has random errors of its zeros, joint compliances and tool, redrawn every 100
//! poses, about 3 mm at the tool; the envelope is the default one. Exit 1 if more than 1 % of the
//! poses get no correction, or more than a tenth of the mean error remains.
#![expect(clippy::print_stdout, reason = "its account is what it is for")]

use std::collections::BTreeMap;
use std::process::ExitCode;

use corrector::{Task, solve};
use physics::{AnyEffect, Arm, Chain, Inputs, JOINTS_MAX, Memories, Model, ParameterValues};
use recording::model::RobotModel;
use recording::model::presets::PRESETS;

/// The default envelope's angle and travel, rad and m.
const REACH: f64 = 0.02;
const COUNT: usize = 10_000;
const POSES_PER_ROBOT: usize = 100;
/// The largest zero error, rad or m; compliance, rad/Nm; tool shift, m.
const ZERO: f64 = 2e-3;
const COMPLIANCE: f64 = 1e-6;
const TOOL: f64 = 1e-3;
/// Required shares: poses without a correction, remaining mean error.
const UNCORRECTED: f64 = 0.01;
const LEFT: f64 = 0.1;

/// Pseudo-random numbers (`SplitMix64`), identical on every machine.
struct SplitMix64(u64);

impl SplitMix64 {
    /// From −1 to 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

#[derive(Default)]
struct PoseStatistics {
    got: BTreeMap<String, usize>,
    uncorrected: usize,
    before_m: Vec<f64>,
    after_m: Vec<f64>,
    after_rad: Vec<f64>,
}

fn erring(arm: Arm, numbers: &mut SplitMix64) -> Result<Model, String> {
    let mut model = Model::nominal(arm);
    let mut push = |kind: &str, joint: Option<usize>, given: &[(&str, &[f64])]| {
        let effect = AnyEffect::build(kind, &arm, joint, ParameterValues(given))
            .map_err(|e| format!("{e:?}"))?;
        model.push(effect).map_err(|e| format!("{e:?}"))
    };
    for i in 0..arm.count() {
        push("joint_offset", Some(i), &[("offset", &[ZERO * numbers.next()])])?;
        push("joint_compliance", Some(i), &[("compliance", &[COMPLIANCE * numbers.next().abs()])])?;
    }
    let shift = [(); 3].map(|()| TOOL * numbers.next());
    push("tool_offset", None, &[("shift", &shift), ("turn", &[0.0; 3])])?;
    Ok(model)
}

fn account(arm: Arm, count: usize) -> Result<PoseStatistics, String> {
    let (mut numbers, mut account) = (SplitMix64(1), PoseStatistics::default());
    let mut model = erring(arm, &mut numbers)?;
    for k in 0..count {
        if k % POSES_PER_ROBOT == 0 {
            model = erring(arm, &mut numbers)?;
        }
        let mut q = [0.0; JOINTS_MAX];
        for (q, joint) in q.iter_mut().zip(arm.joints()) {
            let (low, high) = joint.limits;
            *q = low + (high - low) * (numbers.next() + 1.0) / 2.0;
        }
        let (inputs, memories) = (Inputs::at_rest(q), Memories::default());
        let found = solve(&model, &inputs, &memories, &Task::default(), &[REACH; JOINTS_MAX]);
        let wanted = Chain::nominal(&arm, &q).base_from_tool.origin;
        let error = |q| {
            (model.evaluate(&Inputs::at_rest(q), &memories).real.base_from_tool.origin - wanted)
                .length()
        };
        let got = found.converged || found.limited.is_some();
        let name = match found.limited {
            _ if found.converged => "exact".to_owned(),
            Some(reason) => format!("limited by {reason:?}"),
            None => "uncorrected".to_owned(),
        };
        *account.got.entry(name).or_default() += 1;
        account.uncorrected += usize::from(!got);
        account.before_m.push(error(q));
        account.after_m.push(error(if got { found.q } else { q }));
        account.after_rad.push(found.residual.rad);
    }
    Ok(account)
}

fn mean_and_largest(of: &[f64]) -> (f64, f64) {
    let sum: f64 = of.iter().sum();
    (1e3 * sum / of.len().max(1) as f64, 1e3 * of.iter().fold(0.0_f64, |most, x| most.max(*x)))
}

fn print_statistics(name: &str, account: &PoseStatistics) -> bool {
    let count = account.before_m.len();
    let (before, most_before) = mean_and_largest(&account.before_m);
    let (after, most_after) = mean_and_largest(&account.after_m);
    let (turned, most_turned) = mean_and_largest(&account.after_rad);
    let share = |n: &usize| 100.0 * *n as f64 / count.max(1) as f64;
    let got: Vec<String> =
        account.got.iter().map(|(name, n)| format!("{name} {:.2} %", share(n))).collect();
    println!("{name}: {}", got.join(", "));
    println!(
        "    mm, mean and largest: before {before:.3}, {most_before:.3}; after {after:.4}, {most_after:.3}"
    );
    println!("    mrad left, mean and largest: {turned:.4}, {most_turned:.3}");
    (account.uncorrected as f64) < UNCORRECTED * count as f64 && after <= LEFT * before
}

fn run(count: usize) -> Result<bool, String> {
    let mut held = true;
    for preset in PRESETS {
        let model = RobotModel::parse(preset.name, preset.text).map_err(|e| e.to_string())?;
        let arm = model.physics.arm;
        if (6..=7).contains(&arm.count()) {
            held &= print_statistics(preset.name, &account(arm, count)?);
        }
    }
    Ok(held)
}

fn main() -> ExitCode {
    let count = std::env::args().nth(1).map_or(Ok(COUNT), |argument| argument.parse());
    match count.map_err(|e| e.to_string()).and_then(run) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(why) => {
            println!("poses: {why}");
            ExitCode::from(2)
        }
    }
}
