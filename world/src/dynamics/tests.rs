//! Delays, lags, modes and spikes compared with closed forms.

use super::*;
use crate::test_arm::irb1600;

fn times(n: usize, dt: f64) -> Vec<f64> {
    (0..n).map(|k| k as f64 * dt).collect()
}

fn of(wave: impl Fn(f64) -> f64, t: &[f64]) -> Vec<f64> {
    t.iter().map(|t| wave(*t)).collect()
}

#[test]
fn a_delay_shows_the_motion_of_then_even_between_samples() {
    let t = times(400, 4e-3);
    let wave = |t: f64| 0.4 * (5.0 * t).cos();
    let dynamics = Dynamics { delay_s: 7.3e-3, ..Dynamics::default() };
    let delayed = dynamics.motor_positions(&t, vec![of(wave, &t)]).remove(0);
    for k in 10..400 {
        assert!((delayed[k] - wave(t[k] - 7.3e-3)).abs() < 2e-7);
    }
}

#[test]
fn a_lag_trails_a_ramp_by_speed_times_its_time_constant() {
    let t = times(300, 2e-3);
    let dynamics = Dynamics { lags: vec![(0, 0.03)], ..Dynamics::default() };
    let lagged = dynamics.motor_positions(&t, vec![of(|t| 0.5 * t, &t)]).remove(0);
    let trail = |k: usize| 0.5 * t[k] - lagged[k];
    assert!((0..300).all(|k| (trail(k) - 0.5 * 0.03).abs() < 1e-12), "steady from the start");
}

#[test]
fn a_lag_answers_a_sine_as_its_transfer_function_says() {
    let (w, lag) = (9.0, 0.02);
    let t = times(2000, 1e-3);
    let dynamics = Dynamics { lags: vec![(0, lag)], ..Dynamics::default() };
    let lagged = dynamics.motor_positions(&t, vec![of(|t| (w * t).sin(), &t)]).remove(0);
    let (gain, phase) = (1.0 / (1.0 + (w * lag).powi(2)).sqrt(), (w * lag).atan());
    for k in 500..1990 {
        assert!((lagged[k] - gain * (w * t[k] - phase).sin()).abs() < 1e-6);
    }
}

fn ringing(participation: f64, compliance: f64) -> Mode {
    let part = VibratingPart::Joint(0);
    Mode { part, frequency_hz: 11.0, damping_ratio: 0.05, participation, compliance }
}

#[test]
fn a_mode_answers_a_shaken_joint_as_its_transfer_function_says() {
    let mode = ringing(0.8, 0.0);
    let t = times(8000, 1e-3);
    let w = TAU * 4.0;
    let deflection = mode.deflection(&t, &of(|t| (w * t).sin(), &t), &[]);
    // x = γ w² / (ω² − w² + 2iζωw) · sin wt
    let o = TAU * 11.0;
    let (re, im) = (o * o - w * w, 2.0 * 0.05 * o * w);
    let (gain, phase) = (0.8 * w * w / re.hypot(im), im.atan2(re));
    for k in 4000..7990 {
        let wanted = gain * (w * t[k] - phase).sin();
        assert!((deflection[k] - wanted).abs() < 2e-4 * gain, "{} not {wanted}", deflection[k]);
    }
}

#[test]
fn a_mode_rings_down_at_its_own_frequency_after_a_load_is_let_go() {
    let mode = ringing(1.0, 2e-6);
    let t = times(3000, 1e-3);
    let loads: Vec<f64> = t.iter().map(|t| if *t < 0.5 { 100.0 } else { 0.0 }).collect();
    let deflection = mode.deflection(&t, &[], &loads);
    let mean = loads.iter().sum::<f64>() / 3000.0;
    assert!((deflection[200] - 2e-6 * (100.0 - mean)).abs() < 1e-12, "settled under its load");
    let low = -2e-6 * mean;
    let crossings: Vec<f64> = (600..1200)
        .filter(|k| deflection[*k] < low && deflection[*k + 1] >= low)
        .map(|k| t[k] + 1e-3 * (low - deflection[k]) / (deflection[k + 1] - deflection[k]))
        .collect();
    let period = (crossings[4] - crossings[0]) / 4.0;
    let damped = 11.0 * (1.0_f64 - 0.05 * 0.05).sqrt();
    assert!((period * damped - 1.0).abs() < 1e-3, "{period}");
}

#[test]
fn a_spike_stands_at_a_reversal_against_the_new_motion_and_fades() {
    let spike = Spike { joint: 0, amplitude: 1e-4, time_constant_s: 0.05 };
    let t = times(200, 0.01);
    let motor = of(|t| if t < 1.0 { t } else { 2.0 - t }, &t);
    let deflection = spike.deflection(&t, &motor, 0.0);
    assert!(deflection[..101].iter().all(|x| *x == 0.0), "nothing before the first reversal");
    assert!((deflection[101] - 1e-4 * (-0.2_f64).exp()).abs() < 1e-15);
    assert!((deflection[106] / deflection[101] - (-1.0_f64).exp()).abs() < 1e-9);
    let known = spike.deflection(&t, &motor, -1.0);
    assert!((known[1] + 1e-4 * (-0.2_f64).exp()).abs() < 1e-15, "a first motion that turns back");
}

#[test]
fn effects_are_taken_by_their_names_and_what_does_not_fit_is_refused() {
    let arm = irb1600();
    let mut dynamics = Dynamics::default();
    let mut take = |kind, joint, channel, given: &[(&str, &[f64])]| {
        dynamics.add_named(&arm, kind, joint, channel, ParameterValues(given))
    };
    assert_eq!(take("time_delay", None, None, &[("delay", &[2e-3])]), Ok(true));
    assert_eq!(take("time_delay", None, Some("ql"), &[("delay", &[1e-3])]), Ok(true));
    assert_eq!(take("time_delay", None, Some("tau"), &[("delay", &[1e-3])]), Ok(true));
    assert_eq!(take("torque_delay", None, None, &[("delay", &[5e-3])]), Ok(true));
    assert_eq!(take("time_delay", None, Some("fx"), &[("delay", &[1e-3])]), Ok(false));
    assert_eq!(take("servo_lag", Some(2), None, &[("time_constant", &[0.02])]), Ok(true));
    assert_eq!(take("coulomb_friction", Some(2), None, &[("level", &[3.0])]), Ok(false));
    assert_eq!(take("backlash", Some(2), None, &[("width", &[1e-4])]), Ok(false));
    let mode: [(&str, &[f64]); 2] = [("frequency", &[12.0]), ("damping_ratio", &[0.02])];
    assert_eq!(take("flexible_mode", Some(1), None, &mode), Ok(true));
    assert!(take("flexible_mode", None, None, &mode).is_err(), "neither joint nor axis");
    assert!(take("servo_lag", Some(9), None, &[("time_constant", &[0.02])]).is_err());
    assert_eq!((dynamics.delay_s, dynamics.link_delay_s), (2e-3, 1e-3));
    assert_eq!(dynamics.torque_delay_s, 6e-3);
    assert_eq!(dynamics.lags, [(2, 0.02)]);
    assert_eq!(dynamics.modes[0].participation, 1.0);
}
