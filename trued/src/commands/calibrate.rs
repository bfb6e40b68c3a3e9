//! `trued calibrate`: from measurements of the tool to a model with its uncertainty, validated on held-out poses.
//!
//! Promises: gross faults are looked for first and said with what to do; held-out figures come from fits that never saw those poses; what the
//! data cannot tell is named; a model is written that loads and that the held-out poses call no worse than the first. Never: a fit on poses that a recording
//! keeps for validation.

mod alone;
mod found;
mod model;
mod open;
mod page;
mod things;
mod told;

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use diagnosis::gross::{self, Suspicion};
use diagnosis::proof::Split;
use diagnosis::{Campaign, from_recording};
use indicatif::ProgressBar;
use recording::series::{Heldout, Recording};
use report::count;
use serde::Serialize;
use tracing::warn;

use self::alone::Alone;
use self::found::Found;
use crate::exit::{Answer, Failure, Outcome};
use crate::input::Reading;
use crate::options::{Seed, tolerance_mm};
use crate::output::{Console, Paint};
use crate::progress;

/// Poses that train, at least.
const TRAINING_LEAST: usize = 6;
/// Readings that place a station of the instrument, at least.
const STATION_LEAST: usize = 3;
/// Stages that the progress shows.
const STAGES: u64 = 6;
/// How often the progress draws while a stage lasts.
const TICK: Duration = Duration::from_millis(200);

/// Identify the robot: from tracker measurements to a calibrated model with its uncertainty
///
/// Recordings hold joint positions and what was measured there: points (x, y, z), reflectors, orientations, joint positions on the link side,
/// distances (ballbar, cable), touches of a probe. The measuring frame (one for each `station` that rows name), the reflectors' places, fixed points and what is
/// touched are fitted along where they are not said. Three models are compared on poses that took no part in any fit: the model as it is,
/// with the geometry of every joint, and with the effects that the data ask for; the last is written. Exit 1, and no model, where a gross fault (swapped columns,
/// a wrong unit or sign, a mirrored frame, a wrong tool) makes a fit senseless; where the new model is worse on the held-out poses than the one it began with;
/// and where the remaining error is so large that only a gross fault explains it.
#[derive(Debug, Args)]
pub(crate) struct Calibrate {
    #[command(flatten)]
    reading: Reading,
    /// Where the calibrated model goes
    #[arg(long, value_name = "MODEL2")]
    out: PathBuf,
    /// Write a page with errors, parameters, and what remains open
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Share of the poses, drawn by chance, on which the models are compared, where no recording keeps any (`heldout`)
    #[arg(long, value_name = "PERCENT", default_value_t = 30, value_parser = clap::value_parser!(u8).range(5..=80))]
    heldout: u8,
    /// Where one joint moves alone, take out the sag of the others before its axis is told
    #[arg(long, value_enum, value_name = "WHETHER", default_value_t = Sag::On)]
    sag: Sag,
    /// Write the model also where its own proof fails (see above), and exit 0
    #[arg(long)]
    accept_worse: bool,
    /// The tool error that is allowed, mm: exit 1 where 5 of 100 held-out errors or more exceed it; the model is written all the same
    #[arg(long, value_name = "MM", value_parser = tolerance_mm, allow_negative_numbers = true)]
    tolerance_mm: Option<f64>,
    #[command(flatten)]
    seed: Seed,
    /// Recordings of one robot, each with measuring frames of its own
    #[arg(value_name = "RECORDING", required = true)]
    recordings: Vec<PathBuf>,
}

/// Whether the sag of the joints that stand is taken out of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Sag {
    On,
    Off,
}

/// How the poses were split.
struct Parts {
    split: Split,
    /// The seed, where chance took part.
    seed: Option<u64>,
}

/// The held-out error of the new model against the error that is allowed.
#[derive(Clone, Copy, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Tolerance {
    /// What is allowed.
    tolerance_mm: f64,
    /// What 95 of 100 held-out errors stay within.
    p95_mm: f64,
    /// Whether that is no more.
    met: bool,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Refused<'a> {
    faults: Vec<&'a str>,
}

impl Calibrate {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let mut outputs = console.outputs().file(&self.out).pages(&self.report);
        outputs.check(self.recordings.iter().chain(self.reading.files()))?;
        let (model, recordings) = self.reading.measured(&self.recordings)?;
        let arm = &model.physics.arm;
        let campaign = from_recording::campaign(arm, &recordings).map_err(Failure::input)?;
        let parts = self.parts(&campaign, &recordings)?;
        let progress = progress::bar(console, STAGES, "gross faults");
        progress.enable_steady_tick(TICK);
        let faults = gross::suspicions(&campaign, &model.physics);
        if !faults.is_empty() {
            progress.finish_and_clear();
            return refuse(console, &faults);
        }
        let found = Found::of(model, &recordings, campaign, parts, &mut |stage| {
            step(&progress, stage);
        })?;
        let alone = Alone::of(&found.campaign, &recordings, &found.last, self.sag == Sag::On);
        progress.finish_and_clear();
        if self.is_written(&found) {
            outputs.put(&self.out, model::renewed(&found)?);
        }
        found.warnings.iter().for_each(|warning| warn!("{warning}"));
        if let Some(report) = &self.report {
            outputs.put_page(report, page::render(self, &found, &alone));
        }
        let report = told::Report::of(self, &found, &alone);
        console.write(outputs, "trued.calibrate/1", &report)?;
        console.say(told::told(self, &found, &alone))?;
        for reason in &found.refused {
            let head = console.paint(Paint::Bad, "not proven");
            console.say(format!("{head}: {reason}"))?;
        }
        if self.is_written(&found) {
            let meets = self.tolerance(&found).is_none_or(|tolerance| tolerance.met);
            return Ok(if meets { Answer::Done } else { Answer::No });
        }
        console.say("no model was written; use --accept-worse to write it anyway")?;
        Ok(Answer::No)
    }

    /// The new model against the tolerance, where one is stated.
    fn tolerance(&self, found: &Found) -> Option<Tolerance> {
        let tolerance_mm = self.tolerance_mm?;
        let [.., advanced] = &found.errors;
        let p95_mm = told::mm(advanced.quantile(0.95));
        Some(Tolerance { tolerance_mm, p95_mm, met: p95_mm <= tolerance_mm })
    }

    fn is_written(&self, found: &Found) -> bool {
        self.accept_worse || found.refused.is_empty()
    }

    /// Where the model went, for people.
    fn written(&self, found: &Found) -> String {
        if self.is_written(found) { self.out.display().to_string() } else { "none".to_owned() }
    }

    /// Which poses train and which are held out: as the recordings say, else by chance.
    fn parts(&self, campaign: &Campaign, recordings: &[Recording]) -> Result<Parts, Failure> {
        let is_said = |recording: &Recording| recording.about.heldout != Heldout::Unsaid;
        let parts = if recordings.iter().any(is_said) {
            let held = from_recording::held_out(campaign, recordings);
            let training: Vec<bool> = held.iter().map(|held| !held).collect();
            let trains = training.iter().filter(|trains| **trains).count();
            let says = format!(
                "{trains} of {} poses train, as the recordings' `heldout` says",
                held.len()
            );
            Parts { split: Split { training, says }, seed: None }
        } else {
            let seed = self.seed.settle();
            let split = Split::random(campaign, 1.0 - 0.01 * f64::from(self.heldout), seed);
            Parts { split, seed: Some(seed) }
        };
        let is_length = |pose: &diagnosis::Pose| pose.seen.iter().any(|s| s.reading.is_length());
        let poses = campaign.poses.iter().zip(&parts.split.training);
        let part = |wanted: bool| {
            poses.clone().filter(|(pose, trains)| **trains == wanted && is_length(pose)).count()
        };
        let (trains, held) = (part(true), part(false));
        if trains < TRAINING_LEAST || held == 0 {
            return Err(Failure::input(format!(
                "the tool was measured at {} that train and at {held} held out, expected at least {TRAINING_LEAST} and 1: measure more poses \
                 (some dozens tell a robot's geometry), or change --heldout",
                count(trains, "pose")
            )));
        }
        check_stations(campaign, &parts.split)?;
        Ok(parts)
    }
}

/// A station that no pose which trains places cannot be judged.
fn check_stations(campaign: &Campaign, split: &Split) -> Result<(), Failure> {
    for frame in 0..campaign.surroundings.frames.len() {
        let poses = campaign.poses.iter().zip(&split.training);
        let here = poses.filter(|(pose, _)| pose.frame() == Some(frame));
        let (trains, held): (Vec<_>, Vec<_>) = here.partition(|(_, trains)| **trains);
        let seen: usize = trains.iter().map(|(pose, _)| pose.seen.len()).sum();
        let is_free = campaign.surroundings.frames[frame].free;
        if is_free && seen < STATION_LEAST && !held.is_empty() {
            return Err(Failure::input(format!(
                "station {} of the instrument has {} in the poses that train and {} held out, expected at least {STATION_LEAST} to know where it \
                 stood: measure more there, give its rows the `station` of another, or change --heldout",
                frame + 1,
                count(seen, "reading"),
                held.len()
            )));
        }
    }
    Ok(())
}

fn step(progress: &ProgressBar, stage: &'static str) {
    progress.inc(1);
    progress.set_message(stage);
}

/// Gross faults make any fit senseless: they are said, and nothing is made.
fn refuse(console: &mut Console, faults: &[Suspicion]) -> Outcome {
    let faults: Vec<&str> = faults.iter().map(|fault| fault.says.as_str()).collect();
    console.json("trued.calibrate/1", &Refused { faults: faults.clone() })?;
    let head = console.paint(Paint::Bad, "not calibrated");
    let more = if faults.len() > 1 { "; one of these explains it" } else { "" };
    console.say(format!(
        "{head}: the recording and the model do not belong together as they are{more}"
    ))?;
    for fault in faults {
        console.say(format!("  {fault}"))?;
    }
    console.say("no model was written")?;
    Ok(Answer::No)
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    vec![
        ResultSchema::of::<told::Report>("calibrate", "trued.calibrate/1"),
        ResultSchema::of::<Refused<'_>>("calibrate-refused", "trued.calibrate/1"),
    ]
}
