//! Which moments keep the recording: an event of the vibration watch that becomes an alarm, and a fault of the daemon.
//!
//! Each is told once, when it begins. Called by the recorder for all that it takes from its rings, whether it writes it or not.

use shm_schema::{Health, Verdict, VibrationState};

/// What has been told already.
#[derive(Debug, Default)]
pub struct Alarms {
    /// Events of the vibration watch that alarm now.
    events: Vec<u64>,
    is_in_fault: bool,
}

impl Alarms {
    /// Whether an alarm begins with this verdict; in words.
    pub fn vibration(&mut self, verdict: &Verdict) -> Option<String> {
        let alarms =
            matches!(verdict.state(), Ok(VibrationState::Alarm | VibrationState::Confirmed));
        if verdict.state() == Ok(VibrationState::Over) {
            self.events.retain(|event| *event != verdict.event);
        }
        if !alarms || self.events.contains(&verdict.event) {
            return None;
        }
        self.events.push(verdict.event);
        Some(format!("vibration at {:.1} Hz", verdict.frequency_hz))
    }

    /// Whether a fault begins with this state of the daemon; `says` are its words.
    pub fn health(&mut self, health: &str, says: &str) -> Option<String> {
        let is_in_fault = health == Health::Fault.name();
        let begins = is_in_fault && !self.is_in_fault;
        self.is_in_fault = is_in_fault;
        begins.then(|| format!("fault: {says}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(event: u64, state: VibrationState) -> Verdict {
        Verdict { event, state: state.code(), frequency_hz: 684.0, ..Verdict::default() }
    }

    #[test]
    fn each_event_that_alarms_is_told_once() {
        let mut alarms = Alarms::default();
        assert_eq!(alarms.vibration(&verdict(1, VibrationState::Warn)), None);
        let said = alarms.vibration(&verdict(1, VibrationState::Alarm)).expect("it begins");
        assert!(said.contains("684.0 Hz"), "{said}");
        assert_eq!(alarms.vibration(&verdict(1, VibrationState::Confirmed)), None);
        assert!(alarms.vibration(&verdict(2, VibrationState::Confirmed)).is_some(), "another");
        assert_eq!(alarms.vibration(&verdict(1, VibrationState::Over)), None);
        assert!(alarms.vibration(&verdict(1, VibrationState::Alarm)).is_some(), "again");
    }

    #[test]
    fn a_fault_is_told_when_it_begins() {
        let mut alarms = Alarms::default();
        assert_eq!(alarms.health("running", ""), None);
        assert!(alarms.health("fault", "no model").is_some());
        assert_eq!(alarms.health("fault", "no model"), None);
        assert_eq!(alarms.health("running", ""), None);
        assert!(alarms.health("fault", "no model").is_some(), "again");
    }
}
