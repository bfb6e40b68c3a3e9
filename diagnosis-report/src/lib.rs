//! Results of a diagnosis and of a calibration for people and programs: JSON, lines of text, an HTML page, and the model with what was found.
//!
//! [`calibration`] makes a calibrated model from measurements of the tool. [`diagnose`] reads what recordings of one robot say of positions and of drive torques,
//! [`DiagnosedForces`] what forces alone say. [`plan`] chooses measuring poses, [`iso9283`] reports accuracy and repeatability, [`simulation`] runs a
//! model forward on a recording. Modules of a diagnosis in the order in which to read them:
//! `diagnosed` and `forces` (which engine runs on which recordings), `result` (numbers and words), `page` (the same as a page), `entries` and `drives` (the same
//! as effects of a model file), `drawings` (pictures that several pages share).
//!
//! The same model, recordings and seed give the same bytes. Writes no file.
//!
//! ```no_run
//! use std::fs;
//! use std::path::Path;
//!
//! use diagnosis_report::{Settings, diagnose, lines};
//! use recording::model::RobotModel;
//! use recording::series::{Need, read};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = RobotModel::read(Path::new("arm.toml"))?;
//! let recording = read(Path::new("measured.csv"), None, Need::Measurement)?;
//! let found = diagnose(model, vec![recording], &Settings::default(), &mut |_| {})?;
//! for report in found.reports() {
//!     println!("{}: {}", report.verdict, diagnosis_report::lead(&report));
//!     lines(&report).iter().for_each(|line| println!("{line}"));
//! }
//! fs::write("diagnosis.json", found.json()?)?;
//! fs::write("model.toml", found.model_toml()?)?;
//! fs::write("report.html", found.page(Path::new(".")).render())?;
//! # Ok(())
//! # }
//! ```

pub mod calibration;
mod diagnosed;
pub mod drawings;
mod drives;
pub mod entries;
mod error;
mod forces;
pub mod iso9283;
mod page;
pub mod plan;
pub mod positions;
mod result;
pub mod simulation;
mod tolerance;

/// File name of the model with what was found, beside `diagnosis.json`.
pub const MODEL: &str = "model.toml";

pub use diagnosed::{Diagnosed, Settings, Stage, diagnose};
pub use error::Error;
pub use forces::DiagnosedForces;
pub use result::{Interval, Report, ReportedFinding, Size, Value, Whole, lead, lines};
pub use tolerance::{HeldOut, Tolerance};
