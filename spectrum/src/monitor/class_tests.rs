//! Classes of lines found by the monitor.

use super::tests::{Rig, config, tone_y};
use super::*;
use crate::config::GearFrequency;
use crate::verdict::{Advice, Class, State, Verdict};
use std::f64::consts::TAU;

fn spindle(rpm: f64) -> ProcessState {
    ProcessState { spindle_rpm: rpm, teeth: 2, in_cut: Some(true), ..ProcessState::default() }
}

fn last(events: &[(f64, Verdict)]) -> Verdict {
    events.last().expect("something is said").1
}

#[test]
fn the_tooth_passing_folded_onto_the_67_hz_mode_is_a_suspect_alias_and_no_chatter() {
    for start_s in [0.0, 2.0] {
        let mut rig = Rig::new(config(1000.0), 1.0, 11);
        rig.watch.set_process_state(spindle(28_000.0));
        let events = rig.run(4.0, tone_y(28_000.0 / 30.0, 5.0, start_s));
        let verdict = last(&events);
        assert!((verdict.frequency_hz - 66.67).abs() < 0.3, "{verdict:?}");
        assert!(verdict.suspect_alias && verdict.class == Class::Forced, "{verdict:?}");
        assert_eq!(verdict.alias.map(|alias| alias.order), Some(2));
        assert_eq!(verdict.advice, Advice::SampleFaster);
        assert!(events.iter().all(|(_, v)| v.class != Class::Chatter), "{events:?}");
    }
}

#[test]
fn ringing_at_72_hz_in_the_cut_is_chatter_and_speed_does_not_help() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 12);
    rig.watch.set_process_state(spindle(28_000.0));
    let tooth = |t: f64| 20.0 * (TAU * 28_000.0 / 30.0 * t).sin();
    rig.run(2.0, |_, t| tooth(t));
    let ring = tone_y(72.0, 6.0, 2.0);
    let events = rig.run(2.0, |c, t| tooth(t) + ring(c, t));
    let alarm = events.iter().find(|(_, v)| v.state == State::Alarm).expect("an alarm");
    assert!((2.0..2.12).contains(&alarm.0), "{}", alarm.0);
    let verdict = last(&events);
    assert_eq!((verdict.class, verdict.state), (Class::Chatter, State::Confirmed));
    assert_eq!(verdict.mode.map(|mode| mode.frequency_hz), Some(72.0));
    assert!(!verdict.suspect_alias && verdict.advice == Advice::ChangeCut);
    assert!((verdict.amplitude_n - 6.0).abs() < 0.4, "{}", verdict.amplitude_n);
    assert!(events.iter().all(|(_, v)| v.class != Class::Forced || v.state == State::Warn));
}

#[test]
fn a_force_that_runs_round_an_ellipse_at_two_close_modes_is_mode_coupling() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 13);
    rig.watch.set_process_state(spindle(28_000.0));
    rig.run(2.0, |_, _| 0.0);
    let events = rig.run(2.0, |c, t| match c {
        0 => 4.0 * (TAU * 68.5 * t).cos(),
        1 => 5.0 * (TAU * 68.5 * t).sin(),
        _ => 0.0,
    });
    let verdict = last(&events);
    assert_eq!((verdict.class, verdict.advice), (Class::ModeCoupling, Advice::ChangeCut));
    let along_a_line = |c: usize, t: f64| if c < 2 { 4.0 * (TAU * 68.5 * t).cos() } else { 0.0 };
    let mut rig = Rig::new(config(10_000.0), 1.0, 14);
    rig.watch.set_process_state(spindle(28_000.0));
    rig.run(2.0, |_, _| 0.0);
    assert_eq!(last(&rig.run(2.0, along_a_line)).class, Class::Chatter);
}

#[test]
fn runout_far_from_a_mode_is_forced_and_stays_a_warning() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 15);
    rig.watch.set_process_state(spindle(15_000.0));
    rig.run(2.0, |_, _| 0.0);
    let events = rig.run(2.0, tone_y(250.0, 10.0, 0.0));
    assert!(!events.is_empty());
    assert!(events.iter().all(|(_, v)| v.class == Class::Forced && v.state == State::Warn));
    assert_eq!(last(&events).harmonic.map(|harmonic| harmonic.order), Some(1));
}

#[test]
fn a_tooth_harmonic_on_a_mode_alarms_with_a_speed_that_moves_it_off() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 16);
    rig.watch.set_process_state(spindle(2100.0));
    rig.run(2.0, |_, _| 0.0);
    let verdict = last(&rig.run(2.0, tone_y(70.0, 10.0, 2.0)));
    assert_eq!((verdict.class, verdict.state), (Class::Forced, State::Confirmed));
    assert!(matches!(verdict.advice, Advice::MoveOffMode { .. }), "{:?}", verdict.advice);
}

#[test]
fn a_chatter_is_followed_beside_ten_multiples_of_a_slow_spindle() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 26);
    rig.watch.set_process_state(spindle(3000.0));
    let events = rig.run(3.0, |channel, t| {
        let teeth: f64 = (1..=10).map(|k| (TAU * 50.0 * f64::from(k) * (t - 1.0)).sin()).sum();
        let chatter = (TAU * 675.0 * t).sin();
        match channel {
            1 if t > 1.5 => 20.0 * teeth + 20.0 * chatter,
            1 if t > 1.0 => 20.0 * teeth,
            _ => 0.0,
        }
    });
    let alarms = |v: &Verdict| v.state == State::Alarm && (v.frequency_hz - 675.0).abs() < 5.0;
    let (at_s, _) = events.iter().find(|(_, v)| alarms(v)).expect("the chatter alarms");
    assert!((1.5..1.9).contains(at_s), "{at_s}");
}

#[test]
fn a_chatter_between_two_multiples_of_a_slow_spindle_alarms_by_its_own_frequency() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 27);
    rig.watch.set_process_state(spindle(2016.0));
    let events = rig.run(2.5, |channel, t| {
        let teeth: f64 = (1..=6).map(|k| (TAU * 33.6 * f64::from(k) * (t - 1.0)).sin()).sum();
        let chatter = (TAU * 81.0 * t).sin();
        match channel {
            1 if t > 1.4 => 40.0 * teeth + 25.0 * chatter,
            1 if t > 1.0 => 40.0 * teeth,
            _ => 0.0,
        }
    });
    let alarms = |v: &Verdict| v.state == State::Alarm && v.class != Class::Forced;
    let (at_s, first) = events.iter().find(|(_, v)| alarms(v)).expect("the chatter alarms");
    assert!((first.frequency_hz - 81.0).abs() < 3.0, "{} Hz", first.frequency_hz);
    assert!((1.4..1.8).contains(at_s), "{at_s}");
}

#[test]
fn a_mains_hum_from_the_start_is_electrical_and_no_alarm() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 17);
    let events = rig.run(4.0, tone_y(150.0, 6.0, 0.0));
    assert!(events.iter().all(|(_, v)| v.state == State::Warn), "{events:?}");
    let verdict = last(&events);
    assert_eq!((verdict.class, verdict.advice), (Class::Electrical, Advice::CheckWiring));
}

#[test]
fn a_line_that_is_there_in_air_is_structural() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 18);
    rig.watch.set_process_state(ProcessState { in_cut: Some(false), ..spindle(28_000.0) });
    let events = rig.run(9.0, tone_y(13.0, 6.0, 6.0));
    let verdict = last(&events);
    assert_eq!(verdict.class, Class::Structural);
}

#[test]
fn a_line_that_arises_in_air_after_a_cut_never_alarms_as_chatter() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 24);
    let state = |in_cut| ProcessState { in_cut: Some(in_cut), ..spindle(28_000.0) };
    rig.watch.set_process_state(state(false));
    rig.run(1.5, |_, _| 0.0);
    rig.watch.set_process_state(state(true));
    rig.run(2.0, |_, _| 0.0);
    rig.watch.set_process_state(state(false));
    rig.run(0.3, |_, _| 0.0);
    let events = rig.run(1.0, tone_y(72.0, 10.0, 4.0));
    assert!(!events.is_empty() && events.iter().all(|(_, v)| v.state == State::Warn), "{events:?}");
}

#[test]
fn a_line_that_follows_the_feed_is_a_gears_and_at_one_feed_both_are_reported() {
    // Eleven teeth of a motor that turns 8.02° per mm: only at this feed of a robot that handles do they reach the band.
    let cycles_per_mm = 11.0 * 8.02 / 360.0;
    let gears = vec![GearFrequency { joint: 3, shaft: 1, teeth: 11, cycles_per_mm }];
    let with_wheels = MonitorConfig { gear_frequencies: gears, ..config(10_000.0) };
    let mut rig = Rig::new(with_wheels, 1.0, 19);
    let at_feed = |feed_mm_s: f64| ProcessState { feed_mm_s, ..spindle(28_000.0) };
    rig.watch.set_process_state(at_feed(160.0));
    rig.run(2.0, |_, _| 0.0);
    let events = rig.run(2.0, tone_y(cycles_per_mm * 160.0, 6.0, 2.0));
    let (class, rivals) = (last(&events).class, last(&events).alternatives);
    assert!(class == Class::Gear && rivals.contains(Class::Chatter), "{class:?} {rivals:?}");
    rig.watch.set_process_state(at_feed(208.0));
    let events = rig.run(2.0, tone_y(cycles_per_mm * 208.0, 6.0, 4.0));
    let gear: Vec<_> = events.iter().filter(|(_, v)| (v.frequency_hz - 51.0).abs() < 1.0).collect();
    let verdict = gear.last().expect("the moved line is seen").1;
    assert_eq!(verdict.class, Class::Gear);
    assert!(verdict.alternatives.is_empty(), "{:?}", verdict.alternatives);
    assert_eq!(verdict.advice, Advice::CheckGear { joint: 3, shaft: 1 });
}

#[test]
fn a_gear_is_a_rival_only_where_teeth_can_meet_so_often_per_millimetre() {
    let rivals = |line_hz: f64| {
        let mut rig = Rig::new(config(10_000.0), 1.0, 23);
        rig.watch.set_process_state(ProcessState { feed_mm_s: 10.0, ..spindle(28_000.0) });
        rig.run(2.0, |_, _| 0.0);
        last(&rig.run(2.0, tone_y(line_hz, 6.0, 2.0))).alternatives
    };
    // At 10 mm/s: 4.1 and 8.9 per mm (decision 0010).
    assert!(rivals(41.0).contains(Class::Gear));
    assert!(!rivals(89.0).contains(Class::Gear));
}

#[test]
fn growth_is_told() {
    let mut rig = Rig::new(config(10_000.0), 1.0, 20);
    rig.watch.set_process_state(spindle(28_000.0));
    rig.run(2.0, |_, _| 0.0);
    let growing = |c: usize, t: f64| {
        if c == 1 { 0.5 * (4.0 * (t - 2.0)).exp() * (TAU * 72.0 * t).sin() } else { 0.0 }
    };
    let verdict = last(&rig.run(1.2, growing));
    assert!((verdict.growth_per_s - 4.0).abs() < 1.5, "{verdict:?}");
}
