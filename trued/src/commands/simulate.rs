//! `trued simulate`: simulates tool position and drive torques of a model for a recording's commands, loads and temperatures.
//!
//! The same input and seed give the same bytes; without `--noise` the result is the model's own, to
//! the last digit; the layout remains that of the recording; no input is overwritten. The model is
//! not fitted; only the measuring frame and unknown target positions are estimated, from the
//! recorded data.

mod cut;
mod instrument;
mod station;

use std::path::{Path, PathBuf};

use clap::Args;
use diagnosis::{Arrival, Pose, from_recording};
use glam::DVec3;
use physics::{Given, Inputs, Joints};
use recording::model::{RobotModel, presets};
use recording::series::{self, Channel, Kind, Recording};
use report::count;
use serde::Serialize;
use tracing::warn;
use world::drives;
use world::dynamics::Dynamics;
use world::forward::{self, Seen};
use world::servo;

use self::instrument::{Instrument, Made};
use self::station::Stand;
use crate::exit::{Answer, Failure, Outcome};
use crate::input::{Input, Looked, Reading};
use crate::options::Seed;
use crate::output::Console;

/// Run the model forward: where the tool goes on a recording's commands, as a recording
///
/// Takes commanded joints, loads, temperatures and process state of INPUT and replaces what was measured: points, reflectors, orientations,
/// joint positions of the motor and the link side, torques, in the rows in which they were measured. What INPUT states of its instruments (`sigma`) stays; else the noise is stated. All effects of positions and torques act,
/// delays, lags and modes too. Where positions of the motors were measured beside torques, a plain controller (P around PI, with the commanded speed ahead)
/// closes the loop, so that friction shows in the motion; else the motors go where they are sent. Where the TOML tells of a `[cut]`, forces are those of its cutter
/// at the recorded spindle speed and feed, with the model's effects of cutter and sensor; such a recording needs no joints and no model. An unknown measuring frame is found from what was recorded; with nothing recorded the tool centre point is given in the base frame.
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
    /// Normal noise on every torque, Nm (N of a slide); none if not given
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0, value_parser = not_negative)]
    torque_noise: f64,
    /// Normal noise on every force of a cut, N; none if not given
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0, value_parser = not_negative)]
    force_noise: f64,
    #[command(flatten)]
    seed: Seed,
    /// The recording whose commands are followed
    #[arg(value_name = "INPUT")]
    input: PathBuf,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report<'a> {
    seed: u64,
    /// mm, mrad on angles.
    noise: f64,
    /// Nm, N of a slide.
    torque_noise: f64,
    /// N.
    force_noise: f64,
    model: &'a str,
    recording: String,
    rows: usize,
    columns: Vec<String>,
    left_out: Vec<String>,
    /// Recorded values compared with the model without noise, over single values; `None` if nothing
    /// was recorded.
    recorded_rms_mm: Option<f64>,
    rows_beyond_stiffness: usize,
}

impl Simulate {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let (csv, toml) = files(&self.out);
        let mut outputs = console.outputs().file(&csv).file(&toml);
        outputs.check([&self.input].into_iter().chain(self.reading.files()))?;
        let seed = self.seed.settle();
        let (model, made) = match self.reading.look(&self.input)? {
            Looked::WithoutArm(alone) => {
                let (model, recording) = *alone;
                (model, Made::untouched(recording))
            }
            Looked::OfArm(_) => self.moved(seed)?,
        };
        let Made { mut recording, columns, left_out, understated, recorded_rms_m, rows_beyond } =
            made;
        let with_cutting = model.with_cutting().map_err(Failure::input)?;
        let of_cut = cut::read(&with_cutting, &mut recording, self.force_noise, seed)?;
        if columns.is_empty() && of_cut.columns.is_empty() {
            return Err(lacking(format!(
                "{}: neither joint positions nor a [cut]: nothing can be simulated",
                self.input.display()
            )));
        }
        recording.about.model = self.model_name(&recording, &toml);
        if !understated.is_empty() {
            let columns = understated.join(", ");
            warn!(
                "the noise is more than `sigma` of the recording states, which stays as it is: {columns}"
            );
        }
        outputs.put(&toml, self.about(&recording, seed));
        outputs.put(&csv, recording.to_csv());
        let report = Report {
            seed,
            noise: self.noise,
            torque_noise: self.torque_noise,
            force_noise: self.force_noise,
            model: &model.file.name,
            recording: csv.display().to_string(),
            rows: recording.len(),
            columns: [columns, of_cut.columns].concat(),
            left_out: [left_out, of_cut.left_out].concat(),
            recorded_rms_mm: recorded_rms_m.map(|rms| rms * 1e3),
            rows_beyond_stiffness: rows_beyond,
        };
        console.write(outputs, "trued.simulate/1", &report)?;
        say(console, &report)
    }

    /// The simulated motion of the arm, and the instruments' readings.
    fn moved(&self, seed: u64) -> Result<(RobotModel, Made), Failure> {
        let Input { model, mut recording, .. } = self.reading.read(&self.input, None)?;
        hold_inputs(&mut recording);
        let run = run(&model, &recording, Loop::of(&model, &recording))?;
        let stand = Stand::find(&model, &recording)?;
        let noise = self.noise * 1e-3;
        let instrument = Instrument { stand: &stand, noise, torque_noise: self.torque_noise, seed };
        let made = instrument.look(&model, recording, &run);
        Ok((model, made))
    }

    /// The model's name for the recording's TOML: a preset by name, a file by its path relative to
    /// the TOML.
    fn model_name(&self, recording: &Recording, toml: &Path) -> Option<String> {
        let Some(given) = &self.reading.model else {
            let named = recording.about.model.as_ref()?;
            let from = presets::beside(&recording.file, Path::new(named));
            return Some(from_folder(&from, toml));
        };
        Some(from_folder(given, toml))
    }

    /// The recording's TOML, with how it was made.
    fn about(&self, recording: &Recording, seed: u64) -> String {
        let more = |name: &str, noise: f64| match noise {
            0.0 => String::new(),
            noise => format!(" --{name}-noise {noise}"),
        };
        format!(
            "# simulated: trued simulate --seed {seed} --noise {}{}{}\n{}",
            self.noise,
            more("torque", self.torque_noise),
            more("force", self.force_noise),
            recording.about_toml()
        )
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    let sound = |x: &f64| x.is_finite() && *x >= 0.0;
    text.parse().ok().filter(sound).ok_or_else(|| "expected a number, 0 or above".to_owned())
}

/// `NAME.csv` and `NAME.toml`; a given extension of either kind is kept.
pub(super) fn files(out: &Path) -> (PathBuf, PathBuf) {
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

/// A missing sample keeps the last value: loads, temperatures, process state.
fn hold_inputs(recording: &mut Recording) {
    let is_measured = recording.about.cut.is_some();
    let is_input = |channel: &Channel| match channel {
        Channel::Wrench(_) => !is_measured,
        Channel::Ambient | Channel::JointTemperature(_) | Channel::Spindle | Channel::Feed => true,
        _ => false,
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

/// The positions of the arm on a recording, row by row.
pub(super) fn seen_of(model: &RobotModel, mut recording: Recording) -> Result<Vec<Seen>, Failure> {
    hold_inputs(&mut recording);
    Ok(run(model, &recording, Loop::Unasked)?.seen)
}

/// The drive torques on a recording that moves as commanded, row by row, Nm or N.
pub(super) fn torques_of(
    model: &RobotModel,
    mut recording: Recording,
) -> Result<Vec<Joints>, Failure> {
    hold_inputs(&mut recording);
    Ok(run(model, &recording, Loop::Open)?.torques.unwrap_or_default())
}

/// The sensor's readings of the recording's cut, row by row, N.
pub(super) fn forces_of(model: &RobotModel, recording: &Recording) -> Result<Vec<DVec3>, Failure> {
    let Some(told) = &recording.about.cut else { return Ok(Vec::new()) };
    cut::forces(&model.with_cutting().map_err(Failure::input)?, told, recording)
}

/// What is simulated of the drives.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Loop {
    /// Nothing.
    Unasked,
    /// Their torques, on motions that are as commanded.
    Open,
    /// Their torques, and the resulting motion.
    Closed,
}

impl Loop {
    /// Depends on the measured columns; a model without masses and drive effects has no torques.
    fn of(model: &RobotModel, recording: &Recording) -> Self {
        if model.physics.arm.bodies().next().is_none() && model.drives.is_empty() {
            return Self::Unasked;
        }
        let has = |wanted: fn(&Channel) -> bool| recording.channels().any(|c| wanted(&c));
        let path = recording.about.kind == Kind::Path;
        let by_command = path && recording.input_kind() == series::Input::Command;
        match has(|c| matches!(c, Channel::Torque(_))) {
            true if by_command && has(|c| matches!(c, Channel::Motor(_))) => Self::Closed,
            true => Self::Open,
            false => Self::Unasked,
        }
    }
}

/// The arm, row by row.
struct Run {
    seen: Vec<Seen>,
    /// Simulated torques, Nm or N; `None` if not requested.
    torques: Option<Vec<Joints>>,
}

/// The positions of the arm, row by row, on a recording whose inputs were held.
fn run(model: &RobotModel, recording: &Recording, asked: Loop) -> Result<Run, Failure> {
    let rows = from_recording::motion(&model.physics.arm, recording).map_err(Failure::input)?;
    let with_drives = model.with_drives().map_err(Failure::input)?;
    if recording.about.kind == Kind::Poses {
        let rows: Vec<(Inputs, bool)> =
            rows.iter().map(|row| (row.inputs, row.arrival == Arrival::FromBefore)).collect();
        let torques = (asked != Loop::Unasked).then(|| drives::poses(&with_drives, &rows));
        return Ok(Run { seen: forward::poses(&model.physics, &rows), torques });
    }
    let dynamics = dynamics(model)?;
    // The motors' own motion already contains delay and lag.
    let on_motors = Dynamics { delay_s: 0.0, lags: Vec::new(), ..dynamics.clone() };
    let goes_on = |a: &Pose, b: &Pose| recording.segment.get(a.row) == recording.segment.get(b.row);
    let (mut seen, mut torques) = (Vec::with_capacity(rows.len()), Vec::new());
    for segment in rows.chunk_by(goes_on) {
        let mut inputs: Vec<Inputs> = segment.iter().map(|row| row.inputs).collect();
        match asked {
            Loop::Unasked => {}
            Loop::Open => torques.extend(drives::path(&with_drives, &dynamics, &inputs)),
            Loop::Closed => {
                let followed =
                    servo::path(&with_drives, &dynamics, &inputs).map_err(Failure::input)?;
                torques.extend(followed.iter().map(|row| row.torque));
                inputs.iter_mut().zip(followed).for_each(|(row, seen)| row.q = seen.motor);
            }
        }
        let dynamics = if asked == Loop::Closed { &on_motors } else { &dynamics };
        seen.extend(forward::path(&model.physics, dynamics, &inputs));
    }
    Ok(Run { seen, torques: (asked != Loop::Unasked).then_some(torques) })
}

/// What of the model lags and rings; effects of drives and forces have no dynamics and pass by.
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

/// For `map_err`: an error about something missing in a recording.
fn lacking(text: String) -> Failure {
    Failure::input(text)
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report<'_>>("simulate", "trued.simulate/1")
}
