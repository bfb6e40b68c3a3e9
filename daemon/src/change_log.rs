//! Changes of the daemon's state, for the log, at a readable rate.
//!
//! A change of health is logged with its reason; counted events (rejected commands, missed cycles,
//! losses) at the first occurrence and then as a total, at most every 10 s; a sensor's fault when
//! it begins and when it ends; a vibration event at its alarm, its confirmation and its end; a
//! model when it no longer holds. Not for real-time threads.

use crate::exchange::Exchange;
use crate::sender;
use crate::status::{feed_fault, trim_fault};
use crate::temperatures::place_names;
use crate::throttle::{CountThrottle, MessageBudget};
use shm_schema::{
    Answer, ForceFault, Health, Operation, Reason, Status, Verdict, VibrationState, WatchState,
};
use std::sync::atomic::Ordering::Relaxed;
use tracing::{debug, info, warn};

/// Counters that are logged: name, meaning, and whether they can occur in normal operation.
const COUNTED: [(&str, &str, bool); 7] = [
    ("missed_cycles", "a cycle exceeded its period", false),
    ("commands_lost", "commands were lost", false),
    ("corrected_lost", "targets could not be sent", false),
    ("malformed", "messages were invalid", false),
    ("force_gaps", "force blocks were lost", false),
    ("force_refused", "force blocks were rejected", false),
    ("recorder_dropped", "the recorder dropped records", false),
];

/// Reasons of answers that are counted and logged, in the same form. The others show in the
/// daemon's health, or need no message.
const REASONS: [(Reason, &str, bool); 10] = [
    (Reason::NotFinite, "a command contains a non-finite number", false),
    (Reason::OutOfLimits, "a commanded joint is outside the model's limits", false),
    (Reason::OutOfOrder, "a command is older than its predecessor", false),
    (Reason::Stale, "no fresh command: the correction ramps to zero", true),
    (Reason::Duplicate, "a command was received twice", false),
    (Reason::WrongJointCount, "a command has a different number of joints than the model", false),
    (Reason::NotConverged, "no correction could be computed for a command", false),
    (Reason::TimeJump, "the clock of the command timestamps jumped", false),
    (Reason::Malformed, "a command was invalid", false),
    (Reason::CommandJump, "a command exceeded the speed of the joints", false),
];

/// Messages on health in a burst, and interval of further ones, ns.
const HEALTH_BURST: u32 = 6;
const HEALTH_EVERY_NS: u64 = 2_000_000_000;
/// Likewise for requests.
const REQUEST_BURST: u32 = 20;
const REQUEST_EVERY_NS: u64 = 1_000_000_000;
/// A repeated request with the same answer is logged again after this time, ns.
const REQUEST_AGAIN_NS: u64 = 10_000_000_000;

/// Likewise for sensors.
const SENSOR_BURST: u32 = 30;
const SENSOR_EVERY_NS: u64 = 5_000_000_000;

/// States that were logged and still apply.
#[derive(Debug)]
pub struct ChangeLog {
    health: HealthLog,
    sensors: MessageBudget,
    counted: [CountThrottle; COUNTED.len()],
    reasons: [CountThrottle; REASONS.len()],
    faults: Vec<ForceFault>,
    stale_temperatures: u32,
    trim_fault: Option<&'static str>,
    feed_fault: Option<&'static str>,
    /// Vibration events with an alarm, and their last logged state.
    active_alarms: Vec<(u64, VibrationState)>,
    learning: bool,
    broken_since_ns: u64,
}

impl Default for ChangeLog {
    fn default() -> Self {
        Self {
            health: HealthLog::default(),
            sensors: MessageBudget::new(SENSOR_BURST, SENSOR_EVERY_NS),
            counted: Default::default(),
            reasons: Default::default(),
            faults: Vec::new(),
            stale_temperatures: 0,
            trim_fault: None,
            feed_fault: None,
            active_alarms: Vec::new(),
            learning: false,
            broken_since_ns: 0,
        }
    }
}

impl ChangeLog {
    /// Logs changes since the last status.
    pub fn log(&mut self, exchange: &Exchange, status: &Status) {
        self.health.log(status);
        self.log_counts(exchange, status);
        self.log_temperatures(status);
        self.log_trim(status);
        self.log_feed(status);
        while let Some(verdict) = exchange.new_verdicts.pop() {
            self.log_verdict(&verdict);
        }
        self.log_faults(status);
        let learning = status.watch() == Ok(WatchState::Learning);
        if learning != self.learning {
            let activity = if learning { "is learning the noise floor" } else { "watches" };
            info!("the vibration monitor {activity}");
        }
        self.learning = learning;
        let since_ns = status.model_broken_since_ns;
        if since_ns > 0 && self.broken_since_ns == 0 {
            warn!(
                measurements = status.model_measurements,
                residual_mm = 1e3 * status.model_residual_m,
                "the model is outdated; record a measuring program and run `trued diagnose`"
            );
        }
        self.broken_since_ns = since_ns;
    }

    fn log_counts(&mut self, exchange: &Exchange, status: &Status) {
        let totals = [
            status.missed_cycles,
            status.commands_lost,
            status.corrected_lost,
            status.malformed,
            status.force_gaps,
            status.force_refused,
            status.recorder_dropped,
        ];
        for ((tally, (name, description, is_normal)), total) in
            self.counted.iter_mut().zip(COUNTED).zip(totals)
        {
            log_count(tally, (name, description, is_normal), total, status.t_ns);
        }
        for (tally, (reason, description, is_normal)) in self.reasons.iter_mut().zip(REASONS) {
            let total = exchange.counters.reason(reason);
            log_count(tally, (reason.name(), description, is_normal), total, status.t_ns);
        }
    }

    /// If the rate limit is reached, a change is logged later, if it still applies.
    fn log_faults(&mut self, status: &Status) {
        let faults: Vec<_> = status.force_faults().collect();
        for fault in &faults {
            if !self.faults.contains(fault) && self.sensors.take(status.t_ns) {
                warn!("{fault}");
                self.faults.push(*fault);
            }
        }
        let sensors = &mut self.sensors;
        self.faults.retain(|fault| {
            let is_over = !faults.contains(fault) && sensors.take(status.t_ns);
            if is_over {
                info!("cleared: {fault}");
            }
            !is_over
        });
    }

    fn log_trim(&mut self, status: &Status) {
        let fault = trim_fault(status);
        if fault == self.trim_fault || !self.sensors.take(status.t_ns) {
            return;
        }
        match fault {
            Some(fault) => warn!("{fault}"),
            None => info!("tool measurements are used again"),
        }
        self.trim_fault = fault;
    }

    fn log_feed(&mut self, status: &Status) {
        let fault = feed_fault(status);
        if fault == self.feed_fault || !self.sensors.take(status.t_ns) {
            return;
        }
        match fault {
            Some(fault) => warn!("{fault}"),
            None => info!("the feed limit is kept again"),
        }
        self.feed_fault = fault;
    }

    fn log_temperatures(&mut self, status: &Status) {
        let stale = status.stale_temperatures;
        let (begun, over) = (stale & !self.stale_temperatures, self.stale_temperatures & !stale);
        if begun | over == 0 || !self.sensors.take(status.t_ns) {
            return;
        }
        if begun != 0 {
            warn!("temperatures are stale and treated as unknown: {}", place_names(begun));
        }
        if over != 0 {
            info!("temperatures are no longer stale: {}", place_names(over));
        }
        self.stale_temperatures = stale;
    }

    fn log_verdict(&mut self, verdict: &Verdict) {
        let Ok(state) = verdict.state() else { return };
        let known = self.active_alarms.iter().position(|(event, _)| *event == verdict.event);
        match (state, known) {
            (VibrationState::Warn, _) | (VibrationState::Over, None) => {}
            (VibrationState::Over, Some(place)) => {
                self.active_alarms.swap_remove(place);
                info!("{verdict}");
            }
            (_, Some(place)) if self.active_alarms[place].1 == state => {}
            (_, Some(place)) => {
                self.active_alarms[place].1 = state;
                warn!("{verdict}");
            }
            (_, None) => {
                self.active_alarms.push((verdict.event, state));
                warn!("{verdict}");
            }
        }
    }
}

/// Logs a count that has grown, when due.
fn log_count(
    tally: &mut CountThrottle,
    (name, description, is_normal): (&str, &str, bool),
    total: u64,
    now_ns: u64,
) {
    let Some(count) = tally.due(total, now_ns) else { return };
    if is_normal {
        info!(reason = name, count, total, "{description}");
    } else {
        warn!(reason = name, count, total, "{description}");
    }
}

/// Health as last logged.
#[derive(Debug)]
struct HealthLog {
    logged: Option<Health>,
    last: Option<Health>,
    /// Changes since the last message.
    changes: u32,
    budget: MessageBudget,
}

impl Default for HealthLog {
    fn default() -> Self {
        let budget = MessageBudget::new(HEALTH_BURST, HEALTH_EVERY_NS);
        Self { logged: None, last: None, changes: 0, budget }
    }
}

impl HealthLog {
    fn log(&mut self, status: &Status) {
        let Ok(health) = status.health() else { return };
        self.changes += u32::from(self.last != Some(health));
        self.last = Some(health);
        // Changes back and forth between two messages are included in the number of changes.
        if self.changes == 0 || !self.budget.take(status.t_ns) {
            return;
        }
        let from = self.logged.unwrap_or(Health::Starting);
        let why = status.message.as_str().split_once("; ").map_or("", |(_, why)| why);
        let colon = if why.is_empty() { "" } else { ": " };
        let changes = (self.changes > 1).then_some(self.changes);
        if matches!(health, Health::Degraded | Health::Fault) {
            warn!(changes, "health {from} -> {health}{colon}{why}");
        } else {
            info!(changes, "health {from} -> {health}{colon}{why}");
        }
        (self.logged, self.changes) = (Some(health), 0);
    }
}

/// A request as last logged.
#[derive(Debug)]
struct LoggedRequest {
    answer: Answer,
    message: String,
    pid: Option<u32>,
    at_ns: u64,
}

/// Requests as logged.
#[derive(Debug)]
pub struct RequestLog {
    /// The last message of each operation.
    last: [Option<LoggedRequest>; Operation::ALL.len()],
    unlogged: u64,
    budget: MessageBudget,
}

impl Default for RequestLog {
    fn default() -> Self {
        let budget = MessageBudget::new(REQUEST_BURST, REQUEST_EVERY_NS);
        Self { last: Default::default(), unlogged: 0, budget }
    }
}

impl RequestLog {
    /// Logs a request and its answer; a repetition is counted and reported with the next message.
    pub fn log(
        &mut self,
        operation: u32,
        answer: Answer,
        message: &str,
        pid: Option<u32>,
        now_ns: u64,
    ) {
        let known = Operation::try_from(operation).ok();
        if known == Some(Operation::Ping) {
            debug!(%answer, words = message, pid, "request: ping");
            return;
        }
        let last = known.and_then(|known| self.last.get_mut(known as usize));
        let is_news = last.as_ref().and_then(|last| last.as_ref()).is_none_or(|last| {
            (last.answer, last.message.as_str(), last.pid) != (answer, message, pid)
                || now_ns.saturating_sub(last.at_ns) >= REQUEST_AGAIN_NS
        });
        if !is_news || !self.budget.take(now_ns) {
            self.unlogged += 1;
            return;
        }
        if let Some(last) = last {
            *last = Some(LoggedRequest { answer, message: message.to_owned(), pid, at_ns: now_ns });
        }
        let name = known.map_or("unknown", Operation::name);
        let unlogged = Some(std::mem::take(&mut self.unlogged)).filter(|unlogged| *unlogged > 0);
        let by = sender::description(pid);
        if answer == Answer::Done {
            info!(%answer, words = message, by, unlogged, "request: {name}");
        } else {
            warn!(%answer, words = message, by, unlogged, "request: {name}");
        }
    }
}

/// Logs a summary of the run, in one line.
pub fn summarise(cell: &str, exchange: &Exchange) {
    let counters = &exchange.counters;
    let reasons = REASONS.map(|(reason, ..)| (reason, counters.reason(reason)));
    let reasons: Vec<String> = reasons
        .iter()
        .filter(|(_, count)| *count > 0)
        .map(|(reason, count)| format!("{reason} {count}"))
        .collect();
    let latency = exchange.latency.quantiles();
    let us = |ns: u64| ns as f64 * 1e-3;
    info!(
        cell,
        cycles = counters.cycles.load(Relaxed),
        missed_cycles = counters.missed_cycles.load(Relaxed),
        commands = counters.commands.load(Relaxed),
        commands_lost = counters.commands_lost.load(Relaxed),
        refused = counters.rejected.load(Relaxed),
        reasons = if reasons.is_empty() { "none".to_owned() } else { reasons.join(", ") },
        latency_p50_us = us(latency.p50_ns),
        latency_p99_us = us(latency.p99_ns),
        latency_p999_us = us(latency.p999_ns),
        latency_max_us = us(latency.max_ns),
        "ended"
    );
}
