//! `trued stability`: whether a cut chatters, its distance from the limit, and the nearest stable cuts.
//!
//! The verdict is that of the cut as stated in the file; a mode that cannot be used is an error,
//! never omitted.

mod found;
mod modes;
mod page;
mod told;

use std::path::{Path, PathBuf};

use clap::Args;
use recording::cut::CutFile;
use tracing::warn;

use self::found::Found;
use crate::exit::{Answer, Failure, Outcome};
use crate::output::Console;

/// Predict chatter: stability lobes, the nearest stable cut, the best feed direction
///
/// CUT.toml states the modes at the tip of the tool (by hand, or results of `trued tap`), the cutter, and the cut: spindle speed, depth, direction of
/// feed (docs/stability.md). The limit of depth is computed over spindle speed by the zeroth order and by semi-discretisation, which decides, and over the
/// direction of feed. Linear theory: whether vibration grows, not how large it becomes. Exit 1 where the cut is not stable.
#[derive(Debug, Args)]
pub(crate) struct Stability {
    /// Write a page with the stability chart and the limit over the direction of feed
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// The cut
    #[arg(value_name = "CUT.toml")]
    cut: PathBuf,
}

impl Stability {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let mut outputs = console.outputs().pages(&self.report);
        outputs.check([&self.cut])?;
        let found = found(&self.cut)?;
        if let Some(report) = &self.report {
            outputs.put_page(report, page::page(&self.cut, &found));
        }
        console.write(outputs, "trued.stability/1", &told::Report::of(&found))?;
        for warning in &found.modes.warnings {
            warn!("{warning}");
        }
        console.say(told::told(&found))?;
        Ok(if found.is_stable { Answer::Done } else { Answer::No })
    }
}

fn found(cut: &Path) -> Result<Found, Failure> {
    let file = CutFile::read(cut).map_err(crate::input::unusable)?;
    let modes = modes::all(cut, &file)?;
    Found::of(file, modes)
}

/// What is predicted of a cut that chatters: its verdict, and the nearest stable cuts.
pub(super) fn nearest_stable(cut: &Path) -> Result<Vec<String>, Failure> {
    let found = found(cut)?;
    let nearest = told::nearest(&found).into_iter().skip(1);
    let nearest = nearest.map(|(_, text)| text.trim_start_matches("- ").to_owned());
    let verdict = format!("predicted {}", told::verdict(&found));
    let margin = format!("stable with {} % of depth in hand", 100.0 * found.file.margin);
    Ok([verdict, margin].into_iter().chain(nearest).collect())
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<told::Report>("stability", "trued.stability/1")
}
