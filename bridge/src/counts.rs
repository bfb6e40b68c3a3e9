//! Counters of the bridge: one per kind of datagram and handling.
//!
//! The loop only increments atomics; a separate thread reports them.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use trued_client::Source;

use crate::link::Correction;

macro_rules! counters {
    ($($(#[$doc:meta])* $name:ident = $words:literal, $fault:literal;)*) => {
        /// A kind of event.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Count { $($(#[$doc])* $name,)* }

        impl Count {
            /// All kinds.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// Name in the bridge's output.
            #[must_use]
            pub const fn words(self) -> &'static str {
                match self { $(Self::$name => $words),* }
            }

            /// Whether an increase is reported as a warning.
            #[must_use]
            pub const fn is_fault(self) -> bool {
                match self { $(Self::$name => $fault),* }
            }
        }
    };
}

counters! {
    /// Valid datagrams of the controller.
    Robot = "datagrams of the robot", false;
    /// Valid datagrams of the application.
    Application = "datagrams of the application", false;
    /// Answers to the controller.
    Sent = "answers to the robot", false;
    /// Answers with the daemon's correction for this target.
    Corrected = "answers with a new correction", false;
    /// Answers with the correction of an earlier target, because the daemon was late.
    Late = "answers with the last correction (daemon late)", true;
    /// Answers while the client library ramped the correction.
    Ramping = "answers with a ramping correction", false;
    /// Answers without a correction.
    Plain = "answers without correction", false;
    /// Targets that the daemon refused: they are sent, and the correction ramps to zero.
    Refused = "targets rejected by the daemon", true;
    /// Runs of the robot that started.
    Sessions = "sessions", false;
    /// Missing datagrams of the controller, by their numbers.
    RobotMissed = "datagrams of the robot missed", true;
    /// Missing datagrams of the application, by their numbers.
    ApplicationMissed = "datagrams of the application missed", true;
    /// Cycles of a guided robot without a datagram of the application.
    Silent = "cycles without a datagram of the application", true;
    /// Repeated datagrams.
    Repeated = "repeated datagrams", true;
    /// Datagrams that were overtaken by later ones.
    Old = "out-of-order datagrams", true;
    /// Datagrams that were superseded by newer ones before they could be answered.
    Superseded = "superseded datagrams", true;
    /// Datagrams from other addresses.
    Foreign = "foreign datagrams", true;
    /// Datagrams from another port of the controller: a second mechanical unit.
    OtherUnit = "datagrams of another mechanical unit", true;
    /// Datagrams that are not messages of the protocol, or lack a required number.
    Broken = "invalid datagrams", true;
    /// Datagrams of the application without a connected robot.
    Early = "datagrams of the application without a robot", true;
    /// Targets that this bridge does not correct: poses, other numbers of joints.
    NotCorrected = "targets passed uncorrected", true;
    /// Force samples passed to the vibration monitor.
    Forces = "force samples", false;
    /// Force samples lost before the vibration monitor.
    ForcesLost = "force samples lost", true;
    /// Datagrams that the system did not send.
    NotSent = "datagrams not sent", true;
    /// Answers that the controller reports as late.
    ControllerLate = "late answers counted by the controller", true;
}

/// All counters.
#[derive(Debug, Default)]
pub struct Counts {
    values: [AtomicU64; Count::ALL.len()],
}

impl Counts {
    /// Counts one.
    pub fn increment(&self, what: Count) {
        self.add(what, 1);
    }

    /// Counts several.
    pub fn add(&self, what: Count, several: u64) {
        // The enum has as many variants as the array has elements.
        self.values[what as usize].fetch_add(several, Relaxed);
    }

    /// Counts an answer by the source of its correction.
    pub fn count_answer(&self, made: &Correction) {
        self.increment(match made.source {
            _ if made.is_refused => Count::Refused,
            Source::Corrected => Count::Corrected,
            Source::LastCorrection => Count::Late,
            Source::Ramping => Count::Ramping,
            Source::Plain => Count::Plain,
        });
    }

    /// The present count.
    #[must_use]
    pub fn get(&self, what: Count) -> u64 {
        self.values[what as usize].load(Relaxed)
    }

    /// `words: number`, one line for each count above zero.
    #[must_use]
    pub fn summary(&self) -> String {
        let nonzero = Count::ALL.iter().filter(|what| self.get(**what) > 0);
        nonzero.map(|what| format!("{}: {}\n", what.words(), self.get(*what))).collect()
    }

    /// Warnings whose count has risen since `before`, which is updated.
    pub fn new_warnings(&self, before: &mut [u64; Count::ALL.len()]) -> Vec<String> {
        let mut risen = Vec::new();
        for (what, before) in Count::ALL.iter().zip(before) {
            let now = self.get(*what);
            if what.is_fault() && now > *before {
                risen.push(format!("{}: {} more, {now} in all", what.words(), now - *before));
            }
            *before = now;
        }
        risen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_happened_is_reported_and_only_rising_faults_are_warned_of() {
        let (counts, mut before) = (Counts::default(), [0; Count::ALL.len()]);
        counts.increment(Count::Robot);
        counts.add(Count::Foreign, 3);
        assert_eq!(counts.summary(), "datagrams of the robot: 1\nforeign datagrams: 3\n");
        assert_eq!(counts.new_warnings(&mut before), ["foreign datagrams: 3 more, 3 in all"]);
        assert!(counts.new_warnings(&mut before).is_empty());
    }
}
