//! A status as JSON (schema `trued.status/1`): codes as words, units in the keys.

use serde::Serialize;
use shm_schema::{RecorderState, WrenchGate, latency_below_ns};
use trued_client::{
    FeedReason, FeedState, Health, InCut, JOINTS_MAX, LeadState, Mode, Status, TrimReason,
    TrimState, VibrationState, WatchState, monotonic_ns,
};

/// Status of a cell.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Its name.
    pub cell: String,
    /// Why the daemon does not respond; `null` if it does.
    pub away: Option<String>,
    /// Age of all following values.
    pub age_s: f64,
    /// The daemon's process.
    pub pid: u32,
    /// Time since the daemon's start.
    pub uptime_s: f64,
    /// State of the daemon, a name of [`Health`].
    pub health: &'static str,
    /// Summary for users.
    pub message: String,
    /// Name of the [`Mode`].
    pub mode: &'static str,
    /// Whether the correction is bypassed on request.
    pub bypassed: bool,
    /// The robot as the model states it.
    pub robot: Robot,
    /// The last command and its correction, joint by joint.
    pub joints: Vec<Joint>,
    /// The active model.
    pub model: Model,
    /// Counters since the start.
    pub counts: Counts,
    /// Time from the sending of a command to its answer.
    pub latency_us: Latency,
    /// The force stream.
    pub force: Force,
    /// The vibration monitor.
    pub vibration: Vibration,
    /// Name of the [`RecorderState`].
    pub recorder: &'static str,
    /// Records dropped by the recorder.
    pub recorder_dropped: u64,
    /// 0: ambient, n: joint n.
    pub stale_temperatures: Vec<u32>,
    /// The trim by measurements of the tool.
    pub trim: Trim,
    /// Adaptation of the feed to the force.
    pub feed: Feed,
    /// Compensation of delay, lags and modes.
    pub lead: Lead,
}

/// Lead compensation of delay, lags and modes.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Lead {
    /// Name of the [`LeadState`].
    pub state: &'static str,
    /// Setpoints after the last command that were known, of those that the lead uses.
    pub horizon_points: u32,
    /// Setpoints after a command that the lead uses.
    pub horizon_points_used: u32,
    /// Horizons that were refused: a command differed from them, or no joint could follow them.
    pub horizons_refused: u32,
}

/// Adaptation of the feed to the force. Forces and speed are `null` where unknown.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Feed {
    /// Name of the [`FeedState`].
    pub state: &'static str,
    /// Name of the [`FeedReason`].
    pub reason: &'static str,
    /// The override in use, percent of the programmed feed.
    pub override_percent: f64,
    /// The override that would keep the force at its limit, likewise.
    pub wanted_percent: f64,
    /// The process force, low-passed.
    #[serde(rename = "force_N")]
    pub force_n: f64,
    /// The force at the programmed feed.
    #[serde(rename = "programmed_force_N")]
    pub programmed_force_n: f64,
    /// The limit as a force.
    #[serde(rename = "limit_N")]
    pub limit_n: f64,
    /// Speed of the commanded tool.
    pub speed_mm_s: f64,
    /// Refused wrenches: values that are not finite.
    pub refused: u64,
}

/// The trim by measurements of the tool.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Trim {
    /// Name of the [`TrimState`].
    pub state: &'static str,
    /// Name of the [`TrimReason`].
    pub reason: &'static str,
    /// Displacement of the tool's target, base frame.
    pub trim_mm: [f64; 3],
    /// Estimate of the model's error, base frame: real minus predicted.
    pub found_mm: [f64; 3],
    /// Measurements received.
    pub measurements: u64,
    /// Measurements refused.
    pub refused: u64,
}

/// The robot; texts are empty if the model does not state them.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Robot {
    /// Manufacturer.
    pub maker: String,
    /// Type.
    #[serde(rename = "type")]
    pub kind: String,
    /// Serial number.
    pub serial: String,
    /// Number of joints.
    pub joints: u32,
}

/// A joint at the last command.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Joint {
    /// Commanded position, rad or m.
    pub command: f64,
    /// The limited correction, rad or m.
    pub correction: f64,
    /// The largest correction in this mode, rad or m.
    pub correction_max: f64,
    /// `correction` over `correction_max`, -1 to 1.
    pub share: f64,
}

/// The active model.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Model {
    /// Number of the model since the start.
    pub epoch: u64,
    /// Hash of its text.
    pub hash: String,
    /// Hash of the nominal geometry.
    pub geometry_hash: String,
    /// Effects that the real-time cycle does not compensate.
    pub uncompensated_effects: u32,
    /// Whether measurements of the tool agree with the model.
    pub holds: bool,
    /// Number of measurements.
    pub measurements: u64,
    /// Root mean square distance of recent measurements from the model.
    pub residual_mm: f64,
}

/// Counters since the start.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Counts {
    /// Cycles run.
    pub cycles: u64,
    /// Late cycles.
    pub missed_cycles: u64,
    /// Commands received.
    pub commands: u64,
    /// Missing commands, by their numbers.
    pub commands_lost: u64,
    /// Commands refused.
    pub rejected: u64,
    /// Targets with the last correction held.
    pub held: u64,
    /// Times that commands became stale.
    pub stale: u64,
    /// Targets that could not be sent.
    pub corrected_lost: u64,
    /// Messages that could not be read.
    pub malformed: u64,
}

/// Time from the sending of a command to its answer, µs.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Latency {
    /// The median.
    pub p50: f64,
    /// 99 %.
    pub p99: f64,
    /// 99.9 %.
    pub p999: f64,
    /// The largest.
    pub max: f64,
    /// The mean; 0 before the first.
    pub mean: f64,
    /// Counts since the start by size.
    pub histogram: Vec<LatencyBucket>,
}

/// One bucket of the latency histogram. It begins at the end of the previous one.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LatencyBucket {
    /// Its upper bound, µs; `null` for the last one.
    pub below: Option<f64>,
    /// Count.
    pub count: u64,
}

/// The force stream.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Force {
    /// Name of the [`WrenchGate`].
    pub wrench_gate: &'static str,
    /// Loop gain of the wrench correction, dimensionless.
    pub loop_gain: f64,
    /// Blocks received.
    pub blocks: u64,
    /// Missing blocks.
    pub gaps: u64,
    /// Blocks refused.
    pub refused: u64,
    /// Descriptions of the faults.
    pub faults: Vec<String>,
}

/// The vibration monitor.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Vibration {
    /// Name of the [`WatchState`].
    pub watch: &'static str,
    /// The most important line, as text; `null` if there is none.
    pub line: Option<String>,
    /// Name of the [`InCut`].
    pub in_cut: &'static str,
    /// Spindle speed used; NaN if unknown.
    pub spindle_rpm: f64,
    /// Feed used; NaN if unknown.
    pub feed_mm_s: f64,
}

/// The name of a code, or `unknown` for a code of a later version.
fn name_or_unknown<T, E>(code: Result<T, E>, name: impl Fn(T) -> &'static str) -> &'static str {
    code.map_or("unknown", name)
}

impl Report {
    /// The status of `cell`; `away`: why its daemon does not respond.
    #[must_use]
    pub fn new(cell: &str, status: &Status, away: Option<String>) -> Self {
        let seconds = |from_ns: u64, to_ns: u64| to_ns.saturating_sub(from_ns) as f64 * 1e-9;
        let is_stale = |place: &u32| status.stale_temperatures & (1 << place) != 0;
        Self {
            cell: cell.to_owned(),
            away,
            age_s: seconds(status.t_ns, monotonic_ns()),
            pid: status.pid,
            uptime_s: seconds(status.started_ns, status.t_ns),
            health: name_or_unknown(status.health(), Health::name),
            message: status.message.to_string(),
            mode: name_or_unknown(status.mode(), Mode::name),
            bypassed: status.bypassed != 0,
            robot: Robot {
                maker: status.robot_maker.to_string(),
                kind: status.robot_type.to_string(),
                serial: status.robot_serial.to_string(),
                joints: status.joints,
            },
            joints: joints(status),
            model: Model {
                epoch: status.model_epoch,
                hash: format!("{:016x}", status.model_hash),
                geometry_hash: format!("{:016x}", status.geometry_hash),
                uncompensated_effects: status.uncompensated_effects,
                holds: status.model_broken_since_ns == 0,
                measurements: status.model_measurements,
                residual_mm: 1e3 * status.model_residual_m,
            },
            counts: counts(status),
            latency_us: latency(status),
            force: Force {
                wrench_gate: name_or_unknown(status.wrench_gate.try_into(), WrenchGate::name),
                loop_gain: status.wrench_loop_gain,
                blocks: status.force_blocks,
                gaps: status.force_gaps,
                refused: status.force_refused,
                faults: status.force_faults().map(|fault| fault.to_string()).collect(),
            },
            vibration: vibration(status),
            recorder: name_or_unknown(status.recorder.try_into(), RecorderState::name),
            recorder_dropped: status.recorder_dropped,
            stale_temperatures: (0..=status.joints).filter(is_stale).collect(),
            trim: trim(status),
            feed: feed(status),
            lead: lead(status),
        }
    }
}

impl Trim {
    /// Length of the trim, mm.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        length(self.trim_mm)
    }

    /// Length of the estimated error of the model, mm.
    #[must_use]
    pub fn found_length_mm(&self) -> f64 {
        length(self.found_mm)
    }
}

fn length(vector: [f64; 3]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn trim(status: &Status) -> Trim {
    Trim {
        state: name_or_unknown(status.trim_state(), TrimState::name),
        reason: name_or_unknown(status.trim_reason(), TrimReason::name),
        trim_mm: status.trim_m.map(|m| 1e3 * m),
        found_mm: status.trim_found_m.map(|m| 1e3 * m),
        measurements: status.trim_measurements,
        refused: status.trim_refused,
    }
}

fn lead(status: &Status) -> Lead {
    Lead {
        state: name_or_unknown(status.lead_state(), LeadState::name),
        horizon_points: status.horizon_points,
        horizon_points_used: status.horizon_points_used,
        horizons_refused: status.horizons_refused,
    }
}

fn feed(status: &Status) -> Feed {
    Feed {
        state: name_or_unknown(status.feed_state(), FeedState::name),
        reason: name_or_unknown(status.feed_reason(), FeedReason::name),
        override_percent: 1e2 * status.feed_override,
        wanted_percent: 1e2 * status.feed_wanted,
        force_n: status.feed_force_n,
        programmed_force_n: status.feed_programmed_force_n,
        limit_n: status.feed_limit_n,
        speed_mm_s: 1e3 * status.feed_speed_m_s,
        refused: status.feed_refused,
    }
}

fn joints(status: &Status) -> Vec<Joint> {
    let count = (status.joints as usize).min(JOINTS_MAX);
    let joint = |k: usize| {
        let (correction, correction_max) = (status.correction[k], status.bounds.angle[k]);
        let share = if correction_max > 0.0 { correction / correction_max } else { 0.0 };
        Joint { command: status.q_command[k], correction, correction_max, share }
    };
    (0..count).map(joint).collect()
}

fn counts(status: &Status) -> Counts {
    Counts {
        cycles: status.cycles,
        missed_cycles: status.missed_cycles,
        commands: status.commands,
        commands_lost: status.commands_lost,
        rejected: status.rejected,
        held: status.held,
        stale: status.stale,
        corrected_lost: status.corrected_lost,
        malformed: status.malformed,
    }
}

fn latency(status: &Status) -> Latency {
    let us = |ns: u64| ns as f64 * 1e-3;
    let count: u64 = status.latency_counts.iter().sum();
    let bucket = |(bucket, &count): (usize, &u64)| LatencyBucket {
        below: latency_below_ns(bucket).map(|ns| ns as f64 / 1e3),
        count,
    };
    Latency {
        p50: us(status.latency_p50_ns),
        p99: us(status.latency_p99_ns),
        p999: us(status.latency_p999_ns),
        max: us(status.latency_max_ns),
        mean: us(status.latency_sum_ns) / count.max(1) as f64,
        histogram: status.latency_counts.iter().enumerate().map(bucket).collect(),
    }
}

fn vibration(status: &Status) -> Vibration {
    let has_line = status.verdict.state().is_ok_and(|state| state != VibrationState::Over);
    Vibration {
        watch: name_or_unknown(status.watch(), WatchState::name),
        line: has_line.then(|| status.verdict.to_string()),
        in_cut: name_or_unknown(status.in_cut.try_into(), InCut::name),
        spindle_rpm: status.spindle_rpm,
        feed_mm_s: status.feed_mm_s,
    }
}
