//! One step of one joint: from the path, or from the path and a measured error, to the next correction, within its limits.
//!
//! If learning uses only a fraction λ of its step, because the sign is uncertain (near a mode), the commands approach those of the preview by `1 − λ`,
//! if the plant was identified from the run and this reduces the error.
//!
//! The correction is zero at both ends of the path. If it would exceed the limits, lower bandwidths are tried, and the one with the
//! smallest RMS error by the model is used; the limiter of the daemon (`envelope`) is applied last, so that limits hold in any case.

use crate::fourier::{Transform, product};
use crate::settings::Settings;
use envelope::Limiter;
use joint_dynamics::inverse::{Design, Gains, Source};
use joint_dynamics::plant::Plant;
use realfft::num_complex::Complex64;
use std::f64::consts::PI;

/// Ratio of successive bandwidths that are tried.
const BANDWIDTH_RATIO: f64 = 0.75;
/// Number of bandwidths that are tried.
const BANDWIDTHS: i32 = 8;

/// A joint on a path.
pub(crate) struct Joint<'a> {
    pub(crate) plant: &'a Plant,
    pub(crate) transform: &'a Transform,
    pub(crate) step_s: f64,
    /// Rows at both ends over which the correction fades.
    pub(crate) fade_rows: usize,
    pub(crate) settings: &'a Settings,
}

/// Input of a step, as spectra.
pub(crate) enum StepInput<'a> {
    /// Target of the joint.
    Path(&'a [Complex64]),
    /// The error of a run.
    Run {
        /// Target of the joint, if the plant was identified from the run.
        path: Option<&'a [Complex64]>,
        /// The measured error, without noise.
        error: &'a [Complex64],
    },
}

/// A correction and its remaining error.
#[derive(Clone, Debug, PartialEq)]
pub struct CorrectionStep {
    /// Added to the static commands, rad or m.
    pub correction: Vec<f64>,
    /// The remaining error by the model, rad or m.
    pub residual: Vec<f64>,
    /// Hz; lower than requested if the limits required it.
    pub bandwidth_hz: f64,
    /// Rows in which the limiter reduced the correction.
    pub limited_rows: usize,
}

impl Joint<'_> {
    /// The plant's frequency response at the transform's bins.
    pub(crate) fn response(&self) -> Vec<Complex64> {
        self.transform.bins_hz().iter().map(|hz| self.plant.response(*hz)).collect()
    }

    /// The step from the correction `before`, which left `error`; without a measured error it is
    /// the preview.
    pub(crate) fn step(
        &self,
        known: &StepInput<'_>,
        before: &[f64],
        error: &[f64],
    ) -> CorrectionStep {
        let response = self.response();
        let mut best: Option<(f64, CorrectionStep)> = None;
        for k in 0..BANDWIDTHS {
            let bandwidth_hz = self.settings.bandwidth_hz * BANDWIDTH_RATIO.powi(k);
            let mut is_free = false;
            for wanted in self.correction_candidates(bandwidth_hz, known, before) {
                let tried = self.within_limits(bandwidth_hz, &wanted, before, error, &response);
                let squares = tried.residual.iter().map(|left| left * left).sum::<f64>();
                is_free |= tried.limited_rows == 0;
                if best.as_ref().is_none_or(|(smallest, _)| squares < *smallest) {
                    best = Some((squares, tried));
                }
            }
            if is_free {
                break;
            }
        }
        let nothing = || CorrectionStep {
            correction: before.to_vec(),
            residual: error.to_vec(),
            bandwidth_hz: 0.0,
            limited_rows: 0,
        };
        best.map_or_else(nothing, |(_, stepped)| stepped)
    }

    /// Corrections before limiting: the preview; or the learned one, which, for a plant identified
    /// from the run, is supplemented by the preview where learning is not robust.
    fn correction_candidates(
        &self,
        bandwidth_hz: f64,
        known: &StepInput<'_>,
        before: &[f64],
    ) -> Vec<Vec<f64>> {
        let bins_hz = self.transform.bins_hz();
        let gains = |source: Source| {
            let robust_to = self.settings.robust_to;
            Design { plant: self.plant, bandwidth_hz, robust_to, source }.gains(&bins_hz)
        };
        let preview = |path: &[Complex64]| product(path, &gains(Source::Path).gains);
        let (path, measured) = match *known {
            StepInput::Path(path) => return vec![self.faded(before, preview(path))],
            StepInput::Run { path, error } => (path, error),
        };
        let Gains { gains: inverse, shares } = gains(Source::Error);
        let learned = product(measured, &inverse);
        let mut all = Vec::new();
        if let Some(path) = path {
            let (preview, sent) = (preview(path), self.transform.spectrum(before));
            let beside = |k: usize| learned[k] + (1.0 - shares[k]) * (preview[k] - sent[k]);
            all.push(self.faded(before, (0..learned.len()).map(beside).collect()));
        }
        all.push(self.faded(before, learned));
        all
    }

    /// A correction and its change, faded to zero at both ends of the path.
    fn faded(&self, before: &[f64], change: Vec<Complex64>) -> Vec<f64> {
        let rows = before.len();
        let change = self.transform.samples(change);
        (before.iter().zip(change).enumerate())
            .map(|(row, (before, change))| (before + change) * self.fade(row, rows))
            .collect()
    }

    fn within_limits(
        &self,
        bandwidth_hz: f64,
        wanted: &[f64],
        before: &[f64],
        error: &[f64],
        response: &[Complex64],
    ) -> CorrectionStep {
        let (correction, limited_rows) = self.limit(wanted);
        let changed: Vec<f64> = correction.iter().zip(before).map(|(c, b)| c - b).collect();
        let moved = self.transform.through(&changed, response);
        let residual = error.iter().zip(moved).map(|(error, moved)| error - moved).collect();
        CorrectionStep { correction, residual, bandwidth_hz, limited_rows }
    }

    /// A raised cosine from 0 to 1 at both ends.
    fn fade(&self, row: usize, rows: usize) -> f64 {
        let from_end = row.min(rows.saturating_sub(1 + row)) as f64;
        let share = (from_end / self.fade_rows.max(1) as f64).min(1.0);
        0.5 - 0.5 * (PI * share).cos()
    }

    fn limit(&self, wanted: &[f64]) -> (Vec<f64>, usize) {
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
