//! Which moments keep the recording: events of the vibration watch that become an alarm.
//!
//! Each is told once, when it begins. Called by the recorder for all verdicts that it takes from its ring, whether it writes them or not.

use shm_schema::{Verdict, VibrationState};

/// What has been told already.
#[derive(Debug, Default)]
pub struct Alarms {
    /// Events of the vibration watch that alarm now.
    events: Vec<u64>,
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
}
