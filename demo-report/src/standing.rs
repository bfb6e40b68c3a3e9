//! The cell at rest during the diagnosis: effects of the change of model, and vibration verdicts.
//!
//! It continues only when the model's replacement is half a second old, so that late answers are
//! counted. It never blocks.

use std::sync::mpsc::{Receiver, TryRecvError};

use crate::error::Error;
use crate::outcome::{Swap, Told};

/// Ticks before and after a change of model that count as about it.
const ABOUT_TICKS: u64 = 500;

/// Observations so far.
#[derive(Default)]
pub(crate) struct Standing {
    ticks: u64,
    missed: Vec<u64>,
    epoch: Option<u64>,
    changed_at: Option<u64>,
    told: Option<(bool, Told)>,
}

impl Standing {
    /// Counts a tick: the model with which the newest answer was made, and whether an answer was
    /// late.
    pub(crate) fn tick(&mut self, epoch: Option<u64>, missed: bool) {
        self.ticks += 1;
        if missed {
            self.missed.push(self.ticks);
        }
        let is_new = self.epoch.is_some() && epoch.is_some() && epoch != self.epoch;
        self.epoch = epoch.or(self.epoch);
        if is_new {
            self.changed_at = Some(self.ticks);
        }
    }

    /// Whether to continue: with the diagnosis, and with the result of the model's replacement if
    /// there was one.
    ///
    /// # Errors
    /// The parent is gone, or sent something outside this protocol.
    pub(crate) fn hear(
        &mut self,
        heard: &Receiver<String>,
    ) -> Result<Option<(Told, Option<Swap>)>, Error> {
        match heard.try_recv() {
            Ok(line) => self.told = Some(parse(&line)?),
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return Err(Error::Interrupted),
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
        let missed_about = about.count() as u64;
        Swap { cycles: self.ticks, missed: self.missed.len() as u64, missed_about }
    }
}

fn parse(line: &str) -> Result<(bool, Told), Error> {
    let (again, told) = match (line.strip_prefix("again "), line.strip_prefix("end ")) {
        (Some(told), _) => (true, told),
        (None, Some(told)) => (false, told),
        _ => return Err(Error::system("the demo's cell received an unknown instruction")),
    };
    Ok((again, serde_json::from_str(told).map_err(Error::system)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::Named;
    use std::sync::mpsc::channel;

    fn told() -> Told {
        Told {
            hidden_effect: Named { effect: "backlash".to_owned(), joint: Some(3) },
            said: None,
            named_right: false,
            hidden_effect_mm: 0.1,
            verdict: "undetermined".to_owned(),
            says: Vec::new(),
            truth: String::new(),
            diagnosis_s: 1.0,
        }
    }

    #[test]
    fn it_continues_half_a_second_after_the_change_and_counts_what_was_late_about_it() {
        let (say, heard) = channel();
        let mut standing = Standing::default();
        say.send(format!("again {}", serde_json::to_string(&told()).expect("plain")))
            .expect("heard");
        let mut went_on = None;
        for tick in 1..=3000_u64 {
            // Late long before, about, and after the change at tick 1200.
            standing.tick(Some(1 + u64::from(tick >= 1200)), [100, 900, 1300].contains(&tick));
            if let Some((_, swap)) = standing.hear(&heard).expect("in words of the protocol") {
                went_on = Some((tick, swap.expect("changed")));
                break;
            }
        }
        let (tick, swap) = went_on.expect("it goes on");
        assert_eq!((tick, swap.cycles, swap.missed, swap.missed_about), (1700, 1700, 3, 2));
    }

    #[test]
    fn where_nothing_is_claimed_it_ends_at_once_and_where_nobody_speaks_it_is_interrupted() {
        let (say, heard) = channel();
        let mut standing = Standing::default();
        assert!(standing.hear(&heard).expect("silence is no fault").is_none());
        say.send(format!("end {}", serde_json::to_string(&told()).expect("plain"))).expect("heard");
        let (_, swap) = standing.hear(&heard).expect("words").expect("it ends");
        assert!(swap.is_none());
        drop(say);
        assert!(Standing::default().hear(&heard).is_err());
    }
}
