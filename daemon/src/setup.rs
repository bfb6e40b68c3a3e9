//! From the cell's configuration to what each thread needs.
//!
//! Promises: nothing starts on a configuration or a model that does not fit; the error says what to change.

use crate::pacer::Wait;
use crate::senses::WrenchSource;
use corrector::{Mode, Settings, Task, WrenchSettings};
use envelope::{Limits, LimitsError};
use physics::{Arm, JOINTS_MAX, JointKind};
use recording::cell::{self, CellConfig};
use recording::model::RobotModel;
use shm_schema::JointBounds;
use spectrum::{ConfigError, ProcessState, Watch, WatchConfig};

/// What the corrector is set to.
///
/// # Errors
/// A bound that cannot be.
pub fn settings(config: &CellConfig, arm: &Arm, lockstep: bool) -> Result<Settings, LimitsError> {
    let envelope = envelope(config, arm)?;
    Ok(Settings {
        mode: mode(config.mode),
        envelope,
        task: Task { free_tool_axis: config.task.free_tool_axis, length_m: config.task.length_m },
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

/// The bounds as clients see them.
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

/// The vibration watch, where the cell has one.
///
/// # Errors
/// A setting that cannot be watched.
pub fn watch(config: &CellConfig, model: &RobotModel) -> Result<Option<Watch>, ConfigError> {
    let (Some(force), Some(vibration)) = (config.force, config.vibration) else { return Ok(None) };
    let modes = model.file.modes.iter().map(|mode| spectrum::Mode {
        frequency_hz: mode.frequency_hz,
        damping: mode.damping_ratio.unwrap_or(0.0),
        direction: mode.direction.unwrap_or([0.0; 3]),
    });
    let mut watch = Watch::new(WatchConfig {
        rate_hz: force.rate_hz,
        channels: force.channels,
        band_hz: [vibration.band_hz.0, vibration.band_hz.1],
        modes: modes.collect(),
        least_amplitude_n: vibration.least_amplitude_n,
        ..WatchConfig::default()
    })?;
    if vibration.spindle_rpm.is_some() {
        watch.process_state(ProcessState {
            spindle_rpm: vibration.spindle_rpm.unwrap_or(0.0),
            teeth: vibration.teeth.unwrap_or(0),
            ..ProcessState::default()
        });
    }
    Ok(Some(watch))
}

/// Where the wrench comes from.
pub fn wrench_source(config: &CellConfig) -> WrenchSource {
    match config.wrench.source {
        cell::WrenchSource::Force => WrenchSource::Force,
        cell::WrenchSource::Command => WrenchSource::Command,
        cell::WrenchSource::None => WrenchSource::None,
    }
}

/// How the cycle waits.
pub fn wait(config: &CellConfig) -> Wait {
    match config.cycle.wait {
        cell::Wait::Sleep => Wait::Sleep,
        cell::Wait::Spin => Wait::Spin,
    }
}

/// How each joint moves.
pub fn joint_kinds(arm: &Arm) -> Vec<JointKind> {
    arm.joints().iter().map(|joint| joint.kind).collect()
}

/// The mode that arming leads to: the configured one, or full where that is shadow.
pub fn armed_mode(config: &CellConfig) -> Mode {
    match mode(config.mode) {
        Mode::Shadow => Mode::Full,
        armed => armed,
    }
}

fn envelope(config: &CellConfig, arm: &Arm) -> Result<[Limits; JOINTS_MAX], LimitsError> {
    let of_joint = |i: usize, kind| {
        let (angle, rate, jerk) = config.envelope.of_joint(i, kind);
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
