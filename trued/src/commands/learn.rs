//! `trued learn`: commands of the next run from measurements of the last one.
//!
//! The path is corrected as by `trued correct --dynamic`, and the learned correction is added
//! within the same limits; the resulting table is the input of the next `trued learn`. If an input
//! has an error, nothing is written.

use std::path::{Path, PathBuf};

use clap::Args;
use feedforward::learn::{Learned, Next, Runs, expected_error};
use feedforward::measured::{Clock, Expected, Measured, Seen, links};
use feedforward::preview::{check_joint_limits, lead_s};
use feedforward::{Settings, grid, learn};
use joint_dynamics::plant::{Plant, Plants, Uncertain};
use physics::JointKind;
use recording::cell::CellConfig;
use recording::series::{self, Need, Recording};
use recording::unit::Unit;
use serde::Serialize;
use tracing::warn;

use super::correct::{correct, cycle};
use crate::exit::{Answer, Failure, Outcome};
use crate::in_time::{InTime, OfJoint, OfTool, largest, plants, rms, settled};
use crate::input::{Input, Reading, unusable};
use crate::output::Console;

/// Learn from a measured run: the same path, commanded better the next time
///
/// PATH is the table of `trued correct --dynamic` or of the last `trued learn`: what was wanted (q) and what was commanded (c); a path without corrected joints was
/// commanded as it is. MEASURED is what came of it: joint positions of the link or motor side, or points of the tool; several files are several runs of the
/// same commands, which tells what repeats. Run the table that is written, measure it, learn again: two to four times.
#[derive(Debug, Args)]
pub(crate) struct Learn {
    #[command(flatten)]
    reading: Reading,
    /// The cell that PATH was corrected in, where `trued correct` was given one
    #[arg(long, value_name = "CELL.toml")]
    config: Option<PathBuf>,
    /// Where the next commands go; if not given, `NAME.next.csv` in the present folder
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// What the clock of MEASURED must be set forward by, ms, or `unknown`: it is found from the motion
    #[arg(long, value_name = "MS|unknown", default_value = "0", value_parser = clock, allow_hyphen_values = true)]
    clock_offset_ms: Clock,
    #[command(flatten)]
    in_time: InTime,
    /// What was wanted and commanded
    #[arg(value_name = "PATH.csv")]
    path: PathBuf,
    /// What was measured, a file for each run
    #[arg(value_name = "MEASURED", required = true)]
    measured: Vec<PathBuf>,
}

/// What was learned.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report {
    corrections: String,
    runs: usize,
    step_ms: f64,
    /// What was added to the times of each measurement.
    clock_offsets_ms: Vec<f64>,
    joints: Vec<JointReport>,
    /// Joints, from 1, for which nothing was measured, or only the motor of a joint with a mode.
    not_learned: Vec<usize>,
    /// Of the mean of the runs.
    tool_before: OfTool,
    /// Of the next run, by the model.
    tool_next: OfTool,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct JointReport {
    /// `link`, `motor` or `tool`.
    measured: &'static str,
    error: f64,
    error_rms: f64,
    /// Standard deviation of one run from the mean; none of a single run.
    repeatability: Option<f64>,
    /// The joint over time as this run showed it; none where the model explains the run about as well, and was used.
    by_run: Option<ByRun>,
    #[serde(flatten)]
    next: OfJoint,
}

/// A joint over time, by a run.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ByRun {
    delay_ms: f64,
    lag_ms: f64,
    #[serde(rename = "frequencies_Hz")]
    frequencies_hz: Vec<f64>,
    damping_ratios: Vec<f64>,
}

impl ByRun {
    fn of(plant: &Plant) -> Self {
        let ms = |numbers: &[Uncertain]| numbers.iter().map(|number| number.value * 1e3).sum();
        Self {
            delay_ms: ms(&plant.delays_s),
            lag_ms: ms(&plant.lags_s),
            frequencies_hz: plant.modes.iter().map(|mode| mode.frequency_hz.value).collect(),
            damping_ratios: plant.modes.iter().map(|mode| mode.damping_ratio.value).collect(),
        }
    }

    fn told(&self) -> String {
        let Self { delay_ms, lag_ms, frequencies_hz, .. } = self;
        let modes: Vec<String> = frequencies_hz.iter().map(|hz| format!(", {hz:.2} Hz")).collect();
        format!("by this run delay {delay_ms:.2} ms, lag {lag_ms:.2} ms{}", modes.concat())
    }
}

/// A path: desired and commanded positions.
struct Commands {
    wanted: Vec<Vec<f64>>,
    commanded: Vec<Vec<f64>>,
    step_s: f64,
}

impl Learn {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let out = self.out.clone().unwrap_or_else(|| next_to(&self.path));
        let mut outputs = console.outputs().file(&out);
        let inputs = [&self.path].into_iter().chain(&self.measured);
        outputs.check(inputs.chain(self.reading.files()).chain(&self.config))?;
        let settings = self.in_time.settings()?;
        // The path is trued's own table; the mapping belongs to the measurements.
        let ours = Reading { mapping: None, ..self.reading.clone() };
        let cell = self.config.as_deref().map(CellConfig::read).transpose().map_err(unusable)?;
        let fallback = cell.as_ref().map(|cell| cell.model.as_path());
        let mut input = ours.read(&self.path, fallback)?;
        let plants = plants(&input, &settings)?;
        let commanded = put_on_grid(&mut input, &plants, &settings)?;
        let mut corrections = correct(&input, cycle(self.config.as_deref(), cell, &input)?)?;
        let wanted = settled(&corrections)?;
        let commanded = commanded.unwrap_or_else(|| wanted.clone());
        let step_s = grid::median_step_s(&input.recording.t_s).map_err(Failure::input)?;
        let commands = Commands { wanted, commanded, step_s };
        let measured = self.measured(&input, &plants, &commands, &settings)?;
        let Commands { wanted, commanded, .. } = &commands;
        let runs = Runs { step_s, wanted, commanded, measured: &measured };
        let next = learn(&plants, &runs, &settings).map_err(Failure::input)?;
        check_joint_limits(&input.model.physics.arm, &next.commanded).map_err(Failure::input)?;
        let report = report(&input, &commands, &measured, &next, out.display().to_string());
        corrections.put_joints(next.commanded);
        outputs.put(&out, corrections.csv(input.recording).as_slice());
        console.write(outputs, "trued.learn/1", &report)?;
        console.say(report.told())?;
        console.say(format!("next commands       {}", out.display()))?;
        let limited = report.joints.iter().any(|joint| joint.next.limited_rows > 0);
        Ok(if limited { Answer::No } else { Answer::Done })
    }

    /// The errors of each run.
    fn measured(
        &self,
        input: &Input,
        plants: &Plants,
        commands: &Commands,
        settings: &Settings,
    ) -> Result<Vec<Measured>, Failure> {
        let Commands { wanted, commanded, step_s } = commands;
        let model = &input.model.physics;
        let links = links(model, &input.recording, wanted).map_err(Failure::input)?;
        let tool: Option<Vec<Vec<f64>>> =
            (0..wanted.len()).map(|joint| Some(input.recording.input(joint)?.to_vec())).collect();
        let error = expected_error(plants, *step_s, wanted, commanded);
        let expected = Expected {
            arm: &model.arm,
            times_s: &input.recording.t_s,
            motors: wanted,
            links: &links,
            tool: tool.as_deref().unwrap_or(wanted),
            error: &error,
        };
        let of_run = |path: &PathBuf| {
            let mapping = self.reading.mapping.as_deref();
            let recording = series::read(path, mapping, Need::Samples).map_err(unusable)?;
            recording.notes.iter().for_each(|note| warn!("{}: {note}", path.display()));
            Measured::of(&recording, expected, self.clock_offset_ms, settings)
                .map_err(|error| Failure::input(format!("{}: {error}", path.display())))
        };
        self.measured.iter().map(of_run).collect()
    }
}

/// The path on an even time grid, with the commands if the table contains them.
fn put_on_grid(
    input: &mut Input,
    plants: &Plants,
    settings: &Settings,
) -> Result<Option<Vec<Vec<f64>>>, Failure> {
    let commanded = commanded(&input.recording, &input.joint_kinds)?;
    let lead_s = if commanded.is_some() { 0.0 } else { lead_s(plants, settings) };
    let extended = grid::extended(&input.recording, &input.joint_kinds, lead_s);
    let extended = extended.map_err(Failure::input)?;
    if commanded.is_some() && extended.is_resampled {
        return Err(Failure::input(format!(
            "{}: its rows are not even in time, expected the table of `trued correct --dynamic` or `trued learn`, or a path without corrected joints (c1_deg …)",
            input.recording.file.display()
        )));
    }
    input.recording = extended.recording;
    Ok(commanded)
}

/// The corrected joints of a table, rad or m; none where it has none.
fn commanded(recording: &Recording, kinds: &[JointKind]) -> Result<Option<Vec<Vec<f64>>>, Failure> {
    let mut all = Vec::new();
    for (joint, kind) in kinds.iter().enumerate() {
        let unit = if *kind == JointKind::Revolute { "deg" } else { "mm" };
        let name = format!("c{}_{unit}", joint + 1);
        let Some((_, texts)) = recording.other.iter().find(|(found, _)| *found == name) else {
            continue;
        };
        let si = |text: &String| {
            let value: f64 = text.trim().parse().ok()?;
            Unit::named(unit).map(|unit| unit.to_si(value)).filter(|value| value.is_finite())
        };
        let column: Vec<Option<f64>> = texts.iter().map(si).collect();
        if let Some(row) = column.iter().position(Option::is_none) {
            return Err(Failure::input(format!(
                "{}: row {}: {name} is no number",
                recording.file.display(),
                row + 1
            )));
        }
        all.push(column.into_iter().flatten().collect());
    }
    match all.len() {
        0 => Ok(None),
        found if found == kinds.len() => Ok(Some(all)),
        found => Err(Failure::input(format!(
            "{}: has corrected joints (c1_deg …) of {found} joints, expected {}",
            recording.file.display(),
            kinds.len()
        ))),
    }
}

fn report(
    input: &Input,
    commands: &Commands,
    measured: &[Measured],
    next: &Next,
    corrections: String,
) -> Report {
    let Commands { wanted, step_s, .. } = commands;
    let less = |of: fn(&Learned) -> &Vec<f64>| -> Vec<Vec<f64>> {
        let joints = wanted.iter().zip(&next.joints);
        let reached = |(wanted, learned): (&Vec<f64>, &Option<Learned>)| match learned {
            Some(learned) => wanted.iter().zip(of(learned)).map(|(w, e)| w - e).collect(),
            None => wanted.clone(),
        };
        joints.map(reached).collect()
    };
    let tool = |reached: Vec<Vec<f64>>| OfTool::of(input, wanted, &reached, *step_s);
    let joints = next.joints.iter().zip(&input.joint_kinds).enumerate();
    let joints = joints.filter_map(|(at, (learned, kind))| {
        let learned = learned.as_ref()?;
        Some(JointReport {
            measured: match learned.seen {
                Seen::Link => "link",
                Seen::Motor => "motor",
                Seen::Tool => "tool",
            },
            error: 1e3 * largest(&learned.error),
            error_rms: 1e3 * rms(&learned.error),
            repeatability: learned.repeatability.map(|deviation| 1e3 * deviation),
            by_run: learned.refined.as_ref().map(|refined| ByRun::of(&refined.plant)),
            next: OfJoint::of(at, *kind, &learned.next),
        })
    });
    Report {
        corrections,
        runs: measured.len(),
        step_ms: step_s * 1e3,
        clock_offsets_ms: measured.iter().map(|run| run.clock_offset_s * 1e3).collect(),
        joints: joints.collect(),
        not_learned: (1..).zip(&next.joints).filter(|(_, j)| j.is_none()).map(|(n, _)| n).collect(),
        tool_before: tool(less(|learned| &learned.error)),
        tool_next: tool(less(|learned| &learned.next.left)),
    }
}

impl Report {
    fn told(&self) -> String {
        let offsets: Vec<String> =
            self.clock_offsets_ms.iter().map(|ms| format!("{ms:.2} ms")).collect();
        let mut text = format!("clock offset        {}\n", offsets.join(", "));
        for joint in &self.joints {
            let JointReport { measured, error, error_rms, repeatability, by_run, next } = joint;
            text += &next.told().replace('\n', "");
            text += &format!("; measured ({measured}) {error:.3} at most, {error_rms:.3} rms");
            if let Some(deviation) = repeatability {
                text += &format!(", repeatable to {deviation:.4} rms");
            }
            if let Some(by_run) = by_run {
                text += &format!("; {}", by_run.told());
            }
            text.push('\n');
        }
        for joint in &self.not_learned {
            text += &format!(
                "joint {joint}: not learned, nothing was measured of it but a motor that does not see its mode\n"
            );
        }
        text += &self.tool_before.told("error measured");
        text += self.tool_next.told("next, by the model").trim_end();
        if self.runs == 1 {
            text += "\nrepeatability       not known of one run; give several recordings of the same commands";
        }
        text
    }
}

fn clock(text: &str) -> Result<Clock, String> {
    if text == "unknown" {
        return Ok(Clock::Unknown);
    }
    let offset = text.parse().ok().filter(|ms: &f64| ms.is_finite());
    let expected = "expected a number of milliseconds, or `unknown`";
    offset.map(|ms| Clock::Offset(ms * 1e-3)).ok_or_else(|| expected.to_owned())
}

fn next_to(path: &Path) -> PathBuf {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let stem = name.trim_end_matches(".corrected").trim_end_matches(".next");
    PathBuf::from(format!("{stem}.next.csv"))
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report>("learn", "trued.learn/1")
}
