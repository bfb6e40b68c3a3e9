//! `trued stability`: whether a cut chatters, its distance from the limit, and the nearest stable cuts.
//!
//! The verdict is that of the cut as stated in the file; a mode that cannot be used is an error,
//! never omitted.

use std::path::PathBuf;

use clap::Args;
use spectrum_report::stability::{analyse, read};
use tracing::warn;

use crate::exit::{Answer, Outcome};
use crate::output::Console;
use crate::progress;

/// Predict chatter: stability lobes, the nearest stable cut, the best feed direction
///
/// CUT.toml states the modes at the tip of the tool (by hand, or results of `trued tap`), the cutter, and the cut: spindle speed, depth, direction of
/// feed (docs/stability.md). The limiting depth is computed over spindle speed, by the zeroth order and by semi-discretisation, which decides, and over the
/// direction of feed. The theory is linear: it predicts whether vibration grows, not its amplitude. Exit 1 if the cut is not stable.
#[derive(Debug, Args)]
pub(crate) struct Stability {
    /// Write an HTML page with the stability chart and the limiting depth over the direction of feed
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Cut to analyse
    #[arg(value_name = "CUT.toml")]
    cut: PathBuf,
}

impl Stability {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let mut outputs = console.outputs().pages(&self.report);
        outputs.check([&self.cut])?;
        let spinner = progress::stages(console, "stability lobes, feed directions");
        let analysis = analyse(read(&self.cut)?)?;
        if let Some(report) = &self.report {
            outputs.put_page(report, analysis.page());
        }
        spinner.finish_and_clear();
        console.write(outputs, "trued.stability/1", &analysis.report())?;
        for warning in &analysis.cut.warnings {
            warn!("{warning}");
        }
        console.say(analysis.text())?;
        Ok(if analysis.is_stable { Answer::Done } else { Answer::No })
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<spectrum_report::stability::Report>(
        "stability",
        "trued.stability/1",
    )
}
