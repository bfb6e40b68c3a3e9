//! Modal analysis: natural frequencies, damping and modal masses from a receptance.
//!
//! A mode is identified by three criteria (thesis 4.8 to 4.19): a peak of the imaginary part, a
//! sign change of the real part near it, and sufficient coherence (if available). Frequency and
//! damping are then fitted as a complex pole; modes with overlapping bands are fitted jointly. The
//! stated uncertainty includes noise, misfit, and the variation of the result with the bandwidth
//! and the background polynomial. Peaks without a sign change of the real part, as on the flank of
//! a strong neighbour, and a second mode within one peak are considered too; they must be
//! significant in the fit, and are marked. Peaks too close to be fitted separately at the
//! resolution of the record are fitted jointly; those that no fit explains are reported with the
//! record length that would resolve them. Residual vibration of earlier hits has the same poles: it
//! does not affect frequency and damping, but increases the uncertainty of the modal mass. Valid
//! for viscous damping up to about 0.2. Modes outside the band are not reported.

mod fit;
mod least_squares;
mod merge;
mod peaks;
#[cfg(test)]
mod tests;
mod unresolved;

use crate::config::Mode;
use fit::{Band, Fit, Pole};
use realfft::num_complex::Complex;
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

pub use merge::{MergedMode, merge_modes};
pub use unresolved::{UnresolvedPeak, unresolved_peaks};

/// Default of the smallest coherence at a mode (thesis 4.6.2).
pub const COHERENCE_MIN: f64 = 0.75;
/// Upper limit of the damping ratio: a mode with more has no peak.
const DAMPING_MAX: f64 = 0.3;
/// Half width of the band of a fit, in half-power half widths of a mode. The variations (half
/// width, degree of the background) give the sensitivity of the result.
const BAND_HALF_WIDTHS: f64 = 3.0;
const BAND_VARIATIONS: [(f64, usize); 4] = [(2.0, 1), (2.0, 2), (4.5, 2), (4.5, 3)];
/// Degree of the background polynomial.
const BACKGROUND_DEGREE: usize = 2;
/// Smallest number of bins on either side.
const BINS_MIN: f64 = 7.0;
/// Largest half width of the band, relative to the frequency.
const BAND_PART_MAX: f64 = 0.3;
/// Largest relative uncertainty of the residue of a mode.
const RESIDUE_SIGMA_MAX: f64 = 0.2;
/// Largest number of jointly fitted modes.
const GROUP_MAX: usize = 5;
/// Criteria for an additional mode within one peak: least residual without it, largest residual
/// with it relative to that, and largest relative uncertainty of its residue.
const SPLIT_CRITERIA: (f64, f64, f64) = (0.02, 0.4, 0.07);

/// A measured receptance, and the options of its evaluation.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredReceptance<'a> {
    /// Frequencies, Hz, ascending.
    pub frequency_hz: &'a [f64],
    /// Displacement per force at each, m/N.
    pub receptance: &'a [Complex<f64>],
    /// Coherence at each, 0 to 1, if available.
    pub coherence: Option<&'a [f64]>,
    /// Decay of the exponential window of the measurement, 1/s; 0 for none. It is subtracted from
    /// the damping.
    pub window_decay_per_s: f64,
    /// Shortest interval between two hits of one record, s, for the residual vibration of earlier
    /// hits; `None` if each hit has a separate record.
    pub hit_interval_s: Option<f64>,
}

/// A fitted mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedMode {
    /// Natural frequency (undamped), Hz.
    pub frequency_hz: f64,
    /// Standard uncertainty of it, Hz.
    pub frequency_sigma_hz: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Standard uncertainty of it.
    pub damping_sigma: f64,
    /// Damping ratio by the half-power bandwidth, as a check; `None` where neighbouring modes
    /// overlap.
    pub damping_half_power: Option<f64>,
    /// Modal mass for this pair of excitation and response points, kg. For the driving point
    /// (excitation and response at one point along one direction) it is the modal mass in the usual
    /// sense.
    pub mass_kg: f64,
    /// Standard uncertainty of it, kg.
    pub mass_sigma_kg: f64,
    /// Phase of the residue relative to a real mode at the driving point, rad: 0 in phase with the
    /// force, ±π in antiphase; in between, the mode is complex or affected by neighbouring modes.
    pub phase_rad: f64,
    /// Coherence at the mode.
    pub coherence: Option<f64>,
    /// Remaining vibration of the mode at the next hit, relative to its initial value.
    pub carry_over: f64,
    /// Whether it meets all three criteria; otherwise it was found by the fit only, on the flank of
    /// a neighbouring mode or within its peak.
    pub meets_all_criteria: bool,
    /// Root mean square residual of the fit, relative to the receptance in its band.
    pub residual: f64,
}

impl FittedMode {
    /// Modal stiffness `m ω_n²`, N/m.
    #[must_use]
    pub fn stiffness_n_per_m(&self) -> f64 {
        self.mass_kg * (TAU * self.frequency_hz).powi(2)
    }

    /// Time in which the vibration decays to the share `left` of its initial value, s.
    #[must_use]
    pub fn ring_down_s(&self, left: f64) -> f64 {
        -left.ln() / (TAU * self.frequency_hz * self.damping)
    }

    /// As an entry of the model's modal list, moving along `direction`.
    #[must_use]
    pub fn as_mode(&self, direction: [f64; 3]) -> Mode {
        Mode { frequency_hz: self.frequency_hz, damping: self.damping, direction }
    }
}

/// Start value of a mode, and whether it meets the three criteria.
#[derive(Clone, Copy, Debug)]
struct StartValue {
    at_hz: Complex<f64>,
    meets_all_criteria: bool,
}

/// Identifies and fits the modes of a receptance within a band, lowest first.
///
/// `frequency_hz` and `receptance` are cut to the shorter length.
#[must_use]
pub fn identify_modes(
    measured: &MeasuredReceptance<'_>,
    band_hz: [f64; 2],
    least_coherence: f64,
) -> Vec<FittedMode> {
    let measured = measured.trimmed();
    let peaks = peaks::find_coherent_peaks(&measured, band_hz, least_coherence);
    let mut found: Vec<StartValue> = Vec::new();
    for peak in &peaks {
        for start in measured.start_values(peak, &peaks) {
            let is_separate = |other: &StartValue| {
                let apart = (start.at_hz.re - other.at_hz.re).abs();
                apart > other.at_hz.im.max(start.at_hz.im)
            };
            if found.iter().all(is_separate) && (band_hz[0]..=band_hz[1]).contains(&start.at_hz.re)
            {
                found.push(start);
            }
        }
    }
    found.sort_by(|a, b| a.at_hz.re.total_cmp(&b.at_hz.re));
    let mut modes: Vec<FittedMode> = measured
        .group_overlapping(&found)
        .iter()
        .flat_map(|group| measured.fit_group(group))
        .collect();
    modes.retain(|mode| (band_hz[0]..=band_hz[1]).contains(&mode.frequency_hz));
    modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    modes
}

impl MeasuredReceptance<'_> {
    /// Cut to the common length of frequencies and receptances.
    fn trimmed(&self) -> Self {
        let n = self.frequency_hz.len().min(self.receptance.len());
        let (frequency_hz, receptance) = (&self.frequency_hz[..n], &self.receptance[..n]);
        Self { frequency_hz, receptance, ..*self }
    }

    fn bin_hz(&self) -> f64 {
        match self.frequency_hz {
            [first, .., last] => (last - first) / (self.frequency_hz.len() - 1) as f64,
            _ => 0.0,
        }
    }

    /// Half width of the band of a pole, Hz: `widths` half-power half widths, within limits.
    fn reach_hz(&self, pole_hz: Complex<f64>, widths: f64) -> f64 {
        (widths * pole_hz.im).min(BAND_PART_MAX * pole_hz.re).max(BINS_MIN * self.bin_hz())
    }

    /// The band that contains all poles, each with `widths` half widths on either side.
    fn band(&self, poles: &[Complex<f64>], widths: f64) -> Option<Band> {
        let from = poles.iter().map(|p| p.re - self.reach_hz(*p, widths));
        let to = poles.iter().map(|p| p.re + self.reach_hz(*p, widths));
        let (from, to) = (from.fold(f64::INFINITY, f64::min), to.fold(0.0, f64::max));
        // The first bin (0 Hz) contains no receptance unless displacements were measured.
        Band::between(self.frequency_hz, self.receptance, from.max(self.bin_hz()), to)
    }

    /// Start values of the modes of a peak: a single mode, otherwise jointly with the other peaks
    /// of the band, with additional modes where needed; empty if no fit is valid.
    fn start_values(&self, peak: &peaks::Peak, all: &[peaks::Peak]) -> Vec<StartValue> {
        if let Some(pole) = self.fit_single_mode(peak) {
            return vec![StartValue { at_hz: pole.at_hz, meets_all_criteria: peak.changes_sign }];
        }
        let reach_hz = self.reach_hz(peak.start_value_hz(), BAND_HALF_WIDTHS);
        let is_neighbour = |other: &&peaks::Peak| {
            let apart = (other.frequency_hz - peak.frequency_hz).abs();
            apart > 0.0 && apart < reach_hz
        };
        let together: Vec<&peaks::Peak> =
            std::iter::once(peak).chain(all.iter().filter(is_neighbour)).take(GROUP_MAX).collect();
        let guesses: Vec<_> = together.iter().map(|one| one.start_value_hz()).collect();
        let Some(fit) = self.fit_poles(&guesses, BAND_HALF_WIDTHS, BACKGROUND_DEGREE) else {
            return Vec::new();
        };
        let fit = self.add_close_modes(fit);
        if !fit.poles.iter().all(|pole| self.is_mode(pole)) {
            return Vec::new();
        }
        let signs = |pole: &Pole| {
            let is_nearby = |one: &&&peaks::Peak| one.is_at(pole.at_hz.re);
            together.iter().find(is_nearby).is_some_and(|one| one.changes_sign)
        };
        let start = |pole: &Pole| StartValue { at_hz: pole.at_hz, meets_all_criteria: signs(pole) };
        fit.poles.iter().map(start).collect()
    }

    /// Fits the peak as a single mode; `None` if the result is not a mode at this peak.
    fn fit_single_mode(&self, peak: &peaks::Peak) -> Option<Pole> {
        let rough = *self.band(&[peak.start_value_hz()], 2.0)?.fit_one_pole(1)?.poles.first()?;
        let fit = self.band(&[rough.at_hz], BAND_HALF_WIDTHS)?.fit_one_pole(BACKGROUND_DEGREE)?;
        let pole = *fit.poles.first()?;
        (peak.is_at(pole.at_hz.re) && self.is_mode(&pole)).then_some(pole)
    }

    fn is_mode(&self, pole: &Pole) -> bool {
        let decay_hz = pole.at_hz.im - self.window_decay_per_s / TAU;
        let damped = decay_hz > 0.0 && decay_hz < DAMPING_MAX * pole.at_hz.re;
        damped && pole.residue_sigma < RESIDUE_SIGMA_MAX && pole.sigma_hz < 0.5 * pole.at_hz.im
    }

    /// Groups start values whose bands overlap.
    fn group_overlapping(&self, starts: &[StartValue]) -> Vec<Vec<StartValue>> {
        let mut groups: Vec<Vec<StartValue>> = Vec::new();
        let overlap = |a: &StartValue, b: &StartValue| {
            let reach_hz =
                self.reach_hz(a.at_hz, BAND_HALF_WIDTHS) + self.reach_hz(b.at_hz, BAND_HALF_WIDTHS);
            (b.at_hz.re - a.at_hz.re).abs() < reach_hz
        };
        for start in starts {
            match groups.last_mut() {
                Some(group)
                    if group.len() < GROUP_MAX
                        && group.last().is_some_and(|last| overlap(last, start)) =>
                {
                    group.push(*start);
                }
                _ => groups.push(vec![*start]),
            }
        }
        groups
    }

    fn fit_group(&self, starts: &[StartValue]) -> Vec<FittedMode> {
        let places: Vec<_> = starts.iter().map(|start| start.at_hz).collect();
        let together = self.fit_poles(&places, BAND_HALF_WIDTHS, BACKGROUND_DEGREE);
        let Some(fit) = together.filter(|fit| fit.poles.iter().all(|pole| self.is_mode(pole)))
        else {
            if starts.len() < 2 {
                return Vec::new();
            }
            return starts.iter().flat_map(|start| self.fit_group(&[*start])).collect();
        };
        let fit = self.add_close_modes(fit);
        let places: Vec<_> = fit.poles.iter().map(|pole| pole.at_hz).collect();
        let spread = self.pole_scatter_hz(&places);
        let by_signs = |k: usize| starts.get(k).is_some_and(|start| start.meets_all_criteria);
        let modes = fit.poles.iter().zip(spread).enumerate();
        modes.map(|(k, (pole, spread))| self.fitted_mode(pole, spread, by_signs(k), &fit)).collect()
    }

    fn fit_poles(&self, poles: &[Complex<f64>], reach: f64, degree: usize) -> Option<Fit> {
        self.band(poles, reach)?.fit_poles(poles, degree)
    }

    /// Adds modes to the fit as long as each meets [`SPLIT_CRITERIA`].
    fn add_close_modes(&self, mut fit: Fit) -> Fit {
        let (residual_max, improvement, residue_sigma_max) = SPLIT_CRITERIA;
        while fit.residual > residual_max && fit.poles.len() < GROUP_MAX {
            let poles: Vec<_> = fit.poles.iter().map(|pole| pole.at_hz).collect();
            let width = poles.iter().map(|p| p.im).fold(f64::INFINITY, f64::min);
            let beside = poles.iter().flat_map(|p| [p.re - width, p.re + width]);
            let further = std::iter::once(fit.worst_hz).chain(beside);
            let with = |hz: f64| {
                let starts: Vec<_> =
                    poles.iter().copied().chain([Complex::new(hz, 0.7 * width)]).collect();
                self.fit_poles(&starts, BAND_HALF_WIDTHS, BACKGROUND_DEGREE)
            };
            let is_better = |more: &Fit| {
                more.residual <= improvement * fit.residual
                    && self.are_valid_and_separate(&more.poles, residue_sigma_max)
            };
            let Some(more) = further.filter_map(with).find(is_better) else { break };
            fit = more;
        }
        fit
    }

    /// Whether all poles are modes with sufficiently accurate residues and separate from each
    /// other.
    fn are_valid_and_separate(&self, poles: &[Pole], residue_sigma_max: f64) -> bool {
        let apart = |a: &Pole| {
            let others = poles.iter().filter(|b| b.at_hz != a.at_hz);
            others.map(|b| (a.at_hz - b.at_hz).norm()).fold(f64::INFINITY, f64::min)
        };
        poles.iter().all(|pole| {
            let decay = pole.at_hz.im - self.window_decay_per_s / TAU;
            self.is_mode(pole)
                && pole.residue_sigma < residue_sigma_max
                && apart(pole) > 0.3 * decay
        })
    }

    /// Root mean square change of each pole with the width of the band and the degree of the
    /// polynomial, Hz.
    fn pole_scatter_hz(&self, poles: &[Complex<f64>]) -> Vec<f64> {
        let (mut squares, mut fits) = (vec![0.0; poles.len()], 0.0);
        for (reach, degree) in BAND_VARIATIONS {
            let Some(fit) = self.fit_poles(poles, reach, degree) else { continue };
            fits += 1.0;
            for (sum, (pole, reference_hz)) in squares.iter_mut().zip(fit.poles.iter().zip(poles)) {
                *sum +=
                    (pole.at_hz - reference_hz).norm_sqr().min(reference_hz.im * reference_hz.im);
            }
        }
        // Half of the variance is in each part of the complex number.
        squares.iter().map(|sum| (0.5 * sum / f64::max(fits, 1.0)).sqrt()).collect()
    }

    fn fitted_mode(
        &self,
        pole: &Pole,
        spread_hz: f64,
        meets_all_criteria: bool,
        fit: &Fit,
    ) -> FittedMode {
        let (damped_hz, decay_hz) = (pole.at_hz.re, pole.at_hz.im - self.window_decay_per_s / TAU);
        let frequency_hz = damped_hz.hypot(decay_hz);
        // A record that ends before the mode has decayed shifts the pole by the remaining share of
        // its width.
        let cut_hz = pole.at_hz.im * (-TAU * pole.at_hz.im / self.bin_hz()).exp();
        let sigma_hz = pole.sigma_hz.hypot(spread_hz).hypot(cut_hz);
        // H ≈ A/(ω − p) with A = −1/(2 m ω_d); the residue is with respect to Hz.
        let per_mass = -8.0 * PI * PI * damped_hz * pole.residue;
        let mass_kg = 1.0 / per_mass.norm();
        let carry_over = self.hit_interval_s.map_or(0.0, |s| (-TAU * decay_hz * s).exp());
        // Vibration left by earlier hits changes the residue, with unknown phase, but not the
        // poles.
        let carried_sigma = FRAC_1_SQRT_2 * carry_over / (1.0 - carry_over).max(f64::EPSILON);
        let relative = pole.residue_sigma.hypot(spread_hz / pole.at_hz.im).hypot(carried_sigma);
        let bin = peaks::nearest_bin(self.frequency_hz, damped_hz);
        FittedMode {
            frequency_hz,
            frequency_sigma_hz: sigma_hz,
            damping: decay_hz / frequency_hz,
            damping_sigma: sigma_hz / frequency_hz,
            damping_half_power: peaks::half_power_hz(self.frequency_hz, self.receptance, bin)
                .map(|width_hz| (0.5 * width_hz - self.window_decay_per_s / TAU) / frequency_hz)
                .filter(|damping| *damping > 0.0 && meets_all_criteria),
            mass_kg,
            mass_sigma_kg: mass_kg * relative,
            phase_rad: per_mass.arg(),
            coherence: self.coherence.and_then(|c| c.get(bin)).copied(),
            carry_over,
            meets_all_criteria,
            residual: fit.residual,
        }
    }
}
