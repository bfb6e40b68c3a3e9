//! The curve of detection against false alarms, over the monitor's threshold.

use crate::detection::trials;
use crate::rig::{CHANNELS, Colour, Rig};
use spectrum::{ConfigError, State};

const THRESHOLDS: [f64; 9] = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.15, 1.3];
const AMPLITUDES: [f64; 4] = [0.5, 0.7, 1.0, 1.4];
const TRIALS: usize = 200;
/// A tone reported later than this counts as missed, ms.
const WITHIN_MS: f64 = 500.0;
const RATE_HZ: f64 = 1000.0;

pub(crate) fn table(seed: u64, hours: f64) -> Result<String, ConfigError> {
    let rows: Result<Vec<String>, ConfigError> =
        THRESHOLDS.iter().map(|threshold| row(*threshold, seed, hours)).collect();
    Ok(format!("[\n    {}]", rows?.join(",\n    ")))
}

fn row(threshold: f64, seed: u64, hours: f64) -> Result<String, ConfigError> {
    let rig = |seed| Rig::with_threshold(RATE_HZ, 1.0, Colour::White, seed, threshold);
    let (mut warned, mut alarmed) = (0.0, 0.0);
    rig(seed)?.run(
        3600.0 * hours,
        |_, _| 0.0,
        |_, v| {
            warned += f64::from(u8::from(v.state == State::Warn));
            alarmed += f64::from(u8::from(v.state == State::Alarm));
        },
    );
    let axis_hours = hours * CHANNELS as f64;
    let mut found = Vec::new();
    for over_noise in AMPLITUDES {
        let times = trials(rig(seed + 17)?, over_noise, TRIALS);
        let share = |values: &[f64]| {
            values.iter().filter(|ms| **ms <= WITHIN_MS).count() as f64 / TRIALS as f64
        };
        found.push(format!(
            "{{\"amplitude_over_noise\": {over_noise}, \"warned\": {}, \"alarmed\": {}}}",
            share(&times.warn_ms),
            share(&times.alarm_ms)
        ));
    }
    Ok(format!(
        "{{\"threshold\": {threshold}, \"axis_hours\": {axis_hours}, \"false_warns_per_axis_hour\": {:.4}, \
         \"false_alarms_per_axis_hour\": {:.4}, \"within_ms\": {WITHIN_MS}, \"found\": [{}]}}",
        warned / axis_hours,
        alarmed / axis_hours,
        found.join(", ")
    ))
}
