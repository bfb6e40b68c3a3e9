//! Results of a diagnosis and of a calibration for people and programs: JSON, lines of text, an HTML page, and the resulting model.
//!
//! [`calibration`] makes a calibrated model from measurements of the tool. [`diagnose`] diagnoses positions and drive torques of one robot,
//! [`ForceDiagnosis`] forces without a robot. [`plan`] chooses measuring poses, [`iso9283`] reports accuracy and repeatability, [`simulation`] runs
//! a model forward on a recording. Modules of a diagnosis in reading order: `robot` and `forces` (selection of the diagnosis), `result` (values
//! and sentences), `page` (HTML), `entries` and `drives` (effects of a model file), `drawings` (figures shared by pages).
//!
//! The same model, recordings and seed give the same bytes. Writes no file.
//!
//! ```no_run
//! use std::fs;
//! use std::path::Path;
//!
//! use diagnosis_report::progress::ignore;
//! use diagnosis_report::{Settings, diagnose, lines};
//! use recording::model::RobotModel;
//! use recording::series::{RequiredData, read};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = RobotModel::read(Path::new("arm.toml"))?;
//! let recording = read(Path::new("measured.csv"), None, RequiredData::Measurement)?;
//! let found = diagnose(model, vec![recording], &Settings::default(), &ignore)?;
//! for report in found.reports() {
//!     println!("{}: {}", report.verdict, diagnosis_report::summary(&report));
//!     lines(&report).iter().for_each(|line| println!("{line}"));
//! }
//! fs::write("diagnosis.json", found.json()?)?;
//! fs::write("model.toml", found.model_toml()?)?;
//! fs::write("report.html", found.page(Path::new(".")).render())?;
//! # Ok(())
//! # }
//! ```

pub mod calibration;
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
mod robot;
pub mod simulation;
mod tolerance;

/// File name of a diagnosis as JSON.
pub const JSON: &str = "diagnosis.json";

/// File name of its page.
pub const PAGE: &str = "report.html";

/// File name of the resulting model, next to `diagnosis.json`.
pub const MODEL: &str = "model.toml";

pub use diagnosis::progress;
pub use error::Error;
pub use forces::ForceDiagnosis;
pub use result::{DiagnosisJson, Interval, Report, ReportedFinding, Size, Value, lines, summary};
pub use robot::{RobotDiagnosis, Settings, diagnose};
pub use tolerance::{HeldOut, Tolerance};
