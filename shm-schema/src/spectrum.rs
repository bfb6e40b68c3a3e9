//! Spectra of the force for displays (`/spectrum`).
//!
//! Made only while somebody reads them, at most ten a second. Verdicts are not made from them.

use iceoryx2::prelude::ZeroCopySend;

use crate::layout::{check_range, payload, plain_struct};

/// Most bins of a spectrum.
pub const SPECTRUM_BINS_MAX: usize = 256;

plain_struct! {
    /// Amplitude of the force over frequency, in one window of the newest samples.
    pub struct Spectrum = "trued.Spectrum/1" {
        /// From 1, plus 1 with each spectrum of this daemon's epoch.
        pub seq: u64,
        /// Time of the last force sample used.
        pub t_ns: u64,
        /// When it was made, `CLOCK_MONOTONIC`.
        pub made_ns: u64,
        /// Length of the window, s. Two tones less than `2 / window_s` apart are one line.
        pub window_s: f64,
        /// Middle of the first bin, Hz.
        pub first_hz: f64,
        /// Width of a bin, Hz: the middle of bin `i` is `first_hz + i * bin_hz`.
        pub bin_hz: f64,
        /// Layout version.
        pub layout: u32,
        /// Bins, 1 to 256.
        pub bins: u32,
        /// Amplitude (peak) of a tone in each bin, N: the largest of the force channels, and of the frequencies in the bin. Zero beyond `bins`.
        pub amplitude_n: [f64; SPECTRUM_BINS_MAX],
    }
}
payload!(Spectrum = "trued.Spectrum/1", layout 1, check |s| {
    check_range::<Spectrum>("bins", u64::from(s.bins), 1..=SPECTRUM_BINS_MAX as u64, "1 to 256 bins")
});

impl Spectrum {
    /// The amplitudes, N; no more than there can be.
    #[must_use]
    pub fn amplitudes_n(&self) -> &[f64] {
        &self.amplitude_n[..(self.bins as usize).min(SPECTRUM_BINS_MAX)]
    }

    /// Middle of a bin, Hz.
    #[must_use]
    pub fn frequency_hz(&self, bin: usize) -> f64 {
        self.first_hz + bin as f64 * self.bin_hz
    }
}
