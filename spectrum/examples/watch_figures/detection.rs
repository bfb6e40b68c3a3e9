//! Time until a tone in noise is reported.

use crate::rig::{Colour, Rig, json, quantile};
use spectrum::{ConfigError, State};
use std::f64::consts::TAU;

const TRIALS: usize = 200;

/// Times of the reports, ms after the start of each tone; infinite if not reported.
pub(crate) struct Times {
    pub(crate) warn_ms: Vec<f64>,
    pub(crate) alarm_ms: Vec<f64>,
    false_before: usize,
    error_hz: Vec<f64>,
}

/// Tones of 60 to 120 Hz on channel y, random phase and start, a second each. The noise has rms 1.
pub(crate) fn trials(mut rig: Rig, over_noise: f64, trials: usize) -> Times {
    rig.run(3.0, |_, _| 0.0, |_, _| {});
    let mut times = Times { warn_ms: vec![], alarm_ms: vec![], false_before: 0, error_hz: vec![] };
    for _ in 0..trials {
        let pause = rig.uniform(1.8, 2.0);
        let mut false_before = 0;
        rig.run(
            pause,
            |_, _| 0.0,
            |at_s, v| {
                false_before += usize::from(at_s > 1.2 && v.state != State::Over);
            },
        );
        times.false_before += false_before;
        let (f, phase) = (rig.uniform(60.0, 120.0), rig.uniform(0.0, TAU));
        let (mut warn, mut alarm, mut last_hz) = (f64::INFINITY, f64::INFINITY, f64::NAN);
        let tone = |channel: usize, t: f64| {
            if channel == 1 { over_noise * (TAU * f * t + phase).sin() } else { 0.0 }
        };
        rig.run(1.0, tone, |at_s, v| {
            if (v.frequency_hz - f).abs() < 25.0 && v.state != State::Over {
                warn = warn.min(at_s);
                last_hz = v.frequency_hz;
                if v.state >= State::Alarm {
                    alarm = alarm.min(at_s);
                }
            }
        });
        times.warn_ms.push(1e3 * warn);
        times.alarm_ms.push(1e3 * alarm);
        times.error_hz.push((last_hz - f).abs());
    }
    times
}

pub(crate) fn table(seed: u64) -> Result<String, ConfigError> {
    let mut rows = Vec::new();
    for (rate_hz, rpm) in [(1000.0, 0.0), (10_000.0, 28_000.0), (51_200.0, 28_000.0)] {
        for over_noise in [4.0, 2.0, 1.0] {
            if rate_hz > 20_000.0 && over_noise < 2.0 {
                continue;
            }
            let mut rig = Rig::new(rate_hz, 1.0, Colour::White, seed)?;
            rig.spindle(rpm);
            let mut t = trials(rig, over_noise, TRIALS);
            let mut row = format!(
                "{{\"rate_Hz\": {rate_hz}, \"rpm\": {rpm}, \"amplitude_over_noise\": {over_noise}, \"trials\": {TRIALS}"
            );
            for (name, values) in [
                ("warn_ms", &mut t.warn_ms),
                ("alarm_ms", &mut t.alarm_ms),
                ("last_frequency_error_Hz", &mut t.error_hz),
            ] {
                let (p50, p95) = (quantile(values, 0.5), quantile(values, 0.95));
                row += &format!(", \"{name}\": {{\"p50\": {}, \"p95\": {}}}", json(p50), json(p95));
            }
            rows.push(format!("{row}, \"false_before\": {}}}", t.false_before));
        }
    }
    Ok(format!("[\n    {}]", rows.join(",\n    ")))
}
