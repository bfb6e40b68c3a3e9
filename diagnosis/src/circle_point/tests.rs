//! Known circles, and the effect of noise on the estimates.

use super::*;
use proptest::prelude::*;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

fn arc(direction: DVec3, centre: DVec3, radius: f64, from: f64, to: f64, n: u32) -> Vec<DVec3> {
    let (n1, n2) = normals(direction);
    let angle = |i: u32| from + (to - from) * f64::from(i) / f64::from(n - 1);
    (0..n).map(angle).map(|a| centre + (n1 * libm::cos(a) + n2 * libm::sin(a)) * radius).collect()
}

fn noisy(track: &[DVec3], sigma: f64, rng: &mut ChaCha8Rng) -> Vec<DVec3> {
    let mut draw = || rng.sample::<f64, _>(StandardNormal) * sigma;
    track.iter().map(|p| *p + DVec3::new(draw(), draw(), draw())).collect()
}

fn unit() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0_f64)
        .prop_map(DVec3::from_array)
        .prop_filter("a direction", |v| v.length() > 0.1)
        .prop_map(DVec3::normalize)
}

proptest! {
    #[test]
    fn points_on_circles_give_back_axis_centre_and_radius(
        e in unit(),
        at in prop::array::uniform3(-3.0..3.0_f64).prop_map(DVec3::from_array),
        (r1, r2, rise) in (0.05..1.5_f64, 0.05..1.5_f64, -0.5..0.5_f64),
        (from, sweep) in (-3.0..3.0_f64, 0.4..6.0_f64),
    ) {
        let tracks = [
            arc(e, at, r1, from, from + sweep, 15),
            arc(e, at + e * rise, r2, from + 1.0, from + 1.0 + sweep, 9),
        ];
        let found = axis(&tracks, e, None).expect("two arcs");
        prop_assert!(found.tilt_from(e).length() < 1e-10, "{}", found.tilt_from(e));
        prop_assert!((found.centre(0).expect("first") - at).length() < 1e-10);
        prop_assert!((found.centre(1).expect("second") - at - e * rise).length() < 1e-10);
        prop_assert!((found.circles[0].radius_m - r1).abs() < 1e-10);
        let other = axis(&tracks, -e, None).expect("two arcs");
        prop_assert!((other.direction + found.direction).length() < 1e-10);
    }
}

#[test]
fn the_tilt_of_an_axis_is_recovered_with_its_sign() {
    let nominal = DVec3::Y;
    let tilt = DVec3::new(2e-4, 0.0, -5e-5);
    let e = rotation_from_vector(tilt) * nominal;
    let track = arc(e, DVec3::new(0.1, 2.0, -0.4), 0.9, -0.5, 0.6, 21);
    let found = axis(&[track], nominal, None).expect("an arc");
    assert!((found.tilt_from(nominal) - tilt).length() < 1e-12);
}

#[test]
fn the_true_axis_lies_within_its_stated_uncertainty_as_often_as_it_should() {
    let e = DVec3::new(0.3, -0.5, 0.8).normalize();
    let (centre, radius, sigma) = (DVec3::new(1.0, 0.4, 0.9), 0.8, 30e-6);
    let clean = arc(e, centre, radius, -0.6, 0.6, 25);
    let mut inside = [0_u32; 5];
    let rounds = 1500_u32;
    for seed in 0..rounds {
        let mut rng = ChaCha8Rng::seed_from_u64(u64::from(seed));
        let found = axis(&[noisy(&clean, sigma, &mut rng)], e, Some(sigma)).expect("an arc");
        let (n1, n2) = normals(found.direction);
        let turn = smallest_turn(found.direction, e);
        let away = centre - found.point;
        let (turns, points) = (found.sigma_turn_rad(), found.sigma_point_m());
        let scores = [
            turn.dot(n1) / turns[0],
            turn.dot(n2) / turns[1],
            away.dot(n1) / points[0],
            away.dot(n2) / points[1],
            (found.circles[0].radius_m - radius) / found.circles[0].sigma_radius_m,
        ];
        inside.iter_mut().zip(scores).for_each(|(n, z)| *n += u32::from(z.abs() < 1.96));
    }
    for n in inside {
        let share = f64::from(n) / f64::from(rounds);
        assert!((0.93..0.97).contains(&share), "95 % intervals cover {share}: {inside:?}");
    }
}

#[test]
fn targets_at_other_heights_and_radii_make_the_axis_as_sure_as_they_say() {
    let e = DVec3::new(-0.2, 0.9, 0.4).normalize();
    let (centre, sigma) = (DVec3::new(0.2, -0.4, 0.9), 30e-6);
    let clean = [arc(e, centre, 0.3, -0.4, 0.4, 12), arc(e, centre + e, 0.9, 0.5, 1.3, 12)];
    let (mut inside, rounds) = ([0_u32; 4], 1500_u32);
    for seed in 0..rounds {
        let mut rng = ChaCha8Rng::seed_from_u64(u64::from(seed));
        let tracks = [0, 1].map(|k: usize| noisy(&clean[k], sigma, &mut rng));
        let found = axis(&tracks, e, Some(sigma)).expect("two arcs");
        let (n1, n2) = normals(found.direction);
        let turn = smallest_turn(found.direction, e);
        let true_point = centre + e * (e.dot(found.point - centre));
        let away = true_point - found.point;
        let (turns, points) = (found.sigma_turn_rad(), found.sigma_point_m());
        let scores = [
            turn.dot(n1) / turns[0],
            turn.dot(n2) / turns[1],
            away.dot(n1) / points[0],
            away.dot(n2) / points[1],
        ];
        inside.iter_mut().zip(scores).for_each(|(n, z)| *n += u32::from(z.abs() < 1.96));
    }
    for n in inside {
        let share = f64::from(n) / f64::from(rounds);
        assert!((0.93..0.97).contains(&share), "95 % intervals cover {share}: {inside:?}");
    }
}

#[test]
fn where_no_noise_is_stated_the_points_say_it() {
    let clean = arc(DVec3::Z, DVec3::ZERO, 0.5, 0.0, 5.0, 400);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let found = axis(&[noisy(&clean, 50e-6, &mut rng)], DVec3::Z, None).expect("an arc");
    assert!((found.residual_rms_m / 50e-6 - 1.0).abs() < 0.1, "{}", found.residual_rms_m);
}

#[test]
fn tracks_that_determine_no_axis_say_so() {
    let line: Vec<DVec3> = (0..9).map(|i| DVec3::X * f64::from(i)).collect();
    assert_eq!(axis(&[line], DVec3::Z, None), Err(CircleError::Straight));
    let point = vec![DVec3::ONE; 5];
    assert_eq!(axis(&[point], DVec3::Z, None), Err(CircleError::Straight));
    assert_eq!(axis(&[], DVec3::Z, None), Err(CircleError::NoTrack));
    let few = vec![DVec3::X; 2];
    assert_eq!(axis(&[few], DVec3::Z, None), Err(CircleError::TooFew { track: 1, found: 2 }));
    let broken = vec![DVec3::X, DVec3::Y, DVec3::NAN];
    assert_eq!(axis(&[broken], DVec3::Z, None), Err(CircleError::NotFinite { track: 1 }));
    // Two millimetres of arc at 1 m radius have a sagitta of half a micrometre, far below the noise
    // of 50 µm.
    let short = arc(DVec3::Z, DVec3::ZERO, 1.0, 0.0, 0.002, 9);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let found = axis(&[noisy(&short, 50e-6, &mut rng)], DVec3::Z, Some(50e-6));
    assert_eq!(found, Err(CircleError::Straight));
}
