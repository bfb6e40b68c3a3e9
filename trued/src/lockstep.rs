//! The cell in which a recording is driven row by row: full correction within the default envelope, nothing else running.
//!
//! `correct` and `replay` take the same one, so that they say the same.

use std::path::Path;

use recording::series::Recording;

use crate::setpoints::has_wrench;

/// Its name: short, as paths of the transport are bounded and its place may be deep already.
pub(crate) const CELL: &str = "r";

/// Its configuration, with the model in `model`.
pub(crate) fn cell_toml(model: &Path, recording: &Recording) -> String {
    let wrench = if has_wrench(recording) { "command" } else { "none" };
    // As TOML quotes text: a path that is no plain text never gets here.
    let model = format!("{:?}", model.display().to_string());
    // The period is how often the daemon looks for the next row: as fast as it goes.
    format!(
        "schema = \"trued.cell/1\"\ncell = \"{CELL}\"\nmodel = {model}\nmode = \"full\"\n\n\
         [cycle]\nperiod_ms = 0.1\n\n[wrench]\nsource = \"{wrench}\"\n"
    )
}
