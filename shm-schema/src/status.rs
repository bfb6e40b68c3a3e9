//! State of the daemon (`/status`): 25 times a second, from a thread that is not real-time.

use iceoryx2::prelude::ZeroCopySend;

use crate::JOINTS_MAX;
use crate::codes::{UnknownCode, codes};
use crate::feed::{FeedBounds, FeedReason, FeedState};
use crate::force::FORCE_CHANNELS_MAX;
use crate::horizon::LeadState;
use crate::layout::{check_range, payload, plain_struct};
use crate::measured::{TrimReason, TrimState};
use crate::sensor::ForceFault;
use crate::text::Text;
use crate::vibration::Verdict;

/// Buckets of the latency histogram in a status.
pub const LATENCY_BUCKETS: usize = 17;

/// Upper bound of a bucket of the latency histogram, ns: powers of two from 2¹⁰ (1.024 µs) to 2²⁵ (33.6 ms); none for the last bucket. A bucket begins where
/// the one before it ends.
#[must_use]
pub const fn latency_below_ns(bucket: usize) -> Option<u64> {
    if bucket + 1 < LATENCY_BUCKETS { Some(1 << (10 + bucket)) } else { None }
}

/// Most bytes of each name of a robot in a status.
pub const ROBOT_BYTES_MAX: usize = 64;

plain_struct! {
    /// Limits of the published joint targets; the client ramps by the same rule when the daemon is gone.
    pub struct JointBounds = "trued.JointBounds/1" {
        /// Lower joint limits, rad or m.
        pub min: [f64; JOINTS_MAX],
        /// Upper joint limits, rad or m.
        pub max: [f64; JOINTS_MAX],
        /// Largest correction, rad or m.
        pub angle: [f64; JOINTS_MAX],
        /// Largest rate of the correction, rad/s or m/s.
        pub rate: [f64; JOINTS_MAX],
        /// Largest jerk of the correction, rad/s³ or m/s³.
        pub jerk: [f64; JOINTS_MAX],
    }
}

plain_struct! {
    /// State of the daemon. The first one is published before the epoch is announced.
    pub struct Status = "trued.Status/6" {
        /// From 1, plus 1 with each message of this daemon's epoch.
        pub seq: u64,
        /// When it was made, `CLOCK_MONOTONIC`.
        pub t_ns: u64,
        /// When the daemon started, `CLOCK_MONOTONIC`.
        pub started_ns: u64,
        /// Plus 1 with each change of the model.
        pub model_epoch: u64,
        /// Hash of the model's text: its effects, tool and limits included.
        pub model_hash: u64,
        /// Hash of the robot's nominal geometry: kinds and axes of the joints, nothing else.
        pub geometry_hash: u64,
        /// Cycles run.
        pub cycles: u64,
        /// Cycles that came too late.
        pub missed_cycles: u64,
        /// Commands taken.
        pub commands: u64,
        /// Commands refused.
        pub rejected: u64,
        /// Targets with the last correction held.
        pub held: u64,
        /// Interruptions of the command stream.
        pub stale: u64,
        /// Commands lost, by gaps in their numbers.
        pub commands_lost: u64,
        /// Targets that could not be sent.
        pub corrected_lost: u64,
        /// Force blocks taken.
        pub force_blocks: u64,
        /// Force blocks lost, by gaps in their numbers.
        pub force_gaps: u64,
        /// Force blocks refused: another rate or shape than configured, or out of order.
        pub force_refused: u64,
        /// Messages that could not be read.
        pub malformed: u64,
        /// Records dropped by the recorder.
        pub recorder_dropped: u64,
        /// Latency from sending a command to its answer: median, ns.
        pub latency_p50_ns: u64,
        /// The same at 99 %.
        pub latency_p99_ns: u64,
        /// The same at 99.9 %.
        pub latency_p999_ns: u64,
        /// The worst.
        pub latency_max_ns: u64,
        /// Loop gain of the wrench correction as estimated (dimensionless; NaN where unknown).
        pub wrench_loop_gain: f64,
        /// Spindle speed used by the vibration monitor, 1/min (NaN where unknown).
        pub spindle_rpm: f64,
        /// Feed that it uses, mm/s: as reported, or from the commanded path (NaN where unknown).
        pub feed_mm_s: f64,
        /// Since when measurements of the tool contradict the model, `CLOCK_MONOTONIC`; 0 while it holds.
        pub model_broken_since_ns: u64,
        /// Measurements of the tool since the model was loaded.
        pub model_measurements: u64,
        /// RMS deviation of the latest of them from the model, m (NaN where there are none).
        pub model_residual_m: f64,
        /// Layout version.
        pub layout: u32,
        /// The daemon's process.
        pub pid: u32,
        /// A [`Health`].
        pub health: u32,
        /// A [`Mode`].
        pub mode: u32,
        /// 1 where bypassed.
        pub bypassed: u32,
        /// How many joints the model has, 1 to 16.
        pub joints: u32,
        /// A [`crate::WrenchGate`].
        pub wrench_gate: u32,
        /// A [`RecorderState`].
        pub recorder: u32,
        /// A [`WatchState`].
        pub watch: u32,
        /// Effects of the model that are not compensated.
        pub uncompensated_effects: u32,
        /// A [`crate::InCut`], as reported.
        pub in_cut: u32,
        /// Faults of the force stream: bit `n` is the [`crate::SensorFault`] of code `n`.
        pub stream_faults: u32,
        /// The same of each force channel.
        pub channel_faults: [u32; FORCE_CHANNELS_MAX],
        /// The dominant line of the force spectrum; its state is `over` where there is none.
        pub verdict: Verdict,
        /// Temperatures older than the cell's age limit: bit 0 the ambient one, bit `n` that of joint `n`.
        pub stale_temperatures: u32,
        /// Zero.
        pub reserved: u32,
        /// A [`TrimState`].
        pub trim_state: u32,
        /// A [`TrimReason`].
        pub trim_reason: u32,
        /// Displacement of the tool's target by the trim, base frame, m.
        pub trim_m: [f64; 3],
        /// Estimated error of the model, base frame, m: measured minus predicted.
        pub trim_found_m: [f64; 3],
        /// Measured points received.
        pub trim_measurements: u64,
        /// Measured points refused.
        pub trim_refused: u64,
        /// A [`FeedState`].
        pub feed_state: u32,
        /// A [`FeedReason`].
        pub feed_reason: u32,
        /// The feed override; 1 is the programmed feed.
        pub feed_override: f64,
        /// The override that keeps the force at its limit.
        pub feed_wanted: f64,
        /// The process force, low-passed, N (NaN where unknown).
        pub feed_force_n: f64,
        /// What it would be at the programmed feed, N (NaN where unknown).
        pub feed_programmed_force_n: f64,
        /// The limit as a force, N (NaN where unknown).
        pub feed_limit_n: f64,
        /// Speed of the commanded tool, m/s (NaN where unknown).
        pub feed_speed_m_s: f64,
        /// Wrenches that were refused: no numbers.
        pub feed_refused: u64,
        /// Bounds of the override.
        pub feed_bounds: FeedBounds,
        /// A [`LeadState`].
        pub lead_state: u32,
        /// Setpoints after the last command that were known, of those that the lead uses.
        pub horizon_points: u32,
        /// Setpoints after a command that the lead uses.
        pub horizon_points_used: u32,
        /// Horizons that were refused: a command differed from them, or no joint could follow them.
        pub horizons_refused: u32,
        /// Sum of all latencies since the start, ns.
        pub latency_sum_ns: u64,
        /// How many latencies each bucket holds, see [`latency_below_ns`].
        pub latency_counts: [u64; LATENCY_BUCKETS],
        /// Limits of joints and correction.
        pub bounds: JointBounds,
        /// The last command, rad or m; 0 before the first.
        pub q_command: [f64; JOINTS_MAX],
        /// The correction that the daemon allowed for it, rad or m; 0 before the first. In shadow mode the client sends none of it.
        pub correction: [f64; JOINTS_MAX],
        /// The robot's manufacturer as the model states it; empty where it does not.
        pub robot_maker: Text<ROBOT_BYTES_MAX>,
        /// The robot's type, likewise.
        pub robot_type: Text<ROBOT_BYTES_MAX>,
        /// The robot's serial number, likewise.
        pub robot_serial: Text<ROBOT_BYTES_MAX>,
        /// Message for the operator.
        pub message: Text<512>,
    }
}
payload!(Status = "trued.Status/6", layout 6, check |s| {
    check_range::<Status>("joints", u64::from(s.joints), 1..=JOINTS_MAX as u64, "1 to 16 joints")
});

impl Status {
    /// State of the daemon.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn health(&self) -> Result<Health, UnknownCode> {
        self.health.try_into()
    }

    /// How much the daemon may correct.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn mode(&self) -> Result<Mode, UnknownCode> {
        self.mode.try_into()
    }

    /// State of the vibration monitor.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn watch(&self) -> Result<WatchState, UnknownCode> {
        self.watch.try_into()
    }

    /// State of the trim.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn trim_state(&self) -> Result<TrimState, UnknownCode> {
        self.trim_state.try_into()
    }

    /// Reason for the state of the trim.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn trim_reason(&self) -> Result<TrimReason, UnknownCode> {
        self.trim_reason.try_into()
    }

    /// State of the feed override.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn feed_state(&self) -> Result<FeedState, UnknownCode> {
        self.feed_state.try_into()
    }

    /// Why the feed override is so.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn feed_reason(&self) -> Result<FeedReason, UnknownCode> {
        self.feed_reason.try_into()
    }

    /// Source of the compensation of delay, lags and modes.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn lead_state(&self) -> Result<LeadState, UnknownCode> {
        self.lead_state.try_into()
    }

    /// Faults of the force stream and its channels.
    pub fn force_faults(&self) -> impl Iterator<Item = ForceFault> {
        ForceFault::all(self.stream_faults, self.channel_faults)
    }
}

codes! {
    /// State of the daemon.
    pub enum Health {
        /// It starts.
        Starting = 0 "starting",
        /// Ready; no commands arrive.
        Idle = 1 "idle",
        /// It corrects.
        Running = 2 "running",
        /// It works with restrictions; `message` states them.
        Degraded = 3 "degraded",
        /// It corrects nothing; `message` says why.
        Fault = 4 "fault",
        /// It ends.
        Stopping = 5 "stopping",
    }
}

codes! {
    /// How much the daemon may correct.
    pub enum Mode {
        /// It computes and reports, and corrects nothing.
        Shadow = 0 "shadow",
        /// It corrects within a narrow envelope.
        Limited = 1 "limited",
        /// It corrects within the whole envelope.
        Full = 2 "full",
    }
}

codes! {
    /// State of the vibration monitor.
    pub enum WatchState {
        /// The cell has no vibration monitor.
        Off = 0 "off",
        /// It learns the noise floor: no line is reported yet.
        Learning = 1 "learning",
        /// Monitoring.
        Watching = 2 "watching",
    }
}

codes! {
    /// State of the recorder.
    pub enum RecorderState {
        /// It is switched off.
        Off = 0 "off",
        /// It writes.
        Recording = 1 "recording",
        /// It drops records: the disk is too slow or full.
        Dropping = 2 "dropping",
        /// It cannot write.
        Failed = 3 "failed",
        /// It writes nothing because it was asked to stop, or is configured to wait for a start.
        Stopped = 4 "stopped",
    }
}
