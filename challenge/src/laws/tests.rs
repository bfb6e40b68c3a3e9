//! The characteristic signature of every law.

use super::*;
use crate::arm::Arm;
use crate::effect::EffectKind;
use crate::rng::Rng;
use crate::scene::{Excitation, RecordedInputs};

fn scene(settled: bool) -> Scene {
    let mut rng = Rng::new(11, 0);
    let arm = Arm::random(&mut rng, true);
    let recorded_inputs =
        RecordedInputs { wrench: true, ambient: true, joint_temperatures: false, spindle: true };
    if settled {
        Scene::random_poses(arm, recorded_inputs, 60, Excitation::Full, &mut rng)
    } else {
        Scene::random_path(arm, recorded_inputs, (1500, 100.0), Excitation::Full, &mut rng)
    }
}

fn effect(kind: Kind, parameters: &[f64]) -> Effect {
    Effect { kind, joint: 1, other_joint: 2, parameters: parameters.to_vec() }
}

fn angles(scene: &Scene, effect: &Effect) -> Vec<f64> {
    let effects = [effect.clone()];
    Run::new(scene, &effects).deviations(&effects).iter().map(|deviation| deviation.0[9]).collect()
}

#[test]
fn play_has_one_width_whatever_the_amplitude_and_the_link_stays_within_it() {
    let motor: Vec<f64> =
        (0..4000).map(|k| 0.2 * (f64::from(k) * 0.01).sin() * (f64::from(k) * 5e-4)).collect();
    let play = backlash_contact(&motor, 0.0, |_| 4e-4);
    assert!(play.iter().all(|x| x.abs() <= 2e-4 + 1e-15));
    for k in 1000..3999 {
        if (motor[k] - motor[k - 1]).abs() > 4.1e-4 {
            let side = -2e-4 * (motor[k] - motor[k - 1]).signum();
            assert!((play[k] - side).abs() < 1e-12);
        }
        let link = |k: usize| motor[k] + play[k];
        assert!(
            (link(k) - link(k - 1)) * (motor[k] - motor[k - 1]) >= -1e-18,
            "never against the motor"
        );
    }
}

#[test]
fn two_gaps_of_a_joint_are_one_as_wide_as_both() {
    let scene = scene(false);
    let [narrow, wide, both] = [2e-4, 5e-4, 7e-4].map(|gap| effect(Kind::Backlash, &[gap]));
    let pair = [narrow.clone(), wide.clone()];
    let run = Run::new(&scene, &pair);
    let angles_of_pair: Vec<f64> =
        run.deviations(&pair).iter().map(|deviation| deviation.0[9]).collect();
    assert_eq!(angles_of_pair, angles(&scene, &both));
    let sum = angles(&scene, &narrow).into_iter().zip(angles(&scene, &wide)).map(|(a, b)| a + b);
    assert!(
        sum.zip(&angles_of_pair).any(|(sum, angle)| (sum - angle).abs() > 1e-4),
        "crossed one after the other"
    );
}

#[test]
fn a_hysteresis_builds_up_over_its_distance_and_its_loop_closes() {
    let (height, distance) = (5e-4, 4e-3);
    let recorded: Vec<f64> = (0..=4000).map(|k| f64::from(k) * 2e-5).collect();
    let back: Vec<f64> = (1..=4000).map(|k| 0.08 - f64::from(k) * 2e-5).collect();
    let response = elasto_slip(&[recorded, back].concat(), height, distance);
    assert!((response[4000] + 2.5e-4).abs() < 1e-6, "fully built up");
    // At distance s after the reversal, 63 % of the full height is reached.
    let after = response[4200] - response[4000];
    assert!((after / 5e-4 - (1.0 - (-1.0_f64).exp())).abs() < 0.01, "{after}");
    assert!((response[8000] - 2.5e-4).abs() < 1e-6);
    // A small excursion and back: the state before it is remembered.
    let mut q = 0.08;
    let mut way: Vec<f64> = (0..=4000).map(|k| f64::from(k) * 2e-5).collect();
    for n in 0..800 {
        q += if n < 400 { -1e-5 } else { 1e-5 };
        way.push(q);
    }
    let response = elasto_slip(&way, height, distance);
    assert!((response[4800] - response[4000]).abs() < 1e-9, "return point memory");
}

#[test]
fn settled_play_takes_the_side_it_came_from() {
    let scene = scene(true);
    for (row, angle) in scene.rows.iter().zip(angles(&scene, &effect(Kind::Backlash, &[6e-4]))) {
        assert!((angle + 3e-4 * row.approach[1]).abs() < 1e-15);
    }
}

#[test]
fn a_gear_error_repeats_with_its_order_but_for_small_sidebands() {
    let x = [2e-4, 2.0, 0.4];
    for k in 0..50 {
        let q = f64::from(k) * 0.07;
        let once = transmission_error(&x, q);
        assert!((once - transmission_error(&x, q + std::f64::consts::TAU)).abs() < 1e-15);
        assert!(
            (once - transmission_error(&x, q + std::f64::consts::PI)).abs() < 4.1 * SIDEBAND * 2e-4
        );
    }
}

#[test]
fn a_slow_core_ends_where_the_air_is_and_lags_on_the_way() {
    let mut scene = scene(true);
    for (k, row) in scene.rows.iter_mut().enumerate() {
        (row.t_s, row.ambient_c) = (30.0 * k as f64, if k == 0 { 20.0 } else { 30.0 });
    }
    let response = angles(&scene, &effect(Kind::ThermalZeroLag, &[1e-5, 300.0]));
    assert!((response[10] / 1e-4 - (1.0 - (-1.0_f64).exp())).abs() < 0.03, "{}", response[10]);
    assert!((response[59] / 1e-4 - 1.0).abs() < 0.01);
}

#[test]
fn a_mode_shaken_slowly_bends_as_inertia_over_stiffness() {
    let scene = scene(false);
    let law = effect(Kind::FlexibleMode, &[1.0, 25.0, 0.1]);
    let run = Run::new(&scene, &[]);
    let (mut sum, mut error) = (0.0, 0.0);
    for (fine, response) in
        run.fine_motion.iter().zip(run.fine_motion.iter().map(|fine| modal_response(fine, &law)))
    {
        for k in &fine.row_index {
            let quasi = -fine.rates(1, *k).1 / (std::f64::consts::TAU * 25.0).powi(2);
            sum += quasi * quasi;
            error += (response[*k] - quasi).powi(2);
        }
    }
    assert!(sum > 0.0 && error < 0.01 * sum, "{error} of {sum}");
}

#[test]
fn a_spike_is_silent_until_the_first_reversal_and_points_against_the_new_motion() {
    let scene = scene(false);
    let law = effect(Kind::ReversalSpike, &[3e-4, 0.06]);
    for (fine, _) in Run::new(&scene, &[]).fine_motion.iter().zip(0..) {
        let response = reversal_spike(fine, &law);
        let q: Vec<f64> = fine.row_index.iter().map(|k| fine.q[1][*k]).collect();
        let turn = (2..q.len()).find(|k| (q[*k] - q[k - 1]) * (q[k - 1] - q[k - 2]) < 0.0);
        let turn = turn.expect("it turns");
        assert!(response[..turn].iter().all(|x| *x == 0.0));
        assert!(response[turn] * (q[turn] - q[turn - 1]) < 0.0);
    }
}

#[test]
fn every_kind_moves_something_and_none_of_zero_does() {
    for settled in [false, true] {
        let scene = scene(settled);
        let soft = Effect { parameters: vec![1e-6], ..effect(Kind::JointCompliance, &[]) };
        let still =
            Run::new(&scene, std::slice::from_ref(&soft)).deviations(std::slice::from_ref(&soft));
        for kind in Kind::DICTIONARY.iter().chain(&Kind::OUTSIDE).copied() {
            if settled && kind.needs(crate::kinds::Requirement::Path) {
                continue;
            }
            let parameters: Vec<f64> = (0..kind.count()).map(|k| 1e-3 * (1.0 + k as f64)).collect();
            let one = effect(kind, &parameters);
            for (law, moves) in [(one.clone(), true), (one.scaled(0.0), false)] {
                let both = [soft.clone(), law];
                let run = Run::new(&scene, &both);
                let moved = run.deviations(&both) != still
                    || run.motor_positions() != Run::new(&scene, &[]).motor_positions();
                assert_eq!(moved, moves, "{kind:?}");
            }
        }
    }
}
