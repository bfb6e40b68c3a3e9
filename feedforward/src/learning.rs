//! Learning from recordings: the last commands of a path, measured runs of them, and the commands of the next run.
//!
//! The path is corrected statically by someone else (the daemon's cycle); this adds what runs showed in time.

use joint_dynamics::plant::Plants;
use physics::JointKind;
use recording::model::RobotModel;
use recording::series::Recording;
use recording::unit::Unit;

use crate::error::{FeedforwardError, PathRow};
use crate::grid::{self, SourceRows};
use crate::learn::{NextRun, Runs, expected_error, learn};
use crate::measured::{Clock, Expected, MeasuredErrors, links};
use crate::preview::{check_joint_limits, lead_s};
use crate::result::LearnReport;
use crate::settings::Settings;

/// A path as it was commanded in the last run.
#[derive(Clone, Debug)]
pub struct CommandedPath {
    /// The path on an even time grid, at rest at both ends.
    pub recording: Recording,
    /// The corrected joints that its table contains, rad or m, a list per joint; none where it contains none.
    pub commanded: Option<Vec<Vec<f64>>>,
    /// The rows of the table.
    pub source: SourceRows,
}

impl CommandedPath {
    /// Of the table of a compensation or of learning, or of a path without corrected joints.
    ///
    /// # Errors
    /// As [`grid::extend`]; corrected joints that are incomplete, no numbers, or not even in time.
    pub fn of(
        recording: &Recording,
        kinds: &[JointKind],
        plants: &Plants,
        settings: &Settings,
    ) -> Result<Self, FeedforwardError> {
        let commanded = commanded(recording, kinds)?;
        let lead_s = if commanded.is_some() { 0.0 } else { lead_s(plants, settings) };
        let extended = grid::extend(recording, kinds, lead_s)?;
        if commanded.is_some() && extended.is_resampled {
            return Err(FeedforwardError::UnevenTable);
        }
        Ok(Self { recording: extended.recording, commanded, source: extended.source })
    }
}

/// Commands of a path, rad or m, a list per joint.
#[derive(Clone, Debug)]
pub struct Commands {
    /// With the static correction alone.
    pub wanted: Vec<Vec<f64>>,
    /// What was sent in the last run.
    pub commanded: Vec<Vec<f64>>,
}

/// Learning of a path: measured runs are added one by one.
///
/// ```
/// use feedforward::Settings;
/// use feedforward::learning::{CommandedPath, Commands, Learning};
/// use feedforward::measured::Clock;
/// use joint_dynamics::plant::Plants;
/// use physics::JointKind;
/// use recording::model::RobotModel;
/// use recording::series::Recording;
///
/// fn next_commands(
///     model: &RobotModel,
///     table: &Recording,
///     run: &Recording,
/// ) -> Result<Vec<Vec<f64>>, Box<dyn std::error::Error>> {
///     let settings = Settings::with_limits(0.2, 1.0, 5e3)?;
///     let plants = Plants::of(model, settings.unstated);
///     let path = CommandedPath::of(table, &[JointKind::Revolute; 6], &plants, &settings)?;
///     let joints = (0..6).filter_map(|joint| path.recording.input(joint));
///     let wanted: Vec<Vec<f64>> = joints.map(<[f64]>::to_vec).collect();
///     let commands = Commands { commanded: path.commanded.unwrap_or_else(|| wanted.clone()), wanted };
///     let mut learning = Learning::of(model, &plants, &path.recording, commands, &settings)?;
///     learning.add(run, Clock::Offset(0.0))?;
///     let (next, report) = learning.next("next.csv".to_owned(), &path.source)?;
///     println!("{}", report.text());
///     Ok(next.commanded)
/// }
/// ```
pub struct Learning<'a> {
    model: &'a RobotModel,
    plants: &'a Plants,
    settings: &'a Settings,
    times_s: &'a [f64],
    step_s: f64,
    commands: Commands,
    /// Targets of the links.
    links: Vec<Vec<f64>>,
    /// Joints that give the target of the tool.
    tool: Vec<Vec<f64>>,
    /// Errors that the model predicts.
    expected_error: Vec<Vec<f64>>,
    runs: Vec<MeasuredErrors>,
}

impl<'a> Learning<'a> {
    /// Of a path on an even time grid ([`CommandedPath::recording`]).
    ///
    /// # Errors
    /// Too few rows, or a recording that lacks a joint.
    pub fn of(
        model: &'a RobotModel,
        plants: &'a Plants,
        recording: &'a Recording,
        commands: Commands,
        settings: &'a Settings,
    ) -> Result<Self, FeedforwardError> {
        let Commands { wanted, commanded: sent } = &commands;
        let step_s = grid::median_step_s(&recording.t_s)?;
        let tool: Option<Vec<Vec<f64>>> =
            (0..wanted.len()).map(|joint| Some(recording.input(joint)?.to_vec())).collect();
        Ok(Self {
            links: links(&model.physics, recording, wanted)?,
            tool: tool.unwrap_or_else(|| wanted.clone()),
            expected_error: expected_error(plants, step_s, wanted, sent),
            runs: Vec::new(),
            times_s: &recording.t_s,
            model,
            plants,
            settings,
            step_s,
            commands,
        })
    }

    /// Adds the measurement of a run.
    ///
    /// # Errors
    /// As [`MeasuredErrors::of`].
    pub fn add(&mut self, measurement: &Recording, clock: Clock) -> Result<(), FeedforwardError> {
        let expected = Expected {
            arm: &self.model.physics.arm,
            times_s: self.times_s,
            motors: &self.commands.wanted,
            links: &self.links,
            tool: &self.tool,
            error: &self.expected_error,
        };
        self.runs.push(MeasuredErrors::of(measurement, expected, clock, self.settings)?);
        Ok(())
    }

    /// The commands of the next run, and what was learned; `corrections`: where the commands go; `source`: the rows of the path.
    ///
    /// # Errors
    /// As [`learn()`]; a command beyond the joint limits.
    pub fn next(
        &self,
        corrections: String,
        source: &SourceRows,
    ) -> Result<(NextRun, LearnReport), FeedforwardError> {
        let Commands { wanted, commanded: sent } = &self.commands;
        let runs = Runs { step_s: self.step_s, wanted, commanded: sent, measured: &self.runs };
        let next = learn(self.plants, &runs, self.settings)?;
        let arm = &self.model.physics.arm;
        check_joint_limits(arm, &next.commanded, self.times_s, source)?;
        let report = LearnReport::of(arm, &runs, &next, corrections);
        Ok((next, report))
    }
}

/// The corrected joints of a table, rad or m; none where it has none.
fn commanded(
    recording: &Recording,
    kinds: &[JointKind],
) -> Result<Option<Vec<Vec<f64>>>, FeedforwardError> {
    let mut all = Vec::new();
    for (joint, kind) in kinds.iter().enumerate() {
        let unit = if *kind == JointKind::Revolute { "deg" } else { "mm" };
        let name = format!("c{}_{unit}", joint + 1);
        let Some((_, texts)) = recording.other.iter().find(|(found, _)| *found == name) else {
            continue;
        };
        let si = |text: &String| {
            let value: f64 = text.trim().parse().ok()?;
            Unit::from_name(unit).map(|unit| unit.to_si(value)).filter(|value| value.is_finite())
        };
        let column: Vec<Option<f64>> = texts.iter().map(si).collect();
        if let Some(row) = column.iter().position(Option::is_none) {
            let at = PathRow { row: row + 1, t_s: recording.t_s[row] };
            return Err(FeedforwardError::NoNumber { at, column: name });
        }
        all.push(column.into_iter().flatten().collect());
    }
    match all.len() {
        0 => Ok(None),
        found if found == kinds.len() => Ok(Some(all)),
        found => Err(FeedforwardError::JointsLacking { found, expected: kinds.len() }),
    }
}
