//! Limits compared with closed forms, with an independent integration in time, and with each other.

use super::time_domain_reference::TimeDomainReference;
use super::*;
use nalgebra::DMatrix;
use proptest::prelude::*;
use std::f64::consts::PI;

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// Insperger and Stépán's one mode along the feed: 922 Hz, 1.1 %, 0.03993 kg.
fn one_mode() -> [FlexibleMode; 1] {
    let stiffness_n_per_m = 0.03993 * (TAU * 922.0_f64).powi(2);
    [FlexibleMode { frequency_hz: 922.0, damping_ratio: 0.011, stiffness_n_per_m, direction: X }]
}

/// Their two teeth in down milling, 600 and 200 N/mm².
fn two_teeth(immersion: f64) -> Cutter {
    let [entry_rad, exit_rad] = Cutter::down_milling(immersion);
    Cutter {
        teeth: 2,
        diameter_m: 0.01,
        helix_rad: 0.0,
        entry_rad,
        exit_rad,
        turning: false,
        chip_n_m2: [6e8, 2e8, 0.0],
    }
}

/// A mode along the feed and one across it, close in frequency (values as quoted for Altintas and
/// Budak's example; not checked against the original).
fn two_modes() -> [FlexibleMode; 2] {
    let mode = |frequency_hz, damping_ratio, stiffness_n_per_m, direction| FlexibleMode {
        frequency_hz,
        damping_ratio,
        stiffness_n_per_m,
        direction,
    };
    [mode(603.0, 0.039, 5.59e6, X), mode(666.0, 0.035, 5.715e6, Y)]
}

fn three_teeth(entry_rad: f64, exit_rad: f64) -> Cutter {
    Cutter { teeth: 3, entry_rad, exit_rad, chip_n_m2: [6e8, 0.07 * 6e8, 0.0], ..two_teeth(1.0) }
}

fn stability(modes: &[FlexibleMode], cutter: Cutter) -> Stability {
    Stability::new(modes, cutter, CutAxes::new(X, Z).unwrap()).unwrap()
}

/// Asserts at each speed that the independent integration finds the cut stable 1 % below the limit
/// and at some lower depths, and unstable 1 % above.
fn assert_as_the_peer(modes: &[FlexibleMode], cutter: Cutter, speeds_rpm: [f64; 2], count: usize) {
    let stability = stability(modes, cutter);
    let step = (speeds_rpm[1] - speeds_rpm[0]) / (count - 1) as f64;
    for k in 0..count {
        let rpm = speeds_rpm[0] + k as f64 * step;
        let Some(Limit { depth_m, .. }) = stability.limit(rpm, 0.1).unwrap() else {
            panic!("a limit at {rpm} rpm is expected")
        };
        let growth =
            |part: f64| TimeDomainReference::new(modes, cutter, rpm, part * depth_m).growth(300);
        let (below, above) = (growth(0.99), growth(1.01));
        assert!(below < 0.0 && above > 0.0, "{rpm} rpm, {depth_m} m: {below}, {above}");
        for part in [0.5, 0.8, 0.9, 0.95] {
            assert!(growth(part) < 0.0, "{rpm} rpm: unstable at {part} of {depth_m} m");
        }
    }
}

#[test]
fn one_mode_in_a_slot_is_within_one_percent_of_the_integration_in_time() {
    assert_as_the_peer(&one_mode(), two_teeth(1.0), [5000.0, 25_000.0], 16);
}

#[test]
fn one_mode_at_half_immersion_is_within_one_percent_of_the_integration_in_time() {
    assert_as_the_peer(&one_mode(), two_teeth(0.5), [5000.0, 25_000.0], 16);
}

#[test]
fn one_mode_at_a_tenth_of_immersion_is_within_one_percent_of_the_integration_in_time() {
    assert_as_the_peer(&one_mode(), two_teeth(0.1), [5000.0, 25_000.0], 16);
}

#[test]
fn one_mode_at_a_twentieth_of_immersion_is_within_one_percent_of_the_integration_in_time() {
    assert_as_the_peer(&one_mode(), two_teeth(0.05), [5000.0, 25_000.0], 16);
}

#[test]
fn two_modes_are_within_one_percent_of_the_integration_in_time() {
    assert_as_the_peer(&two_modes(), three_teeth(0.0, PI), [4000.0, 20_000.0], 9);
    assert_as_the_peer(&two_modes(), three_teeth(0.0, 0.5 * PI), [4000.0, 20_000.0], 9);
}

#[test]
fn small_immersion_has_flip_lobes_that_the_zeroth_order_misses() {
    let stability = stability(&one_mode(), two_teeth(0.05));
    let points = limits_by_speed(&stability, [10_000.0, 25_000.0], 61, 0.05).unwrap();
    let flips = points.iter().filter(|point| {
        let Some(limit) = point.limit else { return false };
        let multiplier = stability.multiplier(point.spindle_rpm, limit.depth_m).unwrap();
        let misses = point.zeroth_order.is_none_or(|zeroth| zeroth.depth_m > 2.0 * limit.depth_m);
        multiplier.re < -0.99 && multiplier.im.abs() < 1e-6 && misses
    });
    assert!(flips.count() > 3, "{points:?}");
}

#[test]
fn a_flip_sounds_at_an_odd_multiple_of_half_the_tooth_passing() {
    let stability = stability(&one_mode(), two_teeth(0.05));
    let at_hz = stability.chatter_hz(18_000.0, Complex::new(-1.0, 0.0));
    assert!((at_hz - 900.0).abs() < 1e-6, "1.5 times 600 Hz lies nearest to the mode: {at_hz}");
}

/// A tool that turns along its feed, with a force that pushes it out: 1 mode along the feed.
fn turning() -> Stability {
    let cutter = Cutter { teeth: 1, turning: true, ..two_teeth(1.0) };
    stability(&one_mode(), cutter)
}

#[test]
fn the_least_limit_in_turning_is_the_closed_form() {
    let [FlexibleMode { stiffness_n_per_m: k, damping_ratio: zeta, frequency_hz, .. }] = one_mode();
    // Along the feed the chip pushes with K_rc.
    let least_m = 2.0 * k * zeta * (1.0 + zeta) / 2e8;
    let points = limits_by_speed(&turning(), [9000.0, 20_000.0], 221, 1.0).unwrap();
    let smallest = |limit: &dyn Fn(&SpeedLimits) -> Option<Limit>| {
        let limits = points.iter().filter_map(limit);
        limits.min_by(|a, b| a.depth_m.total_cmp(&b.depth_m)).unwrap()
    };
    for found in [smallest(&|point| point.zeroth_order), smallest(&|point| point.limit)] {
        assert!((found.depth_m / least_m - 1.0).abs() < 3e-3, "{found:?} for {least_m} m");
        let expected_hz = frequency_hz * (1.0 + 2.0 * zeta).sqrt();
        assert!((found.frequency_hz / expected_hz - 1.0).abs() < 1e-3, "{found:?}");
    }
}

/// The limit of one mode in turning by its closed form, m: the smallest `1/(2 Re λ)` of all
/// frequencies with `ωτ = ψ + 2πj`, found where that changes sign on a dense grid.
fn turning_closed_form_m(mode: &FlexibleMode, gain: f64, rpm: f64) -> f64 {
    let (delay_s, omega_n) = (60.0 / rpm, TAU * mode.frequency_hz);
    let at = |ratio: f64| {
        let dynamic = Complex::new(1.0 - ratio * ratio, 2.0 * mode.damping_ratio * ratio);
        let value = dynamic.inv() * (gain / mode.stiffness_n_per_m);
        let turns = (ratio * omega_n * delay_s - 2.0 * value.re.atan2(-value.im)) / TAU;
        (turns, 0.5 / value.re)
    };
    // From resonance on, where the real part has its sign, geometrically denser towards it.
    let ratio = |k: u32| {
        let away = 1e-6 * (6e-5 * f64::from(k)).exp();
        if gain > 0.0 { 1.0 - away } else { 1.0 + away }
    };
    let mut least_m = f64::INFINITY;
    let mut before = at(ratio(0));
    for k in 1..300_000 {
        let r = ratio(k);
        if r <= 0.0 {
            break;
        }
        let now = at(r);
        if before.0.floor() != now.0.floor() && before.0.max(now.0).floor() >= 0.0 {
            least_m = least_m.min(0.5 * (before.1 + now.1));
        }
        before = now;
    }
    least_m
}

/// Powers of ten with exponents between two numbers.
fn log_uniform(from: f64, to: f64) -> impl Strategy<Value = f64> {
    (from..to).prop_map(|exponent: f64| 10f64.powf(exponent))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]
    #[test]
    fn the_zeroth_order_in_turning_is_the_closed_form_at_any_speed(
        frequency_hz in 20.0..1500.0_f64, damping_ratio in log_uniform(-2.7, -0.6), waves in log_uniform(-1.5, 0.7), pushes in any::<bool>(),
    ) {
        let direction = if pushes { X } else { [1.0, 1.0, 0.0] };
        let mode = FlexibleMode { frequency_hz, damping_ratio, stiffness_n_per_m: 1e6, direction };
        // Along the feed the chip pushes with K_rc; obliquely a large K_tc pulls.
        let cutter = Cutter {
            teeth: 1, turning: true, chip_n_m2: if pushes { [8e8, 9e8, 1e8] } else { [9e8, 2e8, 0.0] }, ..two_teeth(1.0)
        };
        let stability = stability(&[mode], cutter);
        let u = Vector3::from(direction).normalize();
        let gain = (u.transpose() * stability.mean_coefficients() * u.xy())[(0, 0)];
        let rpm = 60.0 * frequency_hz / waves;
        let expected_m = turning_closed_form_m(&mode, gain, rpm);
        let depth_max_m = 500.0 * damping_ratio * 2.0 * 1e6 / gain.abs();
        prop_assume!(expected_m < 0.9 * depth_max_m);
        let found = stability.lobes(depth_max_m).limit(rpm);
        let found_m = found.map_or(f64::INFINITY, |limit| limit.depth_m);
        prop_assert!((found_m / expected_m - 1.0).abs() < 1e-3, "{found_m} m, expected {expected_m} m at {rpm} rpm, gain {gain}");
    }
}

#[test]
fn a_limit_far_above_the_least_one_is_found_on_the_edge_of_a_lobe() {
    let mode = FlexibleMode {
        frequency_hz: 120.0,
        damping_ratio: 0.01,
        stiffness_n_per_m: 1e6,
        direction: X,
    };
    let cutter = Cutter { teeth: 1, turning: true, chip_n_m2: [8e8, 9e8, 1e8], ..two_teeth(1.0) };
    let found = stability(&[mode], cutter).lobes(0.1).limit(7376.6).expect("a limit");
    assert!((found.depth_m / 0.1529e-3 - 1.0).abs() < 2e-3, "{found:?}");
}

#[test]
fn a_feed_that_is_not_across_up_is_refused_with_both_remedies() {
    let refused = CutAxes::new(X, [0.5, 0.0, 1.0]).expect_err("63° apart");
    let StabilityError::Skew { angle_deg, feed, up } = refused else { panic!("{refused}") };
    assert!((angle_deg - 63.43).abs() < 0.01, "{angle_deg}");
    for axes in [CutAxes::new(feed, [0.5, 0.0, 1.0]), CutAxes::new(X, up)] {
        assert!(axes.is_ok(), "{axes:?}");
    }
    assert_eq!(CutAxes::new(X, up).expect("across").feed(), X);
    let far = CutAxes::new([1e200, 0.0, 0.0], [0.0, 0.0, 1e-300]).expect("any length");
    assert_eq!((far.feed(), far.up()), (X, Z));
}

#[test]
fn a_pocket_stands_where_the_work_turns_once_in_a_whole_number_of_swings() {
    let stability = turning();
    for swings in [3.0, 4.0, 5.0] {
        let rpm = 60.0 * 922.0 / swings;
        let points = limits_by_speed(&stability, [0.9 * rpm, 1.1 * rpm], 41, 1.0).unwrap();
        let depth = |point: &&SpeedLimits| point.limit.unwrap().depth_m;
        let deepest = points.iter().max_by(|a, b| depth(a).total_cmp(&depth(b))).unwrap();
        assert!((deepest.spindle_rpm / rpm - 1.0).abs() < 0.03, "{swings} swings: {deepest:?}");
    }
}

#[test]
fn both_methods_agree_where_the_force_is_constant() {
    // Products of sines and cosines of four teeth over half a turn add up to constants.
    let constant = Cutter { teeth: 4, ..three_teeth(0.0, PI) };
    let mut other_hz = 0;
    for point in
        limits_by_speed(&stability(&two_modes(), constant), [3000.0, 18_000.0], 31, 0.5).unwrap()
    {
        let (zeroth, limit) = (point.zeroth_order.unwrap(), point.limit.unwrap());
        let [a, b] = [zeroth.depth_m, limit.depth_m];
        assert!((a / b - 1.0).abs() < 0.01, "{} rpm: {a} m, {b} m", point.spindle_rpm);
        let [a, b] = [zeroth.frequency_hz, limit.frequency_hz];
        other_hz += i32::from((a / b - 1.0).abs() > 0.01);
    }
    // Where two lobes meet, either may be the lower.
    assert!(other_hz <= 2, "{other_hz} frequencies differ");
}

/// Eigenvalues of the second-order system without delay: `q'' = −2ζω q' − ω² q + ω²/k uᵀ a W₀ r`.
fn coupled(stability: &Stability, depth_m: f64) -> Vec<Complex<f64>> {
    let (n, mean) = (stability.tip_modes.len(), stability.mean_coefficients());
    let mut system = DMatrix::zeros(2 * n, 2 * n);
    for (i, swing) in stability.tip_modes.iter().enumerate() {
        let omega = swing.omega_rad_s;
        system[(i, n + i)] = 1.0;
        system[(n + i, i)] -= omega * omega;
        system[(n + i, n + i)] = -2.0 * swing.damping_ratio * omega;
        for (j, other) in stability.tip_modes.iter().enumerate() {
            let force = swing.direction.transpose() * mean * other.direction.xy();
            system[(n + i, j)] += omega * omega / swing.stiffness_n_per_m * depth_m * force[(0, 0)];
        }
    }
    system.complex_eigenvalues().iter().copied().collect()
}

/// Two modes of a robot's arm, a little apart in frequency and across each other at an angle.
fn arm(angle_rad: f64, damping_ratio: f64) -> [FlexibleMode; 2] {
    let mode = |frequency_hz: f64, damping_ratio, angle: f64| FlexibleMode {
        frequency_hz,
        damping_ratio,
        stiffness_n_per_m: 1e6,
        direction: [angle.cos(), angle.sin(), 0.0],
    };
    let slow = mode(67.0, damping_ratio, angle_rad);
    // The same decay per second in both.
    [slow, mode(72.0, damping_ratio * 67.0 / 72.0, angle_rad + 0.5 * PI)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_limit_of_mode_coupling_is_where_the_coupled_system_loses_its_damping(
        angle in 0.0..PI, damping in 0.005..0.05_f64, entry in 0.0..1.5_f64, exit in 1.6..PI,
    ) {
        let stability = stability(&arm(angle, damping), three_teeth(entry, exit));
        let worst = |depth_m: f64| {
            coupled(&stability, depth_m).iter().map(|value| value.re).fold(f64::MIN, f64::max)
        };
        let most_m = 0.05;
        match stability.lobes(most_m).mode_coupling() {
            Some(limit) => {
                prop_assert!(worst(0.999 * limit.depth_m) < 0.0, "{limit:?}");
                prop_assert!(worst(1.001 * limit.depth_m) > 0.0, "{limit:?}");
                let eigenvalues = coupled(&stability, limit.depth_m);
                let deviation = |value: &Complex<f64>| (value.im.abs() / TAU - limit.frequency_hz).abs();
                prop_assert!(eigenvalues.iter().any(|value| value.re.abs() < 1.0 && deviation(value) < 0.1), "{limit:?}");
            }
            None => prop_assert!(worst(most_m) < 0.0),
        }
    }

    #[test]
    fn a_limit_does_not_change_when_modes_and_feed_turn_together(
        about in prop::array::uniform3(-1.0..1.0_f64), turn in 0.1..6.0_f64,
    ) {
        let axis = nalgebra::Unit::try_new(Vector3::from(about), 1e-3);
        prop_assume!(axis.is_some());
        let rotation = nalgebra::Rotation3::from_axis_angle(&axis.unwrap(), turn);
        let turned = |v: [f64; 3]| -> [f64; 3] { (rotation * Vector3::from(v)).into() };
        let cutter = Cutter { chip_n_m2: [6e8, 2e8, 1e8], ..three_teeth(0.0, 2.0) };
        let modes = [FlexibleMode { direction: [1.0, 0.4, 0.7], ..two_modes()[0] }, two_modes()[1]];
        let original = stability(&modes, cutter).limit(9000.0, 0.1).unwrap().unwrap();
        let rotated = modes.map(|mode| FlexibleMode { direction: turned(mode.direction), ..mode });
        let axes = CutAxes::new(turned(X), turned(Z)).unwrap();
        let rotated = Stability::new(&rotated, cutter, axes).unwrap().limit(9000.0, 0.1).unwrap().unwrap();
        prop_assert!((original.depth_m / rotated.depth_m - 1.0).abs() < 1e-3, "{original:?} {rotated:?}");
    }

    #[test]
    fn the_mean_stiffness_of_helical_teeth_is_a_fine_sum_over_their_length(
        from in -3.0..3.0_f64, span in 0.01..1.0_f64, helix in -0.8..0.8_f64,
        entry in 0.0..1.5_f64, exit in 1.6..PI, teeth in 1_u32..5,
    ) {
        let depth_m = 0.004;
        let cutter = Cutter { teeth, helix_rad: helix, entry_rad: entry, exit_rad: exit,
            chip_n_m2: [6e8, 2e8, 1e8], ..two_teeth(1.0) };
        let lag = cutter.lag_rad(depth_m);
        let n = 300;
        let mut sum = Matrix3x2::zeros();
        for i in 0..n {
            for j in 0..n {
                let part = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
                for tooth in 0..teeth {
                    let angle = from + span * part(i) - lag * part(j) + TAU * f64::from(tooth) / f64::from(teeth);
                    let angle = angle.rem_euclid(TAU);
                    if (entry..exit).contains(&angle) {
                        let (s, c) = angle.sin_cos();
                        let force = Vector3::new(-6e8 * c - 2e8 * s, 6e8 * s - 2e8 * c, 1e8);
                        sum += force * nalgebra::RowVector2::new(s, c);
                    }
                }
            }
        }
        let difference = DirectionalCoefficients::new(&cutter, depth_m).mean_over_teeth(from, span) - sum / f64::from(n * n);
        prop_assert!(difference.norm() < 0.01 * 6e8, "{difference}");
    }
}

#[test]
fn mode_coupling_without_damping_has_the_depth_of_the_formula() {
    let modes = arm(0.6, 1e-6);
    let stability = stability(&modes, three_teeth(0.0, PI));
    let mean = stability.mean_coefficients();
    let [u, v] = [stability.tip_modes[0].direction, stability.tip_modes[1].direction];
    let [m_1, m_2] = modes.map(|m| m.stiffness_n_per_m / (TAU * m.frequency_hz).powi(2));
    let a =
        |left: Vector3<f64>, right: Vector3<f64>| (left.transpose() * mean * right.xy())[(0, 0)];
    let apart = (TAU * 67.0).powi(2) - (TAU * 72.0).powi(2);
    let along = a(u, u) / m_1 - a(v, v) / m_2;
    let root = 2.0 * (-a(u, v) * a(v, u) / (m_1 * m_2)).sqrt();
    let both = [apart / (along + root), apart / (along - root)];
    let formula_m = both.into_iter().filter(|depth| *depth > 0.0).fold(f64::INFINITY, f64::min);
    let found = stability.lobes(1.0).mode_coupling().unwrap();
    assert!((found.depth_m / formula_m - 1.0).abs() < 1e-3, "{found:?} for {formula_m} m");
    assert!((67.0..72.0).contains(&found.frequency_hz), "{found:?}");
}

#[test]
fn the_direction_of_feed_decides_about_mode_coupling() {
    let stability = stability(&arm(0.0, 0.01), three_teeth(0.0, 0.5 * PI));
    let all = limits_by_feed_direction(&stability, 9000.0, 36, 0.02).unwrap();
    let depths: Vec<f64> =
        all.iter().map(|one| one.mode_coupling.map_or(f64::INFINITY, |l| l.depth_m)).collect();
    let (depth_min, depth_max) =
        depths.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
    assert!(depth_max > 3.0 * depth_min, "{depths:?}");
    // Forces in the plane do not depend on the sense of the feed along a line.
    for k in 0..18 {
        let [a, b] = [&all[k], &all[k + 18]].map(|one| one.limit.map(|l| l.depth_m));
        assert!((a.unwrap_or(1.0) / b.unwrap_or(1.0) - 1.0).abs() < 2e-3, "{a:?} {b:?}");
    }
}

#[test]
fn in_a_slot_the_mean_force_turns_with_the_tool_and_the_direction_of_feed_plays_no_part() {
    let stability = stability(&arm(0.3, 0.01), three_teeth(0.0, PI));
    let depth =
        |angle: f64| stability.with_feed_rotated(angle).lobes(0.1).mode_coupling().unwrap().depth_m;
    for angle in [0.4, 1.3, 2.9, 4.4] {
        assert!((depth(angle) / depth(0.0) - 1.0).abs() < 1e-9, "{angle}");
    }
}

#[test]
fn the_nearest_stable_speed_is_stable_and_the_way_to_it_is_not() {
    let stability = stability(&one_mode(), two_teeth(1.0));
    let depth_m = 3e-3;
    let points = limits_by_speed(&stability, [8000.0, 25_000.0], 171, 0.01).unwrap();
    let from_rpm = 11_500.0;
    let found = nearest_speed_rpm(&stability, &points, from_rpm, depth_m, 0.01).unwrap().unwrap();
    let holds = |rpm: f64| stability.multiplier(rpm, depth_m).unwrap().norm() < 1.0;
    assert!(holds(found) && found != from_rpm, "{found}");
    for part in [0.0, 0.3, 0.6, 0.9, 0.99] {
        assert!(!holds(from_rpm + part * (found - from_rpm)), "{part} of the way to {found}");
    }
    assert!(nearest_speed_rpm(&stability, &points, from_rpm, 9e-3, 0.01).unwrap().is_none());
}

#[test]
fn an_impossible_cutter_is_refused() {
    let axes = CutAxes::new(X, Z).unwrap();
    assert_eq!(CutAxes::new(Z, Z), Err(StabilityError::Axes));
    assert_eq!(CutAxes::new([f64::NAN, 0.0, 0.0], Z), Err(StabilityError::Axes));
    assert_eq!(CutAxes::new([0.0; 3], Z), Err(StabilityError::Axes));
    let new = |modes: &[FlexibleMode], cutter| Stability::new(modes, cutter, axes).map(|_| ());
    assert_eq!(new(&[], two_teeth(1.0)), Err(StabilityError::NoMode));
    let undamped = [FlexibleMode { damping_ratio: 0.0, ..one_mode()[0] }];
    assert!(matches!(new(&undamped, two_teeth(1.0)), Err(StabilityError::Mode { number: 1, .. })));
    let none = Cutter { teeth: 0, ..two_teeth(1.0) };
    assert!(matches!(new(&one_mode(), none), Err(StabilityError::Cutter { what: "teeth", .. })));
    let slow = stability(&one_mode(), two_teeth(1.0)).limit(100.0, 0.01);
    assert!(matches!(slow, Err(StabilityError::TooSlow { .. })), "{slow:?}");
}
