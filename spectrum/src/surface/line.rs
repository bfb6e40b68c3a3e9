//! Spectra of a profile in cycles per mm, and their lines.

use crate::offline::{self, AveragedSpectrum};
use crate::welch::{Scaling, Segments, Spectrum, SpectrumError, Taper, welch};

/// Standard deviation of a line's position due to the parabolic interpolation, bins.
const PARABOLA_BINS: f64 = 0.02;
/// Probability of any line in a long profile of noise.
const FALSE_ALARM_PROBABILITY: f64 = 0.05;
/// Least amplitude of a line relative to the strongest one.
const AMPLITUDE_PART_MIN: f64 = 0.01;

/// A line of a profile's spectrum: a periodic wave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Cycles per mm.
    pub cycles_per_mm: f64,
    /// Standard uncertainty of it, cycles per mm.
    pub sigma_cycles_per_mm: f64,
    /// Amplitude, in the profile's unit.
    pub amplitude: f64,
    /// Ratio of its power to the floor around it.
    pub over_floor: f64,
    /// For a multiple of a stronger line: index of that line in the list, and order of the
    /// multiple.
    pub multiple_of: Option<(usize, u32)>,
}

impl Line {
    /// Its wavelength, mm.
    #[must_use]
    pub fn wavelength_mm(&self) -> f64 {
        1.0 / self.cycles_per_mm
    }

    /// Tolerance of its position, cycles per mm: two standard uncertainties plus half a bin of a
    /// profile of this length.
    #[must_use]
    pub fn tolerance(&self, length_mm: f64) -> f64 {
        2.0 * self.sigma_cycles_per_mm + 0.5 / length_mm
    }
}

/// One-sided power spectrum of a whole profile, without window: its sum is `R_q²` (mean removed).
///
/// # Errors
/// The profile is too short.
pub fn power_spectrum(heights: &[f64], spacing_mm: f64) -> Result<Spectrum, SpectrumError> {
    let plan = Segments {
        taper: Taper::Boxcar,
        scaling: Scaling::Spectrum,
        ..Segments::new(1.0 / spacing_mm, heights.len().max(2))
    };
    welch(heights, &plan)
}

/// The lines of a profile, strongest first: of the spectrum of the whole profile under a Hann
/// window, because a profile is short and its feed marks persist. Waves longer than about a seventh
/// of the profile are not distinguished from form.
///
/// # Errors
/// The profile is too short.
pub fn lines(heights: &[f64], spacing_mm: f64) -> Result<Vec<Line>, SpectrumError> {
    let plan = Segments::new(1.0 / spacing_mm, heights.len().max(2));
    let spectrum = AveragedSpectrum::from_runs([heights], &plan)?;
    let length_mm = heights.len() as f64 * spacing_mm;
    let bins = |ratio: f64| (PARABOLA_BINS * PARABOLA_BINS + 0.5 / ratio).sqrt();
    let to_line = |line: &offline::Line| Line {
        cycles_per_mm: line.frequency,
        sigma_cycles_per_mm: bins(line.ratio) / length_mm,
        amplitude: line.amplitude,
        over_floor: line.ratio,
        multiple_of: None,
    };
    // A bin of noise over the middle of its neighbours spreads exponentially, and a long profile has many bins.
    let ratio_min =
        (spectrum.mean.power.len() as f64 / FALSE_ALARM_PROBABILITY).ln() / std::f64::consts::LN_2;
    let all = spectrum.lines();
    let weakest = all.first().map_or(0.0, |line| AMPLITUDE_PART_MIN * line.amplitude);
    let counts = |line: &&offline::Line| line.ratio >= ratio_min && line.amplitude >= weakest;
    let mut found: Vec<Line> = all.iter().filter(counts).map(to_line).collect();
    for i in 1..found.len() {
        found[i].multiple_of = find_multiple(&found[..i], &found[i], length_mm);
    }
    Ok(found)
}

/// The stronger line that this one is a whole multiple of, the lowest multiple first.
fn find_multiple(stronger: &[Line], line: &Line, length_mm: f64) -> Option<(usize, u32)> {
    let fits = |fundamental: &Line| {
        let order = (line.cycles_per_mm / fundamental.cycles_per_mm).round();
        let deviation = (line.cycles_per_mm - order * fundamental.cycles_per_mm).abs();
        let within = line.tolerance(length_mm).max(order * fundamental.sigma_cycles_per_mm);
        ((2.0..=50.0).contains(&order) && deviation <= within).then_some(order as u32)
    };
    let all =
        stronger.iter().enumerate().filter(|(_, fundamental)| fundamental.multiple_of.is_none());
    all.filter_map(|(i, fundamental)| Some((i, fits(fundamental)?))).min_by_key(|(_, order)| *order)
}
