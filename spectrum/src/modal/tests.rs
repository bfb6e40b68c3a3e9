//! Modes with exactly known poles, single and close to each other, without and with noise.

use super::*;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Natural frequency, damping, modal mass (negative: the points move against each other).
type Known = (f64, f64, f64);

fn grid(n: u32, bin_hz: f64) -> Vec<f64> {
    (0..n).map(|i| bin_hz * f64::from(i)).collect()
}

fn receptance(frequency_hz: &[f64], modes: &[Known], decay: f64) -> Vec<Complex<f64>> {
    let one = |f: &f64, (f_n, damping, mass): &Known| {
        let (s, w_n) = (Complex::new(decay, TAU * f), TAU * f_n);
        (mass * (s * s + 2.0 * damping * w_n * s + w_n * w_n)).inv()
    };
    frequency_hz.iter().map(|f| modes.iter().map(|m| one(f, m)).sum()).collect()
}

fn measured<'a>(f: &'a [f64], h: &'a [Complex<f64>]) -> MeasuredReceptance<'a> {
    MeasuredReceptance {
        frequency_hz: f,
        receptance: h,
        coherence: None,
        window_decay_per_s: 0.0,
        hit_interval_s: None,
    }
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

#[test]
fn modes_between_the_bins_are_found_with_damping_and_mass() {
    let known = [(293.3, 0.02, 1.0), (1071.7, 0.033, -3.0), (1610.2, 0.01, 0.5)];
    let f = grid(4000, 0.5);
    let h = receptance(&f, &known, 0.0);
    let found = identify_modes(&measured(&f, &h), [50.0, 1900.0], COHERENCE_MIN);
    assert_eq!(found.len(), 3, "{found:?}");
    for (mode, (f_n, damping, mass)) in found.iter().zip(known) {
        assert!((mode.frequency_hz / f_n - 1.0).abs() < 1e-5, "{mode:?}");
        assert!((mode.damping / damping - 1.0).abs() < 2e-3, "{mode:?}");
        assert!((mode.mass_kg / f64::abs(mass) - 1.0).abs() < 5e-3, "{mode:?}");
        let against = if mass < 0.0 { PI } else { 0.0 };
        assert!((mode.phase_rad.abs() - against).abs() < 0.02, "{mode:?}");
        assert!((mode.damping_half_power.expect("a width") / damping - 1.0).abs() < 0.1);
        let stiffness = f64::abs(mass) * (TAU * f_n).powi(2);
        assert!((mode.stiffness_n_per_m() / stiffness - 1.0).abs() < 5e-3);
        assert!(mode.meets_all_criteria);
    }
}

#[test]
fn a_peak_without_coherence_is_no_mode() {
    let f = grid(2000, 0.5);
    let h = receptance(&f, &[(300.0, 0.02, 1.0)], 0.0);
    let with = |coherence: &[f64]| {
        let measured = MeasuredReceptance { coherence: Some(coherence), ..measured(&f, &h) };
        identify_modes(&measured, [50.0, 900.0], COHERENCE_MIN)
    };
    assert!(with(&[0.5; 2000]).is_empty());
    assert_eq!(with(&[0.9; 2000])[0].coherence, Some(0.9));
    assert!(with(&[]).is_empty(), "a coherence that is not there is none");
}

#[test]
fn the_windows_decay_is_taken_out_exactly() {
    let f = grid(2000, 0.5);
    let h = receptance(&f, &[(100.0, 0.004, 2.0), (300.0, 0.02, 1.0)], 6.0);
    let measured = MeasuredReceptance { window_decay_per_s: 6.0, ..measured(&f, &h) };
    let found = identify_modes(&measured, [50.0, 900.0], COHERENCE_MIN);
    for (mode, (f_n, damping)) in found.iter().zip([(100.0, 0.004), (300.0, 0.02)]) {
        assert!((mode.frequency_hz / f_n - 1.0).abs() < 1e-5, "{mode:?}");
        assert!((mode.damping / damping - 1.0).abs() < 5e-3, "{mode:?}");
        assert!((mode.damping_half_power.expect("a width") / damping - 1.0).abs() < 0.1);
    }
    assert_eq!(found.len(), 2);
}

#[test]
fn the_robots_close_modes_are_distinguished_by_the_fit_of_a_single_peak() {
    let known = [(67.0, 0.03, 30.0), (72.0, 0.03, 35.0)];
    let f = grid(800, 0.25);
    let h = receptance(&f, &known, 0.0);
    let found = identify_modes(&measured(&f, &h), [40.0, 120.0], COHERENCE_MIN);
    assert_eq!(found.len(), 2, "{found:?}");
    for (mode, (f_n, damping, mass)) in found.iter().zip(known) {
        assert!((mode.frequency_hz / f_n - 1.0).abs() < 2e-3, "{mode:?}");
        assert!((mode.damping / damping - 1.0).abs() < 0.05, "{mode:?}");
        assert!((mode.mass_kg / mass - 1.0).abs() < 0.1, "{mode:?}");
    }
}

/// A receptance with noise of the response sensor (white, as a part of the largest value) and of the force.
fn noisy(h: &[Complex<f64>], level: f64, rng: &mut ChaCha8Rng) -> Vec<Complex<f64>> {
    let size = h.iter().skip(20).map(|h| h.norm()).fold(0.0, f64::max);
    let mut draw = || Complex::new(normal(rng), normal(rng)) * (0.5_f64.sqrt() * level);
    h.iter().map(|h| h * (1.0 + draw()) + size * draw()).collect()
}

/// Share of the errors within two standard uncertainties, of frequency and of damping, and modes that were none.
fn covered(known: &[Known], level: f64, runs: u64) -> (f64, f64, usize, usize) {
    let f = grid(1200, 0.25);
    let clean = receptance(&f, known, 0.0);
    let (mut frequency, mut damping, mut identified, mut wrong) = (0, 0, 0, 0);
    for seed in 0..runs {
        let h = noisy(&clean, level, &mut ChaCha8Rng::seed_from_u64(seed));
        for mode in identify_modes(&measured(&f, &h), [15.0, 280.0], COHERENCE_MIN) {
            let is_near = |k: &&Known| (mode.frequency_hz / k.0 - 1.0).abs() < 0.04;
            let Some((f_n, zeta, _)) = known.iter().find(is_near) else {
                wrong += 1;
                continue;
            };
            identified += 1;
            let is_covered = |error: f64, sigma: f64| usize::from(error.abs() <= 2.0 * sigma);
            frequency += is_covered(mode.frequency_hz - f_n, mode.frequency_sigma_hz);
            damping += is_covered(mode.damping - zeta, mode.damping_sigma);
        }
    }
    let share = |count: usize| count as f64 / identified.max(1) as f64;
    (share(frequency), share(damping), identified, wrong)
}

#[test]
fn the_stated_uncertainty_covers_from_half_a_percent_to_five_of_damping() {
    for zeta in [0.005, 0.01, 0.02, 0.05] {
        for level in [0.002, 0.01, 0.03] {
            let known = [(60.0, zeta, 10.0), (130.0, zeta, -6.0), (210.0, zeta, 3.0)];
            let (frequency, damping, identified, wrong) = covered(&known, level, 40);
            eprintln!(
                "damping {zeta}, noise {level}: {frequency:.3} {damping:.3} of {identified}, {wrong} wrong"
            );
            assert!(frequency > 0.92 && damping > 0.92);
            assert!(wrong <= 3 && identified > 40);
        }
    }
}

#[test]
fn noise_alone_is_no_mode() {
    let f = grid(1200, 0.25);
    let count: usize = (0..40)
        .map(|seed| {
            let mut chance = ChaCha8Rng::seed_from_u64(seed);
            let mut draw = || Complex::new(normal(&mut chance), normal(&mut chance));
            let h: Vec<_> = f.iter().map(|f| draw() / (1.0 + f * f)).collect();
            identify_modes(&measured(&f, &h), [5.0, 280.0], COHERENCE_MIN).len()
        })
        .sum();
    assert!(count <= 4, "{count} modes in 40 records of noise");
}

#[test]
fn one_mode_with_noise_is_not_split() {
    let f = grid(1200, 0.25);
    for zeta in [0.01, 0.03, 0.06] {
        let clean = receptance(&f, &[(70.0, zeta, 30.0)], 0.0);
        for seed in 0..60 {
            let h = noisy(&clean, 0.03, &mut ChaCha8Rng::seed_from_u64(seed));
            let found = identify_modes(&measured(&f, &h), [40.0, 120.0], COHERENCE_MIN);
            assert!(found.len() <= 1, "{zeta} {seed}: {found:?}");
        }
    }
}

proptest! {
    #[test]
    fn one_mode_is_fitted_whatever_its_damping(f_n in 60.0..400.0_f64, damping in 0.005..0.1_f64) {
        let f = grid(2000, 0.5);
        let h = receptance(&f, &[(f_n, damping, 1.0)], 0.0);
        let found = identify_modes(&measured(&f, &h), [20.0, 900.0], COHERENCE_MIN);
        prop_assert_eq!(found.len(), 1);
        prop_assert!((found[0].frequency_hz / f_n - 1.0).abs() < 1e-4, "{:?}", found);
        prop_assert!((found[0].damping / damping - 1.0).abs() < 1e-2, "{:?}", found);
    }

    #[test]
    fn no_function_makes_it_panic(
        parts in proptest::collection::vec((-1e3..1e3_f64, -1e3..1e3_f64), 0..200),
        bin_hz in 1e-3..1e3_f64,
        hole in 0..300_usize,
    ) {
        let f = grid(parts.len() as u32, bin_hz);
        let mut h: Vec<_> = parts.iter().map(|(re, im)| Complex::new(*re, *im)).collect();
        if let Some(h) = h.get_mut(hole) {
            *h = Complex::new(f64::NAN, f64::INFINITY);
        }
        let found = identify_modes(&measured(&f, &h), [0.0, f64::INFINITY], COHERENCE_MIN);
        prop_assert!(found.iter().all(|m| m.frequency_hz.is_finite() && m.damping > 0.0));
    }
}
