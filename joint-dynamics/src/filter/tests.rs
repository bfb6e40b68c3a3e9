//! The filter on a virtual joint: errors left with and without a horizon, rest, jitter, missed commands, new beginnings.

use super::*;
use crate::taps::{FilterTaps, TapsSettings};
use crate::virtual_joint::{JOINT, STEP_S, VirtualJoint, corners, differences, largest, rms};
use proptest::prelude::*;

fn filter(believed: f64) -> Filter {
    let plants = JOINT.believed(believed).plants(0.02);
    Filter::new(
        FilterTaps::new(&plants, STEP_S, &TapsSettings::default()).unwrap(),
        [f64::INFINITY; JOINTS_MAX],
    )
}

fn joints(q: f64) -> Joints {
    let mut joints = [0.0; JOINTS_MAX];
    joints[0] = q;
    joints
}

/// The commands for a path of which the next `known` setpoints are known at each instant.
fn commands(filter: &mut Filter, path: &[f64], known: usize) -> Vec<f64> {
    let path: Vec<Joints> = path.iter().map(|q| joints(*q)).collect();
    (0..path.len())
        .map(|row| {
            let end = (row + 1 + known).min(path.len());
            let t_ns = (row as f64 * STEP_S * 1e9) as u64;
            path[row][0] + filter.step(&path[row], t_ns, &path[row + 1..end]).0[0]
        })
        .collect()
}

/// Largest and RMS error in time with the filter, over those without.
fn left(believed: f64, known: usize) -> (f64, f64) {
    let path = corners(STEP_S, &[(0.1, 1.0), (-0.1, 1.0), (0.05, 0.5)]);
    let without = differences(&path, &JOINT.run(STEP_S, &path));
    let commanded = commands(&mut filter(believed), &path, known);
    let with = differences(&path, &JOINT.run(STEP_S, &commanded));
    (largest(&with) / largest(&without), rms(&with) / rms(&without))
}

#[test]
fn a_horizon_of_delay_and_lag_leaves_a_tenth_of_the_error_and_a_longer_one_less() {
    let (largest, rms) = left(1.0, 10);
    assert!(largest < 0.12 && rms < 0.07, "40 ms: {largest}, {rms}");
    let (largest, rms) = left(1.0, 25);
    assert!(largest < 0.05 && rms < 0.03, "100 ms: {largest}, {rms}");
    let (largest, rms) = left(0.98, 25);
    assert!(largest < 0.06 && rms < 0.05, "100 ms, parameters off by 2 %: {largest}, {rms}");
}

#[test]
fn without_a_horizon_lags_are_compensated_and_the_delay_remains() {
    let path = corners(STEP_S, &[(0.1, 1.0), (-0.1, 1.0), (0.05, 0.5)]);
    let joint = VirtualJoint { participation: 0.0, ..JOINT };
    let delayed = VirtualJoint { lag_s: 0.0, ..joint }.run(STEP_S, &path);
    let mut plants = joint.plants(0.02);
    plants.joints[0].modes.clear();
    let taps = FilterTaps::new(&plants, STEP_S, &TapsSettings::default()).unwrap();
    let commanded = commands(&mut Filter::new(taps, [f64::INFINITY; JOINTS_MAX]), &path, 0);
    let without = differences(&delayed, &joint.run(STEP_S, &path));
    let with = differences(&delayed, &joint.run(STEP_S, &commanded));
    let (largest, rms) = (largest(&with) / largest(&without), rms(&with) / rms(&without));
    assert!(largest < 0.3 && rms < 0.15, "{largest}, {rms}");
}

#[test]
fn without_a_horizon_joints_with_modes_are_not_led() {
    let path = corners(STEP_S, &[(0.1, 1.0)]);
    assert_eq!(commands(&mut filter(1.0), &path, 7), path);
}

#[test]
fn a_model_that_is_off_by_30_per_cent_makes_the_rms_error_no_larger() {
    for believed in [0.7, 1.3] {
        for known in [0, 5, 8, 10, 25, 75, 125] {
            let (_, rms) = left(believed, known);
            assert!(rms <= 1.0, "{believed}, {known} points: {rms}");
        }
    }
}

#[test]
fn what_follows_the_horizon_counts_as_going_on_at_its_last_speed() {
    let (mut stated, mut assumed) = (filter(1.0), filter(1.0));
    let setpoint = |k: u64| joints(1e-3 * (k.min(230) as f64) + if k > 200 { 2e-3 } else { 0.0 });
    for k in 0..220_u64 {
        let all: Vec<Joints> = (k + 1..=k + 125)
            .map(|ahead| {
                // From the 20th setpoint on at constant speed.
                let (from, to) = (setpoint(k + 19)[0], setpoint(k + 20)[0]);
                if ahead <= k + 20 {
                    setpoint(ahead)
                } else {
                    joints(to + (to - from) * (ahead - k - 20) as f64)
                }
            })
            .collect();
        let (lead, _) = stated.step(&setpoint(k), k * 4_000_000, &all);
        let (found, _) = assumed.step(&setpoint(k), k * 4_000_000, &all[..20]);
        assert!((lead[0] - found[0]).abs() < 1e-12, "{k}: {} and {}", lead[0], found[0]);
    }
}

#[test]
fn an_arm_of_many_joints_leads_with_each_as_an_arm_of_one() {
    let mut plants = JOINT.plants(0.02);
    plants.joints = vec![plants.joints[0].clone(); 12];
    let taps = FilterTaps::new(&plants, STEP_S, &TapsSettings::default()).unwrap();
    let (mut one, mut many) = (filter(1.0), Filter::new(taps, [f64::INFINITY; JOINTS_MAX]));
    for k in 0..100 {
        let q = 1e-3 * (k as f64).powf(1.3);
        let (lead, _) = one.step(&joints(q), k * 4_000_000, &[joints(q + 0.01); 20]);
        let (all, _) = many.step(&[q; JOINTS_MAX], k * 4_000_000, &[[q + 0.01; JOINTS_MAX]; 20]);
        assert_eq!(all[..12], [lead[0]; 12]);
        assert_eq!(all[12..], [0.0; 4]);
    }
}

#[test]
fn a_robot_at_rest_is_not_led() {
    let mut filter = filter(1.0);
    for k in 0..200 {
        let (lead, ahead) = filter.step(&joints(0.4), k * 4_000_000, &[joints(0.4); 100]);
        assert_eq!(lead, [0.0; JOINTS_MAX]);
        assert_eq!(ahead, Lookahead { known: 100, used_at_most: 125, needed: 8 });
    }
}

#[test]
fn a_command_that_jumps_begins_anew() {
    let taps = FilterTaps::new(&JOINT.plants(0.02), STEP_S, &TapsSettings::default()).unwrap();
    let mut filter = Filter::new(taps, [0.01; JOINTS_MAX]);
    for k in 0..50 {
        let ahead = [joints(1e-3 * k as f64 + 0.01); 20];
        let (lead, _) = filter.step(&joints(1e-3 * k as f64), k * 4_000_000, &ahead);
        assert!(lead[0] != 0.0);
    }
    assert_eq!(filter.step(&joints(0.06), 200_000_000, &[joints(0.06); 125]).0, [0.0; JOINTS_MAX]);
}

#[test]
fn another_model_goes_on_with_the_path_of_the_one_before() {
    let (mut before, mut kept) = (filter(1.0), filter(1.0));
    for k in 0..120 {
        let _ = before.step(&joints(1e-3 * (k as f64).powf(1.3)), k * 4_000_000, &[]);
    }
    kept.continue_from(&before);
    let q = joints(1e-3 * 120_f64.powf(1.3));
    let (lead, _) = before.step(&q, 480_000_000, &[q; 20]);
    assert_eq!(kept.step(&q, 480_000_000, &[q; 20]).0, lead);
    assert!(lead[0] != 0.0);
}

#[test]
fn jitter_of_the_times_is_no_speed() {
    let (mut even, mut shaken) = (filter(1.0), filter(1.0));
    for k in 0..500_u64 {
        let q = joints(1e-3 * k as f64);
        let jitter_ns = [0, 900_000, 300_000, 1_700_000][k as usize % 4];
        let ahead = [q; 20];
        let (lead, _) = even.step(&q, k * 4_000_000, &ahead);
        let (found, _) = shaken.step(&q, k * 4_000_000 + jitter_ns, &ahead);
        assert_eq!(lead, found);
    }
}

#[test]
fn commands_that_come_at_another_pace_than_the_period_are_led_by_their_speed() {
    for pace in [0.7, 1.4] {
        let mut filter = filter(1.0);
        let (mut sum, mut count) = (0.0, 0);
        for k in 0..1000_u64 {
            let t_ns = (k as f64 * pace * 4e6) as u64;
            // 0.25 rad/s.
            let setpoint = |t_ns: f64| joints(0.25e-9 * t_ns);
            let ahead: Vec<Joints> =
                (1..=40).map(|ahead| setpoint(t_ns as f64 + 4e6 * f64::from(ahead))).collect();
            let (lead, _) = filter.step(&setpoint(t_ns as f64), t_ns, &ahead);
            if k > 300 {
                (sum, count) = (sum + lead[0], count + 1);
            }
        }
        let lead_s = sum / f64::from(count) / 0.25;
        assert!((lead_s - JOINT.delay_s - JOINT.lag_s).abs() < 2e-4, "{pace}: {lead_s} s");
    }
}

#[test]
fn commands_that_were_missed_are_made_good() {
    let (mut all, mut some) = (filter(1.0), filter(1.0));
    for k in 0..500_u64 {
        let q = joints(1e-3 * k as f64);
        let ahead = [q; 20];
        let (lead, _) = all.step(&q, k * 4_000_000, &ahead);
        if k % 7 == 3 || k % 7 == 4 {
            continue;
        }
        let (found, _) = some.step(&q, k * 4_000_000, &ahead);
        assert!((lead[0] - found[0]).abs() < 1e-12, "{k}");
    }
}

#[test]
fn after_a_gap_a_restart_or_a_clock_set_back_the_path_begins_anew() {
    for (t_ns, restarts) in [(1_000_000_000, false), (399_000_000, false), (404_000_000, true)] {
        let mut filter = filter(1.0);
        for k in 0..101 {
            let _ = filter.step(&joints(1e-3 * k as f64), k * 4_000_000, &[]);
        }
        if restarts {
            filter.restart();
        }
        assert_eq!(filter.step(&joints(0.3), t_ns, &[joints(0.3); 125]).0, [0.0; JOINTS_MAX]);
    }
}

proptest! {
    #[test]
    fn any_numbers_give_a_finite_lead(
        steps in prop::collection::vec((-1e3..1e3_f64, 0..100_000_000_u64, 0..200_usize), 1..60),
    ) {
        let (mut filter, mut t_ns) = (filter(1.0), 0_u64);
        for (q, dt_ns, known) in steps {
            t_ns += dt_ns;
            let (lead, _) = filter.step(&joints(q), t_ns, &vec![joints(-q); known]);
            prop_assert!(lead.iter().all(|lead| lead.is_finite()));
        }
        let (lead, _) = filter.step(&joints(f64::NAN), t_ns + 1, &[]);
        prop_assert_eq!(lead, [0.0; JOINTS_MAX]);
    }
}
