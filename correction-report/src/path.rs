//! A path corrected without a daemon, with the keys of `trued.correct/1`.

use std::path::Path;

use daemon::sensor_inputs::SensorInputs;
use daemon::setup;
use feedforward::Settings;
use feedforward::result::PreviewReport;
use recording::cell::{CellConfig, Mode, WrenchSource};
use recording::files::FileError;
use recording::model::RobotModel;
use recording::series::Recording;
use serde::Serialize;

use crate::corrections::{Corrections, Figures, Tolerance};
use crate::dynamic::DynamicPath;
use crate::error::Error;
use crate::lockstep::{CELL, LockstepCycle, cell_toml};
use crate::setpoints::{Setpoints, has_wrench};

/// Remedy for an arm that cannot correct all six degrees of freedom.
const FEWER_JOINTS_NOTE: &str = "an arm with fewer than six joints cannot correct the complete position and orientation; if the tool may rotate about its own axis, \
    set `task.free_tool_axis = true` in the cell's configuration";

/// How a path is corrected.
#[derive(Debug, Clone, Default)]
pub struct CorrectionRequest {
    /// The cell and the name of its file; its mode is ignored. `None`: every correction in full.
    pub cell: Option<(String, CellConfig)>,
    /// Settings of a dynamic compensation; `None`: the static correction alone.
    pub dynamic: Option<Settings>,
}

/// How far a correction is, for display; no result depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// A stage begins.
    Stage(&'static str),
    /// Rows of the present stage that are done, of all.
    Rows {
        /// Rows done, from 0 to `of`.
        done: usize,
        /// All rows.
        of: usize,
    },
}

/// Receives the progress.
pub type Listener<'a> = &'a dyn Fn(Progress);

/// A [`Listener`] that does nothing.
pub fn ignore(_: Progress) {}

/// Rows between two reports of progress: a row takes a few microseconds, a report more than one.
const ROWS_PER_REPORT: usize = 256;

/// A corrected path.
#[derive(Debug)]
pub struct CorrectedPath {
    /// The columns of the recording and the corrected joints, as CSV.
    pub csv: Vec<u8>,
    /// Figures of the corrections.
    pub figures: Figures,
    /// Result of the dynamic compensation; `None` without dynamic compensation.
    pub dynamic: Option<PreviewReport>,
    corrections: Corrections,
    few_joints: bool,
    in_time: Option<DynamicPath>,
}

/// The result as `trued.correct/1`.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report<'a> {
    #[serde(flatten)]
    figures: &'a Figures,
    corrections: String,
    /// The error that is left compared with the tolerance; `None` without --tolerance-mm.
    tolerance: Option<Tolerance>,
    /// Result of the dynamic compensation; none without --dynamic.
    dynamic: Option<&'a PreviewReport>,
}

impl CorrectedPath {
    /// Corrects the commanded joints of `recording`.
    ///
    /// # Errors
    /// A recording without the joints of the model; a cell of another robot; a path or model that cannot be compensated in time.
    pub fn compute(
        model: &RobotModel,
        mut recording: Recording,
        request: CorrectionRequest,
        listener: Listener<'_>,
    ) -> Result<Self, Error> {
        let arm = &model.physics.arm;
        let kinds = setup::joint_kinds(arm);
        recording.check_joints(&kinds).map_err(FileError::Content)?;
        let extend = |settings| DynamicPath::extend(model, &mut recording, &kinds, settings);
        let in_time = request.dynamic.map(extend).transpose()?;
        let (mut corrections, frees_tool_axis) =
            static_corrections(model, &recording, request.cell, listener)?;
        if in_time.is_some() {
            listener(Progress::Stage("dynamic compensation"));
        }
        let dynamic = in_time.as_ref().map(|in_time| in_time.compensate(model, &mut corrections));
        let dynamic = dynamic.transpose()?;
        listener(Progress::Stage("table and figures"));
        let csv = corrections.csv(recording);
        let figures = corrections.figures(&csv);
        let few_joints = arm.count() < 6 && !frees_tool_axis;
        Ok(Self { csv, figures, dynamic, corrections, few_joints, in_time })
    }

    /// The error left compared with an allowed one, mm.
    #[must_use]
    pub fn compare_with_tolerance(&self, tolerance_mm: f64) -> Tolerance {
        self.corrections.compare_with_tolerance(tolerance_mm)
    }

    /// Whether no row keeps an error because of a limit, a hold or a rejection.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.corrections.not_exact_rows() == 0
    }

    /// As JSON; the table is written to `file`.
    #[must_use]
    pub fn report(&self, file: &Path, tolerance: Option<Tolerance>) -> Report<'_> {
        let corrections = file.display().to_string();
        Report { figures: &self.figures, corrections, tolerance, dynamic: self.dynamic.as_ref() }
    }

    /// As text; the table is written to `file`.
    #[must_use]
    pub fn text(
        &self,
        file: &Path,
        tolerance: Option<Tolerance>,
        width: Option<usize>,
    ) -> Vec<String> {
        let figures = match &self.in_time {
            Some(in_time) => self
                .figures
                .text_by_rows(width, in_time.rest_rows(), |row| in_time.row_in_file(row)),
            None => self.figures.text(width),
        };
        let mut lines = vec![figures];
        lines.extend(self.dynamic.as_ref().map(PreviewReport::text));
        lines.push(format!("corrected path      {}", file.display()));
        lines.extend(tolerance.map(|tolerance| tolerance.text()));
        let left = self.corrections.not_exact_rows();
        if left > 0 {
            lines.push(format!(
                "not fully corrected: {}; see in the corrected path the columns `left_mm`, `left_mrad`, `limited_by`",
                report::pluralise(left, "row")
            ));
        }
        // A dynamic path names the limit of each row and the option that raises it.
        if self.few_joints && self.dynamic.is_none() && !self.is_exact() {
            lines.push(FEWER_JOINTS_NOTE.to_owned());
        }
        lines
    }
}

/// The static corrections of all rows in a cell (`None`: every correction in full), and whether the tool may turn about its own axis.
///
/// # Errors
/// A cell of another robot.
pub fn static_corrections(
    model: &RobotModel,
    recording: &Recording,
    cell: Option<(String, CellConfig)>,
    listener: Listener<'_>,
) -> Result<(Corrections, bool), Error> {
    let mut cycle = cycle(model, recording, cell)?;
    let mut corrections = Corrections::new(model);
    listener(Progress::Stage("static corrections"));
    let of = recording.len();
    for (place, row) in Setpoints::new(recording, model.physics.arm.count()).enumerate() {
        if place % ROWS_PER_REPORT == 0 {
            listener(Progress::Rows { done: place, of });
        }
        let answer = cycle.answer(&row).map_err(|why| why.in_row(recording, place))?;
        let left = cycle.remaining_error(&answer);
        corrections.add(row.setpoint.joints(), &answer, left).map_err(Error::system)?;
    }
    listener(Progress::Rows { done: of, of });
    Ok((corrections, cycle.frees_tool_axis()))
}

/// The daemon's cycle in the given cell, or in that of [`cell_toml`].
fn cycle<'m>(
    model: &'m RobotModel,
    recording: &Recording,
    cell: Option<(String, CellConfig)>,
) -> Result<LockstepCycle<'m>, Error> {
    let (name, mut config) = match cell {
        Some(cell) => cell,
        None => {
            let text = cell_toml(Path::new("model.toml"), recording);
            (CELL.to_owned(), CellConfig::parse(CELL, &text).map_err(Error::system)?)
        }
    };
    let arm = &model.physics.arm;
    config.check_against(&name, &setup::joint_kinds(arm)).map_err(FileError::Content)?;
    config.mode = Mode::Full;
    if has_wrench(recording) && config.wrench.source == WrenchSource::Force {
        config.wrench.source = WrenchSource::Command;
    }
    let settings = setup::settings(&config, arm, true).map_err(Error::input)?;
    Ok(LockstepCycle::new(model, settings, SensorInputs::new(setup::wrench_source(&config))))
}
