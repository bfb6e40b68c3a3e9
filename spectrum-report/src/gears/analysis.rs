//! From a path to the gear shafts along it, and the lines that they fit.

use recording::model::RobotModel;

use super::Settings;
use super::lines::Lines;
use super::matching::MatchedLine;
use super::path::TravelledPath;
use super::trains::{self, GearTrain};
use crate::error::Error;

/// Gear shafts and meshes along a path.
pub struct Analysis {
    /// The robot's model.
    pub model: RobotModel,
    /// The path.
    pub travelled: TravelledPath,
    /// The gear trains of the joints that turn along the path.
    pub trains: Vec<GearTrain>,
    /// Lines, with the wheels that fit.
    pub lines: Vec<MatchedLine>,
    /// Remarks, as text.
    pub notes: Vec<String>,
    pub(super) settings: Settings,
}

/// The gear shafts and meshes of a model along a path.
///
/// # Errors
/// [`Error::Input`] if the model, or a selected joint, has no `gear_teeth`.
pub fn analyse(
    model: RobotModel,
    travelled: TravelledPath,
    settings: &Settings,
) -> Result<Analysis, Error> {
    let trains = trains::of(&model.file, &travelled, &settings.joints)?;
    let (lines, notes, settings) = (Vec::new(), Vec::new(), settings.clone());
    Ok(Analysis { model, travelled, trains, lines, notes, settings })
}

impl Analysis {
    /// Matches lines with the wheels.
    pub fn match_lines(&mut self, lines: Lines) {
        let matched =
            lines.lines.into_iter().map(|line| MatchedLine::of(line, &self.trains, &self.settings));
        self.lines.extend(matched);
        self.notes.extend(lines.notes);
    }
}
