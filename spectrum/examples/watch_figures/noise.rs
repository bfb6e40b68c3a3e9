//! Hours of noise without vibration: every verdict is a false alarm.

use crate::rig::{CHANNELS, Colour, Rig};
use spectrum::{ConfigError, State};

const COLOURS: [(&str, Colour); 3] = [
    ("white", Colour::White),
    ("red_30_Hz", Colour::Red(30.0)),
    ("resonant_67_Hz_damping_0.03", Colour::Resonant(67.0, 0.03)),
];
/// Number of starts, and duration of each.
const STARTS: u64 = 500;
const START_S: f64 = 5.0;

pub(crate) fn table(seed: u64, hours: f64) -> Result<String, ConfigError> {
    let mut rows = Vec::new();
    for (rate_hz, hours) in [(1000.0, hours), (10_000.0, 0.1 * hours)] {
        for (name, colour) in COLOURS {
            let mut rig = Rig::new(rate_hz, 1.0, colour, seed)?;
            let (mut warned, mut alarmed) = (0, 0);
            rig.run(
                3600.0 * hours,
                |_, _| 0.0,
                |_, v| {
                    warned += usize::from(v.state == State::Warn);
                    alarmed += usize::from(v.state == State::Alarm);
                },
            );
            rows.push(format!(
                "{{\"rate_Hz\": {rate_hz}, \"noise\": \"{name}\", \"hours_per_axis\": {hours}, \"axes\": {CHANNELS}, \
                 \"warned\": {warned}, \"alarmed\": {alarmed}}}"
            ));
        }
    }
    Ok(format!("[\n    {}]", rows.join(",\n    ")))
}

/// The same over many starts.
pub(crate) fn starts_table(seed: u64) -> Result<String, ConfigError> {
    let rows: Result<Vec<String>, ConfigError> =
        COLOURS.iter().map(|(name, colour)| starts(name, *colour, seed)).collect();
    Ok(format!("[\n    {}]", rows?.join(",\n    ")))
}

/// The first seconds after a start, when the floor is estimated from few frames.
fn starts(name: &str, colour: Colour, seed: u64) -> Result<String, ConfigError> {
    let (mut warned, mut alarmed) = (0, 0);
    for start in 0..STARTS {
        let mut rig = Rig::new(1000.0, 1.0, colour, seed + 1000 + start)?;
        rig.run(
            START_S,
            |_, _| 0.0,
            |_, v| {
                warned += usize::from(v.state == State::Warn);
                alarmed += usize::from(v.state == State::Alarm);
            },
        );
    }
    Ok(format!(
        "{{\"rate_Hz\": 1000, \"noise\": \"{name}\", \"starts\": {STARTS}, \"seconds\": {START_S}, \"axes\": {CHANNELS}, \"warned\": {warned}, \"alarmed\": {alarmed}}}"
    ))
}
