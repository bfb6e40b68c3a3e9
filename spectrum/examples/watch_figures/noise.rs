//! Hours of noise in which nothing rings: every verdict is a false one.

use crate::rig::{CHANNELS, Colour, Rig};
use spectrum::{ConfigError, State};

pub(crate) fn table(seed: u64, hours: f64) -> Result<String, ConfigError> {
    let colours = [
        ("white", Colour::White),
        ("red_30_Hz", Colour::Red(30.0)),
        ("resonant_67_Hz_damping_0.03", Colour::Resonant(67.0, 0.03)),
    ];
    let mut rows = Vec::new();
    for (rate_hz, hours) in [(1000.0, hours), (10_000.0, 0.1 * hours)] {
        for (name, colour) in colours {
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
