//! `trued top`: a running cell on a terminal, with keys.

use clap::Args;

use super::control::Which;
use crate::exit::{Answer, Failure, Outcome};
use crate::interrupt;

/// Watch a running cell on the terminal, and steer it by keys
///
/// State with its reason, correction of each joint as a share of its limit, latency beside the period, missed and refused commands, vibration,
/// what happened. Keys: b bypass on or off, s shadow, l limited, f full, a arm, r reload the model, space freezes the display, q quits.
/// What may let a correction in is asked again (y). Made for 80 columns and 24 rows; nothing is written where nothing changed, for slow
/// lines. `trued status --watch` needs no terminal.
#[derive(Debug, Args)]
pub(crate) struct Top {
    #[command(flatten)]
    which: Which,
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
