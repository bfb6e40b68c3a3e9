//! One step of one joint: from the path, or from the path and a measured error, to the next correction, within its limits.
//!
//! If learning uses only a fraction λ of its step, because the sign is uncertain (near a mode), the commands approach those of the preview by `1 − λ`,
//! if the plant was identified from the run and this reduces the error.
//!
//! The correction is zero at both ends of the path. If it would exceed the limits, lower bandwidths are tried, and the one with the
//! smallest RMS error by the model is used; limits are applied last ([`crate::bounds`]), so that they hold in any case.

use crate::bounds::{Bounded, JointBounds, LimitedBy, bounded};
use crate::fourier::{Transform, product};
use crate::settings::Settings;
use joint_dynamics::inverse::{Design, Gains, Source};
use joint_dynamics::plant::Plant;
use realfft::num_complex::Complex64;
use std::f64::consts::PI;

/// Ratio of successive bandwidths that are tried.
const BANDWIDTH_RATIO: f64 = 0.75;
/// Number of bandwidths that are tried.
pub(crate) const BANDWIDTHS: i32 = 8;

/// A joint on a path.
#[derive(Clone, Copy)]
pub(crate) struct Joint<'a> {
    pub(crate) plant: &'a Plant,
    /// Its targets, rad or m.
    pub(crate) wanted: &'a [f64],
    pub(crate) bounds: JointBounds,
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
    /// What limited the correction, row by row.
    pub limited: Vec<Option<LimitedBy>>,
}

impl CorrectionStep {
    /// Number of rows in which a limit reduced the correction.
    #[must_use]
    pub fn limited_rows(&self) -> usize {
        self.limited.iter().flatten().count()
    }
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
            let bandwidth_hz = self.bandwidth_hz(k);
            let mut is_free = false;
            for wanted in self.correction_candidates(bandwidth_hz, known, before) {
                let tried = self.within_limits(bandwidth_hz, &wanted, before, error, &response);
                let squares = tried.residual.iter().map(|left| left * left).sum::<f64>();
                is_free |= tried.limited_rows() == 0;
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
            limited: vec![None; before.len()],
        };
        best.map_or_else(nothing, |(_, stepped)| stepped)
    }

    /// The bandwidth that is tried in this place, Hz.
    fn bandwidth_hz(&self, place: i32) -> f64 {
        self.settings.bandwidth_hz * BANDWIDTH_RATIO.powi(place)
    }

    /// The correction of a preview at one of the bandwidths that are tried, before its limits.
    pub(crate) fn preview_request(&self, place: i32, path: &[Complex64]) -> Vec<f64> {
        let before = vec![0.0; self.wanted.len()];
        let known = StepInput::Path(path);
        self.correction_candidates(self.bandwidth_hz(place), &known, &before).swap_remove(0)
    }

    /// A requested preview within its limits.
    pub(crate) fn bounded_preview(
        &self,
        place: i32,
        request: &[f64],
        error: &[f64],
    ) -> CorrectionStep {
        let before = vec![0.0; request.len()];
        self.within_limits(self.bandwidth_hz(place), request, &before, error, &self.response())
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
        let share = self.settings.learning_share;
        let learned: Vec<Complex64> =
            product(measured, &inverse).into_iter().map(|bin| share * bin).collect();
        let mut all = Vec::new();
        if let Some(path) = path {
            let (preview, sent) = (preview(path), self.transform.spectrum(before));
            let beside = |k: usize| learned[k] + share * (1.0 - shares[k]) * (preview[k] - sent[k]);
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
        let within = (&self.bounds, &self.settings.limits);
        let Bounded { correction, limited } = bounded(self.wanted, wanted, within, self.step_s);
        let changed: Vec<f64> = correction.iter().zip(before).map(|(c, b)| c - b).collect();
        let moved = self.transform.through(&changed, response);
        let residual = error.iter().zip(moved).map(|(error, moved)| error - moved).collect();
        CorrectionStep { correction, residual, bandwidth_hz, limited }
    }

    /// A raised cosine from 0 to 1 at both ends.
    fn fade(&self, row: usize, rows: usize) -> f64 {
        let from_end = row.min(rows.saturating_sub(1 + row)) as f64;
        let share = (from_end / self.fade_rows.max(1) as f64).min(1.0);
        0.5 - 0.5 * (PI * share).cos()
    }
}
