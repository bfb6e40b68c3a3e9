//! Settings of the correction.

use envelope::Limits;
use glam::DVec3;
use physics::JOINTS_MAX;

/// Share of the envelope's angle in limited mode.
pub const LIMITED_SHARE: f64 = 0.1;

/// How much may be corrected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Computed and reported; the command goes out as it came.
    #[default]
    Shadow,
    /// Within a tenth of the envelope's angle.
    Limited,
    /// Within the whole envelope.
    Full,
}

impl Mode {
    /// Share of the envelope's angle that may be corrected; none in shadow mode, which corrects nothing.
    #[must_use]
    pub const fn angle_share(self) -> Option<f64> {
        match self {
            Self::Shadow => None,
            Self::Limited => Some(LIMITED_SHARE),
            Self::Full => Some(1.0),
        }
    }
}

/// Which of the tool's six freedoms are to be put right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// The tool may turn about its own z.
    pub free_tool_axis: bool,
    /// What a radian of orientation is worth, m; matters only where not all can be put right (fewer than six joints).
    pub length_m: f64,
    /// What the tool is to be displaced by from where the command's geometry puts it, base frame, m: a trim.
    pub offset_m: DVec3,
}

impl Default for Task {
    fn default() -> Self {
        Self { free_tool_axis: false, length_m: 0.2, offset_m: DVec3::ZERO }
    }
}

/// How the measured wrench enters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchSettings {
    /// Whether it enters at all.
    pub enabled: bool,
    /// Corner of the low pass, Hz; well below the first mode.
    pub low_pass_hz: f64,
    /// A sample older than this fades out, ns.
    pub stale_ns: u64,
    /// Stiffness of what the tool pushes against, N/m; none: not known.
    pub process_stiffness: Option<f64>,
    /// Process stiffness times the robot's compliance must stay below this.
    pub loop_gain_max: f64,
}

impl Default for WrenchSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            low_pass_hz: 3.0,
            stale_ns: 50_000_000,
            process_stiffness: None,
            loop_gain_max: 0.5,
        }
    }
}

/// Everything that a cell sets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How much may be corrected.
    pub mode: Mode,
    /// Bounds of each joint's correction.
    pub envelope: [Limits; JOINTS_MAX],
    /// What is to be put right.
    pub task: Task,
    /// How the wrench enters.
    pub wrench: WrenchSettings,
    /// Expected time between commands, ns.
    pub period_ns: u64,
    /// A command older than this is refused, ns.
    pub stale_ns: u64,
    /// A refused solution holds the last correction for this long before it ramps out, ns.
    pub hold_ns: u64,
    /// A joint has turned back once its command moved this far against its last motion, rad or m.
    pub reversal: f64,
    /// A command that moves a joint faster than so many times its stated speed is a jump. Above 1; 2 leaves room for times of
    /// commands that are off by half a cycle.
    pub jump_margin: f64,
    /// Commands pace the cycle and carry the time (a replay): nothing is stale, poses may be settled.
    pub lockstep: bool,
}

impl Settings {
    /// Full correction at 1 kHz within `envelope` for every joint.
    pub fn with_envelope(envelope: Limits) -> Self {
        Self {
            mode: Mode::Full,
            envelope: [envelope; JOINTS_MAX],
            task: Task::default(),
            wrench: WrenchSettings::default(),
            period_ns: 1_000_000,
            stale_ns: 10_000_000,
            hold_ns: 50_000_000,
            reversal: 2e-6,
            jump_margin: 2.0,
            lockstep: false,
        }
    }

    /// Bounds of joint `i`'s correction, with that share of its angle.
    pub(crate) fn limits(&self, i: usize, angle_share: f64) -> Limits {
        let full = self.envelope[i];
        if angle_share == 1.0 {
            return full;
        }
        Limits::new(full.angle() * angle_share, full.rate(), full.jerk()).unwrap_or(full)
    }
}
