//! Checks all corrections of the daemon and all targets of the client by the oracle, in every state.

use super::Summary;
use super::client::Sent;
use crate::cell_loop::JOINTS;
use crate::oracle::Oracle;
use daemon::exchange::Exchange;
use shm_schema::{Corrected, CorrectionStatus, JointBounds, Mode, Reason};
use std::sync::atomic::Ordering::Relaxed;
use trued_client::Source;

/// So many targets in a row must be as they should before a calm ends; where joints turn back, backlash is ramped.
const SETTLED: u64 = 100;

/// The checks of a run.
pub(super) struct InvariantMonitor {
    /// The account.
    pub(super) summary: Summary,
    /// Cycles of this daemon that its recorder took.
    pub(super) recorded: u64,
    daemon: Oracle,
    client: Oracle,
    last_seq: u64,
    settled: u64,
    longest: u64,
    /// Number of consecutive ticks of this calm with the daemon's own correction, bit for bit.
    exact: u64,
    most_exact: u64,
    is_back: bool,
    published: u64,
}

impl InvariantMonitor {
    pub(super) fn new(bounds: &JointBounds) -> Self {
        Self {
            summary: Summary::default(),
            recorded: 0,
            daemon: Oracle::new(bounds, 0.0),
            client: Oracle::new(bounds, 0.0),
            last_seq: 0,
            settled: 0,
            longest: 0,
            exact: 0,
            most_exact: 0,
            is_back: false,
            published: 0,
        }
    }

    /// Another daemon starts, with these limits and without history.
    pub(super) fn another_daemon(&mut self, bounds: &JointBounds) {
        self.daemon = Oracle::new(bounds, 0.0);
        (self.recorded, self.last_seq, self.published) = (0, 0, 0);
        (self.settled, self.longest) = (0, 0);
        (self.exact, self.most_exact, self.is_back) = (0, 0, false);
    }

    /// The client learns other bounds.
    pub(super) fn set_bounds(&mut self, now_ns: u64, bounds: &JointBounds) {
        self.client.set_bounds(now_ns, bounds);
    }

    /// The client begins a run; the robot is at its command.
    pub(super) fn begins_at_zero(&mut self) {
        self.client.begin(&[]);
    }

    /// The daemon ends: its losses must all be counted.
    pub(super) fn end(&mut self, exchange: &Exchange, after_a_calm: bool) {
        if after_a_calm && (self.longest < SETTLED || self.most_exact < SETTLED) {
            let (answered, sent) = (self.longest, self.most_exact);
            self.breaks(&format!(
                "{answered} good answers, {sent} sent, long after the last fault"
            ));
        }
        let dropped = exchange.counters.recorder_dropped.load(Relaxed);
        let kept = self.recorded + exchange.cycles.len() as u64 + dropped;
        if kept != self.published {
            self.breaks(&format!("{} cycles, {kept} recorded or counted", self.published));
        }
    }

    /// A correction that the daemon proposes.
    pub(super) fn published(&mut self, answer: &Corrected, calm: bool, exchange: &Exchange) {
        let summary = &mut self.summary;
        summary.cycles += 1;
        self.published += 1;
        for number in answer.correction.iter().chain(&answer.wanted) {
            summary.hash = (summary.hash.rotate_left(5) ^ number.to_bits())
                .wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
        let (Ok(status), Ok(reason)) = (answer.status(), answer.reason()) else {
            return self.breaks(&format!("no such word: {answer:?}"));
        };
        *summary.counts.entry(format!("{status}/{reason}")).or_default() += 1;
        if answer.seq != self.last_seq + 1 {
            self.breaks(&format!("number {} after {}", answer.seq, self.last_seq));
        }
        self.last_seq = answer.seq;
        let lists = [&answer.correction_rate, &answer.correction_acceleration, &answer.wanted];
        if !lists.iter().all(|list| list.iter().all(|x| x.is_finite())) {
            self.breaks(&format!("a number that is none: {answer:?}"));
        }
        let correction = &answer.correction[..JOINTS];
        if let Err(violation) =
            self.daemon.take(answer.received_ns, answer.t_ns, &[0.0; JOINTS], correction)
        {
            self.breaks(&format!("the daemon: {violation}: {answer:?}"));
        }
        self.settle(status, reason, calm, exchange);
    }

    /// In a calm the daemon must resume its normal operation.
    fn settle(
        &mut self,
        status: CorrectionStatus,
        reason: Reason,
        calm: bool,
        exchange: &Exchange,
    ) {
        let mode =
            if exchange.mode() == corrector::Mode::Shadow { Mode::Shadow } else { Mode::Full };
        let due = match mode {
            Mode::Shadow => (CorrectionStatus::Shadow, Reason::ShadowMode),
            _ => (CorrectionStatus::Corrected, Reason::None),
        };
        self.settled = if calm && (status, reason) == due { self.settled + 1 } else { 0 };
        self.longest = self.longest.max(self.settled);
    }

    /// What the client sends.
    pub(super) fn sent(&mut self, now_ns: u64, sent: &Sent, answer: Option<&Corrected>) {
        *self.summary.counts.entry(format!("client: {:?}", sent.source)).or_default() += 1;
        if let Err(violation) = self.client.take(now_ns, sent.stamp_ns, &sent.command, &sent.target)
        {
            self.breaks(&format!("the client: {violation}: {sent:?}"));
        }
        let is_exact = answer.is_some_and(|answer| answer.correction == sent.correction);
        if sent.source == Source::Corrected && !is_exact {
            self.breaks(&format!("the client says {:?} of {answer:?}", sent.source));
        }
        self.exact = if is_exact { self.exact + 1 } else { 0 };
        self.most_exact = self.most_exact.max(self.exact);
    }

    /// The daemon's own correction was sent again for the first time this many ticks after the last
    /// fault.
    pub(super) fn calm(&mut self, ticks: u64) {
        if self.most_exact >= SETTLED && !self.is_back {
            self.is_back = true;
            self.summary.back_after_ms.push(ticks.saturating_sub(SETTLED));
        }
    }

    fn breaks(&mut self, text: &str) {
        let Summary { cycles, broken, .. } = &mut self.summary;
        broken.get_or_insert(format!("cycle {cycles}: {text}"));
    }
}
