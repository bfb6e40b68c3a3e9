//! Harmonics of the spindle speed, and their aliases.
//!
//! A tone above half the sampling rate appears at its distance from the nearest multiple of the
//! rate: 933.3 Hz (28 000 rpm, two teeth) sampled at 1 kHz reads 66.7 Hz. Assumption: the first 20
//! harmonics of the spindle speed and the first 10 of the tooth passing can be strong.

use crate::verdict::NearestLine;

/// Number of spindle harmonics considered.
const SPINDLE_ORDERS: u32 = 20;
/// Number of tooth-passing harmonics considered.
const TOOTH_ORDERS: u32 = 10;

/// Aliases closer than this are not distinguished, Hz.
const SAME_HZ: f64 = 0.25;

/// The present spindle speed, and its range over the last 150 to 300 ms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spindle {
    pub(crate) hz: f64,
    pub(crate) low_hz: f64,
    pub(crate) high_hz: f64,
    pub(crate) teeth: u32,
}

/// Where a frequency appears after sampling at `rate_hz`.
#[must_use]
pub fn folded_hz(frequency_hz: f64, rate_hz: f64) -> f64 {
    (frequency_hz - rate_hz * (frequency_hz / rate_hz).round()).abs()
}

impl Spindle {
    /// The nearest harmonic of the speed below half the sampling rate.
    pub(crate) fn nearest_harmonic(&self, frequency_hz: f64, rate_hz: f64) -> Option<NearestLine> {
        if self.hz <= 0.0 {
            return None;
        }
        let highest = (0.5 * rate_hz / self.hz).floor();
        let order = (frequency_hz / self.hz).round().clamp(1.0, highest.max(1.0));
        Some(line(frequency_hz, order * self.hz, order as u32))
    }

    /// The nearest alias of a harmonic above half the sampling rate.
    pub(crate) fn nearest_alias(&self, frequency_hz: f64, rate_hz: f64) -> Option<NearestLine> {
        if self.hz <= 0.0 {
            return None;
        }
        let first = (0.5 * rate_hz / self.hz).floor().min(1e6) as u32 + 1;
        let last = SPINDLE_ORDERS.max(TOOTH_ORDERS * self.teeth.min(100));
        (first..=last)
            .filter(|order| *order <= SPINDLE_ORDERS || order % self.teeth.max(1) == 0)
            .map(|order| line(frequency_hz, folded_hz(f64::from(order) * self.hz, rate_hz), order))
            // Where several harmonics fold to the same frequency, the lowest is the strongest.
            .reduce(|best, line| {
                let nearer = line.distance_hz.abs() < best.distance_hz.abs() - SAME_HZ;
                if nearer { line } else { best }
            })
    }

    /// Whether a frequency is a harmonic of a speed within the recent range.
    pub(crate) fn has_harmonic_at(&self, frequency_hz: f64, uncertainty_hz: f64) -> bool {
        if self.hz <= 0.0 {
            return false;
        }
        // The reported speed lags the actual speed while it changes.
        let margin = 0.2 * (self.high_hz - self.low_hz);
        let tolerance = 0.003 * frequency_hz + uncertainty_hz;
        let order = ((frequency_hz - tolerance) / (self.high_hz + margin)).ceil().max(1.0);
        order * (self.low_hz - margin) <= frequency_hz + tolerance
            && order * (self.high_hz + margin) >= frequency_hz - tolerance
    }
}

fn line(frequency_hz: f64, at_hz: f64, order: u32) -> NearestLine {
    NearestLine { frequency_hz: at_hz, distance_hz: frequency_hz - at_hz, order }
}

/// The range of speeds over the last two intervals of 150 ms.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SpeedRange {
    range: [(f64, f64); 2],
    turn_ends_s: f64,
}

impl SpeedRange {
    /// Stores the speed valid at `now_s`, and returns the range of recent speeds.
    pub(crate) fn update(&mut self, hz: f64, teeth: u32, now_s: f64) -> Spindle {
        if now_s >= self.turn_ends_s {
            self.range = [(hz, hz), self.range[0]];
            self.turn_ends_s = now_s + 0.15;
        }
        let (low, high) = self.range[0];
        self.range[0] = (low.min(hz), high.max(hz));
        let whole = self.range.iter().filter(|range| range.0 > 0.0);
        let (low_hz, high_hz) =
            whole.fold((hz, hz), |(low, high), range| (low.min(range.0), high.max(range.1)));
        Spindle { hz, low_hz, high_hz, teeth }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spindle(rpm: f64, teeth: u32) -> Spindle {
        let hz = rpm / 60.0;
        Spindle { hz, low_hz: hz, high_hz: hz, teeth }
    }

    #[test]
    fn the_table_of_aliases_onto_the_67_hz_mode_holds() {
        let s = spindle(28_000.0, 2);
        for (rate_hz, order) in [(1000.0, 2), (2000.0, 13), (4000.0, 17), (8000.0, 17)] {
            let alias = s.nearest_alias(66.667, rate_hz).expect("an alias");
            assert_eq!(alias.order, order, "at {rate_hz} Hz: {alias:?}");
            assert!(alias.distance_hz.abs() < 0.01);
        }
        let alias = s.nearest_alias(133.3, 2000.0).expect("an alias");
        assert_eq!(alias.order, 4);
        assert!(s.nearest_alias(66.667, 51_200.0).is_none(), "nothing strong folds at 51.2 kHz");
    }

    #[test]
    fn a_changing_speed_drives_what_lies_between() {
        let mut recent = SpeedRange::default();
        recent.update(400.0, 2, 0.0);
        let s = recent.update(440.0, 2, 0.1);
        assert!(
            s.has_harmonic_at(420.0, 0.5)
                && s.has_harmonic_at(840.0, 0.5)
                && !s.has_harmonic_at(600.0, 0.5)
        );
        let later = recent.update(440.0, 2, 0.5);
        assert!(later.has_harmonic_at(420.0, 0.5), "windows still hold the old speed");
        assert!(!recent.update(440.0, 2, 0.9).has_harmonic_at(420.0, 0.5));
    }

    proptest! {
        #[test]
        fn a_folded_tone_has_the_same_samples(f in 0.0..5000.0_f64, i in 0..200_i32) {
            let t = f64::from(i) / 1000.0;
            let turn = |hz: f64| (std::f64::consts::TAU * hz * t).cos();
            prop_assert!((turn(f) - turn(folded_hz(f, 1000.0))).abs() < 1e-9);
            prop_assert!(folded_hz(f, 1000.0) <= 500.0);
        }

        #[test]
        fn every_multiple_is_driven(rpm in 600.0..40_000.0_f64, k in 1..30_u32) {
            let s = spindle(rpm, 2);
            prop_assert!(s.has_harmonic_at(f64::from(k) * s.hz, 0.1));
        }
    }
}
