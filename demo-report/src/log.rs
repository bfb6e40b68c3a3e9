//! Log of the demo, tick by tick, and its evaluation.

use hdrhistogram::Histogram;
use physics::{Arm, Joints};
use recording::series::{Channel, FileUnits, Recording, RecordingMetadata};
use trued_client::Verdict;
use world::cell::Tick;

use crate::outcome::{
    Counts, ErrorStatistics, Errors, Latency, MillingResult, SimulatedChatter, VibrationEvent,
};
use crate::scene::Scene;

/// Amplitude from which the robot counts as vibrating, N: below it the force sensor's noise
/// dominates.
const CHATTER_AMPLITUDE_MIN_N: f64 = 0.2;

/// One tick.
pub(crate) struct LogRow {
    pub(crate) t_s: f64,
    pub(crate) without_mm: f64,
    pub(crate) with_mm: f64,
    pub(crate) published: Joints,
    pub(crate) correction: Joints,
    pub(crate) tcp_base: [f64; 3],
    pub(crate) force_tool: [f64; 3],
}

/// Everything that was seen.
pub(crate) struct CellLog {
    pub(crate) rows: Vec<LogRow>,
    pub(crate) events: Vec<VibrationEvent>,
    pub(crate) latency: Histogram<u64>,
    pub(crate) missed: u64,
    pub(crate) broken: u64,
    pub(crate) ringing_from_s: Option<f64>,
}

impl CellLog {
    pub(crate) fn new(ticks: usize) -> Result<Self, hdrhistogram::CreationError> {
        Ok(Self {
            rows: Vec::with_capacity(ticks),
            events: Vec::new(),
            latency: Histogram::new_with_bounds(1, 60_000_000_000, 3)?,
            missed: 0,
            broken: 0,
            ringing_from_s: None,
        })
    }

    /// Logs a tick with the target published for it.
    pub(crate) fn add_tick(&mut self, tick: &Tick, published: &Joints) {
        let (without, with) = tick.errors_m();
        if tick.chatter_n > CHATTER_AMPLITUDE_MIN_N && self.ringing_from_s.is_none() {
            self.ringing_from_s = Some(tick.t_s);
        }
        let mut correction = [0.0; physics::JOINTS_MAX];
        for (i, slot) in correction.iter_mut().enumerate() {
            *slot = published[i] - tick.q_cmd[i];
        }
        let force = tick.forces_tool.iter().sum::<glam::DVec3>() / tick.forces_tool.len() as f64;
        self.rows.push(LogRow {
            t_s: tick.t_s,
            without_mm: 1e3 * without,
            with_mm: 1e3 * with,
            published: *published,
            correction,
            tcp_base: tick.corrected.origin.to_array(),
            force_tool: force.to_array(),
        });
    }

    /// Logs a verdict of the vibration monitor; `start_ns` is the time of the first tick.
    pub(crate) fn add_verdict(&mut self, verdict: &Verdict, start_ns: u64) {
        let t_s = (verdict.t_ns as f64 - start_ns as f64) * 1e-9;
        let name = |code: Result<String, _>| {
            code.unwrap_or_else(|_: shm_schema::UnknownCode| "unknown".to_owned())
        };
        self.events.push(VibrationEvent {
            t_s,
            state: name(verdict.state().map(|state| state.to_string())),
            frequency_Hz: verdict.frequency_hz,
            amplitude_N: verdict.amplitude,
            axis: trued_client::channel_name(verdict.axis).to_owned(),
            class: name(verdict.class().map(|class| class.to_string())),
            suspect_alias: verdict.suspect_alias != 0,
            says: verdict.to_string(),
            after_onset_ms: self.ringing_from_s.map(|from_s| 1e3 * (t_s - from_s)),
        });
    }

    /// The evaluation, from the moment the robot started moving.
    pub(crate) fn milled(&self, scene: &Scene, rejected: u64) -> MillingResult {
        let rows = self.rows.get(scene.dwell..).unwrap_or(&[]);
        let quantile = |share| self.latency.value_at_quantile(share);
        MillingResult {
            seed: scene.seed,
            quick: scene.quick,
            robot: scene.model.file.name.clone(),
            tool_error_mm: Errors {
                without: ErrorStatistics::of(rows.iter().map(|row| row.without_mm)),
                with: ErrorStatistics::of(rows.iter().map(|row| row.with_mm)),
            },
            counts: self.counts(rejected),
            vibration: self.events.clone(),
            ringing: self.ringing(scene),
            latency_ns: Latency {
                p50: quantile(0.5),
                p99: quantile(0.99),
                p999: quantile(0.999),
                max: self.latency.max(),
            },
        }
    }

    /// The counters so far; the daemon has rejected `rejected_commands`.
    pub(crate) fn counts(&self, rejected_commands: u64) -> Counts {
        Counts {
            cycles: self.rows.len() as u64,
            missed_cycles: self.missed,
            rejected_commands,
            invariants_broken: self.broken,
        }
    }

    /// Tool error with correction, from row `from` on.
    pub(crate) fn error_mm(&self, from: usize) -> ErrorStatistics {
        ErrorStatistics::of(self.rows.iter().skip(from).map(|row| row.with_mm))
    }

    fn ringing(&self, scene: &Scene) -> SimulatedChatter {
        let frequency = scene.chatter.frequency_hz;
        let from_s = self.ringing_from_s.unwrap_or(f64::NAN);
        let cut = world::slots::Slots::cut_name(scene.chatter.cut);
        let words = format!(
            "{frequency} Hz in {cut} from {from_s:.2} s, above {CHATTER_AMPLITUDE_MIN_N} N"
        );
        SimulatedChatter { frequency_Hz: frequency, from_s, words }
    }

    /// The run as a recording: commands, tool positions, forces.
    pub(crate) fn recording(&self, scene: &Scene) -> Recording {
        let column = |of: &dyn Fn(&LogRow) -> f64| self.rows.iter().map(of).collect::<Vec<_>>();
        let mut recording = Recording::new(column(&|row| row.t_s));
        recording.units = FileUnits::WORKSHOP;
        recording.metadata = RecordingMetadata {
            measured_in_base: true,
            model: Some("model.toml".to_owned()),
            ..RecordingMetadata::default()
        };
        for joint in 0..scene.model.physics.arm.count() {
            recording.set(Channel::Command(joint), column(&|row| row.published[joint]));
        }
        for axis in 0..3 {
            recording.set(Channel::Position(axis), column(&|row| row.tcp_base[axis]));
            recording.set(Channel::Wrench(axis), column(&|row| row.force_tool[axis]));
            recording.set(Channel::Wrench(axis + 3), vec![0.0; self.rows.len()]);
        }
        recording.set(Channel::Ambient, vec![scene.truth.ambient_celsius; self.rows.len()]);
        recording
    }
}

/// Whether a published target satisfies the invariants: finite, within the limits, near the
/// command, and its correction no further from the previous one than `elapsed_s` allows.
pub(crate) fn keeps_invariants(
    arm: &Arm,
    bounds: &shm_schema::JointBounds,
    command: &Joints,
    published: &Joints,
    before: Option<(&Joints, f64)>,
) -> bool {
    let rounding = 1e-9;
    arm.joints().iter().enumerate().all(|(i, joint)| {
        let (q, correction) = (published[i], published[i] - command[i]);
        let in_limits = q >= joint.limits.0 && q <= joint.limits.1;
        let is_bounded = correction.abs() <= bounds.angle[i] + rounding;
        let is_slow = before.is_none_or(|(before, elapsed_s)| {
            (correction - before[i]).abs() <= bounds.rate[i] * elapsed_s + rounding
        });
        q.is_finite() && in_limits && is_bounded && is_slow
    })
}
