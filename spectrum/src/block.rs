//! Input: blocks of force samples, and the state of the process.
//!
//! Unvalidated borrowed values: [`crate::VibrationMonitor::push`] checks them.

/// The most channels a block may carry: three forces and three moments.
pub const CHANNELS_MAX: usize = 6;

/// Consecutive samples at a constant rate, without a gap.
#[derive(Clone, Copy, Debug, Default)]
pub struct Block<'a> {
    /// Session of the sender: a new one restarts all counts.
    pub session: u64,
    /// Sequence number, incremented by one per block; a jump means that blocks were lost.
    pub seq: u64,
    /// Samples per channel before this block in this session, including lost ones; `None` if the
    /// sender does not count.
    pub samples_before: Option<u64>,
    /// Time of the block's first sample, ns. Copied into verdicts, never compared with a clock.
    pub t_ns: u64,
    /// Sampling rate, Hz; must be the configured one to 0.1 %.
    pub rate_hz: f64,
    /// Number of channels; must be the configured one.
    pub channels: usize,
    /// Samples, interleaved: sample `i` of channel `c` is `samples[i * channels + c]`. N and Nm.
    pub samples: &'a [f64],
}

/// State of the process, as far as known. The default means unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProcessState {
    /// Spindle speed, rev/min. 0 at rest or unknown.
    pub spindle_rpm: f64,
    /// Number of teeth of the cutter. 0 if unknown.
    pub teeth: u32,
    /// Feed along the path, mm/s. 0 at rest or unknown.
    pub feed_mm_s: f64,
    /// Whether the tool is in the cut; `None`: decided by the force level.
    pub in_cut: Option<bool>,
}

/// The channel on which a line was detected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axis {
    /// Force along x.
    #[default]
    X,
    /// Force along y.
    Y,
    /// Force along z.
    Z,
    /// Moment about x.
    Mx,
    /// Moment about y.
    My,
    /// Moment about z.
    Mz,
}

impl Axis {
    /// All axes, in channel order.
    pub const ALL: [Self; CHANNELS_MAX] = [Self::X, Self::Y, Self::Z, Self::Mx, Self::My, Self::Mz];

    /// The axis of a channel; channels beyond the sixth do not exist and read as `Mz`.
    #[must_use]
    pub fn of_channel(channel: usize) -> Self {
        Self::ALL[channel.min(CHANNELS_MAX - 1)]
    }

    /// The channel's place in a block.
    #[must_use]
    pub fn channel(self) -> usize {
        self as usize
    }

    /// Name in messages and files: `x`, `y`, `z`, `mx`, `my`, `mz`.
    #[must_use]
    pub fn name(self) -> &'static str {
        ["x", "y", "z", "mx", "my", "mz"][self as usize]
    }

    /// Whether the channel is a force (N) and not a moment (Nm).
    #[must_use]
    pub fn is_force(self) -> bool {
        (self as usize) < 3
    }
}
