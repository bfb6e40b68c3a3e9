//! Learning from recordings: the last commands of a path, measured runs of them, and the commands of the next run.
//!
//! The path is corrected statically by someone else (the daemon's cycle); this adds what runs showed in time.

use joint_dynamics::plant::Plants;
use physics::JointKind;
use recording::model::RobotModel;
use recording::series::Recording;
use recording::unit::Unit;

use crate::bounds::JointBounds;
use crate::error::{FeedforwardError, PathRow};
use crate::grid::{self, SourceRows};
use crate::history::{Before, History};
use crate::learn::{NextRun, Runs, expected_error, learn};
use crate::measured::{Clock, Expected, MeasuredErrors, Timing, links};
use crate::preview::{check_joint_limits, lead_s};
use crate::result::{LearnReport, RowResult, WentBack};
use crate::settings::Settings;
use crate::tool;

/// A path as it was commanded in the last run.
#[derive(Clone, Debug)]
pub struct CommandedPath {
    /// The path on an even time grid, at rest at both ends.
    pub recording: Recording,
    /// The corrected joints that its table contains, rad or m, a list per joint; none where it contains none.
    pub commanded: Option<Vec<Vec<f64>>>,
    /// The runs before, as the table states them.
    pub history: History,
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
        let commanded = joint_columns(recording, kinds, 'c')?;
        let history = match &commanded {
            Some(_) => History::of(recording, kinds)?,
            None => History::default(),
        };
        let lead_s = if commanded.is_some() { 0.0 } else { lead_s(plants, settings) };
        let extended = grid::extend(recording, kinds, lead_s)?;
        if commanded.is_some() && extended.is_resampled {
            return Err(FeedforwardError::UnevenTable);
        }
        let (recording, source) = (extended.recording, extended.source);
        Ok(Self { recording, commanded, history, source })
    }
}

/// Commands of a path, rad or m, a list per joint.
#[derive(Clone, Debug)]
pub struct Commands {
    /// With the static correction alone.
    pub wanted: Vec<Vec<f64>>,
    /// What was sent in the last run.
    pub commanded: Vec<Vec<f64>>,
    /// The runs before it.
    pub history: History,
}

/// The next run, and what was learned.
#[derive(Debug)]
pub struct Learned {
    /// The commands.
    pub next: NextRun,
    /// What the next run leaves of the errors by the model, row by row.
    pub rows: Vec<RowResult>,
    /// The runs before it, for its table.
    pub history: History,
    /// For people and programs.
    pub report: LearnReport,
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
///     let commanded = path.commanded.unwrap_or_else(|| wanted.clone());
///     let commands = Commands { commanded, wanted, history: path.history };
///     let mut learning = Learning::of(model, &plants, &path.recording, commands, &settings)?;
///     learning.add(run, Clock::Offset(0.0))?;
///     let learned = learning.next("next.csv".to_owned(), &path.source)?;
///     println!("{}", learned.report.text());
///     Ok(learned.next.commanded)
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
        let Commands { wanted, commanded: sent, .. } = &commands;
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
            timing: Timing::of(self.plants),
        };
        self.runs.push(MeasuredErrors::of(measurement, expected, clock, self.settings)?);
        Ok(())
    }

    /// The commands of the next run, and what was learned; `corrections`: where the commands go; `source`: the rows of the path.
    /// After a run that is worse than the one before, the commands are those of the run before.
    ///
    /// # Errors
    /// As [`learn()`]; a command beyond the joint limits.
    pub fn next(
        &self,
        corrections: String,
        source: &SourceRows,
    ) -> Result<Learned, FeedforwardError> {
        let Commands { wanted, commanded: sent, history } = &self.commands;
        let runs = Runs { step_s: self.step_s, wanted, commanded: sent, measured: &self.runs };
        let arm = &self.model.physics.arm;
        let share = history.learning_share * self.settings.learning_share;
        let settings = Settings { learning_share: share, ..*self.settings };
        let mut next = learn(self.plants, &JointBounds::of(arm), &runs, &settings)?;
        let points = |joints: &[Vec<f64>]| tool::points(arm, joints);
        let measured = points(&next.reached(wanted, |learned| &learned.error));
        let run_rms_m = tool::error(&points(wanted), &measured, self.step_s).in_time.rms_m;
        let worse = history
            .before
            .as_ref()
            .filter(|before| run_rms_m > (1.0 + self.settings.worse_share) * before.rms_m);
        let went_back = worse.map(|before| WentBack {
            run_rms_mm: run_rms_m * 1e3,
            before_rms_mm: before.rms_m * 1e3,
            learning_share: 0.5 * share,
        });
        let before = match worse {
            Some(before) => {
                self.go_back(&mut next, before);
                None
            }
            None => Some(Before { commanded: sent.clone(), rms_m: run_rms_m }),
        };
        let learning_share = went_back.as_ref().map_or(share, |back| back.learning_share);
        check_joint_limits(arm, &next.commanded, self.times_s, source)?;
        let mut report = LearnReport::of(arm, &runs, &next, corrections, &self.expected_error);
        if let Some(went_back) = went_back {
            report.go_back(went_back);
        }
        self.warnings(run_rms_m, &next).into_iter().for_each(|warning| report.warn(warning));
        let reached = next.reached(wanted, |learned| &learned.next.residual);
        let steps = next.joints.iter().flatten().map(|learned| &learned.next);
        let rows = RowResult::of(arm, (wanted, &reached), self.step_s, steps);
        Ok(Learned { next, rows, history: History { before, learning_share }, report })
    }

    /// Replaces what was learned by the commands of the run before.
    fn go_back(&self, next: &mut NextRun, before: &Before) {
        let Commands { wanted, .. } = &self.commands;
        let expected = expected_error(self.plants, self.step_s, wanted, &before.commanded);
        next.commanded.clone_from(&before.commanded);
        let joints = next.joints.iter_mut().zip(&before.commanded).zip(wanted).zip(expected);
        for (((learned, commanded), wanted), residual) in joints {
            let Some(learned) = learned else { continue };
            let step = &mut learned.next;
            step.correction = commanded.iter().zip(wanted).map(|(c, w)| c - w).collect();
            step.residual = residual;
            step.limited = vec![None; wanted.len()];
        }
    }

    /// What is to be checked of the runs.
    fn warnings(&self, run_rms_m: f64, next: &NextRun) -> Vec<String> {
        let settings = self.settings;
        let sigma_ms = 1e3 * Timing::of(self.plants).uncertainty_s(settings);
        let late = self.runs.iter().enumerate().filter_map(|(index, run)| {
            let late_ms = 1e3 * run.late_s;
            (late_ms.abs() > sigma_ms.max(1e3 * settings.late_floor_s)).then(|| {
                format!(
                    "run {}: the measurement is {:.1} ms {} than the model predicts, beyond the {sigma_ms:.1} ms of its sigma; it is learned as an error of the robot. \
                     If its clock is not that of the commands, use --clock-offset-ms unknown",
                    index + 1,
                    late_ms.abs(),
                    if late_ms > 0.0 { "later" } else { "earlier" }
                )
            })
        });
        let mut warnings: Vec<String> = late.collect();
        let most_m =
            settings.unexplained_max * self.expected_rms_m(next).max(settings.path_floor_m);
        if run_rms_m > most_m {
            warnings.push(format!(
                "the tracking error of the run is {:.3} mm rms, the model within its sigma predicts at most {:.3} mm: check path, clocks, and delay, lags and modes of the model",
                1e3 * run_rms_m,
                1e3 * most_m / settings.unexplained_max
            ));
        }
        warnings
    }

    /// Root mean square tracking error of the tool in these runs by the model within its uncertainty, m.
    fn expected_rms_m(&self, next: &NextRun) -> f64 {
        let Commands { wanted, commanded: sent, .. } = &self.commands;
        let perturbed = self.plants.perturbed_together(self.settings.sigmas);
        let variants: Vec<Plants> = std::iter::once(self.plants.clone()).chain(perturbed).collect();
        let points = |joints: &[Vec<f64>]| tool::points(&self.model.physics.arm, joints);
        let target = points(wanted);
        let rms_m = |plants: &Plants| {
            let errors = expected_error(plants, self.step_s, wanted, sent);
            let joints = wanted.iter().zip(&errors).zip(&next.joints);
            let reached: Vec<Vec<f64>> = joints
                .map(|((wanted, error), learned)| match learned {
                    Some(_) => wanted.iter().zip(error).map(|(w, e)| w - e).collect(),
                    None => wanted.clone(),
                })
                .collect();
            tool::error(&target, &points(&reached), self.step_s).in_time.rms_m
        };
        variants.iter().map(rms_m).fold(0.0, f64::max)
    }
}

/// The joints of a table in columns with this letter (`c1_deg` …), rad or m; none where it has none.
pub(crate) fn joint_columns(
    recording: &Recording,
    kinds: &[JointKind],
    letter: char,
) -> Result<Option<Vec<Vec<f64>>>, FeedforwardError> {
    let mut all = Vec::new();
    for (joint, kind) in kinds.iter().enumerate() {
        let unit = if *kind == JointKind::Revolute { "deg" } else { "mm" };
        let name = format!("{letter}{}_{unit}", joint + 1);
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

#[cfg(test)]
mod tests;
