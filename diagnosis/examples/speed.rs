//! Computing time of one fit: a thousand poses with three targets each, about sixty parameters, one thread; prints JSON.
//!
//! `cargo run --release -p diagnosis --example speed`
#![expect(clippy::print_stdout, reason = "an example that prints")]

use diagnosis::{
    Arrival, Campaign, Extrinsics, FitParameter, FitSettings, Influence, Instrument,
    MeasuringFrame, Observation, Pose, Reading, ReadingNoise, RecordingInfo, ToolPoint,
    campaign_simulation, fit, geometry,
};
use glam::DVec3;
use physics::{AnyEffect, Frame, Inputs, JOINTS_MAX, ParameterValues};
use recording::model::presets::preset;
use serde_json::json;
use std::error::Error;
use std::time::Instant;

const POSES: u32 = 1000;

fn main() -> Result<(), Box<dyn Error>> {
    let truth = preset("irb1600-6-145-thesis").ok_or("no preset")?.model()?.physics;
    let nominal = preset("irb1600-6-145").ok_or("no preset")?.model()?.physics;
    let campaign = empty()?;
    let campaign =
        campaign_simulation::simulate_readings(&campaign, &truth, &campaign.surroundings, 1.0, 1);
    let mut hypothesis = geometry(&nominal, &[]);
    for joint in 1..6 {
        let sag = vec![0.0; 3 * (6 - joint)];
        let given: &[(&str, &[f64])] = &[("sag", &sag)];
        let effect =
            AnyEffect::build("gravity_sag", &nominal.arm, Some(joint), ParameterValues(given))?;
        hypothesis.add(effect, &[])?;
    }
    let used = vec![true; campaign.poses.len()];
    let settings = FitSettings::full(&used, Influence::Redescending);
    let start = Instant::now();
    let found = fit(&campaign, &hypothesis, &settings);
    let report = json!({
        "poses": POSES, "numbers_read": found.readings, "numbers_fitted": found.columns().len(),
        "steps": found.steps, "converged": found.converged, "seconds": start.elapsed().as_secs_f64(),
    });
    println!("{report:#}");
    Ok(())
}

fn empty() -> Result<Campaign, Box<dyn Error>> {
    let places = [[0.1, 0.0, 0.05], [-0.05, 0.09, 0.06], [-0.05, -0.08, 0.1]];
    let frame = Frame::translation(DVec3::new(2.0, -1.0, 0.4));
    let station = MeasuringFrame { measuring_from_base: frame, pivot: DVec3::ZERO };
    let surroundings = Extrinsics {
        frames: vec![FitParameter::unknown(station)],
        targets: places.map(|place| FitParameter::unknown(DVec3::from_array(place))).to_vec(),
        ..Extrinsics::default()
    };
    let whitening = ReadingNoise::Equal(5e-5).whitening(DVec3::ZERO).ok_or("noise")?;
    let observation = |target| {
        let reading =
            Reading::Point { place: ToolPoint::Target(target), frame: 0, at: DVec3::ZERO };
        Observation { reading, whitening, instrument: 0 }
    };
    let poses = (0..POSES).map(|row| {
        let mut q = [0.0; JOINTS_MAX];
        for (joint, slot) in q.iter_mut().enumerate().take(6) {
            let step = [0.7548, 0.5698, 0.6180, 0.8191, 0.6711, 0.5497][joint];
            let part = (f64::from(row + 1) * step).fract();
            *slot = (part - 0.5) * [3.0, 1.6, 1.6, 4.0, 3.0, 5.0][joint];
        }
        let inputs = Inputs::at_rest(q);
        let observations = (0..3).map(observation).collect();
        Pose {
            inputs,
            arrival: Arrival::Settled,
            recording: 0,
            row: row as usize,
            seen: observations,
        }
    });
    Ok(Campaign {
        poses: poses.collect(),
        surroundings,
        instruments: vec![Instrument {
            name: "tracker".to_owned(),
            noise_is_known: true,
            ..Instrument::default()
        }],
        recordings: vec![RecordingInfo::of_poses("made")],
    })
}
