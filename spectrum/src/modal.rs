//! Natural frequencies, damping and modal masses from a receptance.
//!
//! A mode is identified by three signs (thesis 4.8 to 4.19): the imaginary part peaks, the real part changes sign
//! beside it, and the coherence (where there is one) is high enough. Frequency and damping are then fitted as a
//! complex pole, modes whose bands overlap together. The stated uncertainty includes noise, misfit, and
//! the variation of the result with the bandwidth and the smooth background.
//! Peaks whose real part keeps its sign, as on a strong neighbour's flank, and a second mode within one peak are searched
//! too; they must be clear in the fit, and are marked. Peaks too close for the record's bins to be fitted one by one are
//! fitted together; those that no fit explains are reported with the record that would resolve them. Residual vibration of earlier hits
//! has the same poles: it does not affect frequency and damping, and widens the uncertainty of the modal mass. Holds for viscous damping up to about 0.2. Never a mode
//! that lies outside the band.

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

pub use merge::{Merged, merged};
pub use unresolved::{Unresolved, unresolved};

/// Default of the least coherence at a mode (thesis 4.6.2).
pub const LEAST_COHERENCE: f64 = 0.75;
/// More damping than any mode has that shows a peak.
const DAMPING_MAX: f64 = 0.3;
/// Half width of the band of a fit, in half widths of a mode; other values show how much it
/// matters.
const REACH: f64 = 3.0;
const REACH_OTHER: [(f64, usize); 4] = [(2.0, 1), (2.0, 2), (4.5, 2), (4.5, 3)];
/// Degree of the background polynomial.
const DEGREE: usize = 2;
/// Fewest bins to either side.
const BINS_LEAST: f64 = 7.0;
/// The band's reach, as a part of the frequency, is not wider.
const WIDEST: f64 = 0.3;
/// Largest relative uncertainty of the residue of a mode.
const RESIDUE_SIGMA_MAX: f64 = 0.2;
/// Modes fitted together at most.
const TOGETHER: usize = 5;
/// Criteria for a further mode within one peak: least residual before it, largest residual after it
/// relative to that, and largest relative uncertainty of its residue.
const SPLIT: (f64, f64, f64) = (0.02, 0.4, 0.07);

/// A measured receptance, and the options of its evaluation.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// Frequencies, Hz, growing.
    pub frequency_hz: &'a [f64],
    /// Displacement per force at each, m/N.
    pub receptance: &'a [Complex<f64>],
    /// Coherence at each, 0 to 1, where there is one.
    pub coherence: Option<&'a [f64]>,
    /// Decay of the exponential window of the measurement, 1/s; 0 for none. It is subtracted from
    /// the damping.
    pub window_decay_per_s: f64,
    /// Least time from one hit to the next in one record, s, where hits before may still ring; `None` where none can.
    pub between_hits_s: Option<f64>,
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
    /// Damping ratio by the width of the peak at half its power, as a check; `None` where neighbours hide it.
    pub damping_half_power: Option<f64>,
    /// Modal mass for this pair of points, kg: that of the moving structure where it was struck and measured at one
    /// point along one direction.
    pub mass_kg: f64,
    /// Standard uncertainty of it, kg.
    pub mass_sigma_kg: f64,
    /// Angle of the residue against that of a real mode struck and measured at one point, rad: 0 moves with the
    /// force, ±π against it; in between the mode is complex, or neighbours mix in.
    pub phase_rad: f64,
    /// Coherence at the mode.
    pub coherence: Option<f64>,
    /// Remaining vibration of the mode at the next hit, relative to its start.
    pub carried: f64,
    /// Whether the three signs show it; otherwise it is found by the fit only, on a neighbour's
    /// flank or within its peak.
    pub by_signs: bool,
    /// Root mean square residual of the fit, relative to the receptance in its band.
    pub residual: f64,
}

impl FittedMode {
    /// Modal stiffness `m ω_n²`, N/m.
    #[must_use]
    pub fn stiffness_n_per_m(&self) -> f64 {
        self.mass_kg * (TAU * self.frequency_hz).powi(2)
    }

    /// Time from one hit to the next after which only the share `left` of the vibration remains, s.
    #[must_use]
    pub fn rings_s(&self, left: f64) -> f64 {
        -left.ln() / (TAU * self.frequency_hz * self.damping)
    }

    /// As an entry of the model's modal list, moving along `direction`.
    #[must_use]
    pub fn as_mode(&self, direction: [f64; 3]) -> Mode {
        Mode { frequency_hz: self.frequency_hz, damping: self.damping, direction }
    }
}

/// Start value of a mode, and whether the three signs show it.
#[derive(Clone, Copy, Debug)]
struct Start {
    at_hz: Complex<f64>,
    by_signs: bool,
}

/// Finds and fits the modes of a receptance within a band, lowest first.
///
/// `frequency_hz`, `receptance` and, if given, `coherence` belong together; the shortest length is
/// used.
#[must_use]
pub fn modes(measured: &Measured<'_>, band_hz: [f64; 2], least_coherence: f64) -> Vec<FittedMode> {
    let measured = measured.trimmed();
    let peaks = peaks::coherent(&measured, band_hz, least_coherence);
    let mut found: Vec<Start> = Vec::new();
    for peak in &peaks {
        for start in measured.starts(peak, &peaks) {
            let far = |other: &Start| {
                let apart = (start.at_hz.re - other.at_hz.re).abs();
                apart > other.at_hz.im.max(start.at_hz.im)
            };
            if found.iter().all(far) && (band_hz[0]..=band_hz[1]).contains(&start.at_hz.re) {
                found.push(start);
            }
        }
    }
    found.sort_by(|a, b| a.at_hz.re.total_cmp(&b.at_hz.re));
    let mut modes: Vec<FittedMode> =
        measured.groups(&found).iter().flat_map(|group| measured.group(group)).collect();
    modes.retain(|mode| (band_hz[0]..=band_hz[1]).contains(&mode.frequency_hz));
    modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    modes
}

impl Measured<'_> {
    /// Frequencies and receptances that belong together.
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

    /// Half width of a pole's band, Hz: `widths` half widths.
    fn reach_hz(&self, pole_hz: Complex<f64>, widths: f64) -> f64 {
        (widths * pole_hz.im).min(WIDEST * pole_hz.re).max(BINS_LEAST * self.bin_hz())
    }

    /// The band of some poles, each with `widths` half widths to either side.
    fn band(&self, poles: &[Complex<f64>], widths: f64) -> Option<Band> {
        let from = poles.iter().map(|p| p.re - self.reach_hz(*p, widths));
        let to = poles.iter().map(|p| p.re + self.reach_hz(*p, widths));
        let (from, to) = (from.fold(f64::INFINITY, f64::min), to.fold(0.0, f64::max));
        // The first bin contains no receptance unless displacements were measured.
        Band::of(self.frequency_hz, self.receptance, from.max(self.bin_hz()), to)
    }

    /// Start values of a peak's modes: one mode by itself, otherwise with the other peaks of its
    /// band, otherwise two modes within one peak; `None` if no fit is valid.
    fn starts(&self, peak: &peaks::Peak, all: &[peaks::Peak]) -> Vec<Start> {
        if let Some(pole) = self.alone(peak) {
            return vec![Start { at_hz: pole.at_hz, by_signs: peak.changes_sign }];
        }
        let reach_hz = self.reach_hz(peak.guess_hz(), REACH);
        let beside = |other: &&peaks::Peak| {
            let apart = (other.frequency_hz - peak.frequency_hz).abs();
            apart > 0.0 && apart < reach_hz
        };
        let together: Vec<&peaks::Peak> =
            std::iter::once(peak).chain(all.iter().filter(beside)).take(TOGETHER).collect();
        let guesses: Vec<_> = together.iter().map(|one| one.guess_hz()).collect();
        let Some(fit) = self.fitted(&guesses, REACH, DEGREE) else { return Vec::new() };
        let fit = self.split(fit);
        if !fit.poles.iter().all(|pole| self.is_mode(pole)) {
            return Vec::new();
        }
        let signs = |pole: &Pole| {
            let near = |one: &&&peaks::Peak| one.is_at(pole.at_hz.re);
            together.iter().find(near).is_some_and(|one| one.changes_sign)
        };
        let start = |pole: &Pole| Start { at_hz: pole.at_hz, by_signs: signs(pole) };
        fit.poles.iter().map(start).collect()
    }

    /// One mode by itself, where there is one.
    fn alone(&self, peak: &peaks::Peak) -> Option<Pole> {
        let rough = *self.band(&[peak.guess_hz()], 2.0)?.one_pole(1)?.poles.first()?;
        let fit = self.band(&[rough.at_hz], REACH)?.one_pole(DEGREE)?;
        let pole = *fit.poles.first()?;
        (peak.is_at(pole.at_hz.re) && self.is_mode(&pole)).then_some(pole)
    }

    fn is_mode(&self, pole: &Pole) -> bool {
        let decay_hz = pole.at_hz.im - self.window_decay_per_s / TAU;
        let damped = decay_hz > 0.0 && decay_hz < DAMPING_MAX * pole.at_hz.re;
        damped && pole.residue_sigma < RESIDUE_SIGMA_MAX && pole.sigma_hz < 0.5 * pole.at_hz.im
    }

    /// Modes whose bands overlap belong together.
    fn groups(&self, starts: &[Start]) -> Vec<Vec<Start>> {
        let mut groups: Vec<Vec<Start>> = Vec::new();
        let overlap = |a: &Start, b: &Start| {
            let reach_hz = self.reach_hz(a.at_hz, REACH) + self.reach_hz(b.at_hz, REACH);
            (b.at_hz.re - a.at_hz.re).abs() < reach_hz
        };
        for start in starts {
            match groups.last_mut() {
                Some(group)
                    if group.len() < TOGETHER
                        && group.last().is_some_and(|last| overlap(last, start)) =>
                {
                    group.push(*start);
                }
                _ => groups.push(vec![*start]),
            }
        }
        groups
    }

    fn group(&self, starts: &[Start]) -> Vec<FittedMode> {
        let places: Vec<_> = starts.iter().map(|start| start.at_hz).collect();
        let together = self.fitted(&places, REACH, DEGREE);
        let Some(fit) = together.filter(|fit| fit.poles.iter().all(|pole| self.is_mode(pole)))
        else {
            if starts.len() < 2 {
                return Vec::new();
            }
            return starts.iter().flat_map(|start| self.group(&[*start])).collect();
        };
        let fit = self.split(fit);
        let places: Vec<_> = fit.poles.iter().map(|pole| pole.at_hz).collect();
        let spread = self.spread(&places);
        let by_signs = |k: usize| starts.get(k).is_some_and(|start| start.by_signs);
        let modes = fit.poles.iter().zip(spread).enumerate();
        modes.map(|(k, (pole, spread))| self.told(pole, spread, by_signs(k), &fit)).collect()
    }

    fn fitted(&self, poles: &[Complex<f64>], reach: f64, degree: usize) -> Option<Fit> {
        self.band(poles, reach)?.poles_from(poles, degree)
    }

    /// Adds further modes to the fit, as long as each improves it greatly.
    fn split(&self, mut fit: Fit) -> Fit {
        let (rough, better, known) = SPLIT;
        while fit.residual > rough && fit.poles.len() < TOGETHER {
            let poles: Vec<_> = fit.poles.iter().map(|pole| pole.at_hz).collect();
            let width = poles.iter().map(|p| p.im).fold(f64::INFINITY, f64::min);
            let beside = poles.iter().flat_map(|p| [p.re - width, p.re + width]);
            let further = std::iter::once(fit.worst_hz).chain(beside);
            let with = |hz: f64| {
                let starts: Vec<_> =
                    poles.iter().copied().chain([Complex::new(hz, 0.7 * width)]).collect();
                self.fitted(&starts, REACH, DEGREE)
            };
            let is_better = |more: &Fit| {
                more.residual <= better * fit.residual && self.are_sound(&more.poles, known)
            };
            let Some(more) = further.filter_map(with).find(is_better) else { break };
            fit = more;
        }
        fit
    }

    /// Whether poles are modes, with sufficiently accurate residues, and separate from each other.
    fn are_sound(&self, poles: &[Pole], known: f64) -> bool {
        let apart = |a: &Pole| {
            let others = poles.iter().filter(|b| b.at_hz != a.at_hz);
            others.map(|b| (a.at_hz - b.at_hz).norm()).fold(f64::INFINITY, f64::min)
        };
        poles.iter().all(|pole| {
            let decay = pole.at_hz.im - self.window_decay_per_s / TAU;
            self.is_mode(pole) && pole.residue_sigma < known && apart(pole) > 0.3 * decay
        })
    }

    /// How far each pole moves with the band's width and the polynomial's degree: root mean square, Hz.
    fn spread(&self, poles: &[Complex<f64>]) -> Vec<f64> {
        let (mut squares, mut fits) = (vec![0.0; poles.len()], 0.0);
        for (reach, degree) in REACH_OTHER {
            let Some(fit) = self.fitted(poles, reach, degree) else { continue };
            fits += 1.0;
            for (sum, (pole, at)) in squares.iter_mut().zip(fit.poles.iter().zip(poles)) {
                *sum += (pole.at_hz - at).norm_sqr().min(at.im * at.im);
            }
        }
        // Half of it is in each part of the complex number.
        squares.iter().map(|sum| (0.5 * sum / f64::max(fits, 1.0)).sqrt()).collect()
    }

    fn told(&self, pole: &Pole, spread_hz: f64, by_signs: bool, fit: &Fit) -> FittedMode {
        let (damped_hz, decay_hz) = (pole.at_hz.re, pole.at_hz.im - self.window_decay_per_s / TAU);
        let frequency_hz = damped_hz.hypot(decay_hz);
        // A record that ends before the mode has decayed shifts its pole by the remaining share of
        // its width.
        let cut_hz = pole.at_hz.im * (-TAU * pole.at_hz.im / self.bin_hz()).exp();
        let sigma_hz = pole.sigma_hz.hypot(spread_hz).hypot(cut_hz);
        // H ≈ A/(ω − p) with A = −1/(2 m ω_d); the residue is over Hz.
        let per_mass = -8.0 * PI * PI * damped_hz * pole.residue;
        let mass_kg = 1.0 / per_mass.norm();
        let carried = self.between_hits_s.map_or(0.0, |s| (-TAU * decay_hz * s).exp());
        // Ringing of earlier hits adds to the residue, however its phase falls; poles stay.
        let carried_sigma = FRAC_1_SQRT_2 * carried / (1.0 - carried).max(f64::EPSILON);
        let relative = pole.residue_sigma.hypot(spread_hz / pole.at_hz.im).hypot(carried_sigma);
        let bin = peaks::nearest(self.frequency_hz, damped_hz);
        FittedMode {
            frequency_hz,
            frequency_sigma_hz: sigma_hz,
            damping: decay_hz / frequency_hz,
            damping_sigma: sigma_hz / frequency_hz,
            damping_half_power: peaks::half_power_hz(self.frequency_hz, self.receptance, bin)
                .map(|width_hz| (0.5 * width_hz - self.window_decay_per_s / TAU) / frequency_hz)
                .filter(|damping| *damping > 0.0 && by_signs),
            mass_kg,
            mass_sigma_kg: mass_kg * relative,
            phase_rad: per_mass.arg(),
            coherence: self.coherence.and_then(|c| c.get(bin)).copied(),
            carried,
            by_signs,
            residual: fit.residual,
        }
    }
}
