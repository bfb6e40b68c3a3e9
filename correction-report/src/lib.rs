//! Corrections of a recording for people and programs: row by row without a daemon, or by a daemon of its own, as table, JSON and text.
//!
//! Modules in the order in which to read them: `setpoints` (a recording as setpoints of the robot's loop), `lockstep` (the daemon's cycle without shared
//! memory), `corrections` (all answers as a table and as figures), [`path`] (a corrected path, `trued.correct/1`), [`in_time`] (dynamic compensation of the whole
//! path), [`replay`] (the same over shared memory, `trued.replay/1`), with `own_daemon`.
//!
//! The same recording, model and cell give the same bits, with a daemon and without. Writes no file.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use correction_report::path::{CorrectedPath, Request};
//! use recording::model::RobotModel;
//! use recording::series::{self, Need};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = RobotModel::read(Path::new("arm.toml"))?;
//! let recording = series::read(Path::new("path.csv"), None, Need::Path)?;
//! let corrected = CorrectedPath::of(&model, recording, Request::default())?;
//! println!("{}", corrected.figures.text(None));
//! std::fs::write("path.corrected.csv", &corrected.csv)?;
//! # Ok(())
//! # }
//! ```

mod corrections;
mod error;
pub mod in_time;
mod lockstep;
mod own_daemon;
pub mod path;
pub mod replay;
mod setpoints;

pub use corrections::{Corrections, Figures, Tolerance};
pub use error::Error;
