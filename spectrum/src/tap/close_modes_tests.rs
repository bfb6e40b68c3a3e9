//! Two close modes under hits that follow each other before the structure has stopped vibrating.

use super::TapTest;
use super::tests::{Known, acceleration, blows, config, found, one, with_noise};
use crate::frf::{Estimator, Response};
use crate::modal::{
    COHERENCE_MIN, FittedMode, MeasuredReceptance, UnresolvedPeak, unresolved_peaks,
};

/// Six hits, a person's intervals about `between_s`, ringing carried over from hit to hit.
fn six_hits(known: &[Known], between_s: f64, noise: f64, seed: u64) -> TapTest {
    let hits: Vec<_> = (0..6_u32)
        .map(|k| {
            let hand_s = 0.003 * f64::from(k * k % 5);
            (0.3 + between_s * f64::from(k) + hand_s, 200.0 + 20.0 * f64::from(k))
        })
        .collect();
    let mut force = blows(0.3 + 6.0 * between_s, &hits);
    let mut response = acceleration(&force, known);
    let size = response.iter().fold(0.0_f64, |top, x| top.max(x.abs()));
    with_noise(&mut force, 0.5, 2 * seed);
    with_noise(&mut response, noise * size, 2 * seed + 1);
    one(&force, &response, &config()).expect("hits")
}

fn peaks_left(tap: &TapTest, modes: &[FittedMode]) -> Vec<UnresolvedPeak> {
    let receptance = tap.frf.per_force(Estimator::H1, Response::Displacement);
    let measured = MeasuredReceptance {
        frequency_hz: &tap.frf.frequency_hz,
        receptance: &receptance,
        coherence: tap.frf.coherence.as_deref(),
        window_decay_per_s: tap.frf.window_decay_per_s,
        hit_interval_s: tap.min_hit_interval_s(),
    };
    unresolved_peaks(&measured, [10.0, 200.0], COHERENCE_MIN, modes)
}

#[test]
fn two_modes_six_hertz_apart_are_found_however_soon_the_next_hit_comes() {
    let (mut inside, mut all) = ([0; 3], 0);
    for zeta in [0.005, 0.01, 0.02, 0.03] {
        let known = [(67.0, zeta, 40.0), (73.0, zeta, 45.0)];
        for between_s in [0.6, 0.8, 1.0, 1.2, 2.0] {
            for seed in 0..5 {
                let tap = six_hits(&known, between_s, 0.005, seed);
                let modes = found(&tap, [10.0, 200.0]);
                assert_eq!(modes.len(), 2, "{zeta}, {between_s} s: {modes:#?}");
                let left = peaks_left(&tap, &modes);
                assert!(left.is_empty(), "{zeta}, {between_s} s, {seed}: {left:?}");
                for (mode, (f_n, zeta, mass)) in modes.iter().zip(known) {
                    all += 1;
                    let off_hz = (mode.frequency_hz - f_n).abs();
                    assert!(off_hz < 0.05, "{zeta}, {between_s} s: {mode:?}");
                    assert!((mode.damping / zeta - 1.0).abs() < 0.05, "{between_s} s: {mode:?}");
                    inside[0] += u32::from(off_hz < 2.0 * mode.frequency_sigma_hz);
                    inside[1] += u32::from((mode.damping - zeta).abs() < 2.0 * mode.damping_sigma);
                    inside[2] += u32::from((mode.mass_kg - mass).abs() < 2.0 * mode.mass_sigma_kg);
                }
            }
        }
    }
    eprintln!("of {all}: {inside:?} within two sigma (frequency, damping, mass)");
    assert!(inside.iter().all(|n| f64::from(*n) > 0.9 * f64::from(all)));
}

#[test]
fn ringing_of_the_hit_before_widens_the_uncertainty_of_the_mass_and_says_how_long_to_wait() {
    let tap = six_hits(&[(67.0, 0.005, 40.0), (120.0, 0.02, 25.0)], 0.6, 0.001, 1);
    let modes = found(&tap, [10.0, 200.0]);
    let [slow, quick] = modes.as_slice() else { panic!("{modes:#?}") };
    let left = (-0.005 * std::f64::consts::TAU * 67.0 * 0.6_f64).exp();
    assert!((slow.carry_over - left).abs() < 0.02, "{slow:?}");
    assert!((slow.mass_kg - 40.0).abs() < 2.0 * slow.mass_sigma_kg, "{slow:?}");
    assert!(
        slow.mass_sigma_kg > 0.1 * slow.mass_kg && quick.carry_over < 1e-3,
        "{slow:?} {quick:?}"
    );
    assert!((slow.ring_down_s(0.01) / 2.19 - 1.0).abs() < 0.05, "{}", slow.ring_down_s(0.01));
}

#[test]
fn a_record_of_its_own_for_each_hit_carries_nothing_over() {
    let tap = six_hits(&[(67.0, 0.01, 40.0)], 2.0, 0.001, 1);
    assert!((tap.min_hit_interval_s().expect("one record") - 2.0).abs() < 0.02);
    let force = blows(2.0, &[(0.3, 200.0)]);
    let response = acceleration(&force, &[(67.0, 0.01, 40.0)]);
    assert_eq!(one(&force, &response, &config()).expect("a hit").min_hit_interval_s(), None);
}

#[test]
fn peaks_that_no_fit_explains_are_reported_with_the_record_that_resolves_them() {
    let tap = six_hits(&[(67.0, 0.01, 40.0), (73.0, 0.01, 45.0)], 0.8, 0.005, 1);
    let modes = found(&tap, [10.0, 200.0]);
    assert!(peaks_left(&tap, &modes).is_empty(), "{modes:#?}");
    // As if no fit were valid.
    let left = peaks_left(&tap, &[]);
    let [low, high] = left.as_slice() else { panic!("{left:#?}") };
    for (peak, (own_hz, beside_hz)) in [(low, (67.0, 73.0)), (high, (73.0, 67.0))] {
        assert!((peak.frequency_hz - own_hz).abs() < 1.3, "{peak:?}");
        assert!(peak.neighbour_hz.is_some_and(|hz| (hz - beside_hz).abs() < 1.3), "{peak:?}");
        // Seven bins between them: found separately from 1.2 s on.
        assert!((0.9..1.5).contains(&peak.record_s), "{peak:?}");
    }
}
