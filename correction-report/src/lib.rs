//! Corrections of a recording for people and programs: row by row without a daemon, or by a daemon of its own, as table, JSON and text.
//!
//! Modules in the order in which to read them: `setpoints` (a recording as setpoints of the robot's loop), `lockstep` (the daemon's cycle without shared
//! memory), `corrections` (all answers as a table and as figures), [`path`] (a corrected path, `trued.correct/1`), [`dynamic`] (dynamic compensation of the whole
//! path), [`replay`] (the same over shared memory, `trued.replay/1`), with `private_daemon`.
//!
//! The same recording, model and cell give the same bits, with a daemon and without. Writes no file.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use correction_report::path::{CorrectedPath, CorrectionRequest, ignore};
//! use recording::model::RobotModel;
//! use recording::series::{self, RequiredData};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = RobotModel::read(Path::new("arm.toml"))?;
//! let recording = series::read(Path::new("path.csv"), None, RequiredData::Path)?;
//! let corrected = CorrectedPath::compute(&model, recording, CorrectionRequest::default(), &ignore)?;
//! println!("{}", corrected.figures.text(None));
//! std::fs::write("path.corrected.csv", &corrected.csv)?;
//! # Ok(())
//! # }
//! ```

mod corrections;
pub mod dynamic;
mod error;
mod lockstep;
pub mod path;
mod private_daemon;
pub mod replay;
mod setpoints;

pub use corrections::{Corrections, Figures, Tolerance};
pub use error::Error;
