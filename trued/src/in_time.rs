//! Common parts of dynamic compensation: options, and errors of joints and tool as text and JSON.

use clap::Args;
use feedforward::step::Stepped;
use feedforward::{FeedforwardError, Settings, tool};
use joint_dynamics::plant::Plants;
use physics::JointKind;
use serde::Serialize;

use crate::corrections::Corrections;
use crate::exit::Failure;
use crate::input::Input;

/// How far a compensation in time goes.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Compensation in time")]
pub(crate) struct InTime {
    /// The band in which errors in time are compensated, Hz, 1 to 100
    #[arg(long, value_name = "HZ", default_value_t = 40.0)]
    bandwidth_hz: f64,
    /// Share by which delay, lags, frequencies and damping of the model may be off without the path becoming worse, 0 to 0.5
    #[arg(long, value_name = "SHARE", default_value_t = 0.3)]
    robust_to: f64,
    /// Largest correction in time, mrad (mm of a slide): at speed it is many times that of a static error
    #[arg(long, value_name = "MRAD", default_value_t = 200.0)]
    max_mrad: f64,
    /// Its largest rate, mrad/s (mm/s)
    #[arg(long, value_name = "MRAD/S", default_value_t = 1e3)]
    max_rate_mrad_s: f64,
    /// Its largest jerk, mrad/s³ (mm/s³)
    #[arg(long, value_name = "MRAD/S3", default_value_t = 5e6)]
    max_jerk_mrad_s3: f64,
}

impl InTime {
    /// The same in SI, checked.
    pub(crate) fn settings(&self) -> Result<Settings, Failure> {
        let [position, rate, jerk] =
            [self.max_mrad, self.max_rate_mrad_s, self.max_jerk_mrad_s3].map(|limit| limit * 1e-3);
        let limited = Settings::with_limits(position, rate, jerk).map_err(Failure::input)?;
        let Self { bandwidth_hz, robust_to, .. } = *self;
        let settings = Settings { bandwidth_hz, robust_to, ..limited };
        settings.check().map_err(Failure::input)?;
        Ok(settings)
    }
}

/// The dynamics of a model's joints; reports what is not compensated.
pub(crate) fn plants(input: &Input, settings: &Settings) -> Result<Plants, Failure> {
    let plants = Plants::of(&input.model, settings.unstated);
    if plants.is_empty() {
        return Err(Failure::input(FeedforwardError::NothingInTime));
    }
    Ok(plants)
}

/// The joint positions with the static correction.
pub(crate) fn settled(corrections: &Corrections) -> Result<Vec<Vec<f64>>, Failure> {
    let joints = corrections.joints();
    let lacking = joints.iter().find_map(|joint| joint.iter().position(|q| !q.is_finite()));
    match lacking {
        None => Ok(joints.to_vec()),
        Some(row) => Err(Failure::input(format!(
            "row {}: was rejected, so that there is nothing to command there; `trued correct` without --dynamic says why",
            row + 1
        ))),
    }
}

/// A joint's correction in time.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct OfJoint {
    /// From 1.
    joint: usize,
    unit: &'static str,
    /// The largest dynamic correction, and the maximum and root mean square error left by the
    /// model.
    correction: f64,
    left: f64,
    left_rms: f64,
    bandwidth_hz: f64,
    pub(crate) limited_rows: usize,
}

impl OfJoint {
    pub(crate) fn of(at: usize, kind: JointKind, stepped: &Stepped) -> Self {
        let Stepped { correction, left, bandwidth_hz, limited_rows } = stepped;
        let unit = if kind == JointKind::Revolute { "mrad" } else { "mm" };
        Self {
            joint: at + 1,
            unit,
            correction: 1e3 * largest(correction),
            left: 1e3 * largest(left),
            left_rms: 1e3 * rms(left),
            bandwidth_hz: *bandwidth_hz,
            limited_rows: *limited_rows,
        }
    }

    pub(crate) fn told(&self) -> String {
        let Self { joint, unit, correction, left, bandwidth_hz, limited_rows, .. } = self;
        let held = match limited_rows {
            0 => String::new(),
            rows => format!("; held back by its limits in {rows} rows"),
        };
        format!(
            "joint {joint}: in time up to {correction:.3} {unit}, {left:.3} {unit} left at most, band {bandwidth_hz:.0} Hz{held}\n"
        )
    }
}

/// Largest and root mean square, mm.
#[derive(Debug, Clone, Copy, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct Size {
    largest: f64,
    rms: f64,
}

/// Errors of the tool on a path.
#[derive(Debug, Clone, Copy, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct OfTool {
    /// From where it shall be at that instant.
    in_time_mm: Size,
    /// From the nearest point of the path.
    from_path_mm: Size,
}

impl OfTool {
    /// Of joints that are at `reached` and shall be at `wanted`.
    pub(crate) fn of(
        input: &Input,
        wanted: &[Vec<f64>],
        reached: &[Vec<f64>],
        step_s: f64,
    ) -> Self {
        let points = |joints| tool::points(&input.model.physics.arm, joints);
        let tool::ToolError { in_time, from_path } =
            tool::error(&points(wanted), &points(reached), step_s);
        let mm = |size: tool::Size| Size { largest: size.largest_m * 1e3, rms: size.rms_m * 1e3 };
        Self { in_time_mm: mm(in_time), from_path_mm: mm(from_path) }
    }

    pub(crate) fn told(&self, what: &str) -> String {
        let Self { in_time_mm, from_path_mm } = self;
        format!(
            "{what:<19} from the path {:.3} mm at most ({:.3} rms), at its time {:.3} mm ({:.3} rms)\n",
            from_path_mm.largest, from_path_mm.rms, in_time_mm.largest, in_time_mm.rms
        )
    }
}

/// The largest absolute value.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// The root mean square.
pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
