//! The thesis' virtual robot, measured by a C-Track and calibrated from the nominal model; errors on held-out poses.
//!
//! The calibration does not know the effects of the truth. It is compared with an oracle: a fit of the true effects that starts at the true parameters,
//! so that parameters which the poses do not determine keep their true values. Its held-out error is the best possible with this noise and these poses.

use crate::rig;
use diagnosis::hold_out::{PositionErrors, calibrate};
use diagnosis::hypothesis::Hypothesis;
use diagnosis::progress::ignore;
use diagnosis::{
    Campaign, Fit, FitSettings, Influence, ReadingNoise, campaign_simulation, fit, geometry,
};
use glam::DVec3;
use physics::{Inputs, Model};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::{Value, json};
use std::error::Error;

/// Noise of a C-Track: 0.02 mm across and 0.04 mm along its viewing direction (z of the measuring frame), so that 95 % of the points are within
/// 0.09 mm, which the manufacturer states for its volume.
pub(crate) const C_TRACK: ReadingNoise = ReadingNoise::Axes(DVec3::new(2e-5, 2e-5, 4e-5));
/// Joint ranges of the thesis' tests, degrees.
const PLANAR_DEG: [[f64; 2]; 6] =
    [[0.0, 0.0], [-25.0, 25.0], [-30.0, 30.0], [0.0, 0.0], [-90.0, 90.0], [0.0, 0.0]];
pub(crate) const SPATIAL_DEG: [[f64; 2]; 6] = [
    [-150.0, -120.0],
    [-30.0, 30.0],
    [-30.0, 30.0],
    [-30.0, 30.0],
    [-90.0, 90.0],
    [-175.0, -115.0],
];
/// Number of training and held-out poses; each is measured twice, with all joints approaching from opposite sides.
const TRAINING: usize = 100;
const HELD_OUT: usize = 100;
/// Bin width of the histogram, mm.
const BIN_MM: f64 = 0.02;

pub(crate) fn figures(seeds: u64) -> Result<Value, Box<dyn Error>> {
    let truth = rig::model("irb1600-6-145-thesis")?;
    let nominal = rig::model("irb1600-6-145")?;
    let mut all = serde_json::Map::new();
    for (name, ranges_deg) in [("planar", PLANAR_DEG), ("spatial", SPATIAL_DEG)] {
        let runs = rig::for_seeds(seeds, |seed| run(&truth, &nominal, &ranges_deg, seed));
        let runs: Option<Vec<Run>> = runs.into_iter().collect();
        all.insert(name.to_owned(), summary(&runs.ok_or("no campaign")?));
    }
    Ok(Value::Object(all))
}

/// Held-out errors of one campaign.
struct Run {
    models: Vec<(&'static str, PositionErrors)>,
    rising: PositionErrors,
    falling: PositionErrors,
    effects: usize,
    converged: bool,
    steps: usize,
}

fn run(truth: &Model, nominal: &Model, ranges_deg: &[[f64; 2]; 6], seed: u64) -> Option<Run> {
    let mut chance = ChaCha8Rng::seed_from_u64(seed);
    let mut inputs: Vec<Inputs> = Vec::new();
    for _ in 0..TRAINING + HELD_OUT {
        let one = rig::inputs(&mut chance, ranges_deg);
        inputs.push(one);
        inputs.push(Inputs { direction: one.direction.map(|d| -d), ..one });
    }
    let campaign = rig::campaign(&nominal.arm, &inputs, C_TRACK)?;
    let campaign =
        campaign_simulation::simulate_readings(&campaign, truth, &campaign.surroundings, 1.0, seed);
    let training: Vec<bool> = (0..inputs.len()).map(|pose| pose < 2 * TRAINING).collect();
    let held: Vec<bool> = training.iter().map(|trains| !trains).collect();
    let found = calibrate(&campaign, nominal, &[], &training, &ignore);
    let settings = FitSettings::full(&training, Influence::Equal);
    let oracle = fit(&campaign, &geometry(truth, &[]), &settings);
    let whole = fit(&campaign, &Hypothesis::fixed(*truth), &settings);
    let advanced = &found.advanced.fit;
    let errors = |fit: &Fit| PositionErrors::of(fit, &campaign, &held);
    let arrived = |sign: f64| side(&campaign, &held, sign);
    Some(Run {
        models: vec![
            ("nominal", errors(&found.nominal)),
            ("calibrated", errors(&found.calibrated)),
            ("advanced", errors(advanced)),
            ("oracle", errors(&oracle)),
            ("truth", errors(&whole)),
        ],
        rising: PositionErrors::of(advanced, &campaign, &arrived(1.0)),
        falling: PositionErrors::of(advanced, &campaign, &arrived(-1.0)),
        effects: found.advanced.chosen.len(),
        converged: advanced.converged,
        steps: advanced.steps,
    })
}

/// Held-out poses that joint 2 approached in the direction `sign`.
fn side(campaign: &Campaign, held: &[bool], sign: f64) -> Vec<bool> {
    let poses = campaign.poses.iter().zip(held);
    poses.map(|(pose, held)| *held && pose.inputs.direction[1] == sign).collect()
}

fn summary(runs: &[Run]) -> Value {
    let mm = |metres: f64| (metres * 1e7).round() / 1e4;
    let middle =
        |quantity: &dyn Fn(&Run) -> f64| mm(rig::median(runs.iter().map(quantity).collect()));
    let figures = |quantity: &dyn Fn(&Run) -> &PositionErrors| {
        json!({
            "mean": middle(&|run| quantity(run).mean()), "median": middle(&|run| quantity(run).quantile(0.5)),
            "p95": middle(&|run| quantity(run).quantile(0.95)), "max": middle(&|run| quantity(run).max()),
        })
    };
    let mut models = serde_json::Map::new();
    for (place, (name, _)) in runs[0].models.iter().enumerate() {
        let mut one = figures(&|run| &run.models[place].1);
        one["histogram"] = histogram(&runs[0].models[place].1);
        models.insert((*name).to_owned(), one);
    }
    let worst = runs.iter().map(|run| run.models[2].1.mean()).fold(0.0, f64::max);
    let ratio = |run: &Run| run.models[2].1.mean() / run.models[3].1.mean();
    json!({
        "campaigns": runs.len(), "training_poses": 2 * TRAINING, "heldout_poses": 2 * HELD_OUT,
        "models": models, "advanced_worst_mean": mm(worst),
        "advanced_over_oracle": rig::median(runs.iter().map(ratio).collect()),
        "advanced_over_oracle_worst": runs.iter().map(ratio).fold(0.0, f64::max),
        "advanced_joint_2_rising": figures(&|run| &run.rising),
        "advanced_joint_2_falling": figures(&|run| &run.falling),
        "effects_chosen": runs.iter().map(|run| run.effects).collect::<Vec<_>>(),
        "steps": runs.iter().map(|run| run.steps).collect::<Vec<_>>(),
        "converged": runs.iter().filter(|run| run.converged).count(),
    })
}

/// Number of errors per bin, from zero.
fn histogram(errors: &PositionErrors) -> Value {
    let mut counts = vec![0_u32; (errors.max() * 1e3 / BIN_MM) as usize + 1];
    errors.sorted_m.iter().for_each(|error| counts[(error * 1e3 / BIN_MM) as usize] += 1);
    json!({ "bin_mm": BIN_MM, "counts": counts })
}
