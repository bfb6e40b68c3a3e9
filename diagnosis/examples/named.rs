//! What a recording says of a model: prints the findings.
//!
//! `cargo run --release -p diagnosis --example named -- MODEL RECORDING [MAPPING]`
#![expect(clippy::print_stdout, reason = "an example that prints")]

use diagnosis::diagnose::diagnose;
use diagnosis::from_recording;
use recording::model::RobotModel;
use recording::series::{self, Need};
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
    let recording = series::read(Path::new(file), mapping, Need::Measurement)?;
    let campaign = from_recording::campaign(&model.physics.arm, &[recording])?;
    let found = diagnose(campaign, &model.physics, &model.sigma, None, 1);
    println!("{}: {:?}", found.verdict.name(), found.proof);
    for one in &found.findings {
        println!(
            "{:?} {} gain {:.0} confidence {:.2} held out {:.4} -> {:.4} mm; {:?} ± {:?}; rivals {:?}",
            one.effect.joint().map(|j| j + 1),
            one.effect.spec().kind,
            one.gain,
            one.confidence,
            1e3 * one.heldout[0],
            1e3 * one.heldout[1],
            one.effect.values(),
            one.sigma,
            one.rivals
                .iter()
                .map(|(r, p)| (r.effect.spec().kind, r.effect.joint().map(|j| j + 1), r.behind, *p))
                .collect::<Vec<_>>(),
        );
    }
    println!("{:?}", found.unexplained);
    Ok(())
}
