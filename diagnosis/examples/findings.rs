//! Diagnosis of a recording: prints the verdict, the findings with their alternatives, and unexplained structure.
//!
//! `cargo run --release -p diagnosis --example findings -- MODEL RECORDING [MAPPING]`
#![expect(clippy::print_stdout, reason = "an example that prints")]

use diagnosis::campaign_import;
use diagnosis::diagnose::diagnose;
use diagnosis::progress::ignore;
use recording::model::RobotModel;
use recording::series::{self, RequiredData};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, model, file, rest @ ..] = args.as_slice() else {
        return Err("MODEL RECORDING [MAPPING]".into());
    };
    let model = match recording::model::presets::preset(model) {
        Some(preset) => preset.model()?,
        None => RobotModel::read(Path::new(model))?,
    };
    let mapping = rest.first().map(Path::new);
    let recording = series::read(Path::new(file), mapping, RequiredData::Measurement)?;
    let campaign = campaign_import::campaign(&model.physics.arm, &[recording])?;
    let found = diagnose(campaign, &model.physics, &model.sigma, None, 1, &ignore);
    println!("{}: {:?}", found.verdict.name(), found.test_errors);
    for one in &found.findings {
        println!(
            "{:?} {} gain {:.0} confidence {:.2} held out {:.4} -> {:.4} mm; {:?} ± {:?}; rivals {:?}",
            one.effect.joint().map(|j| j + 1),
            one.effect.spec().kind,
            one.gain,
            one.confidence,
            1e3 * one.held_out_rms[0],
            1e3 * one.held_out_rms[1],
            one.effect.values(),
            one.sigma,
            one.alternatives
                .iter()
                .map(|(r, p)| (
                    r.effect.spec().kind,
                    r.effect.joint().map(|j| j + 1),
                    r.likelihood_loss,
                    *p
                ))
                .collect::<Vec<_>>(),
        );
    }
    println!("{:?}", found.unexplained);
    Ok(())
}
