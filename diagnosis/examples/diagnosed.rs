//! A recording diagnosed from the first half in time to the second and on seeded random halves (on what it keeps for validation, where it says so): mean, 95 % and largest distance of the held-out points, mm,
//! of the model as given and with what was found, and the names.
//!
//! `cargo run --release -p diagnosis --example diagnosed -- MODEL RECORDING MAPPING [SEEDS]`
#![expect(clippy::print_stdout, reason = "an example that prints")]

use diagnosis::diagnose::diagnose;
use diagnosis::from_recording;
use diagnosis::proof::{Errors, Split};
use recording::model::RobotModel;
use recording::series::{self, Heldout, Need};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, model, file, mapping, rest @ ..] = args.as_slice() else {
        return Err("MODEL RECORDING MAPPING [SEEDS]".into());
    };
    let seeds: u64 = rest.first().map_or(Ok(5), |seeds| seeds.parse())?;
    let model = RobotModel::read(Path::new(model))?;
    let recording = series::read(Path::new(file), Some(Path::new(mapping)), Need::Measurement)?;
    let recordings = [recording];
    let campaign = from_recording::campaign(&model.physics.arm, &recordings)?;
    let mut splits = vec![Split::in_time(&campaign, 0.5)];
    splits.extend((1..=seeds).map(|seed| Split::random(&campaign, 0.5, seed)));
    if recordings.iter().any(|recording| recording.about.heldout != Heldout::Unsaid) {
        let held = from_recording::held_out(&campaign, &recordings);
        let training = held.iter().map(|held| !held).collect();
        splits = vec![Split { training, says: "what the recording keeps".to_owned() }];
    }
    for split in splits {
        let held = split.held_out();
        let found = diagnose(campaign.clone(), &model.physics, &model.sigma, Some(held.clone()), 1);
        let of = |fit: &diagnosis::Fit| {
            let errors = Errors::of(fit, &found.campaign, &held);
            [errors.mean(), errors.quantile(0.95), errors.max()].map(|m| (m * 1e7).round() / 1e4)
        };
        let verdict = found.verdict.name();
        println!("{}: {verdict} {:?} -> {:?}", split.says, of(&found.given), of(&found.fit));
        for finding in &found.findings {
            let effect = &finding.effect;
            let joint = effect.joint().map_or(0, |joint| joint + 1);
            println!(
                "    {} {joint} {:.2} {:.3?}",
                effect.spec().kind,
                finding.confidence,
                effect.values()
            );
        }
    }
    Ok(())
}
