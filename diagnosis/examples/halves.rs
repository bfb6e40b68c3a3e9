//! Calibrates a recording on seeded random halves, and on the first half in time; prints the errors on the other half as JSON, mm.
//!
//! `cargo run --release -p diagnosis --example halves -- MODEL RECORDING MAPPING [SEEDS]`
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "an example that prints")]

use diagnosis::campaign_import;
use diagnosis::hold_out::{Calibration, HoldOutSplit, PositionErrors, calibrate};
use diagnosis::progress::ignore;
use recording::model::RobotModel;
use recording::series::{self, RequiredData};
use serde_json::{Value, json};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, model, file, mapping, rest @ ..] = args.as_slice() else {
        return Err("MODEL RECORDING MAPPING [SEEDS]".into());
    };
    let seeds: u64 = rest.first().map_or(Ok(20), |seeds| seeds.parse())?;
    let model = RobotModel::read(Path::new(model))?;
    let recording =
        series::read(Path::new(file), Some(Path::new(mapping)), RequiredData::Measurement)?;
    let campaign = campaign_import::campaign(&model.physics.arm, &[recording])?;
    let run = |split: &HoldOutSplit| {
        let found = calibrate(&campaign, &model.physics, &model.sigma, &split.training, &ignore);
        let shown = show(&found, &|fit| PositionErrors::of(fit, &campaign, &split.held_out()));
        eprintln!("{}: {shown}", split.description);
        shown
    };
    let halves: Vec<Value> =
        (1..=seeds).map(|seed| run(&HoldOutSplit::random(&campaign, 0.5, seed))).collect();
    let median = |which: &str, what: &str| {
        let mut all: Vec<f64> =
            halves.iter().filter_map(|half| half[which][what].as_f64()).collect();
        all.sort_by(f64::total_cmp);
        let n = all.len();
        if n == 0 { f64::NAN } else { 0.5 * (all[(n - 1) / 2] + all[n / 2]) }
    };
    let medians = |which: &str| json!({ "mean": median(which, "mean"), "p95": median(which, "p95"), "max": median(which, "max") });
    let in_time = run(&HoldOutSplit::in_time(&campaign, 0.5));
    let report = json!({
        "recording": file, "unit": "mm", "halves": seeds, "median_of_random_halves": {
            "nominal": medians("nominal"), "calibrated": medians("calibrated"), "advanced": medians("advanced"),
        },
        "first_half_to_second": in_time,
    });
    println!("{report:#}");
    Ok(())
}

fn show(found: &Calibration, errors: &dyn Fn(&diagnosis::Fit) -> PositionErrors) -> Value {
    let figures = |fit: &diagnosis::Fit| {
        let errors = errors(fit);
        let mm = |metres: f64| (metres * 1e7).round() / 1e4;
        json!({ "mean": mm(errors.mean()), "p95": mm(errors.quantile(0.95)), "max": mm(errors.max()) })
    };
    json!({
        "nominal": figures(&found.nominal), "calibrated": figures(&found.calibrated),
        "advanced": figures(&found.advanced.fit), "numbers": found.advanced.fit.columns().len(),
    })
}
