//! The cell at rest during the diagnosis: effects of the change of model, and vibration verdicts.
//!
//! It continues only when the model's replacement is half a second old, so that late answers are
//! counted. It never blocks.

use std::sync::mpsc::{Receiver, TryRecvError};

use crate::error::Error;
use crate::outcome::{DiagnosisOutcome, ModelChange};

/// Ticks before and after a change of model that count as about it.
const CHANGE_WINDOW_TICKS: u64 = 500;

/// Observations so far.
#[derive(Default)]
pub(crate) struct Standstill {
    ticks: u64,
    missed: Vec<u64>,
    epoch: Option<u64>,
    changed_at: Option<u64>,
    instruction: Option<(bool, DiagnosisOutcome)>,
}

impl Standstill {
    /// Counts a tick: the model with which the newest answer was made, and whether an answer was
    /// late.
    pub(crate) fn count_tick(&mut self, epoch: Option<u64>, missed: bool) {
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
    pub(crate) fn poll_instruction(
        &mut self,
        instructions: &Receiver<String>,
    ) -> Result<Option<(DiagnosisOutcome, Option<ModelChange>)>, Error> {
        match instructions.try_recv() {
            Ok(line) => self.instruction = Some(parse_instruction(&line)?),
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return Err(Error::Interrupted),
        }
        Ok(match (&self.instruction, self.changed_at) {
            (Some((false, outcome)), _) => Some((outcome.clone(), None)),
            (Some((true, outcome)), Some(changed_at))
                if self.ticks >= changed_at + CHANGE_WINDOW_TICKS =>
            {
                Some((outcome.clone(), Some(self.model_change(changed_at))))
            }
            _ => None,
        })
    }

    fn model_change(&self, changed_at: u64) -> ModelChange {
        let about =
            self.missed.iter().filter(|tick| tick.abs_diff(changed_at) <= CHANGE_WINDOW_TICKS);
        let missed_about = about.count() as u64;
        ModelChange { cycles: self.ticks, missed: self.missed.len() as u64, missed_about }
    }
}

fn parse_instruction(line: &str) -> Result<(bool, DiagnosisOutcome), Error> {
    let (again, outcome) = match (line.strip_prefix("again "), line.strip_prefix("end ")) {
        (Some(outcome), _) => (true, outcome),
        (None, Some(outcome)) => (false, outcome),
        _ => return Err(Error::system("the demo's cell received an unknown instruction")),
    };
    Ok((again, serde_json::from_str(outcome).map_err(Error::system)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::EffectName;
    use std::sync::mpsc::channel;

    fn outcome() -> DiagnosisOutcome {
        DiagnosisOutcome {
            hidden_effect: EffectName { effect: "backlash".to_owned(), joint: Some(3) },
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
        let (say, instructions) = channel();
        let mut standing = Standstill::default();
        say.send(format!("again {}", serde_json::to_string(&outcome()).expect("plain")))
            .expect("heard");
        let mut went_on = None;
        for tick in 1..=3000_u64 {
            // Late long before, about, and after the change at tick 1200.
            standing
                .count_tick(Some(1 + u64::from(tick >= 1200)), [100, 900, 1300].contains(&tick));
            if let Some((_, swap)) =
                standing.poll_instruction(&instructions).expect("in words of the protocol")
            {
                went_on = Some((tick, swap.expect("changed")));
                break;
            }
        }
        let (tick, swap) = went_on.expect("it goes on");
        assert_eq!((tick, swap.cycles, swap.missed, swap.missed_about), (1700, 1700, 3, 2));
    }

    #[test]
    fn where_nothing_is_claimed_it_ends_at_once_and_where_nobody_speaks_it_is_interrupted() {
        let (say, instructions) = channel();
        let mut standing = Standstill::default();
        assert!(standing.poll_instruction(&instructions).expect("silence is no fault").is_none());
        say.send(format!("end {}", serde_json::to_string(&outcome()).expect("plain")))
            .expect("heard");
        let (_, swap) = standing.poll_instruction(&instructions).expect("words").expect("it ends");
        assert!(swap.is_none());
        drop(say);
        assert!(Standstill::default().poll_instruction(&instructions).is_err());
    }
}
