//! The calibrated model as text.

use recording::model::{ModelFile, RobotModel};
use report::{fixed, pluralise};

use super::MODELS;
use super::models::CalibrationResult;
use crate::entries::updated_file;
use crate::error::Error;

impl CalibrationResult {
    /// The base model's file with the fitted effects, as text of a model file.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn model_toml(&self) -> Result<String, Error> {
        let mut file = updated_file(&self.base, &self.entries);
        let name = file.name.strip_suffix(", nominal").unwrap_or(&file.name);
        file.name = if name.ends_with(", calibrated") {
            name.to_owned()
        } else {
            format!("{name}, calibrated")
        };
        add_origin(&mut file, self);
        let text = file.to_toml();
        RobotModel::parse("the calibrated model", &text).map_err(Error::internal)?;
        Ok(text)
    }
}

/// Adds the origin of the model as comments.
fn add_origin(file: &mut ModelFile, found: &CalibrationResult) {
    let names: Vec<&str> =
        (0..found.campaign.recordings.len()).map(|place| found.recording_name(place)).collect();
    let mm = |metres: f64| fixed(metres * 1e3, 4);
    let errors = MODELS.iter().zip(&found.errors);
    let means: Vec<String> = errors.map(|(name, e)| format!("{name} {}", mm(e.mean()))).collect();
    let mut say = |key: &str, text: String| {
        file.meta.insert(key.to_owned(), text.into());
    };
    say("calibrated_by", format!("trued calibrate {}", env!("CARGO_PKG_VERSION")));
    say(
        "calibrated_from",
        format!(
            "{}, {}; base model {}, {:016x}",
            names.join(", "),
            pluralise(found.poses, "pose"),
            found.base.file.name,
            found.base.hash
        ),
    );
    say("calibrated_robot", found.base.file.identity().to_string());
    let [.., advanced] = &found.errors;
    say(
        "calibration_proof",
        format!(
            "held-out mean error, mm: {}; 95 % {}, largest {}; {}",
            means.join(", "),
            mm(advanced.quantile(0.95)),
            mm(advanced.max()),
            found.split.description
        ),
    );
}
