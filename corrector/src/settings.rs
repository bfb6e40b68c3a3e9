//! Settings of the correction.

use envelope::Limits;
use glam::DVec3;
use physics::JOINTS_MAX;

/// Share of the position limit in limited mode.
pub const LIMITED_SHARE: f64 = 0.1;

/// How much may be corrected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Computed and reported; the command is sent unchanged.
    #[default]
    Shadow,
    /// Within a tenth of the position limit.
    Limited,
    /// Within the whole position limit.
    Full,
}

impl Mode {
    /// Share of the position limit that may be used; `None` in shadow mode, which corrects nothing.
    #[must_use]
    pub const fn angle_share(self) -> Option<f64> {
        match self {
            Self::Shadow => None,
            Self::Limited => Some(LIMITED_SHARE),
            Self::Full => Some(1.0),
        }
    }
}

/// Which of the tool's six degrees of freedom are corrected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// The tool may turn about its own z.
    pub free_tool_axis: bool,
    /// Weight of a radian of orientation, m; matters only if not all can be corrected (fewer than
    /// six joints).
    pub length_m: f64,
    /// Displacement of the tool from the pose of the command by the nominal geometry, base frame,
    /// m: a trim.
    pub offset_m: DVec3,
}

impl Default for Task {
    fn default() -> Self {
        Self { free_tool_axis: false, length_m: 0.2, offset_m: DVec3::ZERO }
    }
}

/// How the measured wrench is used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchSettings {
    /// Whether it is used.
    pub enabled: bool,
    /// Corner frequency of the low-pass, Hz; well below the first mode.
    pub low_pass_hz: f64,
    /// A sample older than this fades out, ns.
    pub stale_ns: u64,
    /// Stiffness of the contact, N/m; `None` if unknown.
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

/// All settings of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How much may be corrected.
    pub mode: Mode,
    /// Limits of each joint's correction.
    pub envelope: [Limits; JOINTS_MAX],
    /// What is corrected.
    pub task: Task,
    /// How the wrench is used.
    pub wrench: WrenchSettings,
    /// Expected time between commands, ns.
    pub period_ns: u64,
    /// A command older than this is refused, ns.
    pub stale_ns: u64,
    /// If the solve fails, the last correction is held for this long before it ramps to zero, ns.
    pub hold_ns: u64,
    /// A joint has reversed once its command has moved this far against its last motion, rad or m.
    pub reversal: f64,
    /// A command that moves a joint faster than this multiple of its stated speed is a jump. Above
    /// 1; 2 allows times of commands to be off by half a cycle.
    pub jump_margin: f64,
    /// Commands pace the cycle and carry the time (a replay): nothing is stale, and poses may be
    /// marked as at rest.
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

    /// Limits of joint `i`'s correction, with the given share of the position limit.
    pub(crate) fn limits(&self, i: usize, angle_share: f64) -> Limits {
        let full = self.envelope[i];
        if angle_share == 1.0 {
            return full;
        }
        Limits::new(full.angle() * angle_share, full.rate(), full.jerk()).unwrap_or(full)
    }
}
