//! `trued diagnose --apply CELL`: loads the resulting model into a running daemon.
//!
//! Only a model whose findings explain the mismatch is loaded, as `trued reload` does; the files
//! remain, whatever the daemon answers. The cell's own files are not changed.

use std::path::Path;

use diagnosis::diagnose::Verdict;
use diagnosis_report::{MODEL, RobotDiagnosis};
use recording::cell::CellConfig;

use super::super::reload::ReloadResult;
use crate::exit::{Answer, Failure, Outcome};
use crate::input::unusable;
use crate::output::Console;

/// The name of the cell, given by its configuration or by name.
pub(super) fn cell(config_or_name: &Path) -> Result<String, Failure> {
    let is_file = config_or_name.exists() || config_or_name.extension().is_some();
    match config_or_name.to_str() {
        Some(name) if !is_file => Ok(name.to_owned()),
        _ => Ok(CellConfig::read(config_or_name).map_err(unusable)?.cell),
    }
}

/// Loads the model in `dir` into the daemon of `cell`, or reports why not.
pub(super) fn apply(
    console: &mut Console,
    cell: &str,
    found: &RobotDiagnosis,
    dir: &Path,
) -> Outcome {
    if let Some(why) = reason_not_applied(found) {
        console.say(format!("not applied: {why}; the daemon keeps its current model"))?;
        return Ok(Answer::No);
    }
    let model = dir.join(MODEL);
    let answer = ReloadResult::request_reload(cell, Some(&model))?.report(console)?;
    if answer == Answer::Done {
        console.say(format!(
            "valid until the daemon of {cell} restarts; to keep it, set `model` in its configuration to {}",
            model.display()
        ))?;
    }
    Ok(answer)
}

/// Why a model must not be used; `None` if it may.
fn reason_not_applied(found: &RobotDiagnosis) -> Option<&'static str> {
    match found.diagnosis.as_ref().map(|diagnosis| diagnosis.verdict) {
        Some(Verdict::MissingPhysics) => None,
        Some(Verdict::Consistent) => Some("the model explains the recordings; nothing to apply"),
        Some(Verdict::UnknownStructure) => {
            Some("part of the error is not explained by any known effect")
        }
        Some(Verdict::Undetermined) => Some("several effects explain the error equally well"),
        None => Some("the recordings do not allow a verdict"),
    }
}
