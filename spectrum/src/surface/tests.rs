//! Comparison of profiles with the standards and direct sums.

use super::*;
use crate::welch::{Detrend, detrended};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;

fn waves(n: i32, spacing_mm: f64, waves: &[(f64, f64)]) -> Vec<f64> {
    let height = |i: i32| {
        let x = spacing_mm * f64::from(i);
        waves.iter().map(|(wavelength, amplitude)| amplitude * (TAU * x / wavelength).sin()).sum()
    };
    (0..n).map(height).collect()
}

fn noise(n: usize, seed: u64, redness: f64) -> Vec<f64> {
    let mut chance = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut last = 0.0;
    let mut draw = || {
        let normal: f64 = (0..12).map(|_| chance.random::<f64>()).sum::<f64>() - 6.0;
        last = redness * last + normal;
        last
    };
    (0..n).map(|_| draw()).collect()
}

#[test]
fn the_filter_passes_each_wavelength_as_the_standard_says() {
    for (wavelength_mm, kept) in [(0.25, 0.000_827), (0.8, 0.5), (2.5, 0.931_482), (8.0, 0.993_093)]
    {
        let z = waves(8000, 0.005, &[(wavelength_mm, 1.0)]);
        let w = gaussian(&z, 0.005, 0.8).expect("a filter");
        let inner = 1600..6400;
        let dot = |a: &[f64]| inner.clone().map(|i| a[i] * z[i]).sum::<f64>();
        let passed = dot(&w) / dot(&z);
        assert!((passed - kept).abs() < 3e-5, "{wavelength_mm} mm: {passed}");
        assert!((gaussian_transmission(wavelength_mm, 0.8) - kept).abs() < 2e-6);
    }
}

#[test]
fn the_filter_keeps_a_constant_to_the_ends() {
    let w = gaussian(&[2.5; 100], 0.01, 0.2).expect("a filter");
    assert!(w.iter().all(|w| (w - 2.5).abs() < 1e-12));
}

/// The standard's sum, point by point.
fn gaussian_by_sums(z: &[f64], spacing_mm: f64, cut_off_mm: f64) -> Vec<f64> {
    let smoothed = |i: usize| {
        let window = (0..z.len()).filter(|j| j.abs_diff(i) as f64 * spacing_mm <= cut_off_mm);
        let (mut sum, mut weights) = (0.0, 0.0);
        for j in window {
            let x = (j.abs_diff(i)) as f64 * spacing_mm / (GAUSS_ALPHA * cut_off_mm);
            let w = (-std::f64::consts::PI * x * x).exp();
            sum += w * z[j];
            weights += w;
        }
        sum / weights
    };
    (0..z.len()).map(smoothed).collect()
}

#[test]
fn waviness_and_roughness_are_parted_and_add_up() {
    let z: Vec<f64> = waves(10_000, 0.001, &[(1.25, 4.0), (0.05, 0.5)])
        .iter()
        .enumerate()
        .map(|(i, z)| z + 0.7e-3 * i as f64)
        .collect();
    let surface = separate(&z, 0.001, &SeparationSettings::at_mm(0.25)).expect("a surface");
    let inner = |v: &[f64]| height_parameters(&v[1000..9000]);
    assert!((inner(&surface.roughness).rms - 0.5 / 2.0_f64.sqrt()).abs() < 0.05);
    assert!((inner(&surface.waviness).total_height - 8.0).abs() < 0.6);
    let line = detrended(&z, Detrend::Linear);
    for (i, z) in line.iter().enumerate() {
        assert!((surface.waviness[i] + surface.roughness[i] - z).abs() < 1e-12);
        assert!((surface.primary[i] - z).abs() < 1e-9);
    }
    assert_eq!(surface.evaluated, 125..9875, "half a cut-off is left away at each end");
    assert!(!surface.ends_kept() && (surface.evaluated_mm() - 9.75).abs() < 1e-9);
    let short = separate(&z[..400], 0.001, &SeparationSettings::at_mm(0.25)).expect("a surface");
    assert!(short.ends_kept(), "what is too short keeps its ends, and says so");
}

#[test]
fn the_short_cut_off_takes_the_instruments_noise() {
    let z = waves(20_000, 0.000_25, &[(0.2, 1.0), (0.001, 0.2)]);
    let parting =
        SeparationSettings { short_cut_off_mm: Some(0.0025), ..SeparationSettings::at_mm(0.8) };
    let surface = separate(&z, 0.000_25, &parting).expect("a surface");
    let rms = height_parameters(&surface.roughness[surface.evaluated.clone()]).rms;
    let kept = 1.0 - gaussian_transmission(0.2, 0.8);
    assert!((rms - kept / 2.0_f64.sqrt()).abs() < 2e-3, "{rms}");
    let turned = SeparationSettings { short_cut_off_mm: Some(0.8), ..parting };
    assert!(matches!(separate(&z, 0.000_25, &turned), Err(SurfaceError::CutOffs { .. })));
}

#[test]
fn each_degree_of_form_takes_its_own_polynomial_and_no_more() {
    for degree in 0..=FORM_MAX {
        let polynomial = |i: usize, highest: usize| {
            let x = i as f64 / 500.0 - 1.0;
            (0..=highest).map(|k| (k as f64 + 1.0) * x.powi(k as i32)).sum::<f64>()
        };
        let z: Vec<f64> = (0..1001).map(|i| polynomial(i, degree)).collect();
        let left = remove_form(&z, degree).expect("a form");
        assert!(left.iter().all(|z| z.abs() < 1e-10), "{degree}");
        let more: Vec<f64> = (0..1001).map(|i| polynomial(i, degree + 1)).collect();
        let left = remove_form(&more, degree).expect("a form");
        assert!(height_parameters(&left).rms > 1e-3, "{degree}");
    }
    let bent = noise(500, 4, 0.9);
    let (line, ours) = (detrended(&bent, Detrend::Linear), remove_form(&bent, 1).expect("a form"));
    assert!(line.iter().zip(&ours).all(|(a, b)| (a - b).abs() < 1e-10));
    assert!(matches!(remove_form(&bent, 6), Err(SurfaceError::Form { degree: 6 })));
}

#[test]
fn parseval_gives_the_same_rms() {
    for n in [500, 501] {
        let z: Vec<f64> = (0..n).map(|i| (f64::from(i * i) * 0.01).sin() + 0.3).collect();
        let power: f64 = power_spectrum(&z, 0.01).expect("a spectrum").power.iter().sum();
        assert!((power.sqrt() - height_parameters(&z).rms).abs() < 1e-12);
    }
}

#[test]
fn a_sines_parameters_are_the_textbooks() {
    let p = height_parameters(&waves(10_000, 0.001, &[(0.1, 3.0)]));
    for (name, found, known) in [
        ("Ra", p.mean_deviation, 6.0 / std::f64::consts::PI),
        ("Rq", p.rms, 3.0 / 2.0_f64.sqrt()),
        ("Rt", p.total_height, 6.0),
        ("Rp", p.peak, 3.0),
        ("Rv", p.valley, 3.0),
        ("Rsk", p.skewness, 0.0),
        ("Rku", p.kurtosis, 1.5),
    ] {
        assert!((found - known).abs() < 2e-3 * (1.0 + known), "{name}: {found}");
    }
    let flat = height_parameters(&[0.5; 9]);
    assert_eq!((flat.rms, flat.skewness, flat.kurtosis, flat.total_height), (0.0, 0.0, 0.0, 0.0));
}

#[test]
fn rz_is_the_mean_over_five_sampling_lengths_or_as_many_as_there_are() {
    let mut z = waves(4800, 0.001, &[(0.1, 1.0)]);
    // One deep scratch counts in one of five sections, and wholly in Rt.
    z[2400] -= 9.0;
    let rt = height_parameters(&z).total_height;
    let (rz, sections) = mean_section_height(&z, 0.001, 0.8).expect("sections");
    assert_eq!(sections, 5);
    assert!((rz - (4.0 * 2.0 + rt) / 5.0).abs() < 0.01, "{rz} of {rt}");
    assert_eq!(mean_section_height(&z[..1700], 0.001, 0.8).map(|(_, n)| n), Some(2));
    assert_eq!(mean_section_height(&z[..700], 0.001, 0.8), None);
}

#[test]
fn the_mean_width_of_elements_is_the_wavelength_and_ripple_is_no_element() {
    let z = waves(10_000, 0.001, &[(0.2, 1.0), (0.007, 0.05)]);
    let width = element_width_mm(&z, 0.001, 0.2).expect("elements");
    assert!((width - 0.2).abs() < 2e-3, "{width}");
    assert_eq!(element_width_mm(&[0.0; 50], 0.001, 0.1), None);
    assert_eq!(element_width_mm(&[], 0.001, 0.1), None);
}

#[test]
fn lines_are_found_with_place_amplitude_and_multiples() {
    let mut z = waves(20_000, 0.000_25, &[(0.2, 0.4), (0.1, 0.2), (0.073, 0.1)]);
    z.iter_mut().zip(noise(20_000, 2, 0.98)).for_each(|(z, n)| *z += 0.004 * n);
    let found = lines(&z, 0.000_25).expect("lines");
    assert_eq!(found.len(), 3, "{found:?}");
    for (line, (wavelength, amplitude)) in found.iter().zip([(0.2, 0.4), (0.1, 0.2), (0.073, 0.1)])
    {
        assert!((line.cycles_per_mm - 1.0 / wavelength).abs() < 3.0 * line.sigma_cycles_per_mm);
        assert!((line.wavelength_mm() / wavelength - 1.0).abs() < 0.01);
        assert!((line.amplitude / amplitude - 1.0).abs() < 0.06, "{line:?}");
    }
    assert_eq!(found[1].multiple_of, Some((0, 2)));
    assert_eq!((found[0].multiple_of, found[2].multiple_of), (None, None));
}

#[test]
fn a_lines_uncertainty_holds_what_noise_does_to_it() {
    let mut within = 0;
    for seed in 0..200 {
        let wavelength = 0.05 + 0.000_7 * seed as f64;
        let mut z = waves(4000, 0.001, &[(wavelength, 0.4)]);
        z.iter_mut().zip(noise(4000, seed, 0.0)).for_each(|(z, n)| *z += n);
        let found = lines(&z, 0.001).expect("lines");
        let error = (found[0].cycles_per_mm - 1.0 / wavelength) / found[0].sigma_cycles_per_mm;
        within += u32::from(error.abs() < 2.0);
    }
    assert!(within >= 186, "{within} of 200 within two standard uncertainties");
}

#[test]
fn noise_white_or_red_shows_lines_rarely() {
    for redness in [0.0, 0.9, 0.999] {
        let with_lines = (0..100)
            .filter(|seed| !lines(&noise(4000, *seed, redness), 0.001).expect("lines").is_empty());
        let count = with_lines.count();
        assert!(count <= 8, "{count} of 100 at {redness}");
    }
}

#[test]
fn impossible_profiles_are_refused_with_a_reason() {
    let settings = |cut_off_mm| SeparationSettings::at_mm(cut_off_mm);
    assert!(matches!(separate(&[0.0; 4], 0.1, &settings(1.0)), Err(SurfaceError::TooShort { .. })));
    assert!(matches!(
        separate(&[f64::NAN; 9], 0.1, &settings(1.0)),
        Err(SurfaceError::NotFinite { index: 0 })
    ));
    assert!(separate(&[0.0; 9], 0.0, &settings(1.0)).is_err());
    assert!(separate(&[0.0; 9], 0.1, &settings(0.05)).is_err());
    assert!(parameters_by_segment(&[0.0; 9], 0.1, 5.0).is_err());
}

proptest! {
    #[test]
    fn the_filter_by_transforms_is_the_standards_sum(
        z in proptest::collection::vec(-5.0..5.0_f64, 8..150),
        offset in -1e4..1e4_f64,
        cut_off in 0.15..20.0_f64,
    ) {
        let z: Vec<f64> = z.iter().map(|z| z + offset).collect();
        let fast = gaussian(&z, 0.1, cut_off).expect("a filter");
        for (a, b) in fast.iter().zip(gaussian_by_sums(&z, 0.1, cut_off)) {
            prop_assert!((a - b).abs() < 1e-10, "{} for {}", a, b);
        }
    }

    #[test]
    fn nothing_finite_makes_it_panic(
        z in proptest::collection::vec(-1e9..1e9_f64, 0..60),
        spacing in 1e-6..1e3_f64,
        cut_off in 1e-6..1e3_f64,
        degree in 0..8_usize,
    ) {
        let parting = SeparationSettings { form_degree: degree, short_cut_off_mm: Some(cut_off / 9.0), cut_off_mm: cut_off };
        if let Ok(surface) = separate(&z, spacing, &parting) {
            let inner = &surface.roughness[surface.evaluated.clone()];
            prop_assert!(height_parameters(inner).rms.is_finite());
            let _ = (mean_section_height(inner, spacing, cut_off), lines(inner, spacing));
        }
        let _ = (lines(&z, spacing), element_width_mm(&z, spacing, 0.1), parameters_by_segment(&z, spacing, cut_off));
    }
}
