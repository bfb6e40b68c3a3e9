//! The daemon's own account of itself, made from the counters.
//!
//! Promises: a status can be made at any time, by reading atomics alone.

use crate::exchange::Exchange;
use corrector::Mode;
use recording::model::RobotModel;
use shm_schema::{Health, JointBounds, Reason, Status, Text, Verdict, monotonic_ns};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// A daemon without a command for this long is idle, ns.
const IDLE_AFTER_NS: u64 = 500_000_000;

/// What changes rarely.
#[derive(Debug)]
pub struct Constants {
    started_ns: u64,
    joints: u32,
    model_hash: u64,
    model_name: String,
    uncompensated: u32,
    bounds: JointBounds,
    /// The mode that arming leads to.
    pub armed_mode: Mode,
    last_verdict: Option<Verdict>,
    seq: u64,
}

impl Constants {
    /// Of this model and these bounds.
    pub fn new(model: &RobotModel, bounds: JointBounds) -> Self {
        let mut constants = Self {
            started_ns: monotonic_ns(),
            joints: 0,
            model_hash: 0,
            model_name: String::new(),
            uncompensated: 0,
            bounds,
            armed_mode: Mode::Full,
            last_verdict: None,
            seq: 0,
        };
        constants.take(model);
        constants
    }

    /// Another model is in use.
    pub fn take(&mut self, model: &RobotModel) {
        self.joints = model.physics.arm.count() as u32;
        self.model_hash = model.hash;
        self.model_name.clone_from(&model.file.name);
        self.uncompensated = model.not_compensated.len() as u32;
        for (i, joint) in model.physics.arm.joints().iter().enumerate() {
            (self.bounds.min[i], self.bounds.max[i]) = joint.limits;
        }
    }

    /// The status now.
    pub fn status(&mut self, exchange: &Exchange) -> Status {
        self.seq += 1;
        if let Some(verdict) = exchange.last_verdict.pop() {
            self.last_verdict = Some(verdict);
        }
        let counters = &exchange.counters;
        let read = |counter: &AtomicU64| counter.load(Relaxed);
        let latency = exchange.latency.quantiles();
        let verdict = self.last_verdict.unwrap_or_default();
        let rings = verdict.state != 0;
        let health = self.health(exchange);
        Status {
            seq: self.seq,
            t_ns: monotonic_ns(),
            started_ns: self.started_ns,
            model_epoch: read(&counters.model_epoch),
            model_hash: self.model_hash,
            cycles: read(&counters.cycles),
            missed_cycles: read(&counters.missed_cycles),
            commands: read(&counters.commands),
            rejected: read(&counters.rejected),
            held: read(&counters.held),
            stale: read(&counters.stale),
            commands_lost: read(&counters.commands_lost),
            corrected_lost: read(&counters.corrected_lost),
            force_blocks: read(&counters.force_blocks),
            force_gaps: read(&counters.force_gaps),
            malformed: read(&counters.malformed),
            recorder_dropped: read(&counters.recorder_dropped),
            latency_p50_ns: latency.p50_ns,
            latency_p99_ns: latency.p99_ns,
            latency_p999_ns: latency.p999_ns,
            latency_max_ns: latency.max_ns,
            wrench_loop_gain: f64::from_bits(read(&counters.loop_gain_bits)),
            vibration_hz: if rings { verdict.frequency_hz } else { f64::NAN },
            vibration_amplitude: if rings { verdict.amplitude } else { f64::NAN },
            pid: std::process::id(),
            health: health.code(),
            mode: mode(exchange.mode()).code(),
            bypassed: u32::from(exchange.bypassed.load(Relaxed)),
            joints: self.joints,
            wrench_gate: counters.gate.load(Relaxed),
            recorder: exchange.recorder().code(),
            vibration: verdict.state,
            vibration_axis: verdict.axis,
            uncompensated_effects: self.uncompensated,
            bounds: self.bounds,
            message: Text::new(&self.words(exchange, health)),
            ..Status::default()
        }
    }

    fn health(&self, exchange: &Exchange) -> Health {
        let last_ns = exchange.counters.last_command_ns.load(Relaxed);
        if !exchange.runs() {
            Health::Stopping
        } else if last_ns == 0 || monotonic_ns().saturating_sub(last_ns) > IDLE_AFTER_NS {
            Health::Idle
        } else if self.last_reason(exchange).is_some() {
            Health::Degraded
        } else {
            Health::Running
        }
    }

    /// Why the last target was not simply corrected, where that is worth a word.
    fn last_reason(&self, exchange: &Exchange) -> Option<Reason> {
        let said = exchange.counters.last_said.load(Relaxed) as u32;
        let reason = Reason::try_from(said).ok()?;
        let quiet = [Reason::None, Reason::Starting, Reason::ShadowMode, Reason::Bypass];
        (!quiet.contains(&reason)).then_some(reason)
    }

    fn words(&self, exchange: &Exchange, health: Health) -> String {
        let mut words = format!("{}: {health}", self.model_name);
        if health == Health::Degraded
            && let Some(reason) = self.last_reason(exchange)
        {
            words = format!("{words} ({reason})");
        }
        if self.uncompensated > 0 {
            words =
                format!("{words}; {} effects of the model are not compensated", self.uncompensated);
        }
        words
    }
}

fn mode(mode: Mode) -> shm_schema::Mode {
    match mode {
        Mode::Shadow => shm_schema::Mode::Shadow,
        Mode::Limited => shm_schema::Mode::Limited,
        Mode::Full => shm_schema::Mode::Full,
    }
}
