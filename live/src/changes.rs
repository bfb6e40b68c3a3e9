//! Changes of a cell's state, as lines for a list of events.

use crate::report::Report;

/// The values that are compared between two statuses.
#[derive(Clone, Debug, PartialEq)]
struct State {
    health: &'static str,
    mode: &'static str,
    bypassed: bool,
    wrench_gate: &'static str,
    recorder: &'static str,
    model_epoch: u64,
}

/// The state at the last status.
#[derive(Debug, Default)]
pub(crate) struct Changes {
    last: Option<State>,
}

impl Changes {
    /// The changes since the last status; empty for the first one.
    pub(crate) fn since_last(&mut self, report: &Report) -> Vec<String> {
        let now = State {
            health: if report.away.is_some() { "no daemon" } else { report.health },
            mode: report.mode,
            bypassed: report.bypassed,
            wrench_gate: report.force.wrench_gate,
            recorder: report.recorder,
            model_epoch: report.model.epoch,
        };
        let Some(last) = self.last.replace(now.clone()) else { return Vec::new() };
        let why = report.away.as_deref().unwrap_or(&report.message);
        let bypass = if now.bypassed { "bypassed" } else { "bypass ended" };
        let all = [
            (now.health != last.health, format!("{} -> {}: {why}", last.health, now.health)),
            (now.mode != last.mode, format!("mode {} -> {}", last.mode, now.mode)),
            (now.bypassed != last.bypassed, bypass.to_owned()),
            (now.wrench_gate != last.wrench_gate, format!("wrench gate {}", now.wrench_gate)),
            (now.recorder != last.recorder, format!("recorder {}", now.recorder)),
            (now.model_epoch != last.model_epoch, format!("model {} in use", now.model_epoch)),
        ];
        all.into_iter().filter(|(changed, _)| *changed).map(|(_, text)| text).collect()
    }
}
