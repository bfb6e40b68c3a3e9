//! The demonstration: a simulated robot mills without and with correction, is measured and diagnosed, and mills again with the model that results.
//!
//! Two processes beside the caller's: the daemon, and the cell with the simulated robot ([`run_cell`]). [`Demo::run`] starts both, diagnoses the cell's
//! measurements, loads the model into the running daemon, and only then reveals the hidden effect; a wrong name is reported as wrong. Modules in the order in
//! which to read them: `scene` (model, true robot, hidden effect, path), `cell` (the loop at 1 kHz), `log` and `measure` (what is recorded of it), `standstill` (the
//! change of model, as the cell sees it), `run` (both processes), `diagnosis`, `outcome` (`trued.demo/1`), `text`, `page`.
//!
//! Everything is drawn by seed except latencies, and what depends on them. Writes its files to one folder, each of them complete or not at all.
//!
//! ```no_run
//! use std::io;
//! use std::path::{Path, PathBuf};
//! use std::process::Command;
//! use std::sync::atomic::AtomicBool;
//!
//! use demo_report::{Demo, Event, Programs, Scene};
//! use diagnosis_report::progress::ignore;
//!
//! /// The installed program is daemon and cell.
//! struct Installed;
//!
//! impl Programs for Installed {
//!     fn daemon(&self, config: &Path) -> io::Result<Command> {
//!         let mut command = Command::new("trued");
//!         command.args(["run", "--with-parent", "--config"]).arg(config);
//!         Ok(command)
//!     }
//!
//!     fn cell(&self, name: &str, out: &Path) -> io::Result<Command> {
//!         let mut command = Command::new("trued");
//!         command.args(["demo", "--quick", "--seed", "7", "--cell", name, "--out"]).arg(out);
//!         Ok(command)
//!     }
//! }
//!
//! # fn main() -> Result<(), demo_report::Error> {
//! let scene = Scene::new(7, true)?;
//! let demo = Demo::new(&scene, PathBuf::from("demo-out"));
//! let mut show = |event| {
//!     if let Event::Text(lines) = event {
//!         lines.iter().for_each(|line| println!("{line}"));
//!     }
//!     Ok(())
//! };
//! let report = demo.run(&Installed, &AtomicBool::new(false), &mut show, &ignore)?;
//! let errors = &report.milled.tool_error_mm;
//! assert!(errors.with.mean < errors.without.mean);
//! # Ok(())
//! # }
//! ```

mod cell;
mod diagnosis;
mod error;
mod log;
mod measure;
mod outcome;
mod page;
mod run;
mod scene;
mod standstill;
mod text;

pub use cell::run_cell;
pub use diagnosis::FOLDER as DIAGNOSIS;
pub use error::Error;
pub use outcome::{
    Counts, DiagnosisOutcome, EffectName, ErrorStatistics, Errors, Latency, MillingResult,
    ModelChange, Report, SimulatedChatter, VibrationEvent,
};
pub use run::{Demo, Event, Programs};
pub use scene::Scene;

/// The files in the folder of a demonstration, besides those of the diagnosis in [`DIAGNOSIS`] and [`PAGE`].
pub const FILES: [&str; 6] = [
    "cell.toml",
    diagnosis_report::MODEL,
    "recording.csv",
    "recording.toml",
    "measured.csv",
    "measured.toml",
];

/// The page in the folder of a demonstration.
pub const PAGE: &str = "report.html";
