//! Impact (tap) tests: natural frequencies with damping, modal mass and stiffness, as JSON (`trued.tap/1`), text, HTML page and the modal list of a model.
//!
//! [`read`] takes the force of an instrumented hammer and the response from files, or response functions that were measured elsewhere; [`analyse`] finds hits,
//! estimates the response function and fits the modes. Modules in the order in which to read them: `input` (files to SI), `analysis` (modes and warnings),
//! `model_file` (the modal list of a model), `result`, `text` and `page`.
//!
//! ```no_run
//! use std::fs;
//! use std::path::Path;
//!
//! use recording::model::RobotModel;
//! use spectrum_report::tap::{Channels, Settings, analyse, read};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let source = read(&["hits.csv"], &Channels::default())?;
//! let analysis = analyse(source, &Settings::default())?;
//! for mode in analysis.modes.iter().filter(|mode| analysis.is_verified(mode)) {
//!     println!("{:.1} Hz, damping {:.2} %", mode.frequency_hz, 100.0 * mode.damping);
//! }
//! let base = RobotModel::read(Path::new("arm.toml"))?;
//! let updated = analysis.updated_model(&base, Path::new("arm-modes.toml"))?;
//! fs::write(&updated.path, &updated.text)?;
//! println!("{}", analysis.text(Some(&updated), None));
//! fs::write("tap.json", analysis.json(Some(&updated))?)?;
//! fs::write("tap.html", analysis.page(Some(&updated)).render())?;
//! # Ok(())
//! # }
//! ```

mod analysis;
mod input;
mod model_file;
mod page;
mod result;
mod text;

pub use analysis::{Analysis, Function, Test, analyse};
pub use input::{Channels, HitRecord, Hits, MeasuredFunction, Source, read};
pub use model_file::UpdatedModel;
pub use result::Report;
use spectrum::frf::Estimator;
use spectrum::modal::COHERENCE_MIN;

/// How an impact test is analysed.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Which noise averages out. Default: that on the response.
    pub estimator: Estimator,
    /// Least coherence of a verified mode; no unit, 0 to 1. Default 0.75 ([`COHERENCE_MIN`]).
    pub coherence_least: f64,
    /// Modes are searched between these frequencies, Hz; the lower first. Default: none, which is
    /// the range excited by the hammer.
    pub band_hz: Option<[f64; 2]>,
    /// Length of the record of each hit, s; above 0. Default: none, which is as long as the hits allow.
    pub block_s: Option<f64>,
    /// Whether the force is zero outside the contact, and the response has an exponential window where it has not decayed. Default: yes.
    pub windows: bool,
    /// Direction of hit and response in the base frame, of unit length, for the model. Default: none.
    pub direction: Option<[f64; 3]>,
    /// Modes are searched up to the frequency at which the force of the hammer has fallen by this
    /// much below its largest, dB; above 0. Default 40. Origin: a choice; below, noise of the force
    /// sensor dominates.
    pub excited_db: f64,
    /// A mode at which the force is below this, dB relative to its largest, is reported as weakly
    /// excited; below 0. Default -20. Origin: the usual requirement on a hammer's tip.
    pub weak_db: f64,
    /// Bins of the spectrum that are ignored at its lower end, unless the band is given. Default 5.
    /// Origin: a choice; the first bins contain the drift of the sensor.
    pub bins_below: usize,
    /// Largest relative difference of the damping between fit and half-power width, in addition to
    /// two standard uncertainties; no unit, above 0. Default 0.25. Origin: a choice.
    pub damping_disagrees: f64,
    /// A mode with more than this share of its vibration left at the next hit is reported; no unit,
    /// 0 to 1. Default 0.05. Origin: a choice; the relative error of its modal mass is the same.
    pub carried_most: f64,
    /// The proposed pause between hits lets a mode decay to this share; no unit, 0 to 1. Default
    /// 0.01. Origin: a choice; a fifth of the value that is reported.
    pub rung_down: f64,
    /// A fit with a larger relative residual of a peak may hide a second mode; no unit, 0 to 1.
    /// Default 0.06. Origin: two modes 3 Hz apart at 67 Hz with 3 % damping and 2 % noise, fitted
    /// as one, leave 0.08.
    pub misfit: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            estimator: Estimator::H1,
            coherence_least: COHERENCE_MIN,
            band_hz: None,
            block_s: None,
            windows: true,
            direction: None,
            excited_db: 40.0,
            weak_db: -20.0,
            bins_below: 5,
            damping_disagrees: 0.25,
            carried_most: 0.05,
            rung_down: 0.01,
            misfit: 0.06,
        }
    }
}
