//! Impact tests on structures whose modes are known exactly, with noise on both channels.

use super::*;
use crate::frf::Estimator;
use crate::modal::{COHERENCE_MIN, FittedMode, MeasuredReceptance, identify_modes};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use realfft::num_complex::Complex;
use std::f64::consts::{PI, TAU};

const RATE_HZ: f64 = 4096.0;
/// Natural frequency Hz, damping, modal mass kg.
pub(super) type Known = (f64, f64, f64);

/// Acceleration of modes under a force whose samples are joined by straight lines: the exact solution of each mode's
/// equation over one sample.
pub(super) fn acceleration(force: &[f64], known: &[Known]) -> Vec<f64> {
    let dt = 1.0 / RATE_HZ;
    let mut sum = vec![0.0; force.len()];
    for (f_n, zeta, mass) in known {
        let w_n = TAU * f_n;
        let w_d = w_n * (1.0 - zeta * zeta).sqrt();
        let lambda = Complex::new(-zeta * w_n, w_d);
        let turn = (lambda * dt).exp();
        let level = (turn - 1.0) / lambda;
        let slope = (turn - 1.0 - lambda * dt) / (lambda * lambda * dt);
        let mut z = Complex::<f64>::default();
        for i in 0..force.len() {
            sum[i] += ((lambda * lambda * z).im / w_d + force[i]) / mass;
            let next = force.get(i + 1).copied().unwrap_or(0.0);
            z = turn * z + level * force[i] + slope * (next - force[i]);
        }
    }
    sum
}

/// A record of half-sine blows of 2.5 ms: seconds and peaks.
pub(super) fn blows(length_s: f64, hits: &[(f64, f64)]) -> Vec<f64> {
    let mut force = vec![0.0; (length_s * RATE_HZ) as usize];
    for (at_s, peak_n) in hits {
        for (i, f) in force.iter_mut().enumerate() {
            let part = (i as f64 / RATE_HZ - at_s) / 0.0025;
            if (0.0..1.0).contains(&part) {
                *f += peak_n * (PI * part).sin();
            }
        }
    }
    force
}

pub(super) fn with_noise(samples: &mut [f64], sigma: f64, seed: u64) {
    let mut chance = ChaCha8Rng::seed_from_u64(seed);
    for x in samples {
        *x += sigma * ((0..12).map(|_| chance.random::<f64>()).sum::<f64>() - 6.0);
    }
}

pub(super) fn config() -> TapConfig {
    TapConfig { rate_hz: RATE_HZ, response: Response::Acceleration, block_s: None, windows: true }
}

pub(super) fn one(
    force: &[f64],
    response: &[f64],
    config: &TapConfig,
) -> Result<TapTest, TapError> {
    evaluate_tap_test(&[TapRecord { force, response }], config)
}

pub(super) fn found(tap: &TapTest, band_hz: [f64; 2]) -> Vec<FittedMode> {
    let receptance = tap.frf.per_force(Estimator::H1, Response::Displacement);
    let measured = MeasuredReceptance {
        frequency_hz: &tap.frf.frequency_hz,
        receptance: &receptance,
        coherence: tap.frf.coherence.as_deref(),
        window_decay_per_s: tap.frf.window_decay_per_s,
        hit_interval_s: tap.min_hit_interval_s(),
    };
    identify_modes(&measured, band_hz, COHERENCE_MIN)
}

const ROBOT: [Known; 3] = [(21.0, 0.03, 60.0), (67.0, 0.025, 40.0), (120.0, 0.015, 25.0)];

#[test]
fn every_hit_is_found_with_its_force_and_contact() {
    let force = blows(10.0, &[(0.5, 300.0), (2.9, 180.0), (5.4, 420.0), (7.8, 90.0)]);
    let mut response = acceleration(&force, &ROBOT);
    with_noise(&mut response, 0.01, 1);
    let force: Vec<f64> = force.iter().map(|f| 3.0 - f).collect();
    let tap = one(&force, &response, &config()).expect("hits");
    assert_eq!(tap.hits.len(), 4);
    for (hit, (at_s, peak_n)) in
        tap.hits.iter().zip([(0.5, -300.0), (2.9, -180.0), (5.4, -420.0), (7.8, -90.0)])
    {
        assert!((hit.at as f64 / RATE_HZ - at_s).abs() < 0.001, "{hit:?}");
        assert!((hit.peak_n / peak_n - 1.0).abs() < 0.05, "{hit:?}: the offset is taken out");
        assert!((hit.contact_s - 0.0025).abs() < 0.001 && hit.rejection.is_none(), "{hit:?}");
    }
    assert_eq!((tap.frf.hits, tap.blocks.len()), (4, 4));
    assert!((tap.block_s - 2.2).abs() < 0.2, "{}", tap.block_s);
    assert_eq!(tap.windows.decay_per_s, 0.0, "what has rung down needs no window");
    // A half sine's spectrum ends at one and a half over its duration; a tenth is reached before.
    let ends_hz = tap.excited_to_hz(20.0);
    assert!((450.0..600.0).contains(&ends_hz), "{ends_hz}");
    assert!(tap.excited_to_hz(40.0) > ends_hz && tap.force_db(ends_hz + 20.0) < -20.0);
    assert!(tap.force_db(20.0) > -0.1);
    let low: f64 = tap.force_spectrum[10];
    let impulse =
        (300.0_f64.powi(2) + 180.0_f64.powi(2) + 420.0_f64.powi(2) + 90.0_f64.powi(2)).sqrt() / 2.0
            * 0.0025
            * 2.0
            / PI;
    assert!((low / impulse - 1.0).abs() < 0.02, "{low} N/Hz for {impulse} Ns");
}

#[test]
fn bad_hits_are_refused_with_the_reason_and_the_good_ones_stay() {
    let hits =
        [(0.5, 300.0), (2.5, 200.0), (4.5, 900.0), (6.5, 250.0), (8.5, 280.0), (10.2, 200.0)];
    let mut blow = hits.to_vec();
    blow.push((2.538, 45.0));
    let mut force = blows(10.5, &blow);
    let mut response = acceleration(&force, &ROBOT);
    with_noise(&mut force, 0.2, 2);
    with_noise(&mut response, 0.01, 3);
    force.iter_mut().for_each(|f| *f = f.min(500.0));
    let end = (6.6 * RATE_HZ) as usize;
    response[end] = f64::NAN;
    let tap = one(&force, &response, &config()).expect("hits");
    let why: Vec<_> = tap.hits.iter().map(|hit| hit.rejection).collect();
    assert!(why[0].is_none(), "{why:?}");
    let Some(HitRejection::DoubleHit { after_s, part }) = why[1] else { panic!("{why:?}") };
    assert!((after_s - 0.038).abs() < 0.001 && (part - 0.225).abs() < 0.02, "{why:?}");
    assert!(matches!(why[2], Some(HitRejection::ForceOverload(3..))), "{why:?}");
    assert_eq!(why[3], Some(HitRejection::MissingSamples));
    assert!(why[4].is_none(), "{why:?}");
    assert!(matches!(why[5], Some(HitRejection::Truncated { .. })), "{why:?}");
    assert_eq!((why.len(), tap.frf.hits), (6, 2));
    let reason = why[1].expect("refused").to_string();
    assert!(reason.starts_with("struck twice: again with 23 %"), "{reason}");
}

#[test]
fn an_overloaded_response_is_refused_and_a_coarse_converter_is_no_overload() {
    let force = blows(6.0, &[(0.5, 300.0), (2.5, 310.0), (4.5, 290.0)]);
    let response = acceleration(&force, &ROBOT);
    let top = response.iter().fold(0.0_f64, |top, x| top.max(*x));
    let coarse = |x: &f64, step: f64| (x / step).round() * step;
    // Ten bits over twice the signal's range.
    let rounded: Vec<f64> = response.iter().map(|x| coarse(x, top / 256.0)).collect();
    let rounded_force: Vec<f64> = force.iter().map(|f| coarse(f, 310.0 / 256.0)).collect();
    let tap = one(&rounded_force, &rounded, &config()).expect("hits");
    assert!(tap.hits.iter().all(|hit| hit.rejection.is_none()), "{:?}", tap.hits);
    let cut: Vec<f64> = rounded.iter().map(|x| x.min(0.6 * top)).collect();
    let refused = one(&rounded_force, &cut, &config());
    let Err(TapError::NoUsableHit { found: 3, first }) = refused else { panic!("{refused:?}") };
    assert!(matches!(first, HitRejection::ResponseOverload(3..)), "{first:?}");
}

#[test]
fn a_record_without_a_hit_says_what_it_saw() {
    let mut quiet = vec![0.0; 8192];
    with_noise(&mut quiet, 0.5, 4);
    let refused = one(&quiet, &quiet, &config());
    assert!(matches!(refused, Err(TapError::NoHit { record: 1, .. })), "{refused:?}");
    assert!(matches!(one(&[0.0; 99], &[0.0; 99], &config()), Err(TapError::NoHit { .. })));
    assert!(matches!(one(&[1.0; 9], &[0.0; 8], &config()), Err(TapError::Unequal { .. })));
    let bad = TapConfig { rate_hz: 0.0, ..config() };
    assert!(matches!(one(&[0.0; 9], &[0.0; 9], &bad), Err(TapError::Frf(_))));
    assert!(evaluate_tap_test(&[], &config()).is_err());
}

#[test]
fn modes_of_a_robot_come_back_from_five_noisy_hits_within_their_uncertainty() {
    let (mut inside, mut all, mut error_max) = ([0, 0, 0], 0, [0.0_f64; 3]);
    for seed in 0..20 {
        let hits: Vec<_> =
            (0..5).map(|k| (0.3 + 3.0 * f64::from(k), 200.0 + 50.0 * f64::from(k))).collect();
        let mut force = blows(15.3, &hits);
        let mut response = acceleration(&force, &ROBOT);
        let size = response.iter().fold(0.0_f64, |top, x| top.max(x.abs()));
        with_noise(&mut force, 1.0, 2 * seed);
        with_noise(&mut response, 0.01 * size, 2 * seed + 1);
        let tap = one(&force, &response, &config()).expect("hits");
        let found = found(&tap, [10.0, 200.0]);
        assert_eq!(found.len(), 3, "{found:#?}");
        for (mode, (f_n, zeta, mass)) in found.iter().zip(ROBOT) {
            all += 1;
            inside[0] += u32::from((mode.frequency_hz - f_n).abs() < 2.0 * mode.frequency_sigma_hz);
            inside[1] += u32::from((mode.damping - zeta).abs() < 2.0 * mode.damping_sigma);
            inside[2] += u32::from((mode.mass_kg - mass).abs() < 2.0 * mode.mass_sigma_kg);
            error_max[2] = error_max[2].max((mode.mass_kg / mass - 1.0).abs());
            error_max[0] = error_max[0].max((mode.frequency_hz / f_n - 1.0).abs());
            error_max[1] = error_max[1].max((mode.damping / zeta - 1.0).abs());
            assert!(mode.coherence.expect("five hits") > 0.95, "{mode:?}");
        }
    }
    eprintln!(
        "of {all}: {inside:?} within two sigma; worst off {error_max:.4?} (part of frequency, damping, mass)"
    );
    assert!(inside.iter().all(|n| f64::from(*n) > 0.9 * f64::from(all)));
    assert!(error_max[0] < 0.005 && error_max[1] < 0.2 && error_max[2] < 0.3);
}

#[test]
fn a_mode_that_has_not_rung_down_is_windowed_and_its_damping_is_still_right() {
    for zeta in [0.0005, 0.002, 0.005] {
        let known = [(67.0, zeta, 40.0), (120.0, 0.02, 25.0)];
        let force = blows(2.0, &[(0.1, 300.0)]);
        let response = acceleration(&force, &known);
        let windowed = one(&force, &response, &config()).expect("a hit");
        assert!(windowed.windows.decay_per_s > 0.0 && windowed.windows.left_at_end > 0.005);
        let modes = found(&windowed, [20.0, 200.0]);
        assert_eq!(modes.len(), 2, "{modes:?}");
        for (mode, (f_n, zeta, _)) in modes.iter().zip(known) {
            assert!((mode.frequency_hz / f_n - 1.0).abs() < 1e-3, "{mode:?}");
            assert!((mode.damping - zeta).abs() < 2e-4 + 0.02 * zeta, "{zeta}: {mode:?}");
        }
    }
}

#[test]
fn noise_on_the_response_leaves_h1_right_and_noise_on_the_force_h2_and_the_truth_is_between() {
    let hits: Vec<_> = (0..40).map(|k| (0.2 + f64::from(k), 250.0)).collect();
    let clean_force = blows(40.2, &hits);
    let clean = acceleration(&clean_force, &[(67.0, 0.05, 40.0)]);
    let plain = TapConfig { windows: false, ..config() };
    let truth = one(&clean_force, &clean, &plain).expect("hits").frf;
    let mean_ratio = |estimate: &[Complex<f64>]| {
        let bins = 40..110;
        let n = bins.len() as f64;
        bins.map(|b| (estimate[b] / truth.h1[b]).norm()).sum::<f64>() / n
    };
    let noisy = |force_sigma: f64, response_sigma: f64| {
        let (mut force, mut response) = (clean_force.clone(), clean.clone());
        with_noise(&mut force, force_sigma, 5);
        with_noise(&mut response, response_sigma, 6);
        let frf = one(&force, &response, &plain).expect("hits").frf;
        (mean_ratio(&frf.h1), mean_ratio(&frf.h2))
    };
    let (h1, h2) = noisy(0.0, 0.5);
    assert!((h1 - 1.0).abs() < 0.03 && h2 > 1.1, "response noise: {h1} {h2}");
    let (h1, h2) = noisy(11.0, 0.0);
    assert!(h1 < 0.9 && (h2 - 1.0).abs() < 0.05, "force noise: {h1} {h2}");
    let (h1, h2) = noisy(8.0, 0.3);
    assert!(h1 < 0.97 && h2 > 1.03, "both: {h1} {h2}");
}

proptest! {
    #[test]
    fn nothing_makes_it_panic(
        force in proptest::collection::vec(prop_oneof![-1e3..1e3_f64, Just(f64::NAN), Just(0.0), Just(900.0)], 0..300),
        rate_hz in prop_oneof![Just(f64::NAN), 1e-3..1e6_f64],
        block_s in proptest::option::of(1e-9..1e9_f64),
        windows in any::<bool>(),
    ) {
        let response: Vec<f64> = force.iter().rev().copied().collect();
        let config = TapConfig { rate_hz, response: Response::Velocity, block_s, windows };
        if let Ok(tap) = one(&force, &response, &config) {
            prop_assert!(tap.frf.h1.iter().all(|h| h.re.is_finite() && h.im.is_finite()));
            prop_assert_eq!(tap.force_spectrum.len(), tap.frf.h1.len());
        }
    }
}
