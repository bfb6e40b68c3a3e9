//! The cell while it stands and waits for the diagnosis: what is seen of the change of model, what is heard.
//!
//! Promises: goes on only once the change is half a second old, so that a late answer about it is counted. Never: a wait.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, TryRecvError};

use super::outcome::{Swap, Told};
use crate::exit::Failure;

/// Ticks before and after a change of model that count as about it.
const ABOUT_TICKS: u64 = 500;

/// What was seen so far.
#[derive(Default)]
pub(super) struct Standing {
    ticks: u64,
    missed: VecDeque<u64>,
    epoch: Option<u64>,
    changed_at: Option<u64>,
    told: Option<(bool, Told)>,
}

impl Standing {
    /// Takes a tick: which model the newest answer was made with, and whether this tick had none in time.
    pub(super) fn tick(&mut self, epoch: Option<u64>, missed: bool) {
        self.ticks += 1;
        if missed {
            self.missed.push_back(self.ticks);
        }
        let is_new = self.epoch.is_some() && epoch.is_some() && epoch != self.epoch;
        self.epoch = epoch.or(self.epoch);
        if is_new {
            self.changed_at = Some(self.ticks);
        }
    }

    /// Whether it is time to go on: with what was said, and with how the change went where there was one.
    ///
    /// # Errors
    /// Nobody speaks any more, or not in words of this protocol.
    pub(super) fn hear(
        &mut self,
        heard: &Receiver<String>,
    ) -> Result<Option<(Told, Option<Swap>)>, Failure> {
        match heard.try_recv() {
            Ok(line) => self.told = Some(parse(&line)?),
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return Err(Failure::Interrupted),
        }
        Ok(match (&self.told, self.changed_at) {
            (Some((false, told)), _) => Some((told.clone(), None)),
            (Some((true, told)), Some(at)) if self.ticks >= at + ABOUT_TICKS => {
                Some((told.clone(), Some(self.swap(at))))
            }
            _ => None,
        })
    }

    fn swap(&self, at: u64) -> Swap {
        let about = self.missed.iter().filter(|tick| tick.abs_diff(at) <= ABOUT_TICKS);
        Swap { cycles: self.ticks, missed_about: about.count() as u64 }
    }
}

fn parse(line: &str) -> Result<(bool, Told), Failure> {
    let (again, told) = match (line.strip_prefix("again "), line.strip_prefix("end ")) {
        (Some(told), _) => (true, told),
        (None, Some(told)) => (false, told),
        _ => return Err(Failure::system("the demo's cell was told something unknown")),
    };
    Ok((again, serde_json::from_str(told).map_err(Failure::system)?))
}
