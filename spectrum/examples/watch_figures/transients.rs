//! Events that must not raise an alarm: entries, exits, shocks, ramps, changes of speed.

use crate::rig::{Colour, Rig};
use spectrum::{ConfigError, State};
use std::f64::consts::TAU;

const TRIALS: usize = 300;

type Signal = Box<dyn Fn(usize, f64) -> f64>;

/// A rise from 0 to 1 over `rise_s`, as a smooth half cosine.
fn rise(t: f64, rise_s: f64) -> f64 {
    let x = (t / rise_s).clamp(0.0, 1.0);
    0.5 - 0.5 * (std::f64::consts::PI * x).cos()
}

/// A half sine of `width_s`.
fn shock(t: f64, width_s: f64) -> f64 {
    if (0.0..width_s).contains(&t) { (std::f64::consts::PI * t / width_s).sin() } else { 0.0 }
}

fn step(rig: &mut Rig) -> Signal {
    let (newton, rise_s) = (rig.uniform(20.0, 200.0), rig.uniform(0.001, 0.02));
    let share = [1.0, rig.uniform(-1.0, 1.0), rig.uniform(-1.0, 1.0)];
    Box::new(move |c, t| newton * share[c] * rise(t - 0.3, rise_s))
}

fn entry_and_exit(rig: &mut Rig) -> Signal {
    let entry = step(rig);
    let (stay_s, fall_s) = (rig.uniform(0.03, 0.6), rig.uniform(0.001, 0.02));
    Box::new(move |c, t| entry(c, t) * (1.0 - rise(t - 0.3 - stay_s, fall_s)))
}

fn single_shock(rig: &mut Rig) -> Signal {
    let (newton, width_s) = (rig.uniform(20.0, 200.0), rig.uniform(0.001, 0.01));
    Box::new(move |c, t| newton / (c + 1) as f64 * shock(t - 0.3, width_s))
}

fn three_shocks(rig: &mut Rig) -> Signal {
    let (newton, width_s) = (rig.uniform(20.0, 200.0), rig.uniform(0.001, 0.01));
    let (a, b) = (rig.uniform(0.04, 0.2), rig.uniform(0.04, 0.2));
    let times_s = [0.3, 0.3 + a, 0.3 + a + b];
    Box::new(move |c, t| {
        newton / (c + 1) as f64
            * times_s.iter().map(|start_s| shock(t - start_s, width_s)).sum::<f64>()
    })
}

/// A shock that a mode of the robot answers by ringing down.
fn ring_down(rig: &mut Rig) -> Signal {
    let (newton, f) = (rig.uniform(5.0, 50.0), rig.uniform(20.0, 120.0));
    let damping = rig.uniform(0.02, 0.06);
    Box::new(move |c, t| {
        let s = (t - 0.3).max(0.0);
        newton / (c + 1) as f64 * (-damping * TAU * f * s).exp() * (TAU * f * s).sin()
    })
}

fn ramp(rig: &mut Rig) -> Signal {
    let (newton_per_s, length_s) = (rig.uniform(20.0, 1000.0), rig.uniform(0.1, 1.0));
    Box::new(move |c, t| newton_per_s / (c + 1) as f64 * (t - 0.3).clamp(0.0, length_s))
}

struct Count {
    warned: usize,
    alarmed: usize,
}

fn count(rate_hz: f64, seed: u64, kind: fn(&mut Rig) -> Signal) -> Result<Count, ConfigError> {
    let mut rig = Rig::new(rate_hz, 1.0, Colour::White, seed)?;
    rig.spindle(28_000.0);
    rig.run(4.0, |_, _| 0.0, |_, _| {});
    let mut count = Count { warned: 0, alarmed: 0 };
    for _ in 0..TRIALS {
        let signal = kind(&mut rig);
        let (mut warned, mut alarmed) = (false, false);
        rig.run(1.5, &signal, |_, v| {
            warned |= v.state == State::Warn;
            alarmed |= matches!(v.state, State::Alarm | State::Confirmed);
        });
        // Back to where it began, slowly, and quiet again.
        let end: Vec<f64> = (0..3).map(|c| signal(c, 1.5)).collect();
        rig.run(2.0, |c, t| end[c] * (1.0 - rise(t, 1.0)), |_, _| {});
        count.warned += usize::from(warned);
        count.alarmed += usize::from(alarmed);
    }
    Ok(count)
}

/// The spindle changes its speed; its lines move along, and the speed is reported every 20 ms.
fn speed_changes(rate_hz: f64, seed: u64) -> Result<(Count, usize), ConfigError> {
    let mut rig = Rig::new(rate_hz, 1.0, Colour::White, seed)?;
    let mut rpm = 28_000.0;
    let mut phase = 0.0;
    rig.spindle(rpm);
    rig.run(4.0, |_, _| 0.0, |_, _| {});
    let mut count = Count { warned: 0, alarmed: 0 };
    let mut forced = 0;
    for trial in 0..TRIALS {
        let goal = rig.uniform(3000.0, 30_000.0);
        let seconds = rig.uniform(0.2, 2.0);
        let (runout, tooth) = (rig.uniform(1.0, 10.0), rig.uniform(5.0, 40.0));
        let (mut alarmed, mut warned) = (false, false);
        let steps = (seconds / 0.02) as usize + 50;
        let slope = (goal - rpm) / seconds / 60.0;
        for k in 0..steps {
            let moving = (k as f64) * 0.02 < seconds;
            let (hz, slope) = (rpm / 60.0, if moving { slope } else { 0.0 });
            let turns = move |t: f64| phase + hz * t + 0.5 * slope * t * t;
            let signal = |c: usize, t: f64| {
                let turn = TAU * turns(t) + c as f64;
                runout * turn.sin() + tooth * (2.0 * turn).sin()
            };
            rig.run(0.02, signal, |_, v| {
                let is_forced = v.class == spectrum::Class::Forced;
                forced += usize::from(is_forced && trial > 0);
                let counts = trial > 0 && !is_forced;
                warned |= counts && v.state == State::Warn;
                alarmed |= counts && matches!(v.state, State::Alarm | State::Confirmed);
            });
            phase = turns(0.02).fract();
            rpm += slope * 0.02 * 60.0;
            rig.spindle(rpm);
        }
        count.warned += usize::from(warned);
        count.alarmed += usize::from(alarmed);
    }
    Ok((count, forced))
}

pub(crate) fn table(seed: u64) -> Result<String, ConfigError> {
    type Kind = (&'static str, fn(&mut Rig) -> Signal);
    let kinds: [Kind; 6] = [
        ("step", step),
        ("entry_and_exit", entry_and_exit),
        ("single_shock", single_shock),
        ("three_shocks", three_shocks),
        ("ring_down", ring_down),
        ("ramp", ramp),
    ];
    let mut rows = Vec::new();
    for rate_hz in [1000.0, 10_000.0] {
        for (name, kind) in kinds {
            let Count { warned, alarmed } = count(rate_hz, seed, kind)?;
            rows.push(format!(
                "{{\"rate_Hz\": {rate_hz}, \"kind\": \"{name}\", \"trials\": {TRIALS}, \"warned\": {warned}, \"alarmed\": {alarmed}}}"
            ));
        }
    }
    let (Count { warned, alarmed }, forced) = speed_changes(10_000.0, seed)?;
    rows.push(format!(
        "{{\"rate_Hz\": 10000, \"kind\": \"speed_change\", \"trials\": {TRIALS}, \"warned_not_forced\": {warned}, \
         \"alarmed_not_forced\": {alarmed}, \"verdicts_forced\": {forced}}}"
    ));
    Ok(format!("[\n    {}]", rows.join(",\n    ")))
}
