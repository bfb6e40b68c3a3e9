//! Holds every published target, the daemon's and the client's, against the invariants of the design.

use super::{Summary, joints};
use crate::cell_loop::{JOINTS, Tick};
use crate::gauge::Gauge;
use daemon::exchange::Exchange;
use shm_schema::{Command, Corrected, CorrectionStatus, JointBounds, Mode, Reason};
use std::sync::atomic::Ordering::Relaxed;
use trued_client::Source;

/// Rounding of a sum and a difference, rad.
const ROUNDING: f64 = 1e-12;
/// So many targets in a row must be as they should before a calm ends; where joints turn back, backlash is ramped.
const SETTLED: u64 = 100;

/// Whoever looks.
pub(super) struct Watch {
    /// The account.
    pub(super) summary: Summary,
    /// Cycles of this daemon that its recorder took.
    pub(super) recorded: u64,
    bounds: JointBounds,
    daemon: Gauge,
    client: Gauge,
    /// The command that the daemon took last, and the last that it believed.
    taken: Option<(Command, u64)>,
    good: Option<Command>,
    last_seq: u64,
    settled: u64,
    longest: u64,
    published: u64,
}

impl Watch {
    pub(super) fn new(bounds: &JointBounds) -> Self {
        let gauge = Gauge::new(joints(&bounds.rate));
        Self {
            summary: Summary::default(),
            recorded: 0,
            bounds: *bounds,
            daemon: gauge.clone(),
            client: gauge,
            taken: None,
            good: None,
            last_seq: 0,
            settled: 0,
            longest: 0,
            published: 0,
        }
    }

    /// Another daemon starts, which knows nothing of the one before.
    pub(super) fn another_daemon(&mut self) {
        self.daemon = Gauge::new(joints(&self.bounds.rate));
        (self.taken, self.good) = (None, None);
        (self.recorded, self.last_seq, self.published) = (0, 0, 0);
        (self.settled, self.longest) = (0, 0);
    }

    /// The daemon has taken that command.
    pub(super) fn delivered(&mut self, command: &Command, received_ns: u64) {
        self.taken = Some((*command, received_ns));
    }

    /// The daemon ends: nothing of what it did was lost uncounted.
    pub(super) fn end(&mut self, exchange: &Exchange, after_a_calm: bool) {
        if after_a_calm && self.longest < SETTLED {
            self.breaks("not as it should be long after the last fault");
        }
        let dropped = exchange.counters.recorder_dropped.load(Relaxed);
        let kept = self.recorded + exchange.cycles.len() as u64 + dropped;
        if kept != self.published {
            self.breaks(&format!("{} cycles, {kept} recorded or counted", self.published));
        }
    }

    /// A target of the daemon.
    pub(super) fn published(&mut self, said: &Corrected, calm: bool, exchange: &Exchange) {
        let summary = &mut self.summary;
        summary.cycles += 1;
        self.published += 1;
        for number in said.q.iter().chain(&said.correction).chain(&said.wanted) {
            summary.hash = (summary.hash.rotate_left(5) ^ number.to_bits())
                .wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
        let (Ok(status), Ok(reason)) = (said.status(), said.reason()) else {
            return self.breaks(&format!("no such word: {said:?}"));
        };
        *summary.said.entry(format!("{status}/{reason}")).or_default() += 1;
        if said.seq != self.last_seq + 1 {
            self.breaks(&format!("number {} after {}", said.seq, self.last_seq));
        }
        self.last_seq = said.seq;
        // Without a command it says the last one again.
        let answers = self.taken.filter(|(_, received_ns)| *received_ns == said.received_ns);
        if let (Some((command, _)), true) = (answers, status != CorrectionStatus::Rejected) {
            self.good = Some(command);
        }
        if let Err(words) = self.judge(said, status) {
            self.breaks(&format!("{words}: {said:?}"));
        }
        self.settle(status, reason, calm, exchange);
    }

    fn judge(&mut self, said: &Corrected, status: CorrectionStatus) -> Result<(), String> {
        let lists = [&said.q, &said.correction, &said.correction_rate, &said.wanted];
        if !lists.iter().all(|list| list.iter().all(|x| x.is_finite())) {
            return Err("a number that is none".to_owned());
        }
        if said.joints == 0 {
            let silent = status == CorrectionStatus::Rejected && self.good.is_none();
            return if silent { Ok(()) } else { Err("no target".to_owned()) };
        }
        let good = self.good.ok_or("a target before the first good command")?;
        let mut near_limit = false;
        for i in 0..JOINTS {
            let (min, max, angle) = (self.bounds.min[i], self.bounds.max[i], self.bounds.angle[i]);
            if !(min..=max).contains(&said.q[i]) || said.correction[i].abs() > angle + ROUNDING {
                return Err(format!("joint {i} out of its bounds"));
            }
            if (said.q[i] - said.correction[i] - good.q[i]).abs() > ROUNDING {
                return Err(format!("joint {i} is not the good command plus its correction"));
            }
            near_limit |= good.q[i] - min < angle || max - good.q[i] < angle;
        }
        if near_limit {
            // What a joint limit cuts may go and come at once.
            self.daemon = Gauge::new(joints(&self.bounds.rate));
            return Ok(());
        }
        self.daemon.take(said.made_ns, joints(&said.correction))
    }

    /// In a calm the daemon must come to do what it is there for.
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

    /// A target of the client.
    pub(super) fn target(&mut self, now_ns: u64, tick: &Tick) {
        let source = format!("client: {:?}", tick.source);
        *self.summary.said.entry(source).or_default() += 1;
        for i in 0..JOINTS {
            let (q, correction) = (tick.target[i], tick.correction[i]);
            let inside = (self.bounds.min[i]..=self.bounds.max[i]).contains(&q);
            let near = correction.abs() <= self.bounds.angle[i] + ROUNDING;
            if !inside || !near {
                self.breaks(&format!("the client's joint {i} out of its bounds: {tick:?}"));
            }
        }
        let broken = self.client.take(now_ns, &tick.correction).err();
        if let Some(words) = broken.filter(|_| tick.source != Source::Rejected) {
            self.breaks(&format!("the client: {words}: {tick:?}"));
        }
    }

    fn breaks(&mut self, words: &str) {
        let Summary { cycles, broken, .. } = &mut self.summary;
        broken.get_or_insert(format!("cycle {cycles}: {words}"));
    }
}
