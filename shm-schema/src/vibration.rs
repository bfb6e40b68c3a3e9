//! Verdicts of the vibration monitor (`/vibration`).

use iceoryx2::prelude::ZeroCopySend;

use crate::codes::{UnknownCode, codes};
use crate::layout::{payload, plain_struct};

plain_struct! {
    /// A verdict on one line of the force spectrum. Unknown values are NaN.
    pub struct Verdict = "trued.Verdict/2" {
        /// From 1, plus 1 with each verdict of this daemon's epoch.
        pub seq: u64,
        /// Time of the last force sample used.
        pub t_ns: u64,
        /// When the verdict was made, `CLOCK_MONOTONIC`.
        pub made_ns: u64,
        /// Number of the vibration event, from its first warning to its end.
        pub event: u64,
        /// Frequency, Hz.
        pub frequency_hz: f64,
        /// Amplitude (peak) on `axis`, N or N·m.
        pub amplitude: f64,
        /// Spindle speed recommended by the advice, 1/min (NaN if none).
        pub advice_rpm: f64,
        /// Rate of growth of the amplitude, 1/s.
        pub growth_per_s: f64,
        /// Nearest mode of the structure, Hz.
        pub nearest_mode_hz: f64,
        /// Distance to it, Hz.
        pub mode_distance_hz: f64,
        /// Nearest spindle or tooth-passing harmonic, Hz.
        pub nearest_harmonic_hz: f64,
        /// Distance to it, Hz.
        pub harmonic_distance_hz: f64,
        /// Nearest alias of a known line, Hz.
        pub nearest_alias_hz: f64,
        /// Distance to it, Hz.
        pub alias_distance_hz: f64,
        /// Layout version.
        pub layout: u32,
        /// A [`VibrationState`].
        pub state: u32,
        /// A [`VibrationClass`].
        pub class: u32,
        /// Possible classes: bit `n` is the class of code `n`.
        pub rivals: u32,
        /// Channel: 0 to 5 for `Fx Fy Fz Mx My Mz`.
        pub axis: u32,
        /// 1 if the line may be an alias of a frequency above half the sampling rate.
        pub suspect_alias: u32,
        /// An [`Advice`].
        pub advice: u32,
        /// Faults of its channel and of the stream: bit `n` is the [`crate::SensorFault`] of code `n`.
        pub sensor_faults: u32,
        /// Number of the recommended stability lobe: waves of the mode between two teeth (0 if none).
        pub advice_lobe: u32,
        /// The joint with a gear shaft at this frequency, from 1 (0 if none, or if the feed is unknown).
        pub gear_joint: u32,
        /// Its shaft, from 1, motor side first.
        pub gear_shaft: u32,
        /// Zero.
        pub reserved: u32,
    }
}
payload!(Verdict = "trued.Verdict/2", layout 2, check |v| {
    crate::layout::check_range::<Verdict>("axis", u64::from(v.axis), 0..=5, "an axis of 0 to 5")
});

impl Verdict {
    /// State of the vibration event.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn state(&self) -> Result<VibrationState, UnknownCode> {
        self.state.try_into()
    }

    /// Class of a vibration.
    ///
    /// # Errors
    /// [`UnknownCode`] where the daemon is of a later version.
    pub fn class(&self) -> Result<VibrationClass, UnknownCode> {
        self.class.try_into()
    }
}

codes! {
    /// State of a vibration event.
    pub enum VibrationState {
        /// Ended, or none detected.
        Over = 0 "over",
        /// A spectral line rises above the noise floor.
        Warn = 1 "warn",
        /// It persists or grows.
        Alarm = 2 "alarm",
        /// It persists or grows, and its class is known.
        Confirmed = 3 "confirmed",
    }
}

codes! {
    /// Class of a vibration.
    pub enum VibrationClass {
        /// Not classified.
        Unknown = 0 "unknown",
        /// Forced vibration at a spindle or tooth-passing harmonic.
        Forced = 1 "forced",
        /// Regenerative chatter.
        Chatter = 2 "chatter",
        /// Mode-coupling chatter.
        ModeCoupling = 3 "mode_coupling",
        /// Gear meshing.
        Gear = 4 "gear",
        /// A structural mode, excited from outside.
        Structural = 5 "structural",
        /// Electrical: mains or inverter.
        Electrical = 6 "electrical",
    }
}

codes! {
    /// Recommended action.
    pub enum Advice {
        /// No recommendation.
        None = 0 "none",
        /// Forced: go to `advice_rpm`, which moves the tooth harmonics off the mode.
        MoveOffMode = 1 "move_off_mode",
        /// Regenerative chatter: go to `advice_rpm`, a pocket between stability lobes.
        StabilityPocket = 2 "stability_pocket",
        /// A change of speed does not help: change the direction of cut, the feed or the depth.
        ChangeCut = 3 "change_cut",
        /// Reduce the depth of cut.
        ReduceDepth = 4 "reduce_depth",
        /// Sample faster, or filter before sampling: the line may be an alias.
        SampleFaster = 5 "sample_faster",
        /// Check the gear trains: the line follows the feed.
        CheckGear = 6 "check_gear",
        /// Check cables, shielding and grounding: the line is at a mains frequency.
        CheckWiring = 7 "check_wiring",
    }
}
