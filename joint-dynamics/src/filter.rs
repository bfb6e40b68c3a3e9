//! The filter over commands that arrive one by one, and the setpoints that are known to follow.
//!
//! A delay can be compensated only where the path is known ahead. With a horizon of at least delay plus lags the filter applies; setpoints beyond the horizon are assumed to go on at
//! the speed of the last known ones. Without it only lags are compensated, `c = Σ T · dq/dt`, which is their exact inverse: joints with the same delay then stay on the path, late by
//! the delay. (Extrapolating at constant speed over the delay would reduce the lateness, but the tool would leave the path at each corner.) If a joint has a mode, nothing is compensated without a
//! horizon: the lag keeps corners from exciting the mode.
//!
//! Commands count as equally spaced by the period of the cell: times of commands serve to find missed ones, not to measure speeds, since their jitter would appear as one.
//!
//! The lead is zero at rest, and after a restart until the joints move. [`Filter::new`] allocates; a step does not. Limits are left to the corrector's limiter.

use crate::taps::Taps;
use physics::{JOINTS_MAX, Joints};

/// Commands whose times are further apart than this, s, and than [`SILENT_PERIODS`] do not belong to one motion: the robot has stopped meanwhile. Both are those of the
/// corrector's limiters (`envelope/src/elapsed.rs`).
const SILENCE_S: f64 = 0.02;
const SILENT_PERIODS: f64 = 3.0;
/// Arms with more joints are rare; the sums over fewer take less than half of the time.
const USUAL_JOINTS: usize = 8;

/// What the lead was computed from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ahead {
    /// Setpoints ahead of the command that were known, at most as many as the filter makes use of.
    pub known: usize,
    /// As many as the filter makes use of.
    pub used_at_most: usize,
    /// As many as it needs to compensate delay and modes.
    pub needed: usize,
}

impl Ahead {
    /// Whether enough is known to compensate delay and modes; otherwise only lags are compensated.
    #[must_use]
    pub fn is_enough(&self) -> bool {
        self.known >= self.needed
    }
}

/// The filter of one arm.
#[derive(Clone, Debug)]
pub struct Filter {
    taps: Taps,
    /// The last commands, every period: a ring that is kept twice, one after the other, so that any `length` in a row are the past.
    past: Vec<Joints>,
    length: usize,
    /// Place of the newest in the first ring.
    newest: usize,
    last_ns: Option<u64>,
    /// What a joint can move from one command to the next, rad or m; more is a jump.
    reach: Joints,
    /// Periods by which the times of the commands are ahead of those counted, −0.5 to 0.5.
    unspent: f64,
}

impl Filter {
    /// A filter without a past, for joints that move by at most `reach` from one command to the next, rad or m; may be infinite.
    #[must_use]
    pub fn new(taps: Taps, reach: Joints) -> Self {
        let length = taps.commands_ahead() + 1;
        let past = vec![[0.0; JOINTS_MAX]; 2 * length];
        Self { taps, past, length, newest: 0, last_ns: None, reach, unspent: 0.0 }
    }

    /// Setpoints ahead of a command that it makes use of.
    #[must_use]
    pub fn commands_ahead(&self) -> usize {
        self.taps.commands_ahead()
    }

    /// Takes over the path of the filter of another model, as far as both remember. A filter of another period begins anew.
    pub fn continue_from(&mut self, before: &Self) {
        self.restart();
        if self.taps.period_s() != before.taps.period_s() {
            return;
        }
        for commands in (0..self.length).rev() {
            self.push(*before.commanded_before(commands));
        }
        (self.last_ns, self.unspent) = (before.last_ns, before.unspent);
    }

    /// Forgets the path: the next command counts as one of a robot at rest.
    pub fn restart(&mut self) {
        self.last_ns = None;
    }

    /// What the joints are to be commanded beyond `q`, the command for the time `t_ns`, rad or m; `following` are the setpoints after it, a period apart.
    ///
    /// A command that is not finite is ignored; its lead is zero. One whose time is not later than that of the command before, or by more than 20 ms and three periods, and one that jumps
    /// begin anew.
    pub fn step(&mut self, q: &Joints, t_ns: u64, following: &[Joints]) -> (Joints, Ahead) {
        let following = &following[..following.len().min(self.commands_ahead())];
        let ahead = Ahead {
            known: following.len(),
            used_at_most: self.commands_ahead(),
            needed: self.taps.commands_needed(),
        };
        if !q.iter().all(|q| q.is_finite()) {
            return ([0.0; JOINTS_MAX], ahead);
        }
        self.take(q, t_ns);
        let lead = match ahead.is_enough() {
            true if self.taps.joints() <= USUAL_JOINTS => self.lead::<USUAL_JOINTS>(following),
            true => self.lead::<JOINTS_MAX>(following),
            false => self.lead_of_lags(),
        };
        (lead, ahead)
    }

    /// For the first `COUNT` joints the sum over the past commands, the known setpoints and their continuation at constant speed.
    fn lead<const COUNT: usize>(&self, following: &[Joints]) -> Joints {
        let (taps, stride) = (&self.taps, self.taps.stride());
        let now = self.commanded_before(0);
        let mut lead = [0.0; JOINTS_MAX];
        for (k, taps) in (1..).zip(taps.past()) {
            add::<COUNT>(&mut lead, taps, self.commanded_before(k * stride), now);
        }
        let known = following.iter().skip(stride - 1).step_by(stride);
        for (taps, q) in taps.future().zip(known) {
            add::<COUNT>(&mut lead, taps, q, now);
        }
        // Whole strides of the horizon; what is known beyond them is less than one stride.
        let known = following.len() / stride;
        let ahead = |k: usize| if k == 0 { now } else { &following[k * stride - 1] };
        let end = ahead(known);
        let before_end = if known == 0 { self.commanded_before(stride) } else { ahead(known - 1) };
        let [rest, steps] = taps.after(known);
        add::<COUNT>(&mut lead, rest, end, now);
        add::<COUNT>(&mut lead, steps, end, before_end);
        lead
    }

    /// The sum of the lags times the speed over the last stride.
    fn lead_of_lags(&self) -> Joints {
        let stride = self.taps.stride();
        let stride_s = stride as f64 * self.taps.period_s();
        let (now, before) = (self.commanded_before(0), self.commanded_before(stride));
        std::array::from_fn(|i| self.taps.lags_s()[i] * (now[i] - before[i]) / stride_s)
    }

    fn commanded_before(&self, commands: usize) -> &Joints {
        &self.past[self.newest + self.length - commands.min(self.length - 1)]
    }

    fn push(&mut self, q: Joints) {
        self.newest = if self.newest + 1 == self.length { 0 } else { self.newest + 1 };
        self.replace(q);
    }

    fn replace(&mut self, q: Joints) {
        (self.past[self.newest], self.past[self.newest + self.length]) = (q, q);
    }

    /// Whether a joint cannot get from one setpoint to the next.
    #[must_use]
    pub fn jumps(&self, from: &Joints, to: &Joints) -> bool {
        self.jumps_in(1.0, from, to)
    }

    /// The same in so many periods.
    fn jumps_in(&self, periods: f64, from: &Joints, to: &Joints) -> bool {
        (0..JOINTS_MAX).any(|i| (to[i] - from[i]).abs() > self.reach[i] * periods)
    }

    /// Takes a command into the past; where some were missed, the way between is even.
    fn take(&mut self, q: &Joints, t_ns: u64) {
        let period_ns = self.taps.period_s() * 1e9;
        let passed_ns = self.last_ns.and_then(|last_ns| t_ns.checked_sub(last_ns));
        let passed_ns = passed_ns.map_or(f64::INFINITY, |ns| ns as f64);
        let periods = passed_ns / period_ns;
        self.last_ns = Some(t_ns);
        let goes_on = passed_ns > 0.0
            && passed_ns <= SILENCE_S.max(SILENT_PERIODS * self.taps.period_s()) * 1e9;
        if !goes_on || self.jumps_in(periods.max(1.0), self.commanded_before(0), q) {
            self.past.fill(*q);
            self.unspent = 0.0;
            return;
        }
        let elapsed = periods + self.unspent;
        let steps = elapsed.round().max(0.0);
        self.unspent = elapsed - steps;
        if steps == 0.0 {
            self.replace(*q);
            return;
        }
        let from = *self.commanded_before(0);
        for step in 1..=steps as usize {
            let share = step as f64 / steps;
            self.push(std::array::from_fn(|i| from[i] + share * (q[i] - from[i])));
        }
    }
}

/// Adds to each of the first `COUNT` joints its tap times the way from `from` to `to`.
fn add<const COUNT: usize>(sum: &mut Joints, taps: &Joints, to: &Joints, from: &Joints) {
    for i in 0..COUNT {
        sum[i] += taps[i] * (to[i] - from[i]);
    }
}

#[cfg(test)]
mod tests;
