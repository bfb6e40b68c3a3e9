//! What is new of the force stream, its vibrations and the model's age, for the log.
//!
//! Promises: a fault is logged when it begins and when it ends; a ringing when it alarms, when it is confirmed, and when it is
//! over; a model when it no longer holds; not more. Never: in a real-time thread.

use crate::exchange::Exchange;
use shm_schema::{ForceFault, Status, Verdict, VibrationState, WatchState};
use tracing::{info, warn};

/// What was logged and still holds.
#[derive(Debug, Default)]
pub struct News {
    faults: Vec<ForceFault>,
    /// Ringings, by event, that alarmed, and how far they had come.
    ringing: Vec<(u64, VibrationState)>,
    learning: bool,
    broken_since_ns: u64,
}

impl News {
    /// Logs what is new since the last status.
    pub fn log(&mut self, exchange: &Exchange, status: &Status) {
        while let Some(verdict) = exchange.told.pop() {
            self.log_verdict(&verdict);
        }
        let faults: Vec<_> = status.force_faults().collect();
        for fault in faults.iter().filter(|fault| !self.faults.contains(fault)) {
            warn!("{fault}");
        }
        for fault in self.faults.iter().filter(|fault| !faults.contains(fault)) {
            info!("no more: {fault}");
        }
        self.faults = faults;
        let learning = status.watch() == Ok(WatchState::Learning);
        if learning != self.learning {
            let words = if learning { "learns the noise floor" } else { "watches" };
            info!("the vibration watch {words}");
        }
        self.learning = learning;
        let since_ns = status.model_broken_since_ns;
        if since_ns > 0 && self.broken_since_ns == 0 {
            warn!(
                measurements = status.model_measurements,
                residual_mm = 1e3 * status.model_residual_m,
                "the model no longer holds; `trued diagnose` on a measuring program says why"
            );
        }
        self.broken_since_ns = since_ns;
    }

    fn log_verdict(&mut self, verdict: &Verdict) {
        let Ok(state) = verdict.state() else { return };
        let known = self.ringing.iter().position(|(event, _)| *event == verdict.event);
        match (state, known) {
            (VibrationState::Warn, _) | (VibrationState::Over, None) => {}
            (VibrationState::Over, Some(place)) => {
                self.ringing.swap_remove(place);
                info!("{verdict}");
            }
            (_, Some(place)) if self.ringing[place].1 == state => {}
            (_, Some(place)) => {
                self.ringing[place].1 = state;
                warn!("{verdict}");
            }
            (_, None) => {
                self.ringing.push((verdict.event, state));
                warn!("{verdict}");
            }
        }
    }
}
