//! Statistics over a period, alarms and changes from the statuses and verdicts of a daemon. No clock, no network.

use std::collections::BTreeMap;

use live::report::Report;
use trued_client::{
    Health, JOINTS_MAX, RecorderState, Status, Verdict, VibrationClass, VibrationState,
    channel_name,
};

use crate::message::{Alarm, CellHealth, CorrectionStatistics, Event};

/// Vibrations that are followed at once; more than a daemon reports.
const VIBRATIONS_MAX: usize = 64;

/// Sums of the correction over a period.
#[derive(Debug, Clone, Default)]
pub struct Accumulator {
    statuses: u64,
    joints: usize,
    squares: [f64; JOINTS_MAX],
    largest: [f64; JOINTS_MAX],
    largest_share: f64,
}

impl Accumulator {
    /// Adds a status.
    pub fn add(&mut self, status: &Status) {
        self.statuses += 1;
        self.joints = self.joints.max((status.joints as usize).min(JOINTS_MAX));
        for k in 0..self.joints {
            let correction = status.correction[k].abs();
            self.squares[k] += correction * correction;
            self.largest[k] = self.largest[k].max(correction);
            let limit = status.bounds.angle[k];
            if limit > 0.0 {
                self.largest_share = self.largest_share.max(correction / limit);
            }
        }
    }

    /// The statistics, and begins anew.
    pub fn take(&mut self) -> CorrectionStatistics {
        let sums = std::mem::take(self);
        let count = sums.statuses.max(1) as f64;
        CorrectionStatistics {
            statuses: sums.statuses,
            rms: sums.squares[..sums.joints].iter().map(|sum| (sum / count).sqrt()).collect(),
            largest: sums.largest[..sums.joints].to_vec(),
            largest_share: sums.largest_share,
        }
    }
}

/// Alarms of a cell; `away`: its daemon does not respond.
#[must_use]
pub fn alarms(status: Option<&Status>, away: bool) -> Vec<Alarm> {
    let mut alarms = Vec::new();
    if away {
        alarms.push(Alarm::DaemonAway);
    }
    let Some(status) = status.filter(|_| !away) else { return alarms };
    let recorder = status.recorder.try_into();
    let vibration = status.verdict.state();
    let is = [
        (Alarm::Fault, status.health() == Ok(Health::Fault)),
        (Alarm::Degraded, status.health() == Ok(Health::Degraded)),
        (
            Alarm::Vibration,
            matches!(vibration, Ok(VibrationState::Alarm | VibrationState::Confirmed)),
        ),
        (Alarm::ModelContradicted, status.model_broken_since_ns != 0),
        (Alarm::ForceFault, status.force_faults().next().is_some()),
        (Alarm::Recorder, matches!(recorder, Ok(RecorderState::Dropping | RecorderState::Failed))),
    ];
    alarms.extend(is.into_iter().filter(|(_, is)| *is).map(|(alarm, _)| alarm));
    alarms
}

/// The health of a cell as published.
#[must_use]
pub fn health(report: Option<&Report>, away: Option<&str>) -> CellHealth {
    let message = report.map_or("", |report| report.message.as_str());
    CellHealth {
        health: report.map(|report| report.health),
        mode: report.map(|report| report.mode),
        bypassed: report.is_some_and(|report| report.bypassed),
        away: away.map(str::to_owned),
        message: away.unwrap_or(message).to_owned(),
    }
}

/// Last published state of a cell, so that only changes become events.
#[derive(Debug, Default)]
pub struct Changes {
    alarms: Vec<Alarm>,
    model_hash: Option<String>,
    vibrations: BTreeMap<u64, (u32, u32)>,
    health: Option<CellHealth>,
}

impl Changes {
    /// Events of alarms and of the model.
    pub fn events(&mut self, alarms: &[Alarm], model_hash: Option<&str>) -> Vec<Event> {
        let mut events = Vec::new();
        let former = std::mem::replace(&mut self.alarms, alarms.to_vec());
        let cleared = former.iter().filter(|alarm| !alarms.contains(alarm));
        events.extend(cleared.map(|&alarm| Event::AlarmCleared { alarm }));
        let raised = alarms.iter().filter(|alarm| !former.contains(alarm));
        events.extend(raised.map(|&alarm| Event::AlarmRaised { alarm }));
        if let Some(to) = model_hash.filter(|hash| self.model_hash.as_deref() != Some(hash)) {
            let former = self.model_hash.replace(to.to_owned());
            events.extend(former.map(|from| Event::ModelChanged { from, to: to.to_owned() }));
        }
        events
    }

    /// The health, if it differs from the last published one. A different message alone does not count, because messages may contain figures; the summary has the present one.
    pub fn health(&mut self, health: CellHealth) -> Option<CellHealth> {
        let last = self.health.as_ref();
        let message = health.message.clone();
        if last.is_some_and(|last| CellHealth { message, ..last.clone() } == health) {
            return None;
        }
        self.health = Some(health.clone());
        Some(health)
    }

    /// An event, if state or class of the vibration differ from the last published ones.
    pub fn vibration(&mut self, verdict: &Verdict) -> Option<Event> {
        let present = (verdict.state, verdict.class);
        if self.vibrations.insert(verdict.event, present) == Some(present) {
            return None;
        }
        let state = verdict.state();
        if state == Ok(VibrationState::Over) {
            self.vibrations.remove(&verdict.event);
        }
        if self.vibrations.len() > VIBRATIONS_MAX {
            self.vibrations.pop_first();
        }
        Some(Event::Vibration {
            vibration: verdict.event,
            state: state.map_or("unknown", VibrationState::name),
            class: verdict.class().map_or("unknown", VibrationClass::name),
            frequency_hz: verdict.frequency_hz,
            amplitude: verdict.amplitude,
            axis: channel_name(verdict.axis),
            sentence: verdict.to_string(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status() -> Status {
        let mut status = Status { joints: 2, health: Health::Running.code(), ..Status::default() };
        status.bounds.angle = [0.02; JOINTS_MAX];
        status
    }

    #[test]
    fn statistics_are_root_mean_square_and_largest_of_the_period_alone() {
        let mut sums = Accumulator::default();
        for correction in [0.003, -0.004] {
            let mut status = status();
            status.correction[1] = correction;
            sums.add(&status);
        }
        let statistics = sums.take();
        assert_eq!(statistics.statuses, 2);
        assert!((statistics.rms[1] - 12.5e-6_f64.sqrt()).abs() < 1e-12, "{statistics:?}");
        assert_eq!((statistics.largest[0], statistics.largest[1]), (0.0, 0.004));
        assert!((statistics.largest_share - 0.2).abs() < 1e-12);
        assert_eq!(sums.take(), CorrectionStatistics::default());
    }

    #[test]
    fn an_alarm_is_told_once_when_it_begins_and_once_when_it_ends() {
        let mut changes = Changes::default();
        let bad = Status { health: Health::Degraded.code(), ..status() };
        let events = changes.events(&alarms(Some(&bad), false), Some("a"));
        assert_eq!(events, [Event::AlarmRaised { alarm: Alarm::Degraded }]);
        assert_eq!(changes.events(&alarms(Some(&bad), false), Some("a")), []);
        let events = changes.events(&alarms(Some(&status()), true), Some("b"));
        let expected = [
            Event::AlarmCleared { alarm: Alarm::Degraded },
            Event::AlarmRaised { alarm: Alarm::DaemonAway },
            Event::ModelChanged { from: "a".to_owned(), to: "b".to_owned() },
        ];
        assert_eq!(events, expected);
    }

    #[test]
    fn a_vibration_is_told_when_it_changes_and_not_with_each_verdict() {
        let mut changes = Changes::default();
        let verdict =
            |state: VibrationState| Verdict { event: 7, state: state.code(), ..Verdict::default() };
        let is_event: Vec<bool> = [
            VibrationState::Warn,
            VibrationState::Warn,
            VibrationState::Alarm,
            VibrationState::Over,
            VibrationState::Warn,
        ]
        .map(|state| changes.vibration(&verdict(state)).is_some())
        .to_vec();
        assert_eq!(is_event, [true, false, true, true, true]);
    }
}
