//! The laser-tracker sets whose robot is not the thesis': held-out errors of the model as it is, with the geometry of every joint, and with the effects that
//! the poses which train ask for. Prints the rows of the table in docs/figures.md, mm.
//!
//! `cargo run --release -p diagnosis --example sets -- DATA [SEEDS]`
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "an example that prints")]

use diagnosis::proof::{Calibration, Errors, Split, calibrate};
use diagnosis::{Campaign, Effort, Fit, Hypothesis, Influence, Settings, fit};
use diagnosis::{Chosen, from_recording};
use recording::mapping::Mapping;
use recording::model::RobotModel;
use recording::model::presets::preset;
use recording::series::{Need, Recording, read_text};
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

/// A recording and its robot, where the data is there.
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
        Need::Measurement,
    )?;
    let campaign = from_recording::campaign(&model.physics.arm, std::slice::from_ref(&recording))?;
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

/// Mean, 95 % and largest, mm.
fn figures(errors: &Errors) -> [f64; 3] {
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

/// Random halves, by kind of row; medians over the seeds.
fn motoman(data: &Path, arm: &str, kinds: &[&str], seeds: u64) -> Answer<()> {
    let model = preset(&format!("motoman-{arm}")).ok_or("preset")?.model()?;
    let mapping = mapping(&format!("motoman-leica-{arm}"))?;
    let Some((campaign, _)) = read(data, "motoman-leica/leica_poses_all.csv", &mapping, &model)?
    else {
        return Ok(());
    };
    let stations = stations(&campaign);
    let mut seen: Vec<Vec<[[f64; 3]; 3]>> = vec![Vec::new(); kinds.len() + 1];
    for seed in 1..=seeds {
        let split = Split::random(&campaign, 0.5, seed);
        let found =
            calibrate(&campaign, &model.physics, &model.sigma, &split.training, &mut |_| ());
        let held = split.held_out();
        for (kind, seen) in seen.iter_mut().enumerate() {
            let wanted: Vec<bool> = held
                .iter()
                .zip(&stations)
                .map(|(held, at)| *held && (kind == kinds.len() || *at == kind))
                .collect();
            seen.push(fits(&found).map(|fit| figures(&Errors::of(fit, &campaign, &wanted))));
        }
    }
    for (kind, seen) in seen.iter().enumerate() {
        let name = kinds.get(kind).copied().unwrap_or("all");
        let poses = stations.iter().filter(|at| kind == kinds.len() || **at == kind).count();
        let middle = |m: usize, k: usize| median(seen.iter().map(|run| run[m][k]).collect());
        row(
            &format!("motoman {arm}, {name}"),
            poses,
            [0, 1, 2].map(|m| [0, 1, 2].map(|k| middle(m, k))),
        );
    }
    Ok(())
}

/// Thirty-six poses are few: each is held out once.
fn sweeps(data: &Path) -> Answer<()> {
    let model = preset("fanuc-r2000ib").ok_or("preset")?.model()?;
    let Some((campaign, _)) = read(data, "kuka-3smr/poses_36.csv", &mapping("kuka-3smr")?, &model)?
    else {
        return Ok(());
    };
    let mut errors = [const { Vec::new() }; 3];
    for (pose, split) in Split::one_by_one(&campaign).iter().enumerate() {
        let found =
            calibrate(&campaign, &model.physics, &model.sigma, &split.training, &mut |_| ());
        let mut only = vec![false; campaign.poses.len()];
        only[pose] = true;
        for (list, fit) in errors.iter_mut().zip(fits(&found)) {
            list.extend(Errors::of(fit, &campaign, &only).sorted_m);
        }
    }
    let models = errors.map(|mut sorted_m| {
        sorted_m.sort_by(f64::total_cmp);
        figures(&Errors { sorted_m })
    });
    row("kuka-3smr (FANUC), pose by pose", campaign.poses.len(), models);
    Ok(())
}

/// Scenes: rows that station the robot place it, the others score; the model comes from `flat` alone, and from all scenes but the one that is scored.
fn hilti(data: &Path) -> Answer<()> {
    let urdf = data.join("hilti/trailblazer.urdf");
    if !urdf.is_file() {
        eprintln!("SKIPPED: {} is not there", urdf.display());
        return Ok(());
    }
    let ends = recording::urdf::Ends { base: Some("base_link"), tip: Some("prism") };
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
    let flat = calibrate(&campaign, &model.physics, &model.sigma, &from_flat, &mut |_| ());
    told(&flat.advanced.chosen, &flat);
    for (scene, name) in names.iter().enumerate() {
        let scored: Vec<bool> = scenes
            .iter()
            .zip(&stationing)
            .map(|(at, stationing)| *at == scene && !stationing)
            .collect();
        let has_base: Vec<bool> = scored
            .iter()
            .zip(&bases)
            .map(|(scored, base)| {
                *scored && (0..bases.len()).any(|k| stationing[k] && bases[k] == *base)
            })
            .collect();
        let rigid_mean = figures(&Errors::of(&baseline, &rigid, &has_base));
        let scores = |found: &Calibration| {
            fits(found).map(|fit| {
                figures(&Errors::of(
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
        let others: Vec<bool> = scenes.iter().map(|at| *at != scene).collect();
        let found = calibrate(&campaign, &model.physics, &model.sigma, &others, &mut |_| ());
        row(&format!("hilti {name}, from the other scenes"), poses, scores(&found));
    }
    Ok(())
}

/// The mapping with a base of its own for each height and arm, without the accelerometer.
fn by_height(mapping: &str) -> String {
    let flat = mapping.replace("heldout = [", "# heldout = [");
    let station = "station = { from = [\"dataset\", \"column_height_m\", \"solution_space\"], labels = true }";
    let split = flat.replace(HILTI_STATION, station);
    let kept = split.lines().filter(|line| !line.starts_with("tilt_"));
    kept.flat_map(|line| [line, "\n"]).collect()
}

/// The surroundings alone, placed by the poses `used` with the effects of a model as they are.
fn placed(campaign: &Campaign, hypothesis: &Hypothesis, used: &[bool]) -> Fit {
    let settings = Settings { used, influence: Influence::Huber, from: None, effort: Effort::Full };
    fit(campaign, &Hypothesis::fixed(*hypothesis.model), &settings)
}

fn told(chosen: &[Chosen], found: &Calibration) {
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
