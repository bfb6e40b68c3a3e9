//! Calibration: from measurements of the tool to a model with its uncertainty, validated on held-out poses, as JSON (`trued.calibrate/1`), text, HTML page and
//! model file.
//!
//! [`calibrate`] fits three models to the training poses: the given model (nominal), with the geometry of every joint (calibrated), and with the effects
//! that the data support (advanced). It compares them on held-out poses, which took part in no fit; the advanced one is the result. Modules in the order in
//! which to read them: `split` (which poses are held out), `calibrated` (fits and held-out errors), `objections` (what speaks against the result),
//! `sweeps_and_loads` (analyses of single joints and of loads), `result`, `text` and `page` (output), `model_file`.
//!
//! The same model, recordings and seed give the same bytes. Writes no file.
//!
//! ```no_run
//! use std::fs;
//! use std::path::Path;
//!
//! use diagnosis_report::calibration::{Settings, calibrate};
//! use recording::model::RobotModel;
//! use recording::series::{Need, read};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = RobotModel::read(Path::new("arm.toml"))?;
//! let recording = read(Path::new("tracker.csv"), None, Need::Measurement)?;
//! let settings = Settings { tolerance_mm: Some(0.1), ..Settings::default() };
//! let calibrated = calibrate(model, &[recording], &settings, &mut |_| {})?;
//! let out = calibrated.is_proven().then(|| Path::new("calibrated.toml"));
//! if let Some(out) = out {
//!     fs::write(out, calibrated.model_toml()?)?;
//! }
//! println!("{}", calibrated.text(out, None));
//! fs::write("calibration.json", calibrated.json(out)?)?;
//! fs::write("calibration.html", calibrated.page(out).render())?;
//! # Ok(())
//! # }
//! ```

mod around;
mod calibrated;
mod model_file;
mod objections;
mod page;
mod result;
mod split;
mod sweeps_and_loads;
mod text;
mod undetermined;

pub use calibrated::{Approached, Calibrated, OfRecording, Outlier, Stationed, calibrate};
pub use diagnosis::single_joint::Sag;
pub use result::{Refused, Report};
use serde::Serialize;
pub use sweeps_and_loads::SweepsAndLoads;

/// Names of the three models, in the order of every list of three.
pub const MODELS: [&str; 3] = ["nominal", "calibrated", "advanced"];

/// How a calibration is made and judged.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Of the split into training and held-out poses, where no recording keeps any (`heldout`). Default 0. The model does not depend on it.
    pub seed: u64,
    /// Share of the poses that is drawn at random and held out, where no recording keeps any; no unit, 0.05 to 0.8. Default 0.3. Origin: a choice; the model is
    /// fitted to all poses afterwards, so that none is lost.
    pub heldout_share: f64,
    /// What of the sag of the other joints is taken out before the axis of a joint that moves alone is determined. Default: that of all others.
    pub sag: Sag,
    /// Error of the tool that is allowed, mm; above 0. Default: none, which judges nothing.
    pub tolerance_mm: Option<f64>,
    /// Least number of training poses with a measured length; from 1. Default 6. Origin: a choice; as many as a measuring frame has degrees of freedom.
    pub training_poses_least: usize,
    /// Readings in training poses that place a station of the instrument; from 3. Default 3. Origin: three points determine a frame.
    pub station_readings_least: usize,
    /// A joint is at rest if its positions differ by no more than this, rad or m; above 0. Default 1e-3. Origin: a choice, above the noise of encoders.
    pub still: f64,
    /// A parameter is reported as implausible beyond this many standard deviations of its prior; no unit, 1 to 10. Default 3: exceeded by chance once in 400.
    pub implausible_sigmas: f64,
    /// Condition number above which a warning is given; no unit, 1e3 to 1e15. Default 1e8: sums of products keep half of the sixteen digits of a double.
    pub condition_max: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 0,
            heldout_share: 0.3,
            sag: Sag::AllOthers,
            tolerance_mm: None,
            training_poses_least: 6,
            station_readings_least: 3,
            still: 1e-3,
            implausible_sigmas: 3.0,
            condition_max: 1e8,
        }
    }
}

/// The held-out error of the new model against the error that is allowed.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Tolerance {
    /// What is allowed.
    pub tolerance_mm: f64,
    /// What 95 of 100 held-out errors stay within.
    pub p95_mm: f64,
    /// Whether that is no more.
    pub met: bool,
}

/// Metres in mm.
fn mm(metres: f64) -> f64 {
    metres * 1e3
}
