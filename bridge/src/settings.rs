//! Thresholds for assigning a datagram to the present run of the controller, to a new run, or to old datagrams.

use std::time::Duration;

use recording::bridge::CommonConfig;

/// Rules for the end of a controller's run, and for the datagrams that belong to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunRules {
    /// Silence of the controller after which its run has ended, unless its sequence numbers continued meanwhile. 0.4 to 10 s, default 1 s. Origin: RSI tolerates
    /// `Timeout` = 100 late packets of 4 ms by default; a controller that is set to wait longer needs a larger value (`[timing] run_ends_after_ms`).
    pub ends_after: Duration,
    /// With this many lost datagrams or more, the controller may have started another run with a number near the old one; the position of the robot decides. 10 to 1000,
    /// default 50. Origin: 0.2 s of EGM's 4 ms, less than a program needs to start `EGMRunJoint` again.
    pub doubtful_lost: u32,
    /// The robot has stopped after this many consecutive messages that do not guide it; fewer may be replayed ones. 1 to 50, default 3.
    /// Origin: a burst that a network repeats or reorders is of one or two datagrams.
    pub stopped_after: u32,
    /// Another mechanical unit is served after this many consecutive datagrams once the present one is silent. 1 to 50, default 3. Origin: as `stopped_after`.
    pub unit_switch_after: u32,
    /// Rules for the numbers of datagrams.
    pub sequence: SequenceRules,
}

impl Default for RunRules {
    fn default() -> Self {
        Self {
            ends_after: Duration::from_secs(1),
            doubtful_lost: 50,
            stopped_after: 3,
            unit_switch_after: 3,
            sequence: SequenceRules::default(),
        }
    }
}

impl RunRules {
    /// The rules of a bridge with this configuration.
    #[must_use]
    pub fn from_config(common: &CommonConfig) -> Self {
        Self { ends_after: Duration::from_secs_f64(common.run_ends_after_s), ..Self::default() }
    }

    /// [`Self::ends_after`] in ns.
    #[must_use]
    pub fn ends_after_ns(&self) -> u64 {
        u64::try_from(self.ends_after.as_nanos()).unwrap_or(u64::MAX)
    }

    /// [`Self::ends_after`] in ms of the controller's clock.
    #[must_use]
    pub fn ends_after_ms(&self) -> u32 {
        u32::try_from(self.ends_after.as_millis()).unwrap_or(u32::MAX)
    }
}

/// Rules for the number of a datagram relative to the previous count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SequenceRules {
    /// Numbers that may be lost at once, for a sender that counts its datagrams. 10 to 100 000,
    /// default 1000. Origin: 4 s of EGM, longer than any network outage during which a run
    /// continues.
    pub lost_max: u32,
    /// A number outside the expected range is accepted after this many consecutive datagrams that count up from it; fewer may be replayed ones. 2 to 50, default 5.
    /// Origin: a run's `stopped_after` plus two, because a wrong decision starts a new run.
    pub accepted_after: u32,
    /// Largest step between two of these. 1 to 10 000, default 100. Origin: RSI counts ms, 12 per
    /// cycle; up to seven in a row may be lost.
    pub ahead_max: u32,
}

impl Default for SequenceRules {
    fn default() -> Self {
        Self { lost_max: 1000, accepted_after: 5, ahead_max: 100 }
    }
}

/// Rules for joining the daemon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct JoinRules {
    /// How long one attempt may take. 0.1 to 10 s, default 1 s. Origin: forty times what the first answer after a daemon's start took at worst (docs/figures.md).
    pub attempt_timeout: Duration,
    /// Pause between two attempts. 10 ms to 10 s, default 0.2 s. Origin: a restart is noticed without visible delay, at negligible load.
    pub retry_after: Duration,
}

impl Default for JoinRules {
    fn default() -> Self {
        Self { attempt_timeout: Duration::from_secs(1), retry_after: Duration::from_millis(200) }
    }
}
