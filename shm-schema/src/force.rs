//! Force samples in blocks (`/force`): no sample is lost undetected.
//!
//! Channels are `Fx Fy Fz Mx My Mz` in N and N·m; fewer channels are the first of these.

use iceoryx2::prelude::ZeroCopySend;

use crate::layout::{check_range, payload, plain_struct};

/// Largest number of channels of a block: a whole wrench.
pub const FORCE_CHANNELS_MAX: usize = 6;
/// Largest number of samples per channel in one block.
pub const FORCE_SAMPLES_MAX: usize = 512;

plain_struct! {
    /// A block of evenly spaced samples.
    pub struct ForceBlock = "trued.ForceBlock/1" {
        /// Starts at 1 and increases by 1 with each block, sent or not: gaps count lost blocks.
        pub seq: u64,
        /// Names this run of the sender: another number means that `seq` starts again.
        pub session: u64,
        /// Time of the first sample, `CLOCK_MONOTONIC` live, the recording's time in a replay.
        pub t_ns: u64,
        /// When it was sent, `CLOCK_MONOTONIC`.
        pub sent_ns: u64,
        /// Samples per channel before this block in this session, lost ones included.
        pub samples_before: u64,
        /// Sampling rate, Hz.
        pub rate_hz: f64,
        /// Layout version.
        pub layout: u32,
        /// Channels, 3 to 6.
        pub channels: u32,
        /// Samples per channel, 1 to 512.
        pub samples: u32,
        /// The constants of [`ForceBlock`].
        pub flags: u32,
        /// Channel by channel, without gap: sample `s` of channel `c` is `data[c * samples + s]`.
        pub data: [f64; FORCE_CHANNELS_MAX * FORCE_SAMPLES_MAX],
    }
}
payload!(ForceBlock = "trued.ForceBlock/1", layout 1, check |b| {
    check_range::<ForceBlock>("channels", u64::from(b.channels), 3..=6, "3 to 6 channels")?;
    check_range::<ForceBlock>("samples", u64::from(b.samples), 1..=512, "1 to 512 samples")
});

impl ForceBlock {
    /// The samples are in base axes (else tool axes).
    pub const IN_BASE: u32 = 1;
    /// The source had single precision.
    pub const INPUT_F32: u32 = 1 << 1;

    /// The samples of one channel; empty if the block has no such channel or its counts exceed its size.
    #[must_use]
    pub fn channel(&self, channel: usize) -> &[f64] {
        let samples = self.samples as usize;
        if channel >= self.channels as usize || samples > FORCE_SAMPLES_MAX {
            return &[];
        }
        self.data.get(channel * samples..(channel + 1) * samples).unwrap_or(&[])
    }
}
