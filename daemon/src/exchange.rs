//! Data shared by the threads: bounded rings allocated at the start, atomically swapped values, counters.
//!
//! No thread waits for another; no locks; a full ring drops the newest entry and counts
//! it.

use crate::latency::Latency;
use crate::position::Positions;
use crate::process::MonitorInputs;
use crate::sensor_inputs::MeasuredWrench;
use crate::tool_motion::PathPoint;
use crate::translate;
use corrector::{FeedReport, Mode, TrimReport};
use crossbeam::queue::ArrayQueue;
use envelope::OverrideLimits;
use joint_dynamics::Filter;
use physics::Model;
use recording::mcap_recording::{LogRecord, ModelChange, StatusRecord};
use shm_schema::{
    Answer, Command, Corrected, DaemonPorts, ForceBlock, JOINTS_MAX, LeadState, Reason,
    RecorderAction, RecorderState, Status, Verdict,
};
use spectrum::Health;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};

/// Cycles that the recorder may lag behind.
const CYCLES_CAPACITY: usize = 4096;
/// Force blocks that the recorder may lag behind; 24 kB each.
const BLOCKS_CAPACITY: usize = 128;
/// A recorder without progress for this long is waiting for its disk, ns.
const RECORDER_HANGS_NS: u64 = 1_000_000_000;
const VERDICTS_CAPACITY: usize = 256;
/// Changes of the model that the recorder may lag behind.
const MODELS_CAPACITY: usize = 16;
/// Log lines that the recorder may lag behind, or that wait for space on the disk.
const LINES_CAPACITY: usize = 256;
/// The same for states: as many seconds.
const STATES_CAPACITY: usize = 64;
/// Commanded points that the supervisor may lag behind; further ones are dropped without effect.
const PATH_CAPACITY: usize = 256;
/// Messages between supervisor and vibration thread that may wait: each replaces the previous ones.
const MAILBOX_CAPACITY: usize = 4;

/// A model on its way to the cycle and, once replaced, back to the supervisor, which frees it.
#[derive(Debug)]
pub struct LoadedModel {
    /// The physics.
    pub physics: Model,
    /// Number of the model since the start.
    pub epoch: u64,
    /// The filter that compensates delay, lags and modes; `None` if the cell does not use it, or if the model has none of them.
    pub filter: Option<Box<Filter>>,
}

impl LoadedModel {
    /// A model without dynamic compensation.
    #[must_use]
    pub fn new(physics: Model, epoch: u64) -> Self {
        Self { physics, epoch, filter: None }
    }
}

/// One cycle, for the recording.
#[derive(Clone, Copy, Debug)]
pub struct CycleRecord {
    /// The command received.
    pub command: Command,
    /// The target sent.
    pub corrected: Corrected,
    /// The wrench used in the cycle, force and moment at the TCP; NaN where unknown.
    pub wrench: [f64; 6],
    /// Whether it is in base axes.
    pub wrench_in_base: bool,
    /// The temperatures used in the cycle, ambient and then one per joint, °C; NaN where unknown.
    pub celsius: [f64; JOINTS_MAX + 1],
    /// The trim in force, base frame, m, and the newest point measured since the previous cycle;
    /// `None` without an instrument.
    pub trim: Option<([f64; 3], Option<MeasuredInBase>)>,
}

/// A measured point, transformed by the registration.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredInBase {
    /// Base frame, m.
    pub point_m: [f64; 3],
    /// When it was measured, ns.
    pub t_ns: u64,
}

/// Sensor status from the vibration thread.
#[derive(Clone, Copy, Debug, Default)]
pub struct SensorStatus {
    /// State of sensor and stream.
    pub health: Health,
    /// Faults of the blocks' clock in the last second, as a set of `shm_schema::SensorFault`.
    pub clock_faults: u32,
    /// The most important line now, if any.
    pub line: Option<Verdict>,
}

/// Answer to a request to the recorder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecorderAnswer {
    /// Done or refused.
    pub answer: Answer,
    /// Message, with the file.
    pub message: String,
}

/// All data that the threads exchange.
#[derive(Debug)]
pub struct Exchange {
    stop: AtomicBool,
    /// Supervisor to cycle: a model to activate between two cycles.
    pub next_model: ArrayQueue<Box<LoadedModel>>,
    /// Cycle to supervisor: the replaced model.
    pub retired_models: ArrayQueue<Box<LoadedModel>>,
    /// Supervisor to cycle and vibration: ports of a new epoch.
    pub new_ports: [ArrayQueue<DaemonPorts>; 2],
    /// Vibration to cycle: the newest wrench.
    pub newest_wrench: ArrayQueue<MeasuredWrench>,
    /// Supervisor to vibration: state of the process.
    pub monitor_inputs: ArrayQueue<MonitorInputs>,
    /// Cycle to supervisor: the commanded path.
    pub path: ArrayQueue<PathPoint>,
    /// Supervisor to cycle: spindle speed, rev/min, as bits.
    pub spindle_rpm_bits: AtomicU64,
    /// Cycle to recorder.
    pub cycles: ArrayQueue<CycleRecord>,
    /// Vibration to recorder.
    pub blocks: ArrayQueue<Box<ForceBlock>>,
    /// Recorder to vibration: empty blocks for reuse, so that nothing is allocated.
    pub empty_blocks: ArrayQueue<Box<ForceBlock>>,
    /// Supervisor to recorder: models that were activated, each with the time of the change, ns.
    pub model_changes: ArrayQueue<Box<ModelChange>>,
    /// All threads of the cell except the cycle, to recorder: log lines.
    pub lines: ArrayQueue<Box<LogRecord>>,
    /// Supervisor to recorder: requests.
    pub recorder_requests: ArrayQueue<RecorderAction>,
    /// Recorder to supervisor: answers to requests.
    pub recorder_answers: ArrayQueue<RecorderAnswer>,
    /// Supervisor to recorder: states of the daemon.
    pub states: ArrayQueue<Box<StatusRecord>>,
    /// Vibration to recorder.
    pub verdicts: ArrayQueue<Verdict>,
    /// Vibration to supervisor: verdicts, for the log and the status.
    pub new_verdicts: ArrayQueue<Verdict>,
    /// Vibration to supervisor: sensor status.
    pub sensor_status: ArrayQueue<SensorStatus>,
    /// Cycle to supervisor: latency from the sending of a command to its answer.
    pub latency: Latency,
    /// Counters.
    pub counters: Counters,
    /// Cycle to supervisor: last position of the arm.
    pub positions: Positions,
    /// Supervisor to cycle: whether the correction is bypassed.
    pub bypassed: AtomicBool,
    /// Supervisor to cycle: opens a wrench gate that closed for its loop gain, as a new trial.
    pub rearm_wrench: AtomicBool,
    /// Supervisor to cycle: accepts an instrument again after a jump.
    pub rearm_instrument: AtomicBool,
    mode: AtomicU32,
    recorder: AtomicU32,
    has_recorder: bool,
}

/// Counters. Each has one writer.
#[derive(Debug, Default)]
#[expect(missing_docs, reason = "each name is what shm_schema::Status documents")]
pub struct Counters {
    /// Iterations of the cycle's loop, with or without a command; shows that it is running.
    pub iterations: AtomicU64,
    pub cycles: AtomicU64,
    pub missed_cycles: AtomicU64,
    pub commands: AtomicU64,
    pub commands_lost: AtomicU64,
    pub rejected: AtomicU64,
    pub held: AtomicU64,
    pub stale: AtomicU64,
    pub malformed: AtomicU64,
    pub corrected_lost: AtomicU64,
    pub force_blocks: AtomicU64,
    pub force_gaps: AtomicU64,
    pub force_refused: AtomicU64,
    pub recorder_dropped: AtomicU64,
    /// Answers by their `shm_schema::Reason`.
    pub reasons: [AtomicU64; Reason::ALL.len()],
    /// Loop gain of the wrench correction, as bits.
    pub loop_gain_bits: AtomicU64,
    /// `shm_schema::WrenchGate` of the last cycle.
    pub gate: AtomicU32,
    /// Model epoch of the last cycle.
    pub model_epoch: AtomicU64,
    /// The last command, rad or m, as bits. For displays: a reader may see some joints of one command and some of the next.
    q_command_bits: [AtomicU64; JOINTS_MAX],
    /// The limited correction for it, likewise.
    correction_bits: [AtomicU64; JOINTS_MAX],
    /// Status and reason of the last cycle: status in the upper half.
    pub last_status_and_reason: AtomicU64,
    /// `CLOCK_MONOTONIC` of the last command, ns.
    pub last_command_ns: AtomicU64,
    /// `CLOCK_MONOTONIC` of the recorder's last turn, ns.
    pub recorder_turn_ns: AtomicU64,
    pub stale_temperatures: AtomicU32,
    /// `CLOCK_MONOTONIC` of the last force block, ns; 0 before the first.
    pub last_block_ns: AtomicU64,
    /// State of the trim.
    pub trim: TrimCounters,
    /// State of the feed override.
    pub feed: FeedCounters,
    /// State of the lead.
    pub lead: LeadCounters,
}

/// State of the lead as of the last cycle, for displays.
#[derive(Debug, Default)]
pub struct LeadCounters {
    /// State, number of known points of the horizon, and largest number of points used: 16, 24 and 24 bits.
    state: AtomicU64,
    refused: AtomicU64,
}

impl LeadCounters {
    /// Stores the state of a cycle.
    pub fn store(&self, state: LeadState, known: u32, used_at_most: u32, refused: u64) {
        let counts = u64::from(known & 0xff_ffff) << 24 | u64::from(used_at_most & 0xff_ffff);
        self.state.store(u64::from(state.code()) << 48 | counts, Relaxed);
        self.refused.store(refused, Relaxed);
    }

    /// Writes it into a status.
    pub fn write_status(&self, status: &mut Status) {
        let state = self.state.load(Relaxed);
        status.lead_state = (state >> 48) as u32;
        status.horizon_points = (state >> 24) as u32 & 0xff_ffff;
        status.horizon_points_used = state as u32 & 0xff_ffff;
        status.horizons_refused = self.refused.load(Relaxed) as u32;
    }
}

/// State of the trim as of the last cycle. For displays: a reader may see some numbers of one cycle
/// and some of the next.
#[derive(Debug, Default)]
pub struct TrimCounters {
    /// State in the upper half, reason in the lower.
    state: AtomicU64,
    trim_bits: [AtomicU64; 3],
    found_bits: [AtomicU64; 3],
    measurements: AtomicU64,
    refused: AtomicU64,
}

impl TrimCounters {
    /// Stores a report.
    pub fn store(&self, report: &TrimReport) {
        let (state, reason) = translate::trim(report);
        self.state.store(u64::from(state.code()) << 32 | u64::from(reason.code()), Relaxed);
        let store = |to: &[AtomicU64; 3], from: [f64; 3]| {
            to.iter().zip(from).for_each(|(bits, value)| bits.store(value.to_bits(), Relaxed));
        };
        store(&self.trim_bits, report.trim_m.to_array());
        store(&self.found_bits, report.model_error_m.to_array());
        self.measurements.store(report.measurements, Relaxed);
        self.refused.store(report.refused, Relaxed);
    }

    /// Writes it into a status.
    pub fn write_status(&self, status: &mut Status) {
        let load =
            |from: &[AtomicU64; 3]| from.each_ref().map(|bits| f64::from_bits(bits.load(Relaxed)));
        let state = self.state.load(Relaxed);
        (status.trim_state, status.trim_reason) = ((state >> 32) as u32, state as u32);
        (status.trim_m, status.trim_found_m) = (load(&self.trim_bits), load(&self.found_bits));
        status.trim_measurements = self.measurements.load(Relaxed);
        status.trim_refused = self.refused.load(Relaxed);
    }
}

/// State of the feed override as of the last cycle.
#[derive(Debug)]
pub struct FeedCounters {
    /// State in the upper half, reason in the lower.
    state: AtomicU64,
    /// In the order of [`FeedCounters::write_status`].
    numbers_bits: [AtomicU64; 11],
    refused: AtomicU64,
}

impl Default for FeedCounters {
    fn default() -> Self {
        let nan = f64::NAN;
        let numbers = [1.0, 1.0, nan, nan, nan, nan, 0.0, 1.0, 0.0, 0.0, 0.0];
        Self {
            state: AtomicU64::new(0),
            numbers_bits: numbers.map(|number: f64| AtomicU64::new(number.to_bits())),
            refused: AtomicU64::new(0),
        }
    }
}

impl FeedCounters {
    /// Stores a report, the bounds of the override, and its value without a daemon.
    pub fn store(&self, report: &FeedReport, bounds: &OverrideLimits, hold_s: f64, lost: f64) {
        let (state, reason) = translate::feed(report);
        self.state.store(u64::from(state.code()) << 32 | u64::from(reason.code()), Relaxed);
        let numbers = [
            report.feed_override,
            report.requested,
            report.force_n,
            report.programmed_force_n,
            report.limit_n,
            report.speed_m_s,
            bounds.floor(),
            lost,
            bounds.down_per_s(),
            bounds.up_per_s(),
            hold_s,
        ];
        for (bits, number) in self.numbers_bits.iter().zip(numbers) {
            bits.store(number.to_bits(), Relaxed);
        }
        self.refused.store(report.refused, Relaxed);
    }

    /// Writes it into a status.
    pub fn write_status(&self, status: &mut Status) {
        let state = self.state.load(Relaxed);
        (status.feed_state, status.feed_reason) = ((state >> 32) as u32, state as u32);
        let bounds = &mut status.feed_bounds;
        let numbers = [
            &mut status.feed_override,
            &mut status.feed_wanted,
            &mut status.feed_force_n,
            &mut status.feed_programmed_force_n,
            &mut status.feed_limit_n,
            &mut status.feed_speed_m_s,
            &mut bounds.floor,
            &mut bounds.lost,
            &mut bounds.down_per_s,
            &mut bounds.up_per_s,
            &mut bounds.hold_s,
        ];
        for (number, bits) in numbers.into_iter().zip(&self.numbers_bits) {
            *number = f64::from_bits(bits.load(Relaxed));
        }
        status.feed_refused = self.refused.load(Relaxed);
    }
}

impl Counters {
    /// Counts an answer by the code of its reason.
    pub fn count_reason(&self, code: u32) {
        if let Some(counter) = self.reasons.get(code as usize) {
            count(counter);
        }
    }

    /// Stores the last command and its correction, for the joints of the arm, for the status.
    pub fn store_command(&self, q_command: &[f64], correction: &[f64]) {
        let store = |to: &[AtomicU64; JOINTS_MAX], from: &[f64]| {
            to.iter().zip(from).for_each(|(bits, value)| bits.store(value.to_bits(), Relaxed));
        };
        store(&self.q_command_bits, q_command);
        store(&self.correction_bits, correction);
    }

    /// The last command, rad or m.
    pub fn q_command(&self) -> [f64; JOINTS_MAX] {
        self.q_command_bits.each_ref().map(|bits| f64::from_bits(bits.load(Relaxed)))
    }

    /// The limited correction for it, rad or m.
    pub fn correction(&self) -> [f64; JOINTS_MAX] {
        self.correction_bits.each_ref().map(|bits| f64::from_bits(bits.load(Relaxed)))
    }

    /// Number of answers with this reason.
    pub fn reason(&self, reason: Reason) -> u64 {
        self.reasons.get(reason.code() as usize).map_or(0, |counter| counter.load(Relaxed))
    }
}

impl Exchange {
    /// Creates all rings; `has_recorder`: whether a recorder drains its rings.
    pub fn new(mode: Mode, has_recorder: bool) -> Self {
        let kept = |n: usize| if has_recorder { n } else { 1 };
        let empty_blocks = ArrayQueue::new(BLOCKS_CAPACITY);
        for _ in 0..kept(BLOCKS_CAPACITY) {
            let _ = empty_blocks.push(Box::default());
        }
        Self {
            stop: AtomicBool::new(false),
            next_model: ArrayQueue::new(1),
            retired_models: ArrayQueue::new(2),
            new_ports: [ArrayQueue::new(1), ArrayQueue::new(1)],
            newest_wrench: ArrayQueue::new(1),
            monitor_inputs: ArrayQueue::new(MAILBOX_CAPACITY),
            path: ArrayQueue::new(PATH_CAPACITY),
            spindle_rpm_bits: AtomicU64::new(f64::NAN.to_bits()),
            cycles: ArrayQueue::new(kept(CYCLES_CAPACITY)),
            blocks: ArrayQueue::new(BLOCKS_CAPACITY),
            empty_blocks,
            model_changes: ArrayQueue::new(MODELS_CAPACITY),
            lines: ArrayQueue::new(kept(LINES_CAPACITY)),
            recorder_requests: ArrayQueue::new(1),
            recorder_answers: ArrayQueue::new(1),
            states: ArrayQueue::new(kept(STATES_CAPACITY)),
            verdicts: ArrayQueue::new(VERDICTS_CAPACITY),
            new_verdicts: ArrayQueue::new(VERDICTS_CAPACITY),
            sensor_status: ArrayQueue::new(MAILBOX_CAPACITY),
            latency: Latency::default(),
            counters: Counters::default(),
            positions: Positions::default(),
            bypassed: AtomicBool::new(false),
            rearm_wrench: AtomicBool::new(false),
            rearm_instrument: AtomicBool::new(false),
            mode: AtomicU32::new(mode_code(mode)),
            recorder: AtomicU32::new(RecorderState::Off.code()),
            has_recorder,
        }
    }

    /// Passes a cycle to the recorder, if there is one; counts it if the ring is full.
    pub fn record(&self, cycle: impl FnOnce() -> CycleRecord) {
        if self.has_recorder && self.cycles.push(cycle()).is_err() {
            count(&self.counters.recorder_dropped);
        }
    }

    /// Passes a change of the model to the recorder, if there is one; if its ring is full, the
    /// oldest is dropped.
    pub fn record_model(&self, change: ModelChange) {
        if self.has_recorder {
            self.model_changes.force_push(Box::new(change));
        }
    }

    /// Passes a log line to the recorder, if there is one; the oldest is dropped if too many wait.
    pub fn record_line(&self, line: impl FnOnce() -> LogRecord) {
        if self.has_recorder {
            self.lines.force_push(Box::new(line()));
        }
    }

    /// Passes a state of the daemon to the recorder, likewise.
    pub fn record_status(&self, state: StatusRecord) {
        if self.has_recorder {
            self.states.force_push(Box::new(state));
        }
    }

    /// Passes a force block to the recorder, if there is one, in one of its empty blocks.
    pub fn record_block(&self, block: &ForceBlock) {
        if !self.has_recorder {
            return;
        }
        let handed_over = self.empty_blocks.pop().is_some_and(|mut empty| {
            *empty = *block;
            self.blocks.push(empty).is_ok()
        });
        if !handed_over {
            count(&self.counters.recorder_dropped);
        }
    }

    /// State of the recorder. One that hangs in its disk cannot report this itself; it is detected
    /// by its missing progress.
    pub fn recorder(&self, now_ns: u64) -> RecorderState {
        let state =
            RecorderState::try_from(self.recorder.load(Relaxed)).unwrap_or(RecorderState::Failed);
        let turn_ns = self.counters.recorder_turn_ns.load(Relaxed);
        let hangs = now_ns.saturating_sub(turn_ns) > RECORDER_HANGS_NS;
        if state == RecorderState::Recording && hangs { RecorderState::Dropping } else { state }
    }

    /// Whether there is a recorder.
    pub fn has_recorder(&self) -> bool {
        self.has_recorder
    }

    /// Sets the state of the recorder.
    pub fn set_recorder(&self, state: RecorderState) {
        self.recorder.store(state.code(), Relaxed);
    }

    /// Whether the threads continue.
    pub fn is_running(&self) -> bool {
        !self.stop.load(Relaxed)
    }

    /// Ends all threads at their next iteration.
    pub fn stop(&self) {
        self.stop.store(true, Relaxed);
    }

    /// The mode in force.
    pub fn mode(&self) -> Mode {
        match self.mode.load(Relaxed) {
            0 => Mode::Shadow,
            1 => Mode::Limited,
            _ => Mode::Full,
        }
    }

    /// Sets the mode, from the next cycle on.
    pub fn set_mode(&self, mode: Mode) {
        self.mode.store(mode_code(mode), Relaxed);
    }
}

fn mode_code(mode: Mode) -> u32 {
    match mode {
        Mode::Shadow => 0,
        Mode::Limited => 1,
        Mode::Full => 2,
    }
}

/// Increments a counter.
pub fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Relaxed);
}
