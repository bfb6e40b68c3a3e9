//! Effect of gross errors on held-out errors: the same campaign clean, and with 5 % of the poses corrupted by swapped reflectors, mistyped digits, and
//! a displaced tracker. Held-out poses are clean.

use crate::rig::{self, between};
use crate::robot::{C_TRACK, SPATIAL_DEG};
use diagnosis::hold_out::{PositionErrors, calibrate};
use diagnosis::progress::ignore;
use diagnosis::{Campaign, Fit, Reading, campaign_simulation};
use glam::DVec3;
use physics::{Inputs, Model};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::{Value, json};
use std::error::Error;

const TRAINING: usize = 200;
const HELD_OUT: usize = 200;
/// Number of corrupted poses: with swapped reflectors, with a mistyped digit, and consecutive ones with a displaced tracker.
const SWAPPED: usize = 4;
const MISTYPED: usize = 3;
const PUSHED: usize = 3;

struct Run {
    clean: [f64; 2],
    /// Without the corrupted poses.
    fewer: [f64; 2],
    spoilt: [f64; 2],
    listed: usize,
    falsely: usize,
}

pub(crate) fn figures(campaigns: u64) -> Result<Value, Box<dyn Error>> {
    let (truth, nominal) = (rig::model("irb1600-6-145-thesis")?, rig::model("irb1600-6-145")?);
    let runs = rig::for_seeds(campaigns, |seed| run(&truth, &nominal, seed));
    let runs: Option<Vec<Run>> = runs.into_iter().collect();
    let runs = runs.ok_or("no campaign")?;
    let middle = |quantity: &dyn Fn(&Run) -> f64| rig::median(runs.iter().map(quantity).collect());
    let mm = |k: usize| json!({ "clean": middle(&|r| 1e3 * r.clean[k]), "fewer": middle(&|r| 1e3 * r.fewer[k]), "spoilt": middle(&|r| 1e3 * r.spoilt[k]) });
    let spoilt = SWAPPED + MISTYPED + PUSHED;
    Ok(json!({
        "campaigns": runs.len(), "training_poses": TRAINING, "spoilt_poses": spoilt,
        "calibrated_mean_mm": mm(0), "advanced_mean_mm": mm(1),
        "calibrated_ratio": middle(&|r| r.spoilt[0] / r.clean[0]),
        "advanced_ratio": middle(&|r| r.spoilt[1] / r.clean[1]),
        "advanced_ratio_over_fewer": middle(&|r| r.spoilt[1] / r.fewer[1]),
        "advanced_ratio_of_fewer": middle(&|r| r.fewer[1] / r.clean[1]),
        "advanced_ratio_worst": runs.iter().map(|r| r.spoilt[1] / r.clean[1]).fold(0.0, f64::max),
        "listed": runs.iter().map(|r| r.listed).sum::<usize>(),
        "of": spoilt * runs.len(),
        "falsely_listed": runs.iter().map(|r| r.falsely).sum::<usize>(),
        "of_clean": (TRAINING - spoilt) * runs.len(),
    }))
}

fn run(truth: &Model, nominal: &Model, seed: u64) -> Option<Run> {
    let mut chance = ChaCha8Rng::seed_from_u64(seed);
    let inputs: Vec<Inputs> =
        (0..TRAINING + HELD_OUT).map(|_| rig::inputs(&mut chance, &SPATIAL_DEG)).collect();
    let empty = rig::campaign(&nominal.arm, &inputs, C_TRACK)?;
    let clean =
        campaign_simulation::simulate_readings(&empty, truth, &empty.surroundings, 1.0, seed);
    let mut spoilt = clean.clone();
    let rows = spoil(&mut spoilt, &mut chance);
    let training: Vec<bool> = (0..inputs.len()).map(|pose| pose < TRAINING).collect();
    let held: Vec<bool> = training.iter().map(|trains| !trains).collect();
    let sound: Vec<bool> =
        training.iter().enumerate().map(|(row, trains)| *trains && !rows.contains(&row)).collect();
    let found = [(&clean, &training), (&clean, &sound), (&spoilt, &training)].map(
        |(campaign, training)| {
            let found = calibrate(campaign, nominal, &[], training, &ignore);
            (found.calibrated, found.advanced.fit)
        },
    );
    let mean = |fit: &Fit| PositionErrors::of(fit, &clean, &held).mean();
    let [clean_m, fewer_m, spoilt_m] =
        found.each_ref().map(|(plain, best)| [mean(plain), mean(best)]);
    let listed = found[2].1.outliers(&spoilt);
    let falsely = listed.iter().filter(|pose| training[**pose] && !rows.contains(pose)).count();
    let listed = rows.iter().filter(|row| listed.contains(row)).count();
    Some(Run { clean: clean_m, fewer: fewer_m, spoilt: spoilt_m, listed, falsely })
}

/// Corrupts training poses and returns their indices.
fn spoil(campaign: &mut Campaign, chance: &mut ChaCha8Rng) -> Vec<usize> {
    let first = (chance.random::<f64>() * (TRAINING - PUSHED) as f64) as usize;
    let mut rows: Vec<usize> = (first..first + PUSHED).collect();
    let push = DVec3::new(0.6, -0.4, 0.5) * 1e-3;
    rows.iter().for_each(|row| change(campaign, *row, &mut |_, position| position + push));
    while rows.len() < PUSHED + SWAPPED + MISTYPED {
        let row = (chance.random::<f64>() * TRAINING as f64) as usize;
        if rows.contains(&row) {
            continue;
        }
        if rows.len() < PUSHED + SWAPPED {
            let Some(places) = points(campaign, row) else { continue };
            change(campaign, row, &mut |target, position| match target {
                0 => places[1],
                1 => places[0],
                _ => position,
            });
        } else {
            let (one, axis) =
                ((chance.random::<f64>() * 3.0) as usize, (chance.random::<f64>() * 3.0) as usize);
            let digit = 10.0_f64.powi(between(chance, -3.0, 0.99).floor() as i32);
            change(campaign, row, &mut |target, mut position| {
                position[axis] += if target == one { digit } else { 0.0 };
                position
            });
        }
        rows.push(row);
    }
    rows
}

fn points(campaign: &Campaign, row: usize) -> Option<Vec<DVec3>> {
    let position = |observation: &diagnosis::Observation| match observation.reading {
        Reading::Point { at, .. } => Some(at),
        _ => None,
    };
    campaign.poses[row].seen.iter().map(position).collect()
}

fn change(campaign: &mut Campaign, row: usize, new: &mut dyn FnMut(usize, DVec3) -> DVec3) {
    for (target, observation) in campaign.poses[row].seen.iter_mut().enumerate() {
        if let Reading::Point { at, .. } = &mut observation.reading {
            *at = new(target, *at);
        }
    }
}
