//! Handling of telegrams by the RSI bridge, without a socket.
//!
//! Every readable telegram is answered with its own `IPOC`, whatever the state of the daemon. A run starts at a correction of
//! zero, like the controller's own sum; within a run the correction continues from the value used by the controller. No allocation except the
//! transport's.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use glam::DMat3;
use physics::{Arm, Frame};
use recording::bridge::{Accumulation, Group, RsiConfig, RsiCorrection};
use recording::series::CoordinateFrame as Axes;
use trued_client::JOINTS_MAX;

use super::telegram::{AnswerTemplate, IPOC_MAX, NUMBERS_MAX, Telegram, rounded};
use crate::corrections::Corrections;
use crate::counts::{Count, Counts};
use crate::daemon_link::DaemonLink;
use crate::displacement::tool_poses;
use crate::link::Link;
use crate::sequence::{Sequence, SequencePosition};
use crate::settings::RunRules;

/// Number of answers that are stored, in case the controller has not used them.
const ANSWERS_KEPT: usize = 32;

/// The request of a telegram.
#[derive(Debug, Clone, Copy)]
pub struct AnswerRequest {
    /// Target of the program, rad; `None` if the telegram does not contain it.
    q: Option<[f64; JOINTS_MAX]>,
    ipoc: Ipoc,
    from: SocketAddr,
}

/// The controller's clock as it was written: the same digits are returned.
#[derive(Debug, Clone, Copy, Default)]
struct Ipoc {
    digits: [u8; IPOC_MAX],
    count: usize,
}

impl Ipoc {
    fn new(text: &str) -> Option<Self> {
        let mut ipoc = Self { count: text.len(), ..Self::default() };
        ipoc.digits.get_mut(..text.len())?.copy_from_slice(text.as_bytes());
        Some(ipoc)
    }

    fn text(&self) -> &str {
        std::str::from_utf8(&self.digits[..self.count]).unwrap_or_default()
    }
}

/// The sensor in terms of RSI.
pub struct Answerer<L = DaemonLink> {
    robot: IpAddr,
    is_shadow: bool,
    setpoint: Group,
    holds_correction: bool,
    correction: RsiCorrection,
    sums: Accumulation,
    form: AnswerTemplate,
    arm: Arm,
    feed: Corrections<L>,
    counts: Arc<Counts>,
    runs: RunRules,
    sequence: Sequence,
    /// Smallest step of the controller's clock so far: one cycle.
    step: u32,
    late: Option<u64>,
    /// Whether the newest telegram has not been answered.
    is_unanswered: bool,
    /// Answers sent, newest first.
    sent: [SentAnswer; ANSWERS_KEPT],
}

/// Content of one answer.
#[derive(Debug, Clone, Copy, Default)]
struct SentAnswer {
    /// The total correction as the controller accumulates it: degrees, mm.
    sum: [f64; NUMBERS_MAX],
    /// The same in joint coordinates, rad.
    rad: [f64; JOINTS_MAX],
}

impl<L: Link> Answerer<L> {
    /// Before the first telegram.
    #[must_use]
    pub fn new(config: RsiConfig, arm: Arm, feed: Corrections<L>, counts: Arc<Counts>) -> Self {
        let runs = RunRules::from_config(&config.common);
        let correction_group = match &config.correction {
            RsiCorrection::Axes(group) | RsiCorrection::Pose(group, _) => group,
        };
        Self {
            form: AnswerTemplate::new(
                &config.ethernet,
                correction_group,
                config.feed.as_ref(),
                &config.others,
            ),
            robot: config.common.robot,
            is_shadow: config.common.absolute_accuracy,
            setpoint: config.setpoint,
            holds_correction: config.setpoint_holds_correction,
            correction: config.correction,
            sums: config.sums,
            arm,
            feed,
            counts,
            sequence: Sequence::clock(runs.sequence),
            runs,
            step: u32::MAX,
            late: None,
            is_unanswered: false,
            sent: [SentAnswer::default(); ANSWERS_KEPT],
        }
    }

    /// Processes a datagram; returns its request if it is to be answered.
    pub fn receive(&mut self, datagram: &[u8], from: SocketAddr) -> Option<AnswerRequest> {
        if from.ip() != self.robot {
            return self.discard(Count::Foreign);
        }
        let Some(telegram) = Telegram::read(datagram) else { return self.discard(Count::Broken) };
        let number = telegram.ipoc.parse::<u64>().ok();
        let Some((ipoc, number)) = Ipoc::new(telegram.ipoc).zip(number) else {
            return self.discard(Count::Broken);
        };
        // The clock may be longer than 32 bits; its steps are not.
        let standing = match self.sequence.classify(Some(number as u32), datagram) {
            SequencePosition::Old => return self.discard(Count::Old),
            SequencePosition::Repeated => return self.discard(Count::Repeated),
            standing => standing,
        };
        self.counts.increment(Count::Robot);
        self.update_run(&telegram, standing);
        self.is_unanswered = true;
        let numbers = telegram.numbers(&self.setpoint);
        if numbers.is_none() {
            self.counts.increment(Count::NotCorrected);
        }
        let q = numbers.map(|degrees| {
            let mut q = [0.0; JOINTS_MAX];
            for (i, q) in q.iter_mut().enumerate().take(self.arm.count()) {
                let held = if self.holds_correction { self.sent[0].rad[i] } else { 0.0 };
                *q = degrees[i].to_radians() - held;
            }
            q
        });
        Some(AnswerRequest { q, ipoc, from })
    }

    fn update_run(&mut self, telegram: &Telegram<'_>, standing: SequencePosition) {
        let late = telegram.late_count();
        let ends_after_ms = self.runs.ends_after_ms();
        // Late answers are counted while RSI is on: a silence during which most cycles were counted
        // is a network failure, and the correction continues.
        let is_silent =
            matches!(standing, SequencePosition::Next { lost } if lost >= ends_after_ms);
        let counted = late.unwrap_or(0).saturating_sub(self.late.unwrap_or(0));
        let cycles = match standing {
            SequencePosition::Next { lost } => u64::from((lost + 1) / self.step.min(lost + 1)),
            _ => 0,
        };
        let counted_on = 2 * counted >= cycles;
        let began_anew = late < self.late;
        if standing == SequencePosition::First || began_anew || (is_silent && !counted_on) {
            self.counts.increment(Count::Sessions);
            self.feed.start_at_zero();
            self.sent = [SentAnswer::default(); ANSWERS_KEPT];
            (self.step, self.late) = (u32::MAX, late);
            return;
        }
        // Cycles without an answer count as late too: nothing was sent in them that would have to
        // be taken back.
        let mut unanswered = u64::from(self.is_unanswered);
        if let SequencePosition::Next { lost } = standing {
            self.step = self.step.min(lost + 1);
            let missed = u64::from((lost + 1) / self.step - 1);
            self.counts.add(Count::RobotMissed, missed);
            unanswered += missed;
        }
        if let (Some(before), Some(now)) = (self.late, late)
            && now > before
        {
            self.counts.add(Count::ControllerLate, now - before);
            self.rewind((now - before).saturating_sub(unanswered));
        }
        self.late = late;
    }

    /// The controller has not used the newest answers: it keeps the value sent before them, and the
    /// correction continues from there.
    fn rewind(&mut self, answers: u64) {
        if answers == 0 {
            return;
        }
        let answers = usize::try_from(answers).unwrap_or(ANSWERS_KEPT).min(ANSWERS_KEPT - 1);
        self.sent.rotate_left(answers);
        let (used, oldest) = (self.sent[0], self.sent[ANSWERS_KEPT - answers - 1]);
        self.sent[ANSWERS_KEPT - answers..].fill(oldest);
        self.feed.continue_from(&used.rad);
    }

    /// Writes the answer into `to`: its length, and its destination.
    pub fn answer(
        &mut self,
        request: &AnswerRequest,
        to: &mut [u8],
    ) -> Option<(usize, SocketAddr)> {
        let before = self.sent[0];
        let mut sent = match request.q {
            Some(q) => self.total_correction(&q),
            // Without a target the correction is unchanged.
            None => before,
        };
        let numbers = match self.sums {
            Accumulation::Absolute => {
                sent.sum = sent.sum.map(rounded);
                sent.sum
            }
            Accumulation::Relative => {
                let increment = std::array::from_fn(|i| rounded(sent.sum[i] - before.sum[i]));
                sent.sum = std::array::from_fn(|i| before.sum[i] + increment[i]);
                increment
            }
        };
        let feed_override = self.feed.link().feed_override();
        let length = self.form.write(to, &numbers, feed_override, request.ipoc.text())?;
        self.sent.rotate_right(1);
        self.sent[0] = sent;
        self.is_unanswered = false;
        self.counts.increment(Count::Sent);
        Some((length, request.from))
    }

    /// The total correction at `q`, rad.
    fn total_correction(&mut self, q: &[f64; JOINTS_MAX]) -> SentAnswer {
        let q = &q[..self.arm.count()];
        let made = self.feed.command(q);
        self.counts.count_answer(&made);
        if self.is_shadow {
            return SentAnswer::default();
        }
        let sum = match &self.correction {
            RsiCorrection::Axes(_) => {
                std::array::from_fn(|i| made.rad.get(i).map_or(0.0, |rad| rad.to_degrees()))
            }
            RsiCorrection::Pose(_, axes) => {
                let (before, after) = tool_poses(&self.arm, q, &made.rad);
                pose_difference(&before, &after, *axes)
            }
        };
        SentAnswer { sum, rad: made.rad }
    }

    /// Source of corrections.
    pub fn link(&mut self) -> &mut L {
        self.feed.link()
    }

    /// Nothing was received for a while: checks the connection to the daemon.
    pub fn check_connection(&mut self) {
        self.feed.link().check_connection();
    }

    /// Counts a datagram that could not be sent.
    pub fn count_not_sent(&self) {
        self.counts.increment(Count::NotSent);
    }

    /// Counts a telegram that was superseded by a newer one before it was answered.
    pub fn count_superseded(&self) {
        self.counts.increment(Count::Superseded);
    }

    fn discard(&self, what: Count) -> Option<AnswerRequest> {
        self.counts.increment(what);
        None
    }
}

/// Difference from `before` to `after` in these axes, about the TCP: mm, then degrees about z, y,
/// x.
fn pose_difference(before: &Frame, after: &Frame, axes: Axes) -> [f64; NUMBERS_MAX] {
    let shift = after.origin - before.origin;
    let back = before.rotation.transpose();
    let (shift, turn) = match axes {
        Axes::Base => (shift, after.rotation * back),
        Axes::Tool => (back * shift, back * after.rotation),
    };
    let [a, b, c] = euler_zyx(&turn).map(f64::to_degrees);
    [shift.x * 1e3, shift.y * 1e3, shift.z * 1e3, a, b, c]
}

/// The angles A, B, C of KUKA's frames: `turn = Rz(A) Ry(B) Rx(C)`, rad; a correction is far from B = 90°.
fn euler_zyx(turn: &DMat3) -> [f64; 3] {
    let (x, y, z) = (turn.x_axis, turn.y_axis, turn.z_axis);
    [libm::atan2(x.y, x.x), libm::atan2(-x.z, libm::hypot(x.x, x.y)), libm::atan2(y.z, z.z)]
}
