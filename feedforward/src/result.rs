//! Results of a compensation in time for people and programs: errors of joints and tool as JSON and text.

mod learned;
mod previewed;

pub use learned::{JointReport, LearnReport, RunDynamics};
pub use previewed::PreviewReport;

use physics::{Arm, JointKind};
use serde::Serialize;

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
}

impl JointCorrection {
    /// Of the joint `index`, from 0.
    #[must_use]
    pub fn of(index: usize, kind: JointKind, stepped: &CorrectionStep) -> Self {
        let CorrectionStep { correction, residual, bandwidth_hz, limited_rows } = stepped;
        let unit = if kind == JointKind::Revolute { "mrad" } else { "mm" };
        Self {
            joint: index + 1,
            unit,
            correction: MILLI * largest(correction),
            left: MILLI * largest(residual),
            left_rms: MILLI * rms(residual),
            bandwidth_hz: *bandwidth_hz,
            limited_rows: *limited_rows,
        }
    }

    fn text(&self) -> String {
        let Self { joint, unit, correction, left, bandwidth_hz, limited_rows, .. } = self;
        let limited = match limited_rows {
            0 => String::new(),
            1 => "; limited in 1 row".to_owned(),
            rows => format!("; limited in {rows} rows"),
        };
        format!(
            "joint {joint}: largest dynamic correction {correction:.3} {unit}, largest remaining error {left:.3} {unit}, bandwidth {bandwidth_hz:.0} Hz{limited}"
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
        format!(
            "{what:<19} path deviation at most {:.3} mm ({:.3} rms), tracking error at most {:.3} mm ({:.3} rms)\n",
            from_path_mm.largest, from_path_mm.rms, in_time_mm.largest, in_time_mm.rms
        )
    }
}

/// The largest absolute value.
fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// The root mean square.
fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
