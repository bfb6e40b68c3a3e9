//! Laser-tracker data sets of other robots than that of the thesis: held-out errors of the nominal model, with calibrated geometry, and with the effects
//! selected on the training poses. Prints the rows of the table in docs/figures.md, mm.
//!
//! `cargo run --release -p diagnosis --example sets -- DATA [SEEDS]`
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "an example that prints")]

use diagnosis::hold_out::{Calibration, HoldOutSplit, PositionErrors, calibrate};
use diagnosis::progress::ignore;
use diagnosis::{AddedEffect, campaign_import};
use diagnosis::{Campaign, Fit, FitSettings, Hypothesis, Influence, fit};
use recording::mapping::Mapping;
use recording::model::RobotModel;
use recording::model::presets::preset;
use recording::series::{Recording, RequiredData, read_text};
use std::error::Error;
use std::path::{Path, PathBuf};

type Answer<T> = Result<T, Box<dyn Error>>;

const HILTI_STATION: &str = "station = { from = \"dataset\", labels = true }";

fn main() -> Answer<()> {
    let mut args = std::env::args().skip(1);
    let data = PathBuf::from(args.next().ok_or("DATA [SEEDS]")?);
    let seeds: u64 = args.next().map_or(Ok(20), |seeds| seeds.parse())?;
    println!(
        "| set, held out | poses | as it is | geometry | with effects |\n| --- | --- | --- | --- | --- |"
    );
    motoman(
        &data,
        "right",
        &["touching tables", "free grid", "arms touching", "touching a wall"],
        seeds,
    )?;
    motoman(&data, "left", &["free grid"], seeds)?;
    sweeps(&data)?;
    hilti(&data)
}

/// A recording as campaign and series; `None` if the file does not exist.
fn read(
    data: &Path,
    file: &str,
    mapping: &str,
    model: &RobotModel,
) -> Answer<Option<(Campaign, Recording)>> {
    let path = data.join(file);
    if !path.is_file() {
        eprintln!("SKIPPED: {} is not there", path.display());
        return Ok(None);
    }
    let recording = read_text(
        file,
        &std::fs::read_to_string(&path)?,
        Some(&Mapping::parse("mapping", mapping)?),
        None,
        RequiredData::Measurement,
    )?;
    let campaign = campaign_import::campaign(&model.physics.arm, std::slice::from_ref(&recording))?;
    Ok(Some((campaign, recording)))
}

fn mapping(name: &str) -> Answer<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/mappings");
    Ok(std::fs::read_to_string(folder.join(format!("{name}.mapping.toml")))?)
}

/// The measuring frame of each pose.
fn stations(campaign: &Campaign) -> Vec<usize> {
    campaign.poses.iter().map(|pose| pose.frame().unwrap_or(0)).collect()
}

/// Mean, 95 % quantile and maximum, mm.
fn figures(errors: &PositionErrors) -> [f64; 3] {
    [errors.mean(), errors.quantile(0.95), errors.max()].map(|metres| metres * 1e3)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { f64::NAN } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

fn fits(found: &Calibration) -> [&Fit; 3] {
    [&found.nominal, &found.calibrated, &found.advanced.fit]
}

fn row(what: &str, poses: usize, models: [[f64; 3]; 3]) {
    let cells = models.map(|[mean, p95, max]| format!("{mean:.3} / {p95:.3} / {max:.3}"));
    println!("| {what} | {poses} | {} |", cells.join(" | "));
}

/// Errors on random halves by station; medians over the seeds.
fn motoman(data: &Path, arm: &str, kinds: &[&str], seeds: u64) -> Answer<()> {
    let model = preset(&format!("motoman-{arm}")).ok_or("preset")?.model()?;
    let mapping = mapping(&format!("motoman-leica-{arm}"))?;
    let Some((campaign, _)) = read(data, "motoman-leica/leica_poses_all.csv", &mapping, &model)?
    else {
        return Ok(());
    };
    let stations = stations(&campaign);
    let mut errors_by_kind: Vec<Vec<[[f64; 3]; 3]>> = vec![Vec::new(); kinds.len() + 1];
    for seed in 1..=seeds {
        let split = HoldOutSplit::random(&campaign, 0.5, seed);
        let found = calibrate(&campaign, &model.physics, &model.sigma, &split.training, &ignore);
        let held = split.held_out();
        for (kind, errors) in errors_by_kind.iter_mut().enumerate() {
            let wanted: Vec<bool> = held
                .iter()
                .zip(&stations)
                .map(|(held, station)| *held && (kind == kinds.len() || *station == kind))
                .collect();
            errors.push(
                fits(&found).map(|fit| figures(&PositionErrors::of(fit, &campaign, &wanted))),
            );
        }
    }
    for (kind, errors) in errors_by_kind.iter().enumerate() {
        let name = kinds.get(kind).copied().unwrap_or("all");
        let poses =
            stations.iter().filter(|station| kind == kinds.len() || **station == kind).count();
        let middle = |m: usize, k: usize| median(errors.iter().map(|run| run[m][k]).collect());
        row(
            &format!("motoman {arm}, {name}"),
            poses,
            [0, 1, 2].map(|m| [0, 1, 2].map(|k| middle(m, k))),
        );
    }
    Ok(())
}

/// Leave-one-out errors of the set of 36 poses.
fn sweeps(data: &Path) -> Answer<()> {
    let model = preset("fanuc-r2000ib").ok_or("preset")?.model()?;
    let Some((campaign, _)) = read(data, "kuka-3smr/poses_36.csv", &mapping("kuka-3smr")?, &model)?
    else {
        return Ok(());
    };
    let mut errors = [const { Vec::new() }; 3];
    for (pose, split) in HoldOutSplit::leave_one_out(&campaign).iter().enumerate() {
        let found = calibrate(&campaign, &model.physics, &model.sigma, &split.training, &ignore);
        let mut only = vec![false; campaign.poses.len()];
        only[pose] = true;
        for (list, fit) in errors.iter_mut().zip(fits(&found)) {
            list.extend(PositionErrors::of(fit, &campaign, &only).sorted_m);
        }
    }
    let models = errors.map(|mut sorted_m| {
        sorted_m.sort_by(f64::total_cmp);
        figures(&PositionErrors { sorted_m })
    });
    row("kuka-3smr (FANUC), pose by pose", campaign.poses.len(), models);
    Ok(())
}

/// Errors by scene: the frame is fitted to the stationing rows and the errors are those of the other rows; the model is calibrated on scene `flat`, and
/// on all scenes except the evaluated one.
fn hilti(data: &Path) -> Answer<()> {
    let urdf = data.join("hilti/trailblazer.urdf");
    if !urdf.is_file() {
        eprintln!("SKIPPED: {} is not there", urdf.display());
        return Ok(());
    }
    let ends = recording::urdf::ChainEnds { base: Some("base_link"), tip: Some("prism") };
    let model = recording::urdf::read(&urdf, &ends)?.model;
    let text = mapping("hilti")?;
    if !text.contains(HILTI_STATION) {
        return Err("the mapping's station has changed".into());
    }
    let file = "hilti/all_measurements.csv";
    let Some((campaign, recording)) = read(data, file, &text, &model)? else { return Ok(()) };
    let by_height = by_height(&text);
    let Some((rigid, _)) = read(data, file, &by_height, &model)? else { return Ok(()) };
    let scenes = stations(&campaign);
    let stationing: Vec<bool> = recording.segment.iter().map(|segment| segment % 2 == 0).collect();
    let baseline = placed(&rigid, &Hypothesis::fixed(model.physics), &stationing);
    let bases = stations(&rigid);
    let names = [
        "diagonal wood",
        "flat",
        "orthogonal wood",
        "outdoor, 9 °C",
        "pallet",
        "seesaw",
        "wood left",
    ];
    let from_flat: Vec<bool> = scenes.iter().map(|scene| *scene == 1).collect();
    let flat = calibrate(&campaign, &model.physics, &model.sigma, &from_flat, &ignore);
    print_effects(&flat.advanced.chosen, &flat);
    for (scene, name) in names.iter().enumerate() {
        let scored: Vec<bool> = scenes
            .iter()
            .zip(&stationing)
            .map(|(pose_scene, stationing)| *pose_scene == scene && !stationing)
            .collect();
        let has_base: Vec<bool> = scored
            .iter()
            .zip(&bases)
            .map(|(scored, base)| {
                *scored && (0..bases.len()).any(|k| stationing[k] && bases[k] == *base)
            })
            .collect();
        let rigid_mean = figures(&PositionErrors::of(&baseline, &rigid, &has_base));
        let scores = |found: &Calibration| {
            fits(found).map(|fit| {
                figures(&PositionErrors::of(
                    &placed(&campaign, &fit.hypothesis, &stationing),
                    &campaign,
                    &scored,
                ))
            })
        };
        let poses = scored.iter().filter(|scored| **scored).count();
        println!(
            "hilti {name}: rigid, a base per height and arm: {:.2} / {:.2} / {:.2}",
            rigid_mean[0], rigid_mean[1], rigid_mean[2]
        );
        if scene != 1 {
            row(&format!("hilti {name}, from flat"), poses, scores(&flat));
        }
        let others: Vec<bool> = scenes.iter().map(|pose_scene| *pose_scene != scene).collect();
        let found = calibrate(&campaign, &model.physics, &model.sigma, &others, &ignore);
        row(&format!("hilti {name}, from the other scenes"), poses, scores(&found));
    }
    Ok(())
}

/// The mapping with a separate base frame for each column height and arm configuration, without the accelerometer.
fn by_height(mapping: &str) -> String {
    let flat = mapping.replace("heldout = [", "# heldout = [");
    let station = "station = { from = [\"dataset\", \"column_height_m\", \"solution_space\"], labels = true }";
    let split = flat.replace(HILTI_STATION, station);
    let kept = split.lines().filter(|line| !line.starts_with("tilt_"));
    kept.flat_map(|line| [line, "\n"]).collect()
}

/// Fit of the extrinsic parameters alone to the poses `used`.
fn placed(campaign: &Campaign, hypothesis: &Hypothesis, used: &[bool]) -> Fit {
    let settings = FitSettings::full(used, Influence::Huber);
    fit(campaign, &Hypothesis::fixed(*hypothesis.model), &settings)
}

fn print_effects(chosen: &[AddedEffect], found: &Calibration) {
    for chosen in chosen {
        if let Some(effect) = found.advanced.fit.hypothesis.model.effects().nth(chosen.effect) {
            eprintln!(
                "hilti flat: {} of joint {:?}",
                effect.spec().kind,
                effect.joint().map(|joint| joint + 1)
            );
        }
    }
}
