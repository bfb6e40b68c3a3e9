//! The model with the measured modes, as text, and the change of each mode.

use std::path::{Path, PathBuf};

use recording::model::{ModeChange, ModeEntry, RobotModel};
use spectrum::MODES_MAX;

use super::analysis::Analysis;
use crate::error::Error;

/// A model with the measured modes, ready to be written.
pub struct UpdatedModel {
    /// Path of the file.
    pub path: PathBuf,
    /// The model file; it loads.
    pub text: String,
    /// What became of each measured mode.
    pub changes: Vec<ModeChange>,
    /// Known modes that were not measured, Hz.
    pub kept_hz: Vec<f64>,
    /// Modes in the model now.
    count: usize,
}

impl Analysis {
    /// `base` with the measured modes, to be written to `path`.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn updated_model(&self, base: &RobotModel, path: &Path) -> Result<UpdatedModel, Error> {
        let entry = |mode: &spectrum::modal::MergedMode| ModeEntry {
            frequency_hz: mode.frequency_hz,
            damping_ratio: Some(mode.damping),
            direction: self.settings.direction,
        };
        let measured: Vec<ModeEntry> = self.modes.iter().map(entry).collect();
        let (model, changes) = base.file.with_modes(&measured);
        let replaced = |mode: &ModeEntry| {
            changes
                .iter()
                .any(|change| matches!(change, ModeChange::Replaced(before) if before == mode))
        };
        let kept_hz = base.file.modes.iter().filter(|mode| !replaced(mode));
        let kept_hz = kept_hz.map(|mode| mode.frequency_hz).collect();
        let (text, count) = (model.to_toml(), model.modes.len());
        // What is written loads, or is not written.
        RobotModel::parse("the model with the measured modes", &text).map_err(Error::internal)?;
        Ok(UpdatedModel { path: path.to_owned(), text, changes, kept_hz, count })
    }
}

impl UpdatedModel {
    /// What became of the measured modes, in one line.
    pub(super) fn line(&self, analysis: &Analysis) -> String {
        let hz = |hz: f64| report::fixed(hz, 1);
        let one = |(mode, change): (&spectrum::modal::MergedMode, &ModeChange)| match change {
            ModeChange::Replaced(before) => {
                format!("{} Hz now {} Hz", hz(before.frequency_hz), hz(mode.frequency_hz))
            }
            ModeChange::Added => format!("{} Hz added", hz(mode.frequency_hz)),
        };
        let mut changes: Vec<String> = analysis.modes.iter().zip(&self.changes).map(one).collect();
        if !self.kept_hz.is_empty() {
            let kept: Vec<String> = self.kept_hz.iter().map(|f| hz(*f)).collect();
            changes.push(format!("{} Hz not measured, kept", kept.join(", ")));
        }
        if self.count > MODES_MAX {
            changes.push(format!(
                "the vibration monitor uses the first {MODES_MAX} of {} modes",
                self.count
            ));
        }
        if changes.is_empty() { "no mode changed".to_owned() } else { changes.join("; ") }
    }
}
