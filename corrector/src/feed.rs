//! Adapts the feed to the force: an override of the programmed feed, at most 1, that keeps the process force under a limit.
//!
//! The force of a cut grows with its feed, `F = P oᵐ`: `o` is the override in force when the force arose, and `P` the force that the cut would take at the programmed feed. `P` changes with
//! depth, width and wear, and is found from what was sent and what was measured:
//!
//! ```text
//! P(t) = ‖L[F](t)‖ / L[o(t − delay)ᵐ]      L = 1 / (1 + s T)      o = (limit / P)^(1/m), within the floor and 1, at bounded rates
//! ```
//!
//! With the stated delay the override cancels out of `P`: no loop is closed, at any gain. A delay that is not as stated closes one, in the logarithm of the override
//! `(e^(−sτ) − e^(−sτ')) / (1 + s T)`: internal model control (Morari and Zafiriou, *Robust Process Control*, 1989, ch. 3). Its gain is at most `|τ − τ'| / T` at every frequency, so that with `T` of two
//! stated delays or more the gain margin is 2 or more at every delay up to twice the stated one (small-gain theorem).
//! The controlled material removal rate of Wang, Zhang and Fuhlbrigge (IROS 2009 and before) does the same by the force per feed.
//!
//! A deflection limit is a force limit over the model's compliance along the force. While the robot is at rest the force does not depend on the feed: `P` and the override are held.
//!
//! Invariants: in every state a finite value from the floor to 1 that changes by no more than the
//! rates, starting from the override that the client last returned, if it states one; the same
//! sequence of inputs gives the same bits.

#[cfg(test)]
mod tests;

use crate::cycle_inputs::WrenchSample;
use crate::history::History;
use crate::outcome::{FeedReason, FeedState};
use envelope::OverrideLimits;
use glam::DVec3;
use libm::{expm1, pow, sqrt};

/// Time constant of the estimate unless set, in stated delays; the least that keeps the gain margin.
pub const FEED_TIME_CONSTANT_DELAYS: f64 = 2.0;

/// The limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FeedLimit {
    /// The process force, N.
    Force(f64),
    /// Deflection of the tool by the model, m.
    Deflection(f64),
}

/// Constants that a cell does not set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedRules {
    /// A cycle that comes later than this counts as this long, s; above the longest cycle. Default
    /// 0.1: commands have paused, and the missed time is not made up for at once.
    pub pause_s: f64,
    /// Time over which the speed of the tool is measured, s; above 0. Default 0.01: longer than the
    /// cycle of most controllers, which repeat a setpoint within a cycle.
    pub speed_over_s: f64,
    /// A programmed feed below this counts as a stop, m/s; above 0. Default 1e-4: slower than any machining feed, faster than what setpoints of a robot at rest differ by.
    pub rest_m_s: f64,
    /// The override that the client returned to the cell may differ from the one sent here by as much as it can change in this time, s; 0.01 to 1. Beyond that the client's value holds: it was
    /// restarted or had no answers. Default 0.05: answers that are a few cycles of a slow controller late.
    pub client_tolerance_s: f64,
}

impl Default for FeedRules {
    fn default() -> Self {
        Self { pause_s: 0.1, speed_over_s: 0.01, rest_m_s: 1e-4, client_tolerance_s: 0.05 }
    }
}

/// Settings of a cell for its feed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedSettings {
    /// Whether the override is sent; otherwise it is computed and reported, and 1 is sent.
    pub is_sent: bool,
    /// The limit.
    pub limit: FeedLimit,
    /// Floor and rates of the override.
    pub bounds: OverrideLimits,
    /// The override where no force is known; from the floor to 1.
    pub lost: f64,
    /// The largest override while the tool is in the air; from the floor to 1.
    pub air: f64,
    /// The tool is in the air while the force is below this, N.
    pub air_n: f64,
    /// Without a force the override holds for this time, s; then it goes to `lost`.
    pub hold_s: f64,
    /// A force older than this is unknown, s.
    pub stale_s: f64,
    /// Delay from an override to the force that results from it, as measured here, s; at most 0.5.
    pub delay_s: f64,
    /// Time constant of the estimate, s; at least [`FEED_TIME_CONSTANT_DELAYS`] delays.
    pub time_constant_s: f64,
    /// How the force grows with the feed: `F ∝ feedᵐ`; above 0 to 1.
    pub exponent: f64,
    /// A force above this multiple of the limit lowers the override at once, at the largest rate;
    /// above 1.
    pub relief: f64,
    /// Constants that a cell does not set.
    pub rules: FeedRules,
}

/// Inputs of a cycle.
#[derive(Clone, Copy, Debug)]
pub struct FeedInput {
    /// The cycle's time, ns.
    pub now_ns: u64,
    /// The newest wrench.
    pub wrench: Option<WrenchSample>,
    /// Tool position of the command, base frame, m; `None` if the command was refused.
    pub tool_m: Option<DVec3>,
    /// The model's compliance at the tool along the force, m/N; `None` if unknown.
    pub compliance_m_per_n: Option<f64>,
    /// Whether corrections are sent.
    pub corrects: bool,
    /// The override that the client returned to the cell last; `None` if it states none.
    pub client_override: Option<f64>,
}

/// State of the feed override.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedReport {
    /// State.
    pub state: FeedState,
    /// Why it is in this state.
    pub reason: FeedReason,
    /// The override sent; 1 is the programmed feed.
    pub feed_override: f64,
    /// The override that would keep the force at its limit.
    pub requested: f64,
    /// The process force, low-passed, N; NaN where unknown.
    pub force_n: f64,
    /// The force at the programmed feed, N; NaN where unknown.
    pub programmed_force_n: f64,
    /// The limit as a force, N; NaN where unknown.
    pub limit_n: f64,
    /// Speed of the commanded tool, m/s; NaN where unknown.
    pub speed_m_s: f64,
    /// Refused wrenches: values that are not finite.
    pub refused: u64,
}

/// A valid force, and its limit.
#[derive(Clone, Copy, Debug)]
struct ForceAndLimit {
    force_n: DVec3,
    limit_n: f64,
}

/// The estimate of the cut; both values pass the same low-pass.
#[derive(Clone, Copy, Debug)]
struct CutEstimate {
    force_n: DVec3,
    /// The override in force when the force arose, raised to the exponent.
    share: f64,
}

/// Adapts the feed of one tool.
#[derive(Clone, Debug)]
pub struct Feed {
    settings: FeedSettings,
    sent: History<f64>,
    found: Option<CutEstimate>,
    speed: SpeedEstimator,
    /// When a force was last known.
    known_ns: Option<u64>,
    stepped_ns: Option<u64>,
    /// Time of measurement of the last refused wrench.
    refused_ns: Option<u64>,
    report: FeedReport,
}

impl Feed {
    /// Without measurements: the override starts at its value for a missing force.
    #[must_use]
    pub fn new(settings: FeedSettings, corrects: bool) -> Self {
        let begins = if settings.is_sent && corrects { settings.lost } else { 1.0 };
        Self {
            settings,
            sent: History::new(),
            found: None,
            speed: SpeedEstimator::new(),
            known_ns: None,
            stepped_ns: None,
            refused_ns: None,
            report: FeedReport {
                feed_override: begins,
                requested: settings.lost,
                ..FeedReport::empty(FeedState::Lost)
            },
        }
    }

    /// The override of this cycle.
    pub fn step(&mut self, input: &FeedInput) -> f64 {
        let dt_s = self.elapse(input.now_ns);
        let rules = self.settings.rules;
        self.follow_client(input);
        self.report.speed_m_s = self.speed.follow(&rules, input.now_ns, input.tool_m);
        let load = self.load(input);
        match &load {
            Ok(load) => self.adapt(input.now_ns, load, dt_s),
            Err(reason) => self.step_without_force(input.now_ns, *reason),
        }
        let is_sent = self.settings.is_sent && input.corrects;
        if !is_sent && self.report.state != FeedState::Lost {
            self.report.state = FeedState::Observing;
        }
        let relief = self.settings.relief;
        let is_far =
            self.is_moving() && load.is_ok_and(|load| length(load.force_n) > relief * load.limit_n);
        let report = &mut self.report;
        let goal = match (is_sent, is_far) {
            (false, _) => 1.0,
            (true, true) => self.settings.bounds.floor(),
            (true, false) => report.requested,
        };
        report.feed_override = self.settings.bounds.step(report.feed_override, goal, dt_s);
        self.sent.push(input.now_ns, report.feed_override);
        report.feed_override
    }

    /// State after the last step.
    #[must_use]
    pub fn report(&self) -> &FeedReport {
        &self.report
    }

    /// The override without a daemon; `is_correcting`: whether corrections are sent.
    #[must_use]
    pub fn override_without_force(&self, corrects: bool) -> f64 {
        if self.settings.is_sent && corrects { self.settings.lost } else { 1.0 }
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &FeedSettings {
        &self.settings
    }

    /// The filtered force, in the axes of the input, N; `None` if unknown.
    #[must_use]
    pub fn force_n(&self) -> Option<DVec3> {
        self.found.map(|found| found.force_n)
    }

    fn elapse(&mut self, now_ns: u64) -> f64 {
        let before_ns = self.stepped_ns.replace(now_ns).unwrap_or(now_ns);
        seconds(now_ns.saturating_sub(before_ns)).min(self.settings.rules.pause_s)
    }

    /// The client limits the override again, and its value is the one in force: if it differs from
    /// the one sent here, this one continues from it.
    fn follow_client(&mut self, input: &FeedInput) {
        let FeedSettings { bounds, rules, .. } = self.settings;
        let behind = rules.client_tolerance_s * f64::max(bounds.down_per_s(), bounds.up_per_s());
        let client_override = input.client_override.filter(|o| (0.0..=1.0).contains(o));
        if let Some(o) = client_override
            && (o - self.report.feed_override).abs() > behind
        {
            self.report.feed_override = o;
            self.sent.clear();
        }
    }

    /// Whether the tool moves; false if its speed is unknown.
    fn is_moving(&self) -> bool {
        let FeedReport { speed_m_s, feed_override, .. } = self.report;
        speed_m_s > self.settings.rules.rest_m_s * feed_override
    }

    /// The force with its limit, if valid.
    fn load(&mut self, input: &FeedInput) -> Result<ForceAndLimit, FeedReason> {
        let sample = input.wrench.ok_or(FeedReason::NoWrench)?;
        if seconds(sample.age_ns) > self.settings.stale_s {
            return Err(FeedReason::Stale);
        }
        if !sample.is_plausible() {
            let measured_ns = input.now_ns.saturating_sub(sample.age_ns);
            if self.refused_ns.replace(measured_ns) != Some(measured_ns) {
                self.report.refused += 1;
            }
            return Err(FeedReason::NotFinite);
        }
        if sample.faulty {
            return Err(FeedReason::SensorFault);
        }
        let limit_n = match self.settings.limit {
            FeedLimit::Force(n) => n,
            FeedLimit::Deflection(m) => {
                let gives = input.compliance_m_per_n.filter(|c| c.is_finite() && *c > 0.0);
                m / gives.ok_or(FeedReason::NoDeflection)?
            }
        };
        Ok(ForceAndLimit { force_n: sample.wrench.force, limit_n })
    }

    fn adapt(&mut self, now_ns: u64, load: &ForceAndLimit, dt_s: f64) {
        let FeedSettings { bounds, air, air_n, exponent, .. } = self.settings;
        self.known_ns = Some(now_ns);
        let moves = self.is_moving();
        let report = &mut self.report;
        (report.reason, report.limit_n) = (FeedReason::None, load.limit_n);
        if !moves {
            // A force on a tool at rest does not depend on its feed, nor does the force of its last motion.
            report.reason = FeedReason::AtRest;
            report.state = FeedState::Adapting;
            report.requested = report.feed_override;
        } else {
            let found = self.update_estimate(now_ns, load, dt_s);
            let report = &mut self.report;
            report.force_n = length(found.force_n);
            report.programmed_force_n = report.force_n / found.share;
            let requested = pow(load.limit_n / report.programmed_force_n, 1.0 / exponent);
            let is_air = report.force_n < air_n;
            let most = if is_air { air.max(bounds.floor()) } else { 1.0 };
            // No force gives 0/0.
            let requested = if requested.is_nan() { 1.0 } else { requested };
            report.requested = requested.clamp(bounds.floor(), most);
            report.state = if is_air { FeedState::Air } else { FeedState::Adapting };
            if requested < bounds.floor() {
                report.reason = FeedReason::AtFloor;
            }
        }
    }

    /// Updates the estimate of the cut with a force.
    fn update_estimate(&mut self, now_ns: u64, load: &ForceAndLimit, dt_s: f64) -> CutEstimate {
        let FeedSettings { delay_s, time_constant_s, exponent, bounds, .. } = self.settings;
        let then_ns = now_ns.saturating_sub((delay_s * 1e9) as u64);
        let sent = self.sent.at(then_ns).unwrap_or(self.report.feed_override);
        let now = CutEstimate {
            force_n: load.force_n,
            share: pow(sent.clamp(bounds.floor(), 1.0), exponent),
        };
        let part = -expm1(-dt_s / time_constant_s);
        let found = match self.found {
            None => now,
            Some(before) => CutEstimate {
                force_n: before.force_n + part * (now.force_n - before.force_n),
                share: before.share + part * (now.share - before.share),
            },
        };
        self.found = Some(found);
        found
    }

    /// No force is known: the override is held, then goes to `lost`.
    fn step_without_force(&mut self, now_ns: u64, reason: FeedReason) {
        let age_s = |known_ns| seconds(now_ns.saturating_sub(known_ns));
        let holds = self.known_ns.is_some_and(|at_ns| age_s(at_ns) <= self.settings.hold_s);
        let report = &mut self.report;
        report.reason = reason;
        if holds {
            (report.state, report.requested) = (FeedState::Holding, report.feed_override);
            return;
        }
        self.found = None;
        let lost = self.settings.lost;
        self.report = FeedReport {
            feed_override: self.report.feed_override,
            speed_m_s: self.report.speed_m_s,
            refused: self.report.refused,
            requested: lost,
            reason,
            ..FeedReport::empty(FeedState::Lost)
        };
    }
}

impl FeedReport {
    /// The programmed feed, without an estimate.
    #[must_use]
    pub fn empty(state: FeedState) -> Self {
        Self {
            state,
            reason: FeedReason::None,
            feed_override: 1.0,
            requested: 1.0,
            force_n: f64::NAN,
            programmed_force_n: f64::NAN,
            limit_n: f64::NAN,
            speed_m_s: f64::NAN,
            refused: 0,
        }
    }
}

/// Speed of the commanded tool, over [`FeedRules::speed_over_s`].
#[derive(Clone, Copy, Debug)]
struct SpeedEstimator {
    from: Option<(u64, DVec3)>,
    m_s: f64,
}

impl SpeedEstimator {
    const fn new() -> Self {
        Self { from: None, m_s: f64::NAN }
    }

    fn follow(&mut self, rules: &FeedRules, now_ns: u64, tool_m: Option<DVec3>) -> f64 {
        let Some(at_m) = tool_m.filter(|at_m| at_m.is_finite()) else {
            *self = Self::new();
            return self.m_s;
        };
        let Some((since_ns, from_m)) = self.from else {
            self.from = Some((now_ns, at_m));
            return self.m_s;
        };
        let dt_s = seconds(now_ns.saturating_sub(since_ns));
        if dt_s >= rules.speed_over_s {
            let is_pause = dt_s > rules.pause_s + rules.speed_over_s;
            self.m_s = if is_pause { f64::NAN } else { length(at_m - from_m) / dt_s };
            self.from = Some((now_ns, at_m));
        }
        self.m_s
    }
}

fn length(vector: DVec3) -> f64 {
    sqrt(vector.length_squared())
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}
