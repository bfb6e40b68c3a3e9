//! Thresholds for the evaluation of lines, each with unit, range and origin.

use crate::config::{ConfigError, in_range};

/// Thresholds of the evaluation of lines. The published figures were measured with the defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// A line first detected just after the noise floor was learned counts as present from the
    /// start if its mean power during learning was at least this share of the power at its first
    /// detection; 0.01 to 0.7. Default 0.25. Derivation: for a steady line the share is 1, less 1.4
    /// dB (0.72) between two bins, and half of that if its amplitude grows by a third meanwhile;
    /// for a line caused by a cut it is the share of the noise, below 1/20 by the detection
    /// threshold.
    pub heard_part: f64,
    /// A self-excited line raises an alarm in the cut only if its mean square, over all forces, is
    /// at least this share of the mean square of the forces relative to those in air (variance and
    /// squared mean); 0 to 0.5. Default 0.004: an amplitude of 9 % of the force. Reference: energy
    /// ratio of chatter and periodic force, Caliskan, Kilic and Altintas 2018 (J. Manuf. Sci. Eng.
    /// 140, 111012). Measured (`cuts 160 3040` with the limit at 0, and real recordings): lines
    /// caused by noise in stable cuts have at most 0.0004 (steady turning: 0.0004), chatters reach
    /// 0.04 to 0.6 (a real one: 0.04 at its first alarm).
    pub least_share: f64,
    /// Spindle speeds, rev/s, at which the signal of one revolution before is subtracted, which
    /// isolates chatter between the harmonics; 2 to 1000, the second above the first; equal: never.
    /// Default 14 to 60: below, the revolution is longer than the window of 72 ms and the delay
    /// outweighs the separation; above, the harmonics are more than four cells of that window
    /// apart, and the windows resolve them (`cuts 160 3040`: with 14 to 240, chatter near a
    /// harmonic of 60 to 140 Hz was detected later; without the subtraction its sidebands raised
    /// the alarm instead).
    pub comb_spindle_hz: [f64; 2],
    /// Least gain of that difference for the search of lines (0 at the harmonics of the speed, 2
    /// halfway between two); 0.1 to 1. Default 0.5: all frequencies except 8 % of the distance of
    /// two harmonics on either side of each.
    pub least_comb_gain: f64,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            heard_part: 0.25,
            least_share: 0.004,
            comb_spindle_hz: [14.0, 60.0],
            least_comb_gain: 0.5,
        }
    }
}

impl Rules {
    /// Checks every limit.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        in_range("rules.heard_part", self.heard_part, 0.01..=0.7, "0.01 to 0.7")?;
        in_range("rules.least_share", self.least_share, 0.0..=0.5, "0 to 0.5")?;
        let [slowest, fastest] = self.comb_spindle_hz;
        in_range("rules.comb_spindle_hz", slowest, 2.0..=1000.0, "2 to 1000 rev/s")?;
        in_range("rules.comb_spindle_hz", fastest, slowest..=1000.0, "the first to 1000 rev/s")?;
        in_range("rules.least_comb_gain", self.least_comb_gain, 0.1..=1.0, "0.1 to 1")
    }
}
