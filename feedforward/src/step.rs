//! One step of one joint: from the path or from an error to the next correction, within its limits.
//!
//! The correction ends at nothing at both ends of the path. Where the limits would hold it back, lower bandwidths are tried, and the one is taken that leaves the
//! smallest root mean square error by the model; the limiter of the daemon (`envelope`) has the last word, so that limits hold whatever was computed.

use crate::fourier::{Transform, product};
use crate::inverse::{Design, Source};
use crate::plant::Plant;
use crate::settings::Settings;
use envelope::Limiter;
use realfft::num_complex::Complex64;
use std::f64::consts::PI;

/// From one bandwidth to the next that is tried.
const LOWER: f64 = 0.75;
/// So many bandwidths are tried.
const TRIES: i32 = 8;

/// A joint on a path.
pub(crate) struct Joint<'a> {
    pub(crate) plant: &'a Plant,
    pub(crate) transform: &'a Transform,
    pub(crate) step_s: f64,
    /// Rows at both ends over which the correction fades.
    pub(crate) fade_rows: usize,
    pub(crate) settings: &'a Settings,
}

/// A correction and what is left with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stepped {
    /// What is added to the static commands, rad or m.
    pub correction: Vec<f64>,
    /// The error that is left by the model, rad or m.
    pub left: Vec<f64>,
    /// Hz; lower than asked where the limits wanted it.
    pub bandwidth_hz: f64,
    /// Rows in which the limiter held the correction back.
    pub limited_rows: usize,
}

impl Joint<'_> {
    /// The plant's frequency response at the transform's bins.
    pub(crate) fn response(&self) -> Vec<Complex64> {
        self.transform.bins_hz().iter().map(|hz| self.plant.response(*hz)).collect()
    }

    /// The step from the correction `before`, which left `error`; `spectrum` is that of its source.
    pub(crate) fn step(
        &self,
        source: Source,
        spectrum: &[Complex64],
        before: &[f64],
        error: &[f64],
    ) -> Stepped {
        let response = self.response();
        let mut best: Option<(f64, Stepped)> = None;
        for k in 0..TRIES {
            let bandwidth_hz = self.settings.bandwidth_hz * LOWER.powi(k);
            let tried = self.at(bandwidth_hz, source, spectrum, before, error, &response);
            let squares = tried.left.iter().map(|left| left * left).sum::<f64>();
            let is_free = tried.limited_rows == 0;
            if best.as_ref().is_none_or(|(least, _)| squares < *least) {
                best = Some((squares, tried));
            }
            if is_free {
                break;
            }
        }
        let nothing = || Stepped {
            correction: before.to_vec(),
            left: error.to_vec(),
            bandwidth_hz: 0.0,
            limited_rows: 0,
        };
        best.map_or_else(nothing, |(_, stepped)| stepped)
    }

    fn at(
        &self,
        bandwidth_hz: f64,
        source: Source,
        spectrum: &[Complex64],
        before: &[f64],
        error: &[f64],
        response: &[Complex64],
    ) -> Stepped {
        let Settings { robust_to, .. } = *self.settings;
        let design = Design { plant: self.plant, bandwidth_hz, robust_to, source };
        let gains = design.gains(&self.transform.bins_hz());
        let change = self.transform.samples(product(spectrum, &gains));
        let wanted: Vec<f64> = (before.iter().zip(change).enumerate())
            .map(|(row, (before, change))| (before + change) * self.fade(row, error.len()))
            .collect();
        let (correction, limited_rows) = self.limited(&wanted);
        let changed: Vec<f64> = correction.iter().zip(before).map(|(c, b)| c - b).collect();
        let moved = self.transform.through(&changed, response);
        let left = error.iter().zip(moved).map(|(error, moved)| error - moved).collect();
        Stepped { correction, left, bandwidth_hz, limited_rows }
    }

    /// A raised cosine from 0 to 1 at both ends.
    fn fade(&self, row: usize, rows: usize) -> f64 {
        let from_end = row.min(rows.saturating_sub(1 + row)) as f64;
        let share = (from_end / self.fade_rows.max(1) as f64).min(1.0);
        0.5 - 0.5 * (PI * share).cos()
    }

    fn limited(&self, wanted: &[f64]) -> (Vec<f64>, usize) {
        let mut limiter = Limiter::at_rest();
        let allowed: Vec<f64> = wanted
            .iter()
            .map(|wanted| limiter.step(*wanted, &self.settings.limits, self.step_s))
            .collect();
        let limited = allowed.iter().zip(wanted).filter(|(allowed, wanted)| allowed != wanted);
        let rows = limited.count();
        (allowed, rows)
    }
}
