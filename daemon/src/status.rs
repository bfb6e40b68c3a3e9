//! The status of the daemon, from the counters and the state of the vibration thread.
//!
//! A status can be composed at any time without waiting; it includes every fault of the force
//! stream.

use crate::ageing::ModelAgeing;
use crate::exchange::{Exchange, SensorStatus};
use crate::lead::LeadSettings;
use crate::setup;
use crate::temperatures::place_names;
use crate::verdicts::faults;
use corrector::Mode;
use joint_dynamics::plant::Plants;
use physics::spec::Need;
use recording::cell::CellConfig;
use recording::model::{RobotEntry, RobotModel};
use shm_schema::{
    FeedReason, Health, InCut, JointBounds, ROBOT_BYTES_MAX, Reason, RecorderState, SensorFault,
    Status, Text, TrimReason, TrimState, VibrationState, WatchState,
};
use spectrum::ProcessState;
use std::fmt::Write as _;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// A daemon without a command for this long is idle, ns.
const IDLE_AFTER_NS: u64 = 500_000_000;

/// Composes the status: constants of cell and model, and the newest sensor status.
#[derive(Debug)]
pub struct StatusBuilder {
    started_ns: u64,
    joints: u32,
    model_hash: u64,
    geometry_hash: u64,
    robot: RobotEntry,
    model_name: String,
    uncompensated: u32,
    /// Settings of the compensation of delay, lags and modes; `None` if it is off.
    pub lead: Option<LeadSettings>,
    /// Whether the model has temperature-dependent effects.
    is_thermal: bool,
    bounds: JointBounds,
    /// Share of the position limit in the mode that corrects.
    angle_share: f64,
    /// The mode after arming.
    pub armed_mode: Option<Mode>,
    /// The highest mode that may be requested.
    pub mode_max: shm_schema::Mode,
    /// Since when and by whom the cell is bypassed, if requested.
    pub bypassed_by: Option<String>,
    /// Since when and by whom the mode was set, if requested.
    pub mode_by: Option<String>,
    /// Time without force blocks after which silence is reported, ns; `None` without a stream.
    silent_after_ns: Option<u64>,
    monitors_vibration: bool,
    sensor_status: Option<SensorStatus>,
    seq: u64,
}

impl StatusBuilder {
    /// For this cell, model and limits.
    pub fn new(
        config: &CellConfig,
        model: &RobotModel,
        bounds: JointBounds,
        lead: Option<LeadSettings>,
        now_ns: u64,
    ) -> Self {
        let mut constants = Self {
            started_ns: now_ns,
            joints: 0,
            model_hash: 0,
            geometry_hash: 0,
            robot: RobotEntry::default(),
            model_name: String::new(),
            uncompensated: 0,
            lead,
            is_thermal: false,
            bounds,
            angle_share: setup::armed_mode(config).and_then(Mode::angle_share).unwrap_or(1.0),
            armed_mode: setup::armed_mode(config),
            mode_max: setup::mode_max(config),
            bypassed_by: None,
            mode_by: None,
            silent_after_ns: setup::silent_after_ns(config),
            monitors_vibration: config.vibration.is_some() && config.force.is_some(),
            sensor_status: None,
            seq: 0,
        };
        constants.set_model(model);
        constants
    }

    /// A new model is active.
    pub fn set_model(&mut self, model: &RobotModel) {
        self.joints = model.physics.arm.count() as u32;
        self.model_hash = model.hash;
        self.geometry_hash = model.file.identity().geometry_hash();
        self.robot.clone_from(&model.file.robot);
        self.model_name.clone_from(&model.file.name);
        self.uncompensated = Plants::not_compensated(model, self.lead.is_some()).len() as u32;
        let mut effects = model.physics.effects();
        self.is_thermal = effects.any(|effect| effect.spec().needs.contains(&Need::Temperature));
        for (i, joint) in model.physics.arm.joints().iter().enumerate() {
            (self.bounds.min[i], self.bounds.max[i]) = joint.limits;
        }
    }

    /// Limits of the corrections that are sent: in limited mode a share of the envelope, in shadow
    /// mode that of the previous mode.
    fn bounds(&mut self, mode: Mode) -> JointBounds {
        self.angle_share = mode.angle_share().unwrap_or(self.angle_share);
        let mut bounds = self.bounds;
        bounds.angle.iter_mut().for_each(|angle| *angle *= self.angle_share);
        bounds
    }

    /// The present status, with the state of the process and the result of the ageing test.
    pub fn status(
        &mut self,
        exchange: &Exchange,
        process: &ProcessState,
        age: &ModelAgeing,
        now_ns: u64,
    ) -> Status {
        self.seq += 1;
        while let Some(sensor_status) = exchange.sensor_status.pop() {
            self.sensor_status = Some(sensor_status);
        }
        let counters = &exchange.counters;
        let read = |counter: &AtomicU64| counter.load(Relaxed);
        let latency = exchange.latency.quantiles();
        let mut status = Status {
            seq: self.seq,
            t_ns: now_ns,
            started_ns: self.started_ns,
            model_epoch: read(&counters.model_epoch),
            model_hash: self.model_hash,
            geometry_hash: self.geometry_hash,
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
            force_refused: read(&counters.force_refused),
            malformed: read(&counters.malformed),
            recorder_dropped: read(&counters.recorder_dropped),
            latency_p50_ns: latency.p50_ns,
            latency_p99_ns: latency.p99_ns,
            latency_p999_ns: latency.p999_ns,
            latency_max_ns: latency.max_ns,
            latency_sum_ns: latency.sum_ns,
            latency_counts: latency.counts,
            wrench_loop_gain: f64::from_bits(read(&counters.loop_gain_bits)),
            pid: std::process::id(),
            mode: mode(exchange.mode()).code(),
            bypassed: u32::from(exchange.bypassed.load(Relaxed)),
            joints: self.joints,
            wrench_gate: counters.gate.load(Relaxed),
            recorder: exchange.recorder(now_ns).code(),
            uncompensated_effects: self.uncompensated,
            stale_temperatures: counters.stale_temperatures.load(Relaxed),
            bounds: self.bounds(exchange.mode()),
            q_command: counters.q_command(),
            correction: counters.correction(),
            robot_maker: robot_name(self.robot.maker.as_deref()),
            robot_type: robot_name(self.robot.kind.as_deref()),
            robot_serial: robot_name(self.robot.serial.as_deref()),
            ..Status::default()
        };
        self.add_sensor_status(exchange, process, &mut status);
        age.write_status(&mut status);
        counters.trim.write_status(&mut status);
        counters.feed.write_status(&mut status);
        counters.lead.write_status(&mut status);
        let health = self.health(exchange, &status);
        status.health = health.code();
        let aged = age.message(status.t_ns);
        status.message = Text::new(&self.summary(exchange, health, &status, aged.as_deref()));
        status
    }

    /// Adds the state of force stream, monitor and process.
    fn add_sensor_status(&self, exchange: &Exchange, process: &ProcessState, status: &mut Status) {
        let known = |x: f64| if x > 0.0 { x } else { f64::NAN };
        status.spindle_rpm = known(process.spindle_rpm);
        status.feed_mm_s = known(process.feed_mm_s);
        status.in_cut = match process.in_cut {
            None => InCut::Unknown,
            Some(false) => InCut::Air,
            Some(true) => InCut::Cut,
        }
        .code();
        let SensorStatus { health, clock_faults, line } = self.sensor_status.unwrap_or_default();
        let silent = self.is_silent(exchange, status.t_ns);
        let watch = match (self.monitors_vibration, self.sensor_status) {
            (false, _) => WatchState::Off,
            (true, Some(_)) if !health.learning => WatchState::Watching,
            (true, _) => WatchState::Learning,
        };
        status.watch = watch.code();
        status.stream_faults = faults(health.stream) | clock_faults;
        status.channel_faults = health.channel.map(faults);
        if silent {
            // The last line found is out of date.
            status.stream_faults |= SensorFault::Silent.bit();
        } else if let Some(line) = line {
            status.verdict = line;
        }
    }

    fn is_silent(&self, exchange: &Exchange, now_ns: u64) -> bool {
        let last_ns = exchange.counters.last_block_ns.load(Relaxed).max(self.started_ns);
        let silence_ns = now_ns.saturating_sub(last_ns);
        self.silent_after_ns.is_some_and(|limit_ns| silence_ns > limit_ns)
    }

    fn health(&self, exchange: &Exchange, status: &Status) -> Health {
        if !exchange.is_running() {
            Health::Stopping
        } else if status.force_faults().next().is_some() || recorder_fault(status).is_some() {
            Health::Degraded
        } else if !commands_arrive(exchange, status.t_ns) {
            Health::Idle
        } else if self.last_reason(exchange).is_some()
            || status.model_broken_since_ns > 0
            || trim_fault(status).is_some()
            || feed_fault(status).is_some()
            || (self.is_thermal && status.stale_temperatures != 0)
        {
            Health::Degraded
        } else {
            Health::Running
        }
    }

    /// Why the status of the last target is not `corrected`, if this is to be reported.
    fn last_reason(&self, exchange: &Exchange) -> Option<Reason> {
        let code = exchange.counters.last_status_and_reason.load(Relaxed) as u32;
        let reason = Reason::try_from(code).ok()?;
        let quiet = [Reason::None, Reason::Starting, Reason::ShadowMode, Reason::Bypass];
        (!quiet.contains(&reason)).then_some(reason)
    }

    /// Summary for users, most urgent first.
    fn summary(
        &self,
        exchange: &Exchange,
        health: Health,
        status: &Status,
        aged: Option<&str>,
    ) -> String {
        let mut text = format!("{}: {health}", self.model_name);
        let mut add = |part: std::fmt::Arguments<'_>| {
            // Writing to a string cannot fail.
            let _ = write!(text, "; {part}");
        };
        if status.bypassed != 0 {
            let by = self.bypassed_by.as_deref().unwrap_or_default();
            add(format_args!("bypassed {by}"));
        }
        if let (Some(by), Ok(mode)) = (&self.mode_by, status.mode()) {
            add(format_args!("mode {mode} {by}"));
        }
        if commands_arrive(exchange, status.t_ns)
            && let Some(reason) = self.last_reason(exchange)
        {
            add(format_args!("{reason}"));
        }
        if let Some(aged) = aged {
            add(format_args!("{aged}"));
        }
        for fault in status.force_faults() {
            add(format_args!("{fault}"));
        }
        for fault in [trim_fault(status), feed_fault(status)].into_iter().flatten() {
            add(format_args!("{fault}"));
        }
        if self.is_thermal && status.stale_temperatures != 0 {
            let stale = place_names(status.stale_temperatures);
            add(format_args!("temperatures are stale and treated as unknown: {stale}"));
        }
        if let Some(fault) = recorder_fault(status) {
            add(format_args!("{fault}"));
        }
        if status.verdict.state().is_ok_and(|state| state != VibrationState::Over) {
            add(format_args!("{}", status.verdict));
        }
        if status.watch() == Ok(WatchState::Learning) {
            add(format_args!(
                "the vibration monitor is learning the noise floor and reports no lines yet"
            ));
        }
        if self.uncompensated > 0 {
            add(format_args!("{} effects of the model are not compensated", self.uncompensated));
        }
        text
    }
}

/// A name of the robot for a message; empty if the model does not state it.
fn robot_name(name: Option<&str>) -> Text<ROBOT_BYTES_MAX> {
    Text::new(name.unwrap_or_default())
}

/// Why measurements of the tool are not used as configured.
pub fn trim_fault(status: &Status) -> Option<&'static str> {
    let missing = [TrimState::Waiting, TrimState::Holding, TrimState::Ramping];
    status.trim_state().ok().filter(|state| missing.contains(state))?;
    Some(match status.trim_reason().ok()? {
        TrimReason::None | TrimReason::Bounded => return None,
        TrimReason::NoMeasurement => {
            "no tool measurements received; check whether the beam is interrupted"
        }
        TrimReason::NotFinite => "tool measurements are not finite or implausibly far away",
        TrimReason::OutOfOrder => "tool measurements are not in the order of their timestamps",
        TrimReason::Late => {
            "tool measurements are older than twice the sum of latency and interval"
        }
        TrimReason::Ahead => {
            "timestamps of the instrument are in the future; synchronise its clock"
        }
        TrimReason::NotPredicted => {
            "no tool position is available for the time of the measurement: commands paused or were rejected"
        }
        TrimReason::Jumped => {
            "the instrument's readings jumped; check its registration, then run `trued arm`"
        }
    })
}

/// Why the limit of the feed is not kept.
pub fn feed_fault(status: &Status) -> Option<&'static str> {
    Some(match status.feed_reason().ok()? {
        FeedReason::None | FeedReason::AtRest => return None,
        FeedReason::NoWrench => {
            "the feed limit cannot be kept: no wrench received; the override goes to lost_percent"
        }
        FeedReason::Stale => {
            "the feed limit cannot be kept: the wrench is stale; the override goes to lost_percent"
        }
        FeedReason::SensorFault => {
            "the feed limit cannot be kept: the force sensor has a fault; the override goes to lost_percent"
        }
        FeedReason::NotFinite => {
            "the feed limit cannot be kept: the wrench is not finite; the override goes to lost_percent"
        }
        FeedReason::NoDeflection => {
            "the feed limit cannot be kept: the model has no compliance at the tool; the override goes to lost_percent"
        }
        FeedReason::AtFloor => {
            "the feed limit is exceeded at floor_percent; reduce the cut or floor_percent"
        }
    })
}

/// Fault of the recording.
fn recorder_fault(status: &Status) -> Option<&'static str> {
    match RecorderState::try_from(status.recorder) {
        Ok(RecorderState::Off | RecorderState::Recording | RecorderState::Stopped) => None,
        Ok(RecorderState::Dropping) => {
            Some("the recorder loses records: its disk does not respond")
        }
        Ok(RecorderState::Failed) | Err(_) => Some(
            "nothing is recorded: the recording cannot be written; check whether the disk is full",
        ),
    }
}

/// Whether commands arrived recently.
pub fn commands_arrive(exchange: &Exchange, now_ns: u64) -> bool {
    let last_ns = exchange.counters.last_command_ns.load(Relaxed);
    last_ns != 0 && now_ns.saturating_sub(last_ns) <= IDLE_AFTER_NS
}

/// Conversion of a mode for the corrector.
pub fn corrector_mode(mode: shm_schema::Mode) -> Mode {
    match mode {
        shm_schema::Mode::Shadow => Mode::Shadow,
        shm_schema::Mode::Limited => Mode::Limited,
        shm_schema::Mode::Full => Mode::Full,
    }
}

fn mode(mode: Mode) -> shm_schema::Mode {
    match mode {
        Mode::Shadow => shm_schema::Mode::Shadow,
        Mode::Limited => shm_schema::Mode::Limited,
        Mode::Full => shm_schema::Mode::Full,
    }
}
