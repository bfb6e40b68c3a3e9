//! Signals over the tool path instead of time, for spectra in cycles per mm, and their match with
//! gear trains.
//!
//! Vibration caused by a gear or by surface waviness has a constant number of cycles per mm at any
//! feed (thesis 4.4, A III); structural vibration has a constant number of cycles per second. The
//! signal is averaged over equal steps of path, which is also the anti-alias filter (first zero at
//! one cycle per step). Valid while the tool moves forward; standstills are skipped.

use crate::config::GearFrequency;

/// Number of multiples of a gear frequency that a line is matched with.
pub const MULTIPLES: u32 = 3;

/// A record that cannot be resampled over the path.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PathError {
    /// Path and signal differ in length.
    #[error("spatial spectrum: {path} path and {signal} signal samples, expected equal numbers")]
    Unequal {
        /// Path samples.
        path: usize,
        /// Signal samples.
        signal: usize,
    },
    /// The path runs backwards, or is not a number.
    #[error(
        "spatial spectrum: the path at sample {index} is not a number or runs back; give the path length, which only grows"
    )]
    NotForward {
        /// Place in the record, from 0.
        index: usize,
    },
    /// The step is invalid, or the path is shorter than two steps.
    #[error(
        "spatial spectrum: a step of {step_mm} mm over a path of {path_mm} mm, expected a step above 0 and a path of two steps or more"
    )]
    Step {
        /// Step, mm.
        step_mm: f64,
        /// Length of the path, mm.
        path_mm: f64,
    },
}

/// The signal's mean over each step of path. `path_mm` is the path length at each sample.
///
/// # Errors
/// Unequal records, a path that runs backwards, an invalid step.
pub fn resample_over_path(
    path_mm: &[f64],
    signal: &[f64],
    step_mm: f64,
) -> Result<Vec<f64>, PathError> {
    if path_mm.len() != signal.len() {
        return Err(PathError::Unequal { path: path_mm.len(), signal: signal.len() });
    }
    let backward = path_mm
        .windows(2)
        .position(|pair| pair[1].is_nan() || pair[0].is_nan() || pair[1] < pair[0]);
    if let Some(before) = backward {
        return Err(PathError::NotForward { index: before + 1 });
    }
    let length = path_mm.last().zip(path_mm.first()).map_or(0.0, |(last, first)| last - first);
    let steps = (length / step_mm).floor();
    if !(step_mm > 0.0 && (2.0..1e9).contains(&steps)) {
        return Err(PathError::Step { step_mm, path_mm: length });
    }
    let mut sums = vec![0.0; steps as usize];
    for (place, value) in path_mm.windows(2).zip(signal.windows(2)) {
        integrate_over_steps(
            &mut sums,
            [place[0] - path_mm[0], place[1] - path_mm[0]],
            [value[0], value[1]],
            step_mm,
        );
    }
    Ok(sums.iter().map(|sum| sum / step_mm).collect())
}

/// Adds the integral of the straight line between two samples to the steps that it crosses.
fn integrate_over_steps(sums: &mut [f64], place: [f64; 2], value: [f64; 2], step_mm: f64) {
    let [from, to] = place;
    if to <= from {
        return;
    }
    let interpolated = |x: f64| value[0] + (value[1] - value[0]) * (x - from) / (to - from);
    let mut left = from;
    while left < to {
        let step = (left / step_mm).floor();
        let mut right = ((step + 1.0) * step_mm).min(to);
        if right <= left {
            right = to;
        }
        if let Some(sum) = sums.get_mut((0.5 * (left + right) / step_mm) as usize) {
            *sum += 0.5 * (interpolated(left) + interpolated(right)) * (right - left);
        }
        left = right;
    }
}

/// Gear frequencies of which a multiple is within `tolerance` (relative) of a line, with the order
/// of the multiple; nearest first, lower orders preferred as the stronger ones.
#[must_use]
pub fn match_gears(
    cycles_per_mm: f64,
    wheels: &[GearFrequency],
    tolerance: f64,
) -> Vec<(GearFrequency, u32)> {
    let multiples =
        wheels.iter().flat_map(|wheel| (1..=MULTIPLES).map(move |order| (*wheel, order)));
    let deviation = |(wheel, order): &(GearFrequency, u32)| {
        (f64::from(*order) * wheel.cycles_per_mm / cycles_per_mm - 1.0).abs()
    };
    let mut found: Vec<(GearFrequency, u32)> =
        multiples.filter(|candidate| deviation(candidate) <= tolerance).collect();
    found.sort_by(|a, b| {
        (deviation(a) + 0.01 * f64::from(a.1)).total_cmp(&(deviation(b) + 0.01 * f64::from(b.1)))
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::welch::{Segments, welch};
    use std::f64::consts::TAU;

    #[test]
    fn waviness_of_constant_cycles_per_mm_is_one_line_whatever_the_feed() {
        let mut place_mm = 0.0;
        let (mut path, mut signal) = (Vec::new(), Vec::new());
        for i in 0..60_000 {
            let feed_mm_s = [5.0, 10.0, 20.0][i / 20_000];
            place_mm += feed_mm_s / 1000.0;
            path.push(place_mm);
            signal
                .push(3.0 * (TAU * 0.3 * place_mm).sin() + (TAU * 13.0 * i as f64 / 1000.0).sin());
        }
        let even = resample_over_path(&path, &signal, 0.25).expect("a signal over path");
        let spectrum = welch(&even, &Segments::new(4.0, 400)).expect("a spectrum");
        let largest = (0..spectrum.power.len())
            .max_by(|a, b| spectrum.power[*a].total_cmp(&spectrum.power[*b]))
            .expect("a line");
        assert!(
            (spectrum.frequency[largest] - 0.3).abs() < 0.011,
            "{}",
            spectrum.frequency[largest]
        );
    }

    #[test]
    fn a_straight_signal_is_averaged_exactly_and_standstill_is_skipped() {
        let path = [0.0, 0.3, 0.3, 0.9, 1.0];
        let signal = path.map(|x| 2.0 * x);
        let even = resample_over_path(&path, &signal, 0.25).expect("a signal over path");
        for (k, mean) in even.iter().enumerate() {
            assert!((mean - 2.0 * 0.25 * (k as f64 + 0.5)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_path_that_runs_back_is_refused_with_its_place() {
        let refused = resample_over_path(&[0.0, 1.0, 0.5], &[0.0; 3], 0.1);
        assert_eq!(refused, Err(PathError::NotForward { index: 2 }));
        assert!(resample_over_path(&[0.0, f64::NAN], &[0.0; 2], 0.1).is_err());
        assert!(resample_over_path(&[0.0, 1.0], &[0.0; 2], 0.0).is_err());
        assert!(resample_over_path(&[0.0], &[0.0; 2], 0.1).is_err());
    }

    #[test]
    fn a_line_is_matched_with_its_wheel() {
        let wheel = |joint, shaft, teeth, cycles_per_mm| GearFrequency {
            joint,
            shaft,
            teeth,
            cycles_per_mm,
        };
        let wheels = [wheel(1, 1, 1, 0.0165), wheel(1, 1, 10, 0.165), wheel(3, 1, 11, 0.32)];
        let best = |line| match_gears(line, &wheels, 0.02).first().copied();
        assert_eq!(best(0.166), Some((wheels[1], 1)));
        assert_eq!(best(0.0331), Some((wheels[0], 2)));
        assert_eq!(best(3.0), None);
        assert_eq!(
            match_gears(0.325, &wheels, 0.03).len(),
            2,
            "all pairs that fit equally well are reported"
        );
    }
}
