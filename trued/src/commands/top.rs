//! `trued top`: a running cell on a terminal, with keys.

use clap::Args;

use super::control::CellSelection;
use crate::exit::{Answer, Failure, Outcome};
use crate::interrupt;

/// Monitor a running cell on the terminal, and operate it by keys
///
/// Shows the state with its reason, the correction of each joint relative to its limit, the latency relative to the period, missed and rejected commands,
/// vibration and recent events. Keys: b bypass on or off, s shadow, l limited, f full, a arm, r reload the model, space freezes the display, q quits.
/// Requests that can enable a correction must be confirmed (y). Designed for 80 columns and 24 rows; only changes are written, for slow
/// connections. `trued status --watch` works without a terminal.
#[derive(Debug, Args)]
pub(crate) struct Top {
    #[command(flatten)]
    which: CellSelection,
}

impl Top {
    pub(crate) fn run(&self) -> Outcome {
        let (cell, looking) = self.which.join()?;
        let (_, asking) = self.which.join()?;
        let stop = interrupt::flag()?;
        live::top::run(&cell, looking, asking, &stop).map_err(Failure::system)?;
        Ok(Answer::Done)
    }
}
