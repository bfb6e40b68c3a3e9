//! Filter for commands that arrive one by one, with a preview of the setpoints that follow.
//!
//! A delay can be compensated only where the path is known ahead. With a horizon of at least delay plus lags the filter applies; setpoints beyond the horizon are extrapolated at
//! the speed of the last known ones. Without it only lags are compensated, `c = Σ T · dq/dt`, which is their exact inverse: joints with the same delay then stay on the path, late by
//! the delay. (Extrapolating at constant speed over the delay would reduce the lateness, but the tool would leave the path at each corner.) If a joint has a mode, nothing is compensated without a
//! horizon: the lag keeps corners from exciting the mode.
//!
//! Commands count as equally spaced by the period of the cell: times of commands serve to find missed ones, not to measure speeds, since their jitter would appear as one.
//!
//! The lead is zero at rest, and after a restart until the joints move. [`Filter::new`] allocates; a step does not. Limits are left to the corrector's limiter.

use crate::taps::FilterTaps;
use physics::{JOINTS_MAX, Joints};

/// Commands further apart than this, s, and than [`SILENT_PERIODS`] periods do not belong to one motion: the robot has stopped in between. Both values are those of the
/// corrector's limiters (`envelope/src/elapsed.rs`).
const SILENCE_S: f64 = 0.02;
const SILENT_PERIODS: f64 = 3.0;
/// Number of joints of most arms: sums over this many take less than half of the time of those over [`JOINTS_MAX`].
const USUAL_JOINTS: usize = 8;

/// Number of setpoints from which a lead was computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lookahead {
    /// Known setpoints after the command, at most `used_at_most`.
    pub known: usize,
    /// Largest number of setpoints that the filter uses.
    pub used_at_most: usize,
    /// Number required to compensate delay and modes.
    pub needed: usize,
}

impl Lookahead {
    /// Whether delay and modes can be compensated; otherwise only lags are compensated.
    #[must_use]
    pub fn is_sufficient(&self) -> bool {
        self.known >= self.needed
    }
}

/// The filter of one arm.
#[derive(Clone, Debug)]
pub struct Filter {
    taps: FilterTaps,
    /// The last commands, one per period: a ring buffer stored twice in succession, so that any `length` consecutive entries are contiguous.
    past: Vec<Joints>,
    length: usize,
    /// Index of the newest command in the first copy.
    newest: usize,
    last_ns: Option<u64>,
    /// Largest motion of a joint from one command to the next, rad or m; a larger one is a jump.
    reach: Joints,
    /// Difference between the commands' times and the periods counted, periods, −0.5 to 0.5.
    time_offset: f64,
}

impl Filter {
    /// A filter without history, for joints that move by at most `reach` from one command to the next, rad or m; may be infinite.
    #[must_use]
    pub fn new(taps: FilterTaps, reach: Joints) -> Self {
        let length = taps.commands_ahead() + 1;
        let past = vec![[0.0; JOINTS_MAX]; 2 * length];
        Self { taps, past, length, newest: 0, last_ns: None, reach, time_offset: 0.0 }
    }

    /// Number of setpoints after a command that the filter uses.
    #[must_use]
    pub fn commands_ahead(&self) -> usize {
        self.taps.commands_ahead()
    }

    /// Copies the command history of another model's filter. A filter with another period restarts.
    pub fn continue_from(&mut self, before: &Self) {
        self.restart();
        if self.taps.period_s() != before.taps.period_s() {
            return;
        }
        for commands in (0..self.length).rev() {
            self.push(*before.commanded_before(commands));
        }
        (self.last_ns, self.time_offset) = (before.last_ns, before.time_offset);
    }

    /// Clears the history: the next command is treated as that of a robot at rest.
    pub fn restart(&mut self) {
        self.last_ns = None;
    }

    /// Lead to be added to `q`, the command for the time `t_ns`, rad or m; `following`: setpoints after it, one period apart.
    ///
    /// A command that is not finite is ignored; its lead is zero. The filter restarts if the time does not increase, if more than 20 ms and three periods have passed, or if a joint
    /// jumps.
    pub fn step(&mut self, q: &Joints, t_ns: u64, following: &[Joints]) -> (Joints, Lookahead) {
        let following = &following[..following.len().min(self.commands_ahead())];
        let ahead = Lookahead {
            known: following.len(),
            used_at_most: self.commands_ahead(),
            needed: self.taps.commands_needed(),
        };
        if !q.iter().all(|q| q.is_finite()) {
            return ([0.0; JOINTS_MAX], ahead);
        }
        self.record_command(q, t_ns);
        let lead = match ahead.is_sufficient() {
            true if self.taps.joints() <= USUAL_JOINTS => self.lead::<USUAL_JOINTS>(following),
            true => self.lead::<JOINTS_MAX>(following),
            false => self.lag_lead(),
        };
        (lead, ahead)
    }

    /// Sum over the past commands, the known setpoints and their extrapolation at constant speed, for the first `COUNT` joints.
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
        // Whole strides of the horizon; the remaining known setpoints are less than one stride.
        let known = following.len() / stride;
        let ahead = |k: usize| if k == 0 { now } else { &following[k * stride - 1] };
        let end = ahead(known);
        let before_end = if known == 0 { self.commanded_before(stride) } else { ahead(known - 1) };
        let [rest, steps] = taps.extrapolation_taps(known);
        add::<COUNT>(&mut lead, rest, end, now);
        add::<COUNT>(&mut lead, steps, end, before_end);
        lead
    }

    /// The sum of the lags times the speed over the last stride.
    fn lag_lead(&self) -> Joints {
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

    /// Whether the motion of a joint from one setpoint to the next is a jump.
    #[must_use]
    pub fn is_jump(&self, from: &Joints, to: &Joints) -> bool {
        self.is_jump_in(1.0, from, to)
    }

    /// The same for setpoints this number of periods apart.
    fn is_jump_in(&self, periods: f64, from: &Joints, to: &Joints) -> bool {
        (0..JOINTS_MAX).any(|i| (to[i] - from[i]).abs() > self.reach[i] * periods)
    }

    /// Adds a command to the history; missed commands are interpolated linearly.
    fn record_command(&mut self, q: &Joints, t_ns: u64) {
        let period_ns = self.taps.period_s() * 1e9;
        let passed_ns = self.last_ns.and_then(|last_ns| t_ns.checked_sub(last_ns));
        let passed_ns = passed_ns.map_or(f64::INFINITY, |ns| ns as f64);
        let periods = passed_ns / period_ns;
        self.last_ns = Some(t_ns);
        let is_contiguous = passed_ns > 0.0
            && passed_ns <= SILENCE_S.max(SILENT_PERIODS * self.taps.period_s()) * 1e9;
        if !is_contiguous || self.is_jump_in(periods.max(1.0), self.commanded_before(0), q) {
            self.past.fill(*q);
            self.time_offset = 0.0;
            return;
        }
        let elapsed = periods + self.time_offset;
        let steps = elapsed.round().max(0.0);
        self.time_offset = elapsed - steps;
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

/// Adds to each of the first `COUNT` joints its tap times the motion from `from` to `to`.
fn add<const COUNT: usize>(sum: &mut Joints, taps: &Joints, to: &Joints, from: &Joints) {
    for i in 0..COUNT {
        sum[i] += taps[i] * (to[i] - from[i]);
    }
}

#[cfg(test)]
mod tests;
