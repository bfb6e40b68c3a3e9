//! Vibration events from their first warning to their end, assembled from the verdicts of the last five minutes.

use ::report::{Column, Table, fixed};

use crate::history::Event;

/// A vibration event.
#[derive(Debug)]
pub(super) struct VibrationEvent {
    event: u64,
    pub(super) from_ms: u64,
    /// End; `None` while the event lasts.
    pub(super) to_ms: Option<u64>,
    pub(super) low_hz: f64,
    pub(super) high_hz: f64,
    /// Its largest amplitude.
    amplitude: f64,
    channel: &'static str,
    /// Whether it exceeded a warning.
    pub(super) is_alarm: bool,
    /// Frequency and class.
    pub(super) name: String,
}

/// All events, in the order of their begin. An event that began before the history starts with its next verdict.
pub(super) fn from_events(events: &[Event], now_ms: u64) -> Vec<VibrationEvent> {
    let mut found: Vec<VibrationEvent> = Vec::new();
    for (event, line) in events.iter().filter_map(|event| Some((event, event.line?))) {
        let is_over = line.state == "over";
        let known = found.iter_mut().find(|one| one.event == line.event && one.to_ms.is_none());
        let one = match known {
            Some(known) => known,
            None if is_over => continue,
            None => {
                found.push(VibrationEvent {
                    event: line.event,
                    from_ms: event.t_ms.min(now_ms),
                    to_ms: None,
                    low_hz: line.frequency_hz,
                    high_hz: line.frequency_hz,
                    amplitude: 0.0,
                    channel: line.channel,
                    is_alarm: false,
                    name: String::new(),
                });
                let Some(new) = found.last_mut() else { continue };
                new
            }
        };
        if is_over {
            one.to_ms = Some(event.t_ms);
            continue;
        }
        (one.low_hz, one.high_hz) =
            (one.low_hz.min(line.frequency_hz), one.high_hz.max(line.frequency_hz));
        one.amplitude = one.amplitude.max(line.amplitude);
        one.is_alarm |= line.state != "warn";
        one.name = format!("{} Hz {}", fixed(line.frequency_hz, 0), line.class.replace('_', " "));
    }
    found
}

/// The events as a table, newest first.
pub(super) fn table(episodes: &[VibrationEvent], now_ms: u64) -> Table {
    let heads = [
        Column::new("Vibration"),
        Column::new("State"),
        Column::new("Largest amplitude (N, Nm)"),
        Column::new("Channel"),
        Column::new("Began (s ago)"),
        Column::new("Lasted (s)"),
    ];
    let seconds = |from_ms: u64, to_ms: u64| 1e-3 * to_ms.saturating_sub(from_ms) as f64;
    episodes.iter().rev().fold(Table::new("Vibration events", heads), |table, one| {
        let state = match (one.is_alarm, one.to_ms) {
            (true, None) => "alarm, lasts",
            (true, Some(_)) => "alarm, over",
            (false, None) => "warning, lasts",
            (false, Some(_)) => "warning, over",
        };
        table.row([
            one.name.as_str().into(),
            state.into(),
            one.amplitude.into(),
            one.channel.into(),
            seconds(one.from_ms, now_ms).into(),
            seconds(one.from_ms, one.to_ms.unwrap_or(now_ms)).into(),
        ])
    })
}
