//! Converts the cell's configuration to the settings of each thread.
//!
//! Nothing starts with a configuration or a model that does not fit; the error states the remedy.

pub mod check;

use crate::feed::CellFeed;
use crate::instrument::Instrument;
use crate::lead::LeadSettings;
use crate::pacer::WaitMode;
use crate::sensor_inputs::{SensorInputs, WrenchSource};
use crate::vibration::{BlockRules, ClockTolerance, ForceProcessor};
use corrector::{
    FEED_TIME_CONSTANT_DELAYS, FeedLimit, FeedRules, FeedSettings, Mode, Settings,
    TRIM_TIME_CONSTANT_DELAYS, Task, Trim, TrimRules, TrimSettings, WrenchSettings,
};
use envelope::{Limits, LimitsError, OverrideLimits};
use glam::DVec3;
use joint_dynamics::TapsSettings;
use physics::{Arm, Inputs, JOINTS_MAX, JointKind, Memories, Model, Wrench};
use recording::cell::{self, CellConfig};
use recording::faults::Fault;
use recording::model::RobotModel;
use recording::series::CoordinateFrame;
use shm_schema::{FORCE_SAMPLES_MAX, JointBounds, SPECTRUM_BINS_MAX};
use spectrum::{ConfigError, DisplaySpectrum, MonitorConfig, SensorStream, VibrationMonitor};

/// Settings of the corrector.
///
/// # Errors
/// A limit out of range.
pub fn settings(config: &CellConfig, arm: &Arm, lockstep: bool) -> Result<Settings, LimitsError> {
    let envelope = envelope(config, arm)?;
    Ok(Settings {
        mode: mode(config.mode),
        envelope,
        task: Task {
            free_tool_axis: config.task.free_tool_axis,
            length_m: config.task.length_m,
            ..Task::default()
        },
        wrench: WrenchSettings {
            enabled: config.wrench.source != cell::WrenchSource::None,
            low_pass_hz: config.wrench.low_pass_hz,
            stale_ns: nanoseconds(config.wrench.stale_s),
            process_stiffness: config.wrench.process_stiffness_n_per_m,
            loop_gain_max: config.wrench.loop_gain_max,
        },
        period_ns: nanoseconds(config.cycle.period_s),
        stale_ns: nanoseconds(config.cycle.stale_s),
        lockstep,
        ..Settings::with_envelope(envelope[0])
    })
}

/// Limits of the joints, for clients.
pub fn bounds(settings: &Settings, arm: &Arm) -> JointBounds {
    let mut bounds = JointBounds {
        min: [0.0; JOINTS_MAX],
        max: [0.0; JOINTS_MAX],
        angle: [0.0; JOINTS_MAX],
        rate: [0.0; JOINTS_MAX],
        jerk: [0.0; JOINTS_MAX],
    };
    for (i, joint) in arm.joints().iter().enumerate() {
        (bounds.min[i], bounds.max[i]) = joint.limits;
        let limits = settings.envelope[i];
        bounds.angle[i] = limits.angle();
        bounds.rate[i] = limits.rate();
        bounds.jerk[i] = limits.jerk();
    }
    bounds
}

/// Processing of the force samples.
///
/// # Errors
/// An invalid setting of the vibration monitor.
pub fn force_processor(
    config: &CellConfig,
    model: &RobotModel,
) -> Result<ForceProcessor, ConfigError> {
    let Some(force) = config.force else { return Ok(ForceProcessor::None) };
    let sensor = sensor(config, force);
    let Some(vibration) = config.vibration else {
        return Ok(ForceProcessor::Sensor(Box::new(SensorStream::new(&sensor))));
    };
    let watch = VibrationMonitor::new(MonitorConfig {
        modes: modes(model, config.wrench.frame).collect(),
        least_amplitude_n: vibration.least_amplitude_n,
        least_amplitude_nm: vibration.least_amplitude_nm,
        threshold: vibration.threshold,
        ..sensor
    })?;
    Ok(ForceProcessor::Watch(Box::new(watch)))
}

/// Spectra for displays: of the monitored band, or of the monitor's default one.
pub(crate) fn overview(config: &CellConfig) -> Option<Box<DisplaySpectrum>> {
    let sensor = sensor(config, config.force?);
    Some(Box::new(DisplaySpectrum::new(&sensor, SPECTRUM_BINS_MAX)))
}

fn sensor(config: &CellConfig, force: cell::Force) -> MonitorConfig {
    let standard = MonitorConfig::default();
    let band_hz = config.vibration.map_or(standard.band_hz, |v| [v.band_hz.0, v.band_hz.1]);
    MonitorConfig {
        rate_hz: force.rate_hz,
        channels: force.channels,
        full_scale_n: force.full_scale_n,
        full_scale_nm: force.full_scale_nm,
        band_hz,
        ..standard
    }
}

/// Conditions under which the wrench of a force block is used. In lockstep blocks carry the
/// recording's time, which cannot be compared with the present clock.
pub fn block_rules(config: &CellConfig, lockstep: bool) -> BlockRules {
    let live = config.force.filter(|_| !lockstep);
    BlockRules {
        clock: live.map(|force| ClockTolerance {
            ahead_ns: nanoseconds(force.ahead_s),
            late_ns: nanoseconds(force.late_s),
        }),
        use_faulty_channels: config.wrench.use_faulty_channels,
    }
}

/// The model's natural frequencies. Their directions are in base axes, so they apply to the force
/// channels only if these are too.
pub fn modes(model: &RobotModel, frame: CoordinateFrame) -> impl Iterator<Item = spectrum::Mode> {
    model.file.modes.iter().map(move |mode| spectrum::Mode {
        frequency_hz: mode.frequency_hz,
        damping: mode.damping_ratio.unwrap_or(0.0),
        direction: mode.direction.filter(|_| frame == CoordinateFrame::Base).unwrap_or([0.0; 3]),
    })
}

/// Time without force blocks after which silence is reported, ns: a second, or two of the longest
/// blocks. `None` without a stream.
pub fn silent_after_ns(config: &CellConfig) -> Option<u64> {
    let longest_s = |rate_hz: f64| 2.0 * FORCE_SAMPLES_MAX as f64 / rate_hz;
    config.force.map(|force| nanoseconds(longest_s(force.rate_hz).max(1.0)))
}

/// Source of the wrench.
pub fn wrench_source(config: &CellConfig) -> WrenchSource {
    match config.wrench.source {
        cell::WrenchSource::Force => WrenchSource::Force,
        cell::WrenchSource::Command => WrenchSource::Command,
        cell::WrenchSource::None => WrenchSource::None,
    }
}

/// Sensor inputs of the cycle. In lockstep each row of the recording contains all of them.
pub fn sensor_inputs(config: &CellConfig, lockstep: bool) -> SensorInputs {
    let sensor_inputs = SensorInputs::new(wrench_source(config));
    if lockstep {
        return sensor_inputs;
    }
    let sensor_inputs = sensor_inputs.with_age_limit(nanoseconds(config.temperature.stale_s));
    let lead = lead(config, 1.0).map(|_| Box::default());
    sensor_inputs.with_instrument(instrument(config)).with_feed(feed(config)).with_lead(lead)
}

/// Settings of the compensation of delay, lags and modes; `None` if it is off.
#[must_use]
pub fn lead(config: &CellConfig, jump_margin: f64) -> Option<LeadSettings> {
    let is_on = |dynamic: &cell::Dynamic| dynamic.mode == cell::DynamicMode::Compensate;
    let cell::Dynamic { bandwidth_hz, robust_to, .. } = config.dynamic.filter(is_on)?;
    let taps = TapsSettings { bandwidth_hz, robust_to, ..TapsSettings::default() };
    Some(LeadSettings { taps, period_s: config.cycle.period_s, jump_margin })
}

/// The adaptation of the feed to the force, if configured.
fn feed(config: &CellConfig) -> Option<Box<CellFeed>> {
    let feed = config.feed.filter(|feed| feed.mode != cell::FeedMode::Off)?;
    let bounds = OverrideLimits::new(feed.floor, feed.down_per_s, feed.up_per_s)?;
    let settings = FeedSettings {
        is_sent: feed.mode == cell::FeedMode::Adapt,
        limit: match feed.limit {
            cell::FeedLimit::Force(n) => FeedLimit::Force(n),
            cell::FeedLimit::Deflection(m) => FeedLimit::Deflection(m),
        },
        bounds,
        lost: feed.lost,
        air: feed.air,
        air_n: feed.air_n,
        hold_s: feed.hold_s,
        stale_s: config.wrench.stale_s,
        delay_s: feed.latency_s,
        time_constant_s: feed.time_constant_s.unwrap_or(FEED_TIME_CONSTANT_DELAYS * feed.latency_s),
        exponent: feed.exponent,
        relief: feed.relief,
        rules: FeedRules::default(),
    };
    Some(Box::new(CellFeed::new(settings, config.mode != cell::Mode::Shadow)))
}

/// The error for a deflection limit with a model that has no compliance.
#[must_use]
pub fn deflection_limit_fault(config: &CellConfig, model: &Model) -> Option<Fault> {
    let feed = config.feed.filter(|feed| feed.mode != cell::FeedMode::Off)?;
    if !matches!(feed.limit, cell::FeedLimit::Deflection(_)) || has_compliance(model) {
        return None;
    }
    let message = "limits the deflection, but the model has no compliance at the tool";
    let fault = Fault::new("feed.deflection_limit_mm", message);
    Some(fault.expected("a model with compliance, or force_limit_N"))
}

/// Whether a force of 100 N displaces the tool, near the middle of the joints' ranges.
fn has_compliance(model: &Model) -> bool {
    let mut q = [0.0; JOINTS_MAX];
    for (q, joint) in q.iter_mut().zip(model.arm.joints()) {
        let (min, max) = joint.limits;
        *q = if min.is_finite() && max.is_finite() { 0.4 * min + 0.6 * max } else { 0.3 };
    }
    let tool = |force| {
        let mut inputs = Inputs::at_rest(q);
        inputs.wrench_base = Wrench { force, ..Wrench::ZERO };
        let mut memories = Memories::default();
        model.settle(&inputs, &mut memories);
        model.evaluate(&inputs, &memories).real.base_from_tool.origin
    };
    tool(DVec3::splat(100.0)) != tool(DVec3::splat(-100.0))
}

/// The instrument that measures the tool, if the cell has one and uses it.
fn instrument(config: &CellConfig) -> Option<Box<Instrument>> {
    let measured = config.measured.filter(|measured| measured.mode != cell::MeasuredMode::Off)?;
    let mut settings = TrimSettings {
        is_sent: measured.mode == cell::MeasuredMode::Trim,
        base_from_instrument: measured.base_from_instrument,
        point_in_tool_m: measured.point_in_tool_m,
        latency_s: measured.latency_s,
        interval_s: measured.interval_s,
        reaction_s: measured.reaction_s,
        time_constant_s: 0.0,
        noise_m: measured.noise_m,
        jump_m: measured.jump_m,
        hold_s: measured.hold_s,
        limit_m: measured.limit_m,
        rules: TrimRules::default(),
    };
    settings.time_constant_s =
        measured.time_constant_s.unwrap_or(TRIM_TIME_CONSTANT_DELAYS * settings.delay_s());
    let trim = Trim::new(settings);
    Some(Box::new(Instrument::new(trim, nanoseconds(measured.latency_s))))
}

/// How the cycle waits.
pub fn wait_mode(config: &CellConfig) -> WaitMode {
    match config.cycle.wait {
        cell::WaitMode::Sleep => WaitMode::Sleep,
        cell::WaitMode::Spin => WaitMode::Spin,
    }
}

/// Kind of each joint.
pub fn joint_kinds(arm: &Arm) -> Vec<JointKind> {
    arm.joints().iter().map(|joint| joint.kind).collect()
}

/// The mode after arming: the configured one. `None` if that is shadow mode: a client cannot exceed
/// the commissioned mode.
pub fn armed_mode(config: &CellConfig) -> Option<Mode> {
    Some(mode(config.mode)).filter(|mode| *mode != Mode::Shadow)
}

/// The highest mode that a client may select.
pub fn mode_max(config: &CellConfig) -> shm_schema::Mode {
    match config.mode_max {
        cell::Mode::Shadow => shm_schema::Mode::Shadow,
        cell::Mode::Limited => shm_schema::Mode::Limited,
        cell::Mode::Full => shm_schema::Mode::Full,
    }
}

fn envelope(config: &CellConfig, arm: &Arm) -> Result<[Limits; JOINTS_MAX], LimitsError> {
    let of_joint = |i: usize, kind| {
        let (angle, rate, jerk) = config.envelope.limits_of_joint(i, kind);
        Limits::new(angle, rate, jerk)
    };
    let mut limits = [of_joint(0, arm.joints()[0].kind)?; JOINTS_MAX];
    for (i, joint) in arm.joints().iter().enumerate() {
        limits[i] = of_joint(i, joint.kind)?;
    }
    Ok(limits)
}

fn mode(mode: cell::Mode) -> Mode {
    match mode {
        cell::Mode::Shadow => Mode::Shadow,
        cell::Mode::Limited => Mode::Limited,
        cell::Mode::Full => Mode::Full,
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}
