//! Gear shafts and tooth meshes per millimetre of path, and the lines that they fit, as JSON (`trued.gears/1`), text and HTML page.
//!
//! [`straight`] and [`recorded`] give the rotation of each joint along a path; [`analyse`] gives the shafts and meshes of the model's gear trains along it, and
//! [`Analysis::match_lines`] assigns lines to them: given ones, those of stylus profiles ([`crate::surface`]), and those of recordings over their path
//! ([`crate::vibration`]). Revolutions, teeth and degrees per mm have separate columns (decision 0010); every wheel that fits a line is listed, with the
//! probability of a random match; a wheel whose speed varies too much to produce a line is not matched. Modules in the order in which to read them: `path`,
//! `trains`, `lines`, `matching`, `analysis`, `result`, `text`, `page`.
//!
//! ```no_run
//! use std::fs;
//! use std::path::Path;
//!
//! use recording::model::RobotModel;
//! use spectrum_report::gears::{Lines, Settings, analyse, straight};
//! use spectrum_report::surface::{Format, read};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = RobotModel::read(Path::new("irb1600-6-145-thesis"))?;
//! let path = straight(&model.physics.arm, &[0.0, 0.0, 0.0, 0.0, 90.0, 0.0], &[0.0, 20.0, 0.0], 4)?;
//! let mut analysis = analyse(model, path, &Settings::default())?;
//! let mut lines = Lines::default();
//! lines.add_profile(&read("milled.csv", &Format::default())?)?;
//! analysis.match_lines(lines);
//! println!("{}", analysis.text(None));
//! fs::write("gears.json", analysis.json()?)?;
//! fs::write("gears.html", analysis.page().render())?;
//! # Ok(())
//! # }
//! ```

mod analysis;
mod lines;
mod matching;
mod page;
mod path;
mod result;
mod text;
mod trains;

pub use analysis::{Analysis, analyse};
pub use lines::{Line, Lines};
pub use matching::{MatchedLine, MatchingGear};
pub use path::{PathPart, RevolutionsPerMm, TravelledPath, recorded, straight};
pub use result::Report;
pub use trains::GearTrain;

/// How gear trains are analysed.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Joints whose gears are analysed, from 1. Default: none, which is all.
    pub joints: Vec<u8>,
    /// Tolerance of a match relative to the line, in addition to the uncertainty of the line and half the
    /// drift of the wheel, percent; above 0, at most 50. Default 2. Origin: a choice.
    pub tolerance_percent: f64,
    /// A wheel whose speed varies along the path by more than this part of its mean produces no line; no
    /// unit, above 0. Default 0.2. Origin: a choice.
    pub drift_max: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { joints: Vec::new(), tolerance_percent: 2.0, drift_max: 0.2 }
    }
}
