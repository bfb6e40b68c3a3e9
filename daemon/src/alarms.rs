//! Detects new vibration alarms, which mark the recording to be kept.
//!
//! Each event is reported once, when its alarm begins. The recorder passes every verdict of its
//! ring, including those that it does not write.

use shm_schema::{Verdict, VibrationState};

/// Active alarms that have been reported.
#[derive(Debug, Default)]
pub struct Alarms {
    /// Vibration events with an active alarm.
    events: Vec<u64>,
}

impl Alarms {
    /// A description of the alarm that begins with this verdict; none if no alarm begins.
    pub fn new_alarm(&mut self, verdict: &Verdict) -> Option<String> {
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
    fn each_alarm_is_reported_once() {
        let mut alarms = Alarms::default();
        assert_eq!(alarms.new_alarm(&verdict(1, VibrationState::Warn)), None);
        let message = alarms.new_alarm(&verdict(1, VibrationState::Alarm)).expect("it begins");
        assert!(message.contains("684.0 Hz"), "{message}");
        assert_eq!(alarms.new_alarm(&verdict(1, VibrationState::Confirmed)), None);
        assert!(alarms.new_alarm(&verdict(2, VibrationState::Confirmed)).is_some(), "another");
        assert_eq!(alarms.new_alarm(&verdict(1, VibrationState::Over)), None);
        assert!(alarms.new_alarm(&verdict(1, VibrationState::Alarm)).is_some(), "again");
    }
}
