//! Taps: the lead at constant speed, and what has none.

use super::*;
use crate::virtual_joint::JOINT;

#[test]
fn a_path_at_constant_speed_is_led_by_delay_and_lag() {
    for period_s in [0.0005, 0.001, 0.002, 0.004] {
        let plants = JOINT.plants(0.02);
        let taps = FilterTaps::new(&plants, period_s, &TapsSettings::default()).unwrap();
        let step_s = taps.stride() as f64 * period_s;
        let past = (1..).zip(taps.past()).map(|(k, taps)| -f64::from(k) * taps[0]);
        let future = (1..).zip(taps.future()).map(|(k, taps)| f64::from(k) * taps[0]);
        let lead_s = step_s * past.chain(future).sum::<f64>();
        assert!((lead_s - JOINT.delay_s - JOINT.lag_s).abs() < 1e-12, "{period_s}: {lead_s}");
        assert!(step_s <= 0.004 + 1e-9 && taps.side_count() as f64 * step_s >= 0.3 - 1e-9);
    }
}

#[test]
fn commands_that_are_too_slow_for_the_bandwidth_have_no_taps() {
    let plants = JOINT.plants(0.02);
    let settings = TapsSettings::default();
    assert!(FilterTaps::new(&plants, 0.006, &settings).is_ok());
    let refused = FilterTaps::new(&plants, 0.012, &settings);
    assert_eq!(refused, Err(TapsError::Sampling { period_s: 0.012, longest_s: 0.00625 }));
    let slower = TapsSettings { bandwidth_hz: 20.0, ..settings };
    assert!(FilterTaps::new(&plants, 0.012, &slower).is_ok());
}

#[test]
fn a_rate_of_four_times_the_bandwidth_is_enough_however_its_period_is_rounded() {
    let plants = JOINT.plants(0.02);
    for hz in [10.0, 20.0, 40.0, 83.3, 100.0] {
        let settings = TapsSettings { bandwidth_hz: hz, ..TapsSettings::default() };
        for period_s in [0.25 / hz, 0.25 / hz * (1.0 + f64::EPSILON), 250.0 / hz * 1e-3] {
            let taps = FilterTaps::new(&plants, period_s, &settings).unwrap();
            let step_s = taps.stride() as f64 * period_s;
            assert!(step_s <= 0.25 / hz * (1.0 + 1e-6), "{hz}, {period_s}");
        }
    }
}

#[test]
fn a_model_without_dynamics_has_no_taps() {
    let plants = Plants { joints: vec![Plant::default(); 6], left_out: Vec::new() };
    let none = FilterTaps::new(&plants, 0.004, &TapsSettings::default());
    assert_eq!(none, Err(TapsError::NothingInTime));
}
