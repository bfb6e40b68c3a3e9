//! Results of a compensation in time for people and programs: errors of joints and tool as JSON and text.

mod learned;
mod previewed;

pub use learned::{JointReport, LearnReport, RunDynamics, WentBack};
pub use previewed::PreviewReport;

use physics::{Arm, JointKind};
use serde::Serialize;

use crate::bounds::LimitedBy;
use crate::step::CorrectionStep;
use crate::tool;

/// mm per m, mrad per rad, ms per s.
const MILLI: f64 = 1e3;

/// A joint's correction in time.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointCorrection {
    /// From 1.
    joint: usize,
    unit: &'static str,
    /// The largest dynamic correction, and the maximum and root mean square error left by the
    /// model.
    correction: f64,
    left: f64,
    left_rms: f64,
    bandwidth_hz: f64,
    /// Rows in which a limit reduced the correction.
    pub limited_rows: usize,
    /// The same by limit.
    limited: Vec<LimitCount>,
}

/// Rows in which a limit reduced a correction.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct LimitCount {
    by: LimitedBy,
    rows: usize,
    /// What to change so that it limits no more.
    remedy: &'static str,
}

/// What remains of the errors of a row, and what limited its correction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowResult {
    /// Distance of the tool from the path by the model, m.
    pub left_m: f64,
    /// Deviation of its orientation from that of the path there, rad.
    pub left_rad: f64,
    /// The limit that reduced the correction of a joint.
    pub limited_by: Option<LimitedBy>,
}

impl RowResult {
    /// Of all rows of a path whose joints shall be at `wanted` and are at `reached`, rad or m.
    #[must_use]
    pub fn of<'a>(
        arm: &Arm,
        (wanted, reached): (&[Vec<f64>], &[Vec<f64>]),
        step_s: f64,
        joints: impl Iterator<Item = &'a CorrectionStep>,
    ) -> Vec<Self> {
        let joints: Vec<&CorrectionStep> = joints.collect();
        let limit =
            |row: usize| joints.iter().find_map(|joint| joint.limited.get(row).copied().flatten());
        let errors = tool::row_errors(arm, wanted, reached, step_s).into_iter().enumerate();
        errors
            .map(|(row, (left_m, left_rad))| Self { left_m, left_rad, limited_by: limit(row) })
            .collect()
    }
}

impl JointCorrection {
    /// Of the joint `index`, from 0.
    #[must_use]
    pub fn of(index: usize, kind: JointKind, stepped: &CorrectionStep) -> Self {
        let CorrectionStep { correction, residual, bandwidth_hz, limited } = stepped;
        let unit = if kind == JointKind::Revolute { "mrad" } else { "mm" };
        Self {
            joint: index + 1,
            unit,
            correction: MILLI * largest(correction),
            left: MILLI * largest(residual),
            left_rms: MILLI * rms(residual),
            bandwidth_hz: *bandwidth_hz,
            limited_rows: stepped.limited_rows(),
            limited: limit_counts(limited),
        }
    }

    fn text(&self) -> String {
        let Self { joint, unit, correction, left, bandwidth_hz, limited_rows, .. } = self;
        let limited = match limited_rows {
            0 => String::new(),
            rows => {
                let by = |LimitCount { by, rows, remedy }: &LimitCount| {
                    format!("{} in {rows}: {remedy}", by.name())
                };
                let by: Vec<String> = self.limited.iter().map(by).collect();
                let noun = if *rows == 1 { "row" } else { "rows" };
                format!("; limited in {rows} {noun} ({})", by.join("; "))
            }
        };
        let [correction, left] = [correction, left].map(|value| digits(*value));
        format!(
            "joint {joint}: largest dynamic correction {correction} {unit}, largest remaining error {left} {unit}, bandwidth {bandwidth_hz:.0} Hz{limited}"
        )
    }
}

/// Largest and root mean square, mm.
#[derive(Debug, Clone, Copy, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Size {
    largest: f64,
    rms: f64,
}

/// Errors of the tool on a path.
#[derive(Debug, Clone, Copy, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ToolErrors {
    /// From where it shall be at that instant.
    in_time_mm: Size,
    /// From the nearest point of the path.
    from_path_mm: Size,
}

impl ToolErrors {
    /// Of joints that are at `reached` and shall be at `wanted`, rad or m, lists per joint.
    #[must_use]
    pub fn of(arm: &Arm, wanted: &[Vec<f64>], reached: &[Vec<f64>], step_s: f64) -> Self {
        let points = |joints| tool::points(arm, joints);
        let tool::ToolError { in_time, from_path } =
            tool::error(&points(wanted), &points(reached), step_s);
        let mm =
            |size: tool::Size| Size { largest: size.largest_m * MILLI, rms: size.rms_m * MILLI };
        Self { in_time_mm: mm(in_time), from_path_mm: mm(from_path) }
    }

    fn text(&self, what: &str) -> String {
        let Self { in_time_mm, from_path_mm } = self;
        let mm = [from_path_mm.largest, from_path_mm.rms, in_time_mm.largest, in_time_mm.rms];
        let [largest, rms, late, late_rms] = mm.map(digits);
        format!(
            "{what:<19} path deviation at most {largest} mm ({rms} rms), tracking error at most {late} mm ({late_rms} rms)\n"
        )
    }
}

/// Rows by limit, the most frequent one first.
fn limit_counts(limited: &[Option<LimitedBy>]) -> Vec<LimitCount> {
    let mut all: Vec<LimitedBy> = limited.iter().flatten().copied().collect();
    all.sort_unstable();
    let count =
        |same: &[LimitedBy]| LimitCount { by: same[0], rows: same.len(), remedy: same[0].remedy() };
    let mut counts: Vec<LimitCount> = all.chunk_by(|a, b| a == b).map(count).collect();
    counts.sort_by_key(|count| std::cmp::Reverse(count.rows));
    counts
}

/// A value with three significant digits; a millionth or less is 0.
fn digits(value: f64) -> String {
    let size = value.abs();
    if size < 1e-6 {
        return "0".to_owned();
    }
    let places = (2.0 - size.log10().floor()).clamp(0.0, 8.0) as usize;
    format!("{value:.places$}")
}

/// The largest absolute value.
fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// The root mean square.
fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
