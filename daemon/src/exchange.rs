//! Data shared by the threads: bounded rings allocated at the start, atomically swapped values, counters.
//!
//! Promises: no thread waits for another; a full ring drops the newest and counts it.
//! Never: a lock.

use crate::latency::Latency;
use crate::position::Positions;
use crate::process::Known;
use crate::senses::Measured;
use crate::translate;
use crate::travel::PathPoint;
use corrector::{FeedReport, Mode, TrimReport};
use crossbeam::queue::ArrayQueue;
use envelope::OverrideLimits;
use physics::Model;
use recording::blackbox::{LogRecord, ModelChange, StatusRecord};
use shm_schema::{
    Answer, Command, Corrected, DaemonPorts, ForceBlock, JOINTS_MAX, Reason, RecorderAction,
    RecorderState, Status, Verdict,
};
use spectrum::Health;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};

/// Cycles that the recorder may lag behind.
const CYCLES_KEPT: usize = 4096;
/// Force blocks that the recorder may lag behind; 24 kB each.
const BLOCKS_KEPT: usize = 128;
/// A recorder that has not come back for so long waits for its disk, ns.
const RECORDER_HANGS_NS: u64 = 1_000_000_000;
const VERDICTS_KEPT: usize = 256;
/// Changes of the model that the recorder may lag behind.
const MODELS_KEPT: usize = 16;
/// Lines of the log that the recorder may lag behind, or that wait for a disk with room.
const LINES_KEPT: usize = 256;
/// The same for states: as many seconds.
const STATES_KEPT: usize = 64;
/// Commanded points that the supervisor may lag behind; what is dropped beyond is not missed.
const PATH_KEPT: usize = 256;
/// Accounts between supervisor and vibration that may wait: each makes those before it needless.
const ACCOUNTS_KEPT: usize = 4;

/// A model on its way to the cycle, and, once replaced, back to be freed where freeing may take time.
#[derive(Debug)]
pub struct LoadedModel {
    /// The physics.
    pub physics: Model,
    /// Counts models since the start.
    pub epoch: u64,
}

/// One cycle, for the black box.
#[derive(Clone, Copy, Debug)]
pub struct CycleRecord {
    /// What came.
    pub command: Command,
    /// What went out.
    pub corrected: Corrected,
    /// The wrench as it entered the cycle, force and moment at the TCP; NaN where none was known.
    pub wrench: [f64; 6],
    /// Whether it stood in base axes.
    pub wrench_in_base: bool,
    /// The temperatures as they entered the cycle, ambient and then one per joint, °C; NaN where unknown.
    pub celsius: [f64; JOINTS_MAX + 1],
    /// The trim in force, base frame, m, and the newest point that was measured since the cycle before; none without an instrument.
    pub trim: Option<([f64; 3], Option<MeasuredInBase>)>,
}

/// A measured point by the registration.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredInBase {
    /// Base frame, m.
    pub point_m: [f64; 3],
    /// When it was measured, ns.
    pub t_ns: u64,
}

/// What the vibration thread has to say of itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hearing {
    /// Sensor and stream.
    pub health: Health,
    /// Faults of the blocks' clock in the last second, as a set of `shm_schema::SensorFault`.
    pub clock_faults: u32,
    /// The line that matters most now, where there is one.
    pub line: Option<Verdict>,
}

/// What became of a request to the recorder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecorderAnswer {
    /// Done or refused.
    pub answer: Answer,
    /// In words, with the file.
    pub says: String,
}

/// Everything that threads hand to each other.
#[derive(Debug)]
pub struct Exchange {
    stop: AtomicBool,
    /// Supervisor to cycle: a model to take over between two cycles.
    pub next_model: ArrayQueue<Box<LoadedModel>>,
    /// Cycle to supervisor: the model that it replaced.
    pub retired_models: ArrayQueue<Box<LoadedModel>>,
    /// Supervisor to cycle and vibration: ports of a new epoch.
    pub new_ports: [ArrayQueue<DaemonPorts>; 2],
    /// Vibration to cycle: the newest wrench.
    pub newest_wrench: ArrayQueue<Measured>,
    /// Supervisor to vibration: what the process does.
    pub known: ArrayQueue<Known>,
    /// Cycle to supervisor: where the tool is sent.
    pub path: ArrayQueue<PathPoint>,
    /// Supervisor to cycle: spindle speed, rev/min, as bits.
    pub spindle_rpm_bits: AtomicU64,
    /// Cycle to recorder.
    pub cycles: ArrayQueue<CycleRecord>,
    /// Vibration to recorder.
    pub blocks: ArrayQueue<Box<ForceBlock>>,
    /// Recorder to vibration: boxes to be filled again, so that nobody allocates.
    pub empty_blocks: ArrayQueue<Box<ForceBlock>>,
    /// Supervisor to recorder: models that took the place of the one before, each with the time of the change, ns.
    pub model_changes: ArrayQueue<Box<ModelChange>>,
    /// The cell's threads, but for the cycle, to recorder: what they log.
    pub lines: ArrayQueue<Box<LogRecord>>,
    /// Supervisor to recorder: what somebody asks of it.
    pub recorder_asked: ArrayQueue<RecorderAction>,
    /// Recorder to supervisor: what became of it.
    pub recorder_answered: ArrayQueue<RecorderAnswer>,
    /// Supervisor to recorder: how the daemon is.
    pub states: ArrayQueue<Box<StatusRecord>>,
    /// Vibration to recorder.
    pub verdicts: ArrayQueue<Verdict>,
    /// Vibration to supervisor: verdicts, to be told.
    pub told: ArrayQueue<Verdict>,
    /// Vibration to supervisor: how it is.
    pub hearing: ArrayQueue<Hearing>,
    /// Cycle to supervisor: latency from the command's sending to its answer.
    pub latency: Latency,
    /// Counts.
    pub counters: Counters,
    /// Cycle to supervisor: where the arm was last.
    pub positions: Positions,
    /// Supervisor to cycle: the correction is to be taken out.
    pub bypassed: AtomicBool,
    /// Supervisor to cycle: a wrench gate that closed for its loop gain may try again.
    pub rearm: AtomicBool,
    /// Supervisor to cycle: an instrument that jumped is to be believed again.
    pub believe_instrument: AtomicBool,
    mode: AtomicU32,
    recorder: AtomicU32,
    records: bool,
}

/// What is counted. Each has one writer.
#[derive(Debug, Default)]
#[expect(missing_docs, reason = "each name is what shm_schema::Status documents")]
pub struct Counters {
    /// Turns of the cycle's loop, with a command or without: it lives.
    pub turns: AtomicU64,
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
    /// The correction allowed for it, likewise.
    correction_bits: [AtomicU64; JOINTS_MAX],
    /// Status and reason of the last cycle: status in the upper half.
    pub last_said: AtomicU64,
    /// `CLOCK_MONOTONIC` of the last command, ns.
    pub last_command_ns: AtomicU64,
    /// `CLOCK_MONOTONIC` of the recorder's last turn, ns.
    pub recorder_turn_ns: AtomicU64,
    pub stale_temperatures: AtomicU32,
    /// `CLOCK_MONOTONIC` of the last force block, ns; 0 before the first.
    pub last_block_ns: AtomicU64,
    /// How the trim by measurements is.
    pub trim: TrimCounters,
    /// State of the feed override.
    pub feed: FeedCounters,
}

/// How the trim by measurements is, as of the last cycle. For displays: a reader may see some numbers of one cycle and some of the next.
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
    /// Keeps a report.
    pub fn show(&self, report: &TrimReport) {
        let (state, reason) = translate::trim(report);
        self.state.store(u64::from(state.code()) << 32 | u64::from(reason.code()), Relaxed);
        let store = |to: &[AtomicU64; 3], from: [f64; 3]| {
            to.iter().zip(from).for_each(|(bits, value)| bits.store(value.to_bits(), Relaxed));
        };
        store(&self.trim_bits, report.trim_m.to_array());
        store(&self.found_bits, report.found_m.to_array());
        self.measurements.store(report.measurements, Relaxed);
        self.refused.store(report.refused, Relaxed);
    }

    /// Writes it into a status.
    pub fn put(&self, status: &mut Status) {
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
    /// In the order of [`FeedCounters::put`].
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
    pub fn show(&self, report: &FeedReport, bounds: &OverrideLimits, hold_s: f64, lost: f64) {
        let (state, reason) = translate::feed(report);
        self.state.store(u64::from(state.code()) << 32 | u64::from(reason.code()), Relaxed);
        let numbers = [
            report.feed_override,
            report.wanted,
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
    pub fn put(&self, status: &mut Status) {
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

    /// Keeps the last command and its correction, of the joints that the arm has, for the status.
    pub fn show(&self, q_command: &[f64], correction: &[f64]) {
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

    /// The correction allowed for it, rad or m.
    pub fn correction(&self) -> [f64; JOINTS_MAX] {
        self.correction_bits.each_ref().map(|bits| f64::from_bits(bits.load(Relaxed)))
    }

    /// Answers for that reason.
    pub fn reason(&self, reason: Reason) -> u64 {
        self.reasons.get(reason.code() as usize).map_or(0, |counter| counter.load(Relaxed))
    }
}

impl Exchange {
    /// Makes all rings; `records` tells whether a recorder will drain its own.
    pub fn new(mode: Mode, records: bool) -> Self {
        let kept = |n: usize| if records { n } else { 1 };
        let empty_blocks = ArrayQueue::new(BLOCKS_KEPT);
        for _ in 0..kept(BLOCKS_KEPT) {
            let _ = empty_blocks.push(Box::default());
        }
        Self {
            stop: AtomicBool::new(false),
            next_model: ArrayQueue::new(1),
            retired_models: ArrayQueue::new(2),
            new_ports: [ArrayQueue::new(1), ArrayQueue::new(1)],
            newest_wrench: ArrayQueue::new(1),
            known: ArrayQueue::new(ACCOUNTS_KEPT),
            path: ArrayQueue::new(PATH_KEPT),
            spindle_rpm_bits: AtomicU64::new(f64::NAN.to_bits()),
            cycles: ArrayQueue::new(kept(CYCLES_KEPT)),
            blocks: ArrayQueue::new(BLOCKS_KEPT),
            empty_blocks,
            model_changes: ArrayQueue::new(MODELS_KEPT),
            lines: ArrayQueue::new(kept(LINES_KEPT)),
            recorder_asked: ArrayQueue::new(1),
            recorder_answered: ArrayQueue::new(1),
            states: ArrayQueue::new(kept(STATES_KEPT)),
            verdicts: ArrayQueue::new(VERDICTS_KEPT),
            told: ArrayQueue::new(VERDICTS_KEPT),
            hearing: ArrayQueue::new(ACCOUNTS_KEPT),
            latency: Latency::default(),
            counters: Counters::default(),
            positions: Positions::default(),
            bypassed: AtomicBool::new(false),
            rearm: AtomicBool::new(false),
            believe_instrument: AtomicBool::new(false),
            mode: AtomicU32::new(mode_code(mode)),
            recorder: AtomicU32::new(RecorderState::Off.code()),
            records,
        }
    }

    /// Hands a cycle to the recorder, where there is one; counts it where the ring is full.
    pub fn record(&self, cycle: impl FnOnce() -> CycleRecord) {
        if self.records && self.cycles.push(cycle()).is_err() {
            count(&self.counters.recorder_dropped);
        }
    }

    /// Hands a change of the model to the recorder, where there is one; one that hangs in its disk does without the oldest.
    pub fn record_model(&self, change: ModelChange) {
        if self.records {
            self.model_changes.force_push(Box::new(change));
        }
    }

    /// Hands a line of the log to the recorder, where there is one; the oldest goes where too many wait.
    pub fn note(&self, line: impl FnOnce() -> LogRecord) {
        if self.records {
            self.lines.force_push(Box::new(line()));
        }
    }

    /// Hands a state of the daemon to the recorder, likewise.
    pub fn note_state(&self, state: StatusRecord) {
        if self.records {
            self.states.force_push(Box::new(state));
        }
    }

    /// Hands a force block to the recorder, where there is one, in one of its own empty boxes.
    pub fn record_block(&self, block: &ForceBlock) {
        if !self.records {
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

    /// How the recorder is. One that does not come back from the disk has said nothing of that itself.
    pub fn recorder(&self, now_ns: u64) -> RecorderState {
        let said =
            RecorderState::try_from(self.recorder.load(Relaxed)).unwrap_or(RecorderState::Failed);
        let turn_ns = self.counters.recorder_turn_ns.load(Relaxed);
        let hangs = now_ns.saturating_sub(turn_ns) > RECORDER_HANGS_NS;
        if said == RecorderState::Recording && hangs { RecorderState::Dropping } else { said }
    }

    /// Whether there is a recorder.
    pub fn records(&self) -> bool {
        self.records
    }

    /// Says how the recorder is.
    pub fn set_recorder(&self, state: RecorderState) {
        self.recorder.store(state.code(), Relaxed);
    }

    /// Whether the threads go on.
    pub fn runs(&self) -> bool {
        !self.stop.load(Relaxed)
    }

    /// Ends all threads at their next turn.
    pub fn stop(&self) {
        self.stop.store(true, Relaxed);
    }

    /// How much may be corrected.
    pub fn mode(&self) -> Mode {
        match self.mode.load(Relaxed) {
            0 => Mode::Shadow,
            1 => Mode::Limited,
            _ => Mode::Full,
        }
    }

    /// Changes how much may be corrected, from the next cycle on.
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

/// One more.
pub fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Relaxed);
}
