//! Calibration: from measurements of the tool to a model with its uncertainty, validated on held-out poses, as JSON (`trued.calibrate/1`), text, HTML
//! page and model file.
//!
//! [`calibrate`] fits three models to the training poses: the given model (nominal), with the geometry of every joint (calibrated), and with the
//! effects that the data support (advanced). It compares them on held-out poses, which are used in no fit; the advanced one is the result. Modules in
//! reading order: `split` (held-out poses), `models` (fits and held-out errors), `checks` (reasons against the result, warnings), `sweeps_and_loads`
//! (analyses of single joints and of loads), `result`, `text` and `page` (output), `model_file`.
//!
//! The same model, recordings and seed give the same bytes. Writes no file.
//!
//! ```no_run
//! use std::fs;
//! use std::path::Path;
//!
//! use diagnosis_report::calibration::{Settings, calibrate};
//! use diagnosis_report::progress::ignore;
//! use recording::model::RobotModel;
//! use recording::series::{RequiredData, read};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = RobotModel::read(Path::new("arm.toml"))?;
//! let recording = read(Path::new("tracker.csv"), None, RequiredData::Measurement)?;
//! let settings = Settings { tolerance_mm: Some(0.1), ..Settings::default() };
//! let calibrated = calibrate(model, &[recording], &settings, &ignore)?;
//! let out = calibrated.is_validated().then(|| Path::new("calibrated.toml"));
//! if let Some(out) = out {
//!     fs::write(out, calibrated.model_toml()?)?;
//! }
//! println!("{}", calibrated.text(out, None));
//! fs::write("calibration.json", calibrated.json(out)?)?;
//! fs::write("calibration.html", calibrated.page(out).render())?;
//! # Ok(())
//! # }
//! ```

mod checks;
mod fixed_objects;
mod model_file;
mod models;
mod page;
mod registered_sizes;
mod result;
mod split;
mod sweeps_and_loads;
mod text;
mod undetermined;

pub use diagnosis::single_joint::SagCorrection;
pub use models::{
    ApproachErrors, CalibrationResult, Outlier, RecordingErrors, StationErrors, calibrate,
};
pub use result::{Rejection, Report};
use serde::Serialize;
pub use sweeps_and_loads::SweepsAndLoads;

/// Names of the three models, in the order of every list of three.
pub const MODELS: [&str; 3] = ["nominal", "calibrated", "advanced"];

/// Settings of a calibration and of its validation.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Seed of the split into training and held-out poses, if no recording reserves any (`heldout`). Default 0. The model does not depend on it.
    pub seed: u64,
    /// Fraction of the poses that is drawn at random and held out, if no recording reserves any; no unit, 0.05 to 0.8. Default 0.3. Origin: a choice;
    /// the model is fitted to all poses afterwards, so that none is lost.
    pub heldout_share: f64,
    /// Gravity deflection that is removed before the axis of a swept joint is determined. Default: that of all other joints.
    pub sag: SagCorrection,
    /// Allowed error of the tool, mm; above 0. Default: none, so that no tolerance is evaluated.
    pub tolerance_mm: Option<f64>,
    /// Least number of training poses with a measured length; from 1. Default 6. Origin: a choice; as many as a measuring frame has degrees of
    /// freedom.
    pub training_poses_least: usize,
    /// Least number of measurements in training poses for a station of the instrument; from 3. Default 3. Origin: three points determine a frame.
    pub station_readings_least: usize,
    /// A joint is at rest if its positions differ by no more than this, rad or m; above 0. Default 1e-3. Origin: a choice, above the noise of
    /// encoders.
    pub rest_tolerance: f64,
    /// Number of standard deviations of its prior beyond which a parameter is reported as implausible; no unit, 1 to 10. Default 3: exceeded by
    /// chance once in 400.
    pub implausible_sigmas: f64,
    /// Condition number above which a warning is given; no unit, 1e3 to 1e15. Default 1e8: sums of products keep half of the sixteen digits of a
    /// double.
    pub condition_max: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 0,
            heldout_share: 0.3,
            sag: SagCorrection::AllOthers,
            tolerance_mm: None,
            training_poses_least: 6,
            station_readings_least: 3,
            rest_tolerance: 1e-3,
            implausible_sigmas: 3.0,
            condition_max: 1e8,
        }
    }
}

/// The held-out error of the resulting model compared with the allowed error.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Tolerance {
    /// Allowed error, mm.
    pub tolerance_mm: f64,
    /// 95 % quantile of the held-out errors, mm.
    pub p95_mm: f64,
    /// Whether it is within the tolerance.
    pub met: bool,
}

/// Converts metres to mm.
fn mm(metres: f64) -> f64 {
    metres * 1e3
}
