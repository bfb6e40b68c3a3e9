//! Corrections of a recording, row by row: as a table, and as figures.
//!
//! Promises: one row per command, the recording's columns first; the same answers give the same bytes.

use std::collections::BTreeMap;
use std::fmt;

use corrector::Residual;
use daemon::setup;
use feedforward::bounds::LimitedBy;
use feedforward::result::RowResult;
use physics::JointKind;
use recording::files::content_hash;
use recording::model::RobotModel;
use recording::series::Recording;
use recording::unit::Unit;
use report::{TextTable, pluralise, significant};
use serde::Serialize;
use shm_schema::{Corrected, CorrectionStatus, Reason, UnknownCode};

/// The answers to all rows.
#[derive(Debug)]
pub struct Corrections {
    kinds: Vec<JointKind>,
    /// One list per joint; NaN in rows without a target.
    q: Vec<Vec<f64>>,
    status: Vec<CorrectionStatus>,
    /// The tool error left with the published joints, m and rad; NaN if unknown.
    left_m: Vec<f64>,
    left_rad: Vec<f64>,
    limited_by: Vec<Option<LimitName>>,
    figures: Figures,
}

/// What limited a row.
#[derive(Debug, Clone, Copy, PartialEq)]
enum LimitName {
    /// The static correction.
    Static(Reason),
    /// The dynamic one.
    Dynamic(LimitedBy),
}

impl fmt::Display for LimitName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Static(reason) => reason.fmt(f),
            Self::Dynamic(by) => f.write_str(by.name()),
        }
    }
}

/// Figures computed from the answers.
#[derive(Debug, Clone, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Figures {
    model: ModelName,
    pub(crate) rows: usize,
    /// Rows by status.
    statuses: BTreeMap<String, usize>,
    /// Why rows are not simply corrected.
    reasons: Vec<ReasonCount>,
    /// Of revolute and of prismatic joints, where there are any.
    largest_correction: Vec<LargestCorrection>,
    /// Tool error left with the published correction, by the model; rows where it is unknown are
    /// omitted. `None` if it is unknown in all rows.
    largest_left: Option<RemainingError>,
    /// Rows whose tool error is unknown: they were rejected, or an effect is beyond its validity
    /// range.
    unknown_rows: usize,
    /// Rows that are limited, held or rejected, or whose solve failed: they keep some tool error.
    not_exact_rows: usize,
    /// Of the table that is written with `--out` or `--corrections`.
    corrections_hash: String,
}

#[derive(Debug, Clone, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ModelName {
    name: String,
    hash: String,
    /// Maker, type and serial number as far as the model states them.
    robot: String,
    /// Hash of the nominal geometry.
    geometry: String,
}

#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ReasonCount {
    status: String,
    reason: String,
    rows: usize,
    /// From 1.
    first_row: usize,
}

#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct LargestCorrection {
    value: f64,
    unit: &'static str,
    /// From 1.
    joint: usize,
    /// From 1.
    row: usize,
}

/// The largest tool error left; rows from 1.
#[derive(Debug, Clone, Copy, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct RemainingError {
    mm: f64,
    mm_row: usize,
    mrad: f64,
    mrad_row: usize,
}

/// The tool errors left compared with the allowed error.
#[derive(Debug, Clone, Copy, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Tolerance {
    /// Allowed error of the tool's position.
    pub tolerance_mm: f64,
    /// The largest error left, if it is known in any row.
    pub largest_mm: Option<f64>,
    /// Rows with a larger or unknown error.
    pub rows_beyond: usize,
    /// Whether there is no such row.
    pub met: bool,
}

impl Corrections {
    /// No answers yet.
    pub(crate) fn new(model: &RobotModel) -> Self {
        let kinds = setup::joint_kinds(&model.physics.arm);
        let name = ModelName {
            name: model.file.name.clone(),
            hash: hex(model.hash),
            robot: model.file.robot.to_string(),
            geometry: model.file.identity().geometry(),
        };
        let q = vec![Vec::new(); kinds.len()];
        let figures = Figures { model: name, ..Figures::default() };
        let (status, left_m, left_rad) = (Vec::new(), Vec::new(), Vec::new());
        Self { kinds, q, status, left_m, left_rad, limited_by: Vec::new(), figures }
    }

    /// Adds the answer to the next row, whose commanded joints are `q_cmd`, and the tool error left
    /// with it.
    ///
    /// # Errors
    /// A status or reason of a later version.
    pub(crate) fn add(
        &mut self,
        q_cmd: &[f64],
        answer: &Corrected,
        left: Option<Residual>,
    ) -> Result<(), UnknownCode> {
        let (status, reason) = (answer.status()?, answer.reason()?);
        for (list, q) in self.q.iter_mut().zip(answer.added_to(q_cmd)) {
            list.push(q);
        }
        self.status.push(status);
        self.left_m.push(left.map_or(f64::NAN, |left| left.m));
        self.left_rad.push(left.map_or(f64::NAN, |left| left.rad));
        let is_limited = status == CorrectionStatus::Limited;
        self.limited_by.push(is_limited.then_some(LimitName::Static(reason)));
        self.figures.add(answer, status, reason, &self.kinds);
        self.figures.add_remaining_error(left);
        Ok(())
    }

    /// The recording's columns, the corrected joints (`c1_deg` …, `c1_mm` for prismatic) and the status, as CSV.
    #[must_use]
    pub fn csv(&self, mut recording: Recording) -> Vec<u8> {
        let mut columns = Vec::new();
        for (joint, (kind, q)) in self.kinds.iter().zip(&self.q).enumerate() {
            let unit = if *kind == JointKind::Revolute { "deg" } else { "mm" };
            let in_unit = |q: f64| Unit::from_name(unit).map_or(q, |unit| unit.from_si(q));
            let text =
                |q: &f64| if q.is_nan() { String::new() } else { format!("{:?}", in_unit(*q)) };
            columns.push((format!("c{}_{unit}", joint + 1), q.iter().map(text).collect()));
        }
        let statuses = self.status.iter().map(ToString::to_string).collect();
        columns.push(("status".to_owned(), statuses));
        for (name, left) in [("left_mm", &self.left_m), ("left_mrad", &self.left_rad)] {
            let text = |x: &f64| if x.is_nan() { String::new() } else { format!("{:.6}", x * 1e3) };
            columns.push((name.to_owned(), left.iter().map(text).collect()));
        }
        let reasons =
            self.limited_by.iter().map(|by| by.map_or_else(String::new, |by| by.to_string()));
        columns.push(("limited_by".to_owned(), reasons.collect()));
        // Columns of an earlier correction in the recording are replaced.
        recording.other.retain(|(name, _)| columns.iter().all(|(ours, _)| ours != name));
        recording.other.extend(columns);
        recording.to_csv()
    }

    /// The corrected joints, one list per joint, rad or m; NaN in rows without a target.
    pub(crate) fn joints(&self) -> &[Vec<f64>] {
        &self.q
    }

    /// Puts other joints in their place, those that are commanded so that the arm is there in time, with what
    /// they leave of the errors: row by row it adds to the error of the static correction.
    pub fn compensate(&mut self, q: Vec<Vec<f64>>, rows: &[RowResult]) {
        self.q = q;
        for (row, result) in rows.iter().enumerate().take(self.status.len()) {
            self.left_m[row] += result.left_m;
            self.left_rad[row] += result.left_rad;
            if let Some(by) = result.limited_by {
                self.limit(row, by);
            }
        }
        self.figures.largest_left = self.largest_left();
    }

    /// A limit reduced the dynamic correction of a row, from 0.
    fn limit(&mut self, row: usize, by: LimitedBy) {
        let before = self.status[row];
        if ![CorrectionStatus::Corrected, CorrectionStatus::Ramping].contains(&before) {
            return;
        }
        let limited = CorrectionStatus::Limited;
        self.status[row] = limited;
        self.limited_by[row] = Some(LimitName::Dynamic(by));
        let figures = &mut self.figures;
        if let Some(rows) = figures.statuses.get_mut(&before.to_string()) {
            *rows -= 1;
        }
        figures.statuses.retain(|_, rows| *rows > 0);
        *figures.statuses.entry(limited.to_string()).or_default() += 1;
        figures.not_exact_rows += 1;
        figures.count_reason(limited.to_string(), by.name().to_owned(), row + 1);
    }

    /// The largest tool errors left.
    fn largest_left(&self) -> Option<RemainingError> {
        let largest = |left: &[f64]| {
            let known = left.iter().enumerate().filter(|(_, left)| !left.is_nan());
            let (row, left) = known.max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0)))?;
            Some((left * 1e3, row + 1))
        };
        let ((mm, mm_row), (mrad, mrad_row)) =
            largest(&self.left_m).zip(largest(&self.left_rad))?;
        Some(RemainingError { mm, mm_row, mrad, mrad_row })
    }

    /// Number of rows whose tool error is not fully corrected.
    pub(crate) fn not_exact_rows(&self) -> usize {
        self.figures.not_exact_rows
    }

    /// The error left compared with the allowed one, mm.
    pub(crate) fn compare_with_tolerance(&self, tolerance_mm: f64) -> Tolerance {
        let beyond = |left_m: &&f64| left_m.is_nan() || **left_m * 1e3 > tolerance_mm;
        let rows_beyond = self.left_m.iter().filter(beyond).count();
        let largest_mm = self.figures.largest_left.map(|left| left.mm);
        Tolerance { tolerance_mm, largest_mm, rows_beyond, met: rows_beyond == 0 }
    }

    /// The figures, with the hash of the table.
    pub(crate) fn figures(&self, csv: &[u8]) -> Figures {
        let mut figures = self.figures.clone();
        figures.corrections_hash = hex(content_hash(csv));
        figures
    }
}

impl Figures {
    fn add(
        &mut self,
        answer: &Corrected,
        status: CorrectionStatus,
        reason: Reason,
        kinds: &[JointKind],
    ) {
        self.rows += 1;
        let exact = [CorrectionStatus::Corrected, CorrectionStatus::Ramping].contains(&status);
        self.not_exact_rows += usize::from(!exact || reason == Reason::NotConverged);
        *self.statuses.entry(status.to_string()).or_default() += 1;
        if reason != Reason::None {
            self.count_reason(status.to_string(), reason.to_string(), self.rows);
        }
        for (joint, kind) in kinds.iter().enumerate() {
            let unit = if *kind == JointKind::Revolute { "mrad" } else { "mm" };
            self.update_largest_correction(answer.correction[joint].abs() * 1e3, unit, joint + 1);
        }
    }

    /// Adds the tool error left in the last row.
    fn add_remaining_error(&mut self, left: Option<Residual>) {
        let Some(left) = left else {
            self.unknown_rows += 1;
            return;
        };
        let (mm, mrad, row) = (left.m * 1e3, left.rad * 1e3, self.rows);
        let largest = self.largest_left.get_or_insert(RemainingError {
            mm,
            mm_row: row,
            mrad,
            mrad_row: row,
        });
        if mm > largest.mm {
            (largest.mm, largest.mm_row) = (mm, row);
        }
        if mrad > largest.mrad {
            (largest.mrad, largest.mrad_row) = (mrad, row);
        }
    }

    fn count_reason(&mut self, status: String, reason: String, row: usize) {
        let same = |known: &&mut ReasonCount| known.status == status && known.reason == reason;
        match self.reasons.iter_mut().find(same) {
            Some(known) => known.rows += 1,
            None => {
                self.reasons.push(ReasonCount { status, reason, rows: 1, first_row: row });
            }
        }
    }

    fn update_largest_correction(&mut self, value: f64, unit: &'static str, joint: usize) {
        let largest = LargestCorrection { value, unit, joint, row: self.rows };
        match self.largest_correction.iter_mut().find(|known| known.unit == unit) {
            Some(known) if known.value >= value => {}
            Some(known) => *known = largest,
            None => self.largest_correction.push(largest),
        }
    }

    /// A summary for the user, its table at most `width` characters wide.
    #[must_use]
    pub fn text(&self, width: Option<usize>) -> String {
        self.text_by_rows(width, 0, |row| row)
    }

    /// The same where `rest_rows` of the rows were added by a compensation in time; `row_in_file` gives the
    /// row of the user's file for each.
    pub(crate) fn text_by_rows(
        &self,
        width: Option<usize>,
        rest_rows: usize,
        row_in_file: impl Fn(usize) -> usize,
    ) -> String {
        let mut table = TextTable::new(["status", "rows", "share"]);
        for (status, rows) in &self.statuses {
            let share = 100.0 * *rows as f64 / self.rows.max(1) as f64;
            table = table.row([status.clone(), rows.to_string(), format!("{share:.1} %")]);
        }
        let rest = match rest_rows {
            0 => String::new(),
            rows => format!(", {rows} of them added at standstill; rows are those of the file"),
        };
        let mut text = format!(
            "{}, {}{rest}\n\n{}\n",
            self.model.name,
            pluralise(self.rows, "row"),
            table.render(width)
        );
        for ReasonCount { status, reason, rows, first_row } in &self.reasons {
            let first_row = row_in_file(*first_row);
            text += &format!(
                "{status} for {reason}: {}, the first is row {first_row}\n",
                pluralise(*rows, "row")
            );
        }
        for LargestCorrection { value, unit, joint, row } in &self.largest_correction {
            let row = row_in_file(*row);
            text += &format!(
                "largest correction  {} {unit} (joint {joint}, row {row})\n",
                significant(*value, 3)
            );
        }
        let Some(RemainingError { mm, mm_row, mrad, mrad_row }) = self.largest_left else {
            return text + "largest error left  unknown for all rows";
        };
        let [mm_row, mrad_row] = [mm_row, mrad_row].map(row_in_file);
        let [mm, mrad] =
            [(mm, FINEST_MM), (mrad, FINEST_MRAD)].map(|(value, finest)| remaining(value, finest));
        text += &format!("largest error left  {mm} mm (row {mm_row}), ");
        text += &format!("{mrad} mrad (row {mrad_row}), by the model");
        if self.unknown_rows > 0 {
            text += &format!(", unknown for {}", pluralise(self.unknown_rows, "row"));
        }
        text
    }
}

impl Tolerance {
    /// The verdict.
    #[must_use]
    pub fn text(&self) -> String {
        let Self { tolerance_mm, rows_beyond, met, .. } = self;
        if *met {
            return format!("tolerance           {tolerance_mm} mm met in every row");
        }
        let rows = pluralise(*rows_beyond, "row");
        format!(
            "tolerance           {tolerance_mm} mm not met: {rows} with a larger or unknown remaining error; see the column `left_mm`"
        )
    }
}

/// Remaining errors below this are written as 0, mm and mrad. Origin: a choice, a thousandth of what any instrument resolves.
const FINEST_MM: f64 = 1e-6;
const FINEST_MRAD: f64 = 1e-6;

/// A remaining error of three significant digits; below `finest` it is 0.
fn remaining(value: f64, finest: f64) -> String {
    if value < finest { "0".to_owned() } else { significant(value, 3) }
}

fn hex(hash: u64) -> String {
    format!("{hash:016x}")
}
