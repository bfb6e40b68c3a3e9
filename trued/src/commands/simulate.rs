//! `trued simulate`: the model run forward over a recording's commands, loads and temperatures: where the tool goes.
//!
//! Promises: the same input and seed give the same bytes; without `--noise` the result is the model's own, to the last digit; the
//! layout stays the recording's; nothing is written over an input. Never: a fit of the model; only the measuring frame and targets whose
//! place is not known are found, from what was recorded.

mod instrument;
mod station;

use std::path::{Path, PathBuf};

use clap::Args;
use diagnosis::{Arrival, Pose, from_recording};
use physics::{Given, Inputs};
use recording::model::RobotModel;
use recording::series::{self, Channel, Kind, Recording};
use serde::Serialize;
use tracing::warn;
use world::dynamics::Dynamics;
use world::forward::{self, Seen};

use self::instrument::Instrument;
use self::station::Stand;
use super::correct::check_apart;
use crate::exit::{Answer, Failure, Outcome};
use crate::input::{Input, Reading, count};
use crate::options::Seed;
use crate::output::Console;

/// Run the model forward: where the tool goes on a recording's commands, as a recording
///
/// Takes commanded joints, loads, temperatures and process state of INPUT and replaces what was measured: points, reflectors, orientations,
/// joint positions of the motor and the link side, in the rows in which they were measured. All effects of positions act, delays, lags and modes
/// too. An unknown measuring frame is found from what was recorded; with nothing recorded the tool centre point is given in the base frame.
#[derive(Debug, Args)]
pub(crate) struct Simulate {
    #[command(flatten)]
    reading: Reading,
    /// Where the recording goes: NAME.csv and NAME.toml
    #[arg(long, value_name = "NAME")]
    out: PathBuf,
    /// Normal noise on every measured value, mm (mrad on angles); none if not given
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0, value_parser = not_negative)]
    noise: f64,
    #[command(flatten)]
    seed: Seed,
    /// The recording whose commands are followed
    #[arg(value_name = "INPUT")]
    input: PathBuf,
}

#[derive(Serialize)]
struct Report<'a> {
    seed: u64,
    /// mm, mrad on angles.
    noise: f64,
    model: &'a str,
    recording: String,
    rows: usize,
    columns: Vec<String>,
    left_out: Vec<String>,
    /// What was recorded against the model without noise, over single values; none where nothing was.
    recorded_rms_mm: Option<f64>,
    rows_beyond_stiffness: usize,
}

impl Simulate {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let (csv, toml) = files(&self.out);
        for input in std::iter::once(&self.input).chain(&self.reading.model) {
            check_apart(input, &csv)?;
            check_apart(input, &toml)?;
        }
        let Input { model, mut recording, .. } = self.reading.read(&self.input, None)?;
        hold_inputs(&mut recording);
        let seed = self.seed.settle();
        let seen = run(&model, &recording)?;
        let stand = Stand::find(&model, &recording)?;
        let instrument = Instrument { stand: &stand, noise: self.noise * 1e-3, seed };
        let made = instrument.look(&model, recording, &seen);
        let mut recording = made.recording;
        recording.about.model = Some(self.model_name(&recording, &toml));
        self.write(&recording, seed, (&csv, &toml))?;
        let report = Report {
            seed,
            noise: self.noise,
            model: &model.file.name,
            recording: csv.display().to_string(),
            rows: recording.len(),
            columns: made.columns,
            left_out: made.left_out,
            recorded_rms_mm: made.recorded_rms_m.map(|rms| rms * 1e3),
            rows_beyond_stiffness: seen.iter().filter(|seen| seen.beyond).count(),
        };
        console.json("trued.simulate/1", &report)?;
        say(console, &report)
    }

    /// As the recording's TOML shall name it: a preset by its name, a file by its way from there.
    fn model_name(&self, recording: &Recording, toml: &Path) -> String {
        let Some(given) = &self.reading.model else {
            let named = recording.about.model.clone().unwrap_or_default();
            let from = crate::input::beside(&recording.file, Path::new(&named));
            return from_folder(&from, toml);
        };
        from_folder(given, toml)
    }

    fn write(
        &self,
        recording: &Recording,
        seed: u64,
        (csv, toml): (&Path, &Path),
    ) -> Result<(), Failure> {
        let about = format!(
            "# simulated: trued simulate --seed {seed} --noise {}\n{}",
            self.noise,
            recording.about_toml()
        );
        crate::atomic::write(toml, |file| file.write_all(about.as_bytes()))?;
        crate::atomic::write(csv, |file| file.write_all(&recording.to_csv()))?;
        Ok(())
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    let sound = |x: &f64| x.is_finite() && *x >= 0.0;
    text.parse().ok().filter(sound).ok_or_else(|| "expected a number, 0 or above".to_owned())
}

/// `NAME.csv` and `NAME.toml`; a name that ends so already keeps its ending.
fn files(out: &Path) -> (PathBuf, PathBuf) {
    let has =
        |ending: &str| out.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending));
    let stem = if has("csv") || has("toml") { out.with_extension("") } else { out.to_owned() };
    let with = |ending: &str| {
        let mut name = stem.clone().into_os_string();
        name.push(ending);
        PathBuf::from(name)
    };
    let csv = with(".csv");
    let toml = series::about_path(&csv);
    (csv, toml)
}

fn from_folder(model: &Path, toml: &Path) -> String {
    let is_preset = recording::model::presets::at(model).is_some() && !model.exists();
    let folder = toml.parent().unwrap_or(Path::new(""));
    let same = model.parent() == Some(folder);
    let name = match model.canonicalize() {
        Ok(whole) if !is_preset && !same => whole,
        _ if same && !is_preset => PathBuf::from(model.file_name().unwrap_or_default()),
        _ => model.to_owned(),
    };
    name.display().to_string()
}

/// What was not sampled in a row is what it was last: loads, temperatures, process state.
fn hold_inputs(recording: &mut Recording) {
    let is_input = |channel: &Channel| {
        matches!(
            channel,
            Channel::Wrench(_) | Channel::Ambient | Channel::JointTemperature(_) | Channel::Spindle
        )
    };
    let channels: Vec<Channel> = recording.channels().filter(is_input).collect();
    for channel in channels {
        let mut last = f64::NAN;
        let hold = |sample: &f64| {
            last = if sample.is_nan() { last } else { *sample };
            last
        };
        let held = recording.column(channel).unwrap_or_default().iter().map(hold).collect();
        recording.set(channel, held);
    }
}

/// Where the arm goes on a recording, row by row.
pub(super) fn seen_of(model: &RobotModel, mut recording: Recording) -> Result<Vec<Seen>, Failure> {
    hold_inputs(&mut recording);
    run(model, &recording)
}

/// Where the arm goes, row by row, on a recording whose inputs are held.
fn run(model: &RobotModel, recording: &Recording) -> Result<Vec<Seen>, Failure> {
    let rows = from_recording::motion(&model.physics.arm, recording).map_err(Failure::input)?;
    if recording.about.kind == Kind::Poses {
        let rows: Vec<(Inputs, bool)> =
            rows.iter().map(|row| (row.inputs, row.arrival == Arrival::FromBefore)).collect();
        return Ok(forward::poses(&model.physics, &rows));
    }
    let dynamics = dynamics(model)?;
    let goes_on = |a: &Pose, b: &Pose| recording.segment.get(a.row) == recording.segment.get(b.row);
    let mut seen = Vec::with_capacity(rows.len());
    for segment in rows.chunk_by(goes_on) {
        let inputs: Vec<Inputs> = segment.iter().map(|row| row.inputs).collect();
        seen.extend(forward::path(&model.physics, &dynamics, &inputs));
    }
    Ok(seen)
}

/// What of the model lags and rings; effects of torques and forces move no tool and pass by.
fn dynamics(model: &RobotModel) -> Result<Dynamics, Failure> {
    let mut dynamics = Dynamics::default();
    let arm = &model.physics.arm;
    for entry in model.not_compensated.iter().filter_map(|at| model.file.effects.get(*at)) {
        let Some(numbers) = entry.to_si(arm) else { continue };
        let given: Vec<(&str, &[f64])> = numbers.iter().map(|(s, v)| (*s, v.as_slice())).collect();
        let joint = entry.joint.map(|joint| joint.saturating_sub(1));
        dynamics
            .take(arm, &entry.kind, joint, entry.channel.as_deref(), Given(&given))
            .map_err(|error| Failure::input(format!("{}: {error}", entry.title())))?;
    }
    Ok(dynamics)
}

fn say(console: &mut Console, report: &Report<'_>) -> Outcome {
    if report.rows_beyond_stiffness > 0 {
        warn!(
            "in {} a joint is loaded beyond what its stiffness_hardening holds for",
            count(report.rows_beyond_stiffness, "row")
        );
    }
    if !report.left_out.is_empty() {
        warn!("not simulated and left out: {}", report.left_out.join(", "));
    }
    let rows = count(report.rows, "row");
    console.say(format!("{}, {rows}: {}", report.model, report.columns.join(", ")))?;
    console.say(format!("noise               {} mm (mrad), seed {}", report.noise, report.seed))?;
    if let Some(rms) = report.recorded_rms_mm {
        console.say(format!("recorded − model    {rms:.4} mm rms per value"))?;
    }
    console.say(format!("recording           {}", report.recording))?;
    Ok(Answer::Done)
}

/// For `map_err`: what a recording lacks.
fn lacking(text: String) -> Failure {
    Failure::input(text)
}
