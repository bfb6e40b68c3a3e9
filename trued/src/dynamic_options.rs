//! Options of a compensation in time.

use clap::Args;
use feedforward::Settings;

use crate::exit::Failure;
use crate::options::in_unit;

/// The unit of the limits, rad.
const MRAD: f64 = 1e-3;

/// The options of [`InTime`].
pub(crate) const IN_TIME: [&str; 5] =
    ["bandwidth_hz", "robust_to", "max_mrad", "max_rate_mrad_s", "max_jerk_mrad_s3"];

/// Bandwidth, robustness and limits of dynamic compensation.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Dynamic compensation")]
pub(crate) struct InTime {
    /// Bandwidth of the dynamic compensation, Hz, 1 to 100
    #[arg(long, value_name = "HZ", default_value_t = Settings::BANDWIDTH_HZ)]
    bandwidth_hz: f64,
    /// Relative error of the model's delay, lags, frequencies and damping that must not make the path worse, 0 to 0.5
    #[arg(long, value_name = "SHARE", default_value_t = Settings::ROBUST_TO)]
    robust_to: f64,
    /// Largest dynamic correction of a joint, mrad (mm for a linear axis); at speed it is many times the static correction
    #[arg(long, value_name = "MRAD", default_value_t = in_unit(Settings::LIMITS[0], MRAD), value_parser = positive, allow_negative_numbers = true)]
    max_mrad: f64,
    /// Largest rate of the dynamic correction, mrad/s (mm/s)
    #[arg(long, value_name = "MRAD/S", default_value_t = in_unit(Settings::LIMITS[1], MRAD), value_parser = positive, allow_negative_numbers = true)]
    max_rate_mrad_s: f64,
    /// Largest jerk of the dynamic correction, mrad/s³ (mm/s³)
    #[arg(long, value_name = "MRAD/S3", default_value_t = in_unit(Settings::LIMITS[2], MRAD), value_parser = positive, allow_negative_numbers = true)]
    max_jerk_mrad_s3: f64,
}

/// A limit in the unit of its option.
fn positive(text: &str) -> Result<f64, String> {
    let limit: f64 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    if limit.is_finite() && limit > 0.0 {
        Ok(limit)
    } else {
        Err(format!("{text} is out of range, expected a finite number above 0"))
    }
}

impl InTime {
    /// The same in SI, checked.
    pub(crate) fn settings(&self) -> Result<Settings, Failure> {
        let [position, rate, jerk] =
            [self.max_mrad, self.max_rate_mrad_s, self.max_jerk_mrad_s3].map(|limit| limit * MRAD);
        let limited = Settings::with_limits(position, rate, jerk).map_err(Failure::input)?;
        let Self { bandwidth_hz, robust_to, .. } = *self;
        let settings = Settings { bandwidth_hz, robust_to, ..limited };
        settings.check().map_err(Failure::input)?;
        Ok(settings)
    }
}
