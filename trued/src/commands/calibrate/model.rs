//! The calibrated model as text.

use recording::model::{ModelFile, RobotModel};
use report::fixed;

use super::found::{Found, MODELS};
use crate::exit::Failure;

/// The base model's file with what was found, ready to be written: it loads, or there is none.
pub(super) fn renewed(found: &Found) -> Result<String, Failure> {
    let mut file = found.base.file.clone();
    for entry in &found.entries {
        match entry.of_base.and_then(|at| file.effects.get_mut(at)) {
            Some(there) => *there = entry.written.clone(),
            None if entry.is_empty() => {}
            None => file.effects.push(entry.written.clone()),
        }
    }
    let name = file.name.strip_suffix(", nominal").unwrap_or(&file.name);
    file.name = if name.ends_with(", calibrated") {
        name.to_owned()
    } else {
        format!("{name}, calibrated")
    };
    explain(&mut file, found);
    let text = file.to_toml();
    RobotModel::parse("the calibrated model", &text).map_err(Failure::system)?;
    Ok(text)
}

/// What it was made from.
fn explain(file: &mut ModelFile, found: &Found) {
    let names: Vec<&str> =
        (0..found.campaign.recordings.len()).map(|place| found.recording(place)).collect();
    let mm = |metres: f64| fixed(metres * 1e3, 4);
    let errors = MODELS.iter().zip(&found.errors);
    let means: Vec<String> = errors.map(|(name, e)| format!("{name} {}", mm(e.mean()))).collect();
    let mut say = |key: &str, words: String| {
        file.meta.insert(key.to_owned(), words.into());
    };
    say("calibrated_by", format!("trued calibrate {}", env!("CARGO_PKG_VERSION")));
    say(
        "calibrated_from",
        format!(
            "{}, {} poses; base model {}, {:016x}",
            names.join(", "),
            found.poses,
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
            found.split.says
        ),
    );
}
