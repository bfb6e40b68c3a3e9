//! The cell's configuration, `trued.cell/1`: parsed and validated.
//!
//! Format: docs/reference/cell.md. A valid [`CellConfig`] has every value in range, in SI; all
//! errors of a file are reported. Values that depend on the model (lists per joint) are checked by
//! [`CellConfig::check_against`].

mod read;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use crate::faults::{Fault, Faults};
use crate::files::{FileError, read_text};
use crate::model::presets;
use crate::series::CoordinateFrame;
use glam::DVec3;
use physics::JointKind;

/// Name of the format.
pub(crate) const SCHEMA: &str = "trued.cell/1";

/// How much of the correction is sent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mode {
    /// Computed and recorded; the command is sent unchanged.
    #[default]
    Shadow,
    /// Within a tenth of the envelope.
    Limited,
    /// Within the envelope.
    Full,
}

/// A cell.
#[derive(Debug, Clone, PartialEq)]
pub struct CellConfig {
    /// Name: part of the services' names; 1 to 24 small letters, digits, `-`.
    pub cell: String,
    /// The model: a file, a relative path counting from the configuration's folder; or a preset.
    pub model: PathBuf,
    /// Mode after a start.
    pub mode: Mode,
    /// Highest mode that can be requested; at least `mode`.
    pub mode_max: Mode,
    /// The cycle.
    pub cycle: Cycle,
    /// Bounds of the correction.
    pub envelope: Envelope,
    /// Requirements of the tool's task.
    pub task: Task,
    /// Source and use of the wrench.
    pub wrench: Wrench,
    /// Age limit of temperatures.
    pub temperature: Temperature,
    /// The instrument that measures the tool, if configured.
    pub measured: Option<Measured>,
    /// Compensation of delay, lags and modes of the joints, if configured.
    pub dynamic: Option<Dynamic>,
    /// Adaptation of the feed to the force, if configured.
    pub feed: Option<Feed>,
    /// The force stream, if configured.
    pub force: Option<Force>,
    /// The vibration monitor, if enabled.
    pub vibration: Option<Vibration>,
    /// Scheduling of the cycle thread.
    pub realtime: Realtime,
    /// The recorder, if enabled.
    pub recorder: Option<Recorder>,
}

/// `[cycle]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Time between commands, s.
    pub period_s: f64,
    /// Age from which a command counts as stale, s.
    pub stale_s: f64,
    /// How the cycle thread waits.
    pub wait: WaitMode,
}

/// How the cycle thread waits for the next command.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum WaitMode {
    /// Sleeps to absolute times.
    #[default]
    Sleep,
    /// Spins: for an isolated core.
    Spin,
}

/// `[envelope]`: limits of the correction. A list has one value per joint; a single value applies
/// to every joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Envelope {
    /// Of revolute joints, rad, rad/s, rad/s³.
    pub revolute: CorrectionLimits,
    /// Of prismatic joints, m, m/s, m/s³.
    pub prismatic: CorrectionLimits,
}

/// Limits of the correction: position, rate, jerk.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrectionLimits {
    /// Largest correction, rad or m.
    pub position: Vec<f64>,
    /// Largest rate of the correction, rad/s or m/s.
    pub rate: Vec<f64>,
    /// Largest jerk of the correction, rad/s³ or m/s³.
    pub jerk: Vec<f64>,
}

/// `[task]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task {
    /// The task leaves the rotation about the tool's z axis free: the solution need not keep it.
    pub free_tool_axis: bool,
    /// Lever arm that converts an angular error into a displacement, m.
    pub length_m: f64,
}

/// Source of the wrench for the correction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum WrenchSource {
    /// The force stream.
    Force,
    /// The command message contains it.
    Command,
    /// No wrench.
    #[default]
    None,
}

/// `[wrench]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench {
    /// Source.
    pub source: WrenchSource,
    /// Corner of the low-pass, Hz.
    pub low_pass_hz: f64,
    /// Age from which a wrench is ramped to zero, s.
    pub stale_s: f64,
    /// Axes in which it is measured.
    pub frame: CoordinateFrame,
    /// Stiffness of the process (cutting, contact), N/m, if known.
    pub process_stiffness_n_per_m: Option<f64>,
    /// Largest loop gain (process stiffness times robot compliance), below 1.
    pub loop_gain_max: f64,
    /// Use the wrench although a force channel is stuck or saturated.
    pub use_faulty_channels: bool,
}

/// `[temperature]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Temperature {
    /// Age at which a temperature counts as unknown, s; infinite for no limit.
    pub stale_s: f64,
}

/// Use of the measurements of the tool.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum MeasuredMode {
    /// They are not read.
    Off,
    /// The model's error is estimated and reported.
    #[default]
    Observe,
    /// The tool is trimmed by the estimated error.
    Trim,
}

/// `[measured]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Use of the measurements.
    pub mode: MeasuredMode,
    /// From the instrument's coordinates to the robot's base.
    pub base_from_instrument: physics::Frame,
    /// The measured point in tool coordinates, m.
    pub point_in_tool_m: DVec3,
    /// Time between two measurements, s.
    pub interval_s: f64,
    /// Delay from a measurement to its arrival, s.
    pub latency_s: f64,
    /// Delay from a command until the tool reaches it, s.
    pub reaction_s: f64,
    /// Time constant of the trim, s; none: chosen for the delay.
    pub time_constant_s: Option<f64>,
    /// Standard deviation of a measurement, of each axis, m.
    pub noise_m: f64,
    /// A larger change from one measurement to the next is a jump of the instrument, m.
    pub jump_m: f64,
    /// The trim is held for this long without measurements, s.
    pub hold_s: f64,
    /// The largest trim, m.
    pub limit_m: f64,
    /// Standard uncertainty of the model per axis by its validation, m, if it is to be monitored by
    /// the trim's estimate.
    pub model_sigma_m: Option<f64>,
}

/// Use of the feed override.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum FeedMode {
    /// Nothing.
    Off,
    /// The override is computed and reported; the programmed feed is used.
    #[default]
    Observe,
    /// The override is sent.
    Adapt,
}

/// The limit of the feed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FeedLimit {
    /// The process force, N.
    Force(f64),
    /// Deflection of the tool by the model, m.
    Deflection(f64),
}

/// `[feed]`. Overrides are shares of the programmed feed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feed {
    /// Use of the override.
    pub mode: FeedMode,
    /// The limit.
    pub limit: FeedLimit,
    /// The smallest override.
    pub floor: f64,
    /// The override if no force is known.
    pub lost: f64,
    /// The largest override while the tool is not cutting.
    pub air: f64,
    /// Forces below this count as zero, N.
    pub air_n: f64,
    /// How fast the override may fall, per s.
    pub down_per_s: f64,
    /// How fast it may rise, per s.
    pub up_per_s: f64,
    /// Delay from an override to the resulting force, as measured here, s.
    pub latency_s: f64,
    /// Time constant of the estimate, s; none: chosen for the latency.
    pub time_constant_s: Option<f64>,
    /// How the force grows with the feed: its exponent.
    pub exponent: f64,
    /// A force beyond this multiple of the limit lowers the override at once.
    pub relief: f64,
    /// The override is held for this long without a force, s.
    pub hold_s: f64,
}

/// Whether dynamic errors are compensated.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum DynamicMode {
    /// Nothing.
    Off,
    /// Delay, lags and modes of the joints are compensated by the model.
    #[default]
    Compensate,
}

/// `[dynamic]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dynamic {
    /// Whether they are compensated.
    pub mode: DynamicMode,
    /// Frequency at which the correction's third derivative and the path error have equal weight,
    /// Hz.
    pub bandwidth_hz: f64,
    /// Relative deviation of model parameters up to which compensation does not increase the RMS
    /// error.
    pub robust_to: f64,
}

/// `[force]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Force {
    /// Samples per second.
    pub rate_hz: f64,
    /// Channels: the first of Fx Fy Fz Mx My Mz.
    pub channels: usize,
    /// Largest force that the sensor can measure, N; infinite if unknown.
    pub full_scale_n: f64,
    /// Largest moment that it can measure, Nm; infinite if unknown.
    pub full_scale_nm: f64,
    /// How far a block's stamp may lie ahead of the daemon's clock, s.
    pub ahead_s: f64,
    /// Largest delay of a block after its last sample, s.
    pub late_s: f64,
}

/// `[vibration]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vibration {
    /// Lowest and highest frequency that is watched, Hz.
    pub band_hz: (f64, f64),
    /// Spectral lines below this amplitude are ignored, N.
    pub least_amplitude_n: f64,
    /// The same for moments, Nm.
    pub least_amplitude_nm: f64,
    /// Factor on the detection threshold (power over the noise floor) of a spectral line.
    pub threshold: f64,
    /// Spindle speed, revolutions per minute, if constant and known.
    pub spindle_rpm: Option<f64>,
    /// Teeth of the cutter, if known.
    pub teeth: Option<u32>,
}

/// `[realtime]`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Realtime {
    /// Priority of `SCHED_FIFO`; none: the ordinary scheduler.
    pub fifo_priority: Option<u8>,
    /// Core to which the cycle is pinned.
    pub core: Option<usize>,
    /// Lock memory.
    pub lock_memory: bool,
    /// Refuse to start if a setting is refused (otherwise it is reported and the daemon continues).
    pub enforce: bool,
}

/// `[recorder]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorder {
    /// Folder of the recordings.
    pub dir: PathBuf,
    /// Size from which a new file is begun, bytes.
    pub max_file_bytes: u64,
    /// Number of recordings from which on the oldest are removed; those that were kept are not counted.
    pub keep_files: usize,
    /// Whether recording begins with the daemon; otherwise on request.
    pub starts_recording: bool,
    /// Whether an alarm causes the recording to be kept.
    pub keeps_alarms: bool,
    /// Number of kept recordings from which on no further one is kept.
    pub kept_files_max: usize,
}

impl CellConfig {
    /// Reads a configuration; relative paths in it count from its folder. A model that is no file there and has the
    /// name of a preset stays a name.
    ///
    /// # Errors
    /// The file cannot be read, or all its faults.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let mut config = Self::parse(&path.display().to_string(), &read_text(path)?)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let beside = folder.join(&config.model);
        if beside.exists() || presets::by_path(&config.model).is_none() {
            config.model = beside;
        }
        if let Some(recorder) = &mut config.recorder {
            recorder.dir = folder.join(&recorder.dir);
        }
        Ok(config)
    }

    /// Reads a configuration from a text.
    ///
    /// # Errors
    /// All faults of the text.
    pub fn parse(name: &str, text: &str) -> Result<Self, Faults> {
        read::parse(name, text)
    }

    /// The feed override without a daemon and with unknown mode: that for a lost force in a cell
    /// that adapts its feed and corrects after a start, otherwise 1.
    #[must_use]
    pub fn fallback_feed_override(&self) -> f64 {
        let feed = self.feed.filter(|feed| feed.mode == FeedMode::Adapt);
        feed.filter(|_| self.mode != Mode::Shadow).map_or(1.0, |feed| feed.lost)
    }

    /// Checks the lists per joint against a robot with these joints.
    ///
    /// # Errors
    /// Every list of another length.
    pub fn check_against(&self, name: &str, joints: &[JointKind]) -> Result<(), Faults> {
        let mut faults = Faults::new(name);
        for (key, list) in self.envelope.limit_lists() {
            if list.len() != 1 && list.len() != joints.len() {
                let fault =
                    Fault::new(format!("envelope.{key}"), format!("has {} values", list.len()));
                faults.push(
                    fault.expected(format!("one value, or {} (one per joint)", joints.len())),
                );
            }
        }
        if faults.is_empty() { Ok(()) } else { faults.into_result(None) }
    }
}

impl Envelope {
    fn limit_lists(&self) -> [(&'static str, &[f64]); 6] {
        let (r, p) = (&self.revolute, &self.prismatic);
        [
            ("angle_mrad", &r.position),
            ("rate_mrad_s", &r.rate),
            ("jerk_mrad_s3", &r.jerk),
            ("travel_mm", &p.position),
            ("rate_mm_s", &p.rate),
            ("jerk_mm_s3", &p.jerk),
        ]
    }

    /// Position, rate and jerk limit of a joint (from 0), SI. A joint beyond the end of a list has
    /// its last value.
    #[must_use]
    pub fn limits_of_joint(&self, joint: usize, kind: JointKind) -> (f64, f64, f64) {
        let bounds = match kind {
            JointKind::Revolute => &self.revolute,
            JointKind::Prismatic => &self.prismatic,
        };
        // A list that was read is not empty; for one made in code zero (no correction) is safe.
        let pick = |list: &[f64]| list.get(joint).or(list.last()).copied().unwrap_or(0.0);
        (pick(&bounds.position), pick(&bounds.rate), pick(&bounds.jerk))
    }
}
