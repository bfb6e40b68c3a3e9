//! Independent check of the targets sent to a robot, from the time, the command, the target sent,
//! and the active limits. Every tick is checked, in any state of daemon and client. Its rules, with
//! `c = sent - command` of each joint:
//!
//! 1. For a command of finite values the target has the same number of finite values.
//! 2. `|c| ≤ angle`, to rounding.
//! 3. `|Δc| ≤ rate · Δt` over the time between two ticks: of their commands' stamps while those stay within 20 ms of the clock, else of the clock.
//! 4. The third divided difference of any four ticks in a row is at most the jerk. If ticks are
//!    unevenly spaced, the times at which a robot executes them are uncertain by the spread `u` of the
//!    newest intervals (their median at most: a missed cycle is not jitter): the effect of `v u` at
//!    the rate `v` is allowed.
//! 5. After a silence (longer than 20 ms, and than three times the shorter of the two intervals
//!    before it) the robot has stopped: `c` is unchanged, and continues from rest. This also applies
//!    after an answer that the controller has not used.
//! 6. After the limits changed, the larger of the old and the new ones apply for as long as braking
//!    from the former into the latter may take; then the new ones.
//! 7. In shadow mode the target is the command, bit for bit, once an existing correction has had
//!    the time of rule 6.

use crate::cell_loop::JOINTS;
use shm_schema::JointBounds;
use std::collections::VecDeque;

/// Rounding of a sum and a difference, rad; and per rad of the command.
const ROUNDING: f64 = 1e-15;
const RELATIVE: f64 = 1e-15;
/// Largest difference between command stamps and the clock, ns; beyond it the clock was set.
const STAMPED_NS: u64 = 20_000_000;
/// Ticks closer than this are not separate samples of the jerk, s: half the period of the fastest
/// cycle.
const NODES_S: f64 = 5e-5;
const SILENCE_S: f64 = 0.02;
/// A robot that stopped is represented by two times at rest, this far apart, s: its motion
/// continues from rest.
const STOOD_S: f64 = 4e-3;
const SILENT_INTERVALS: f64 = 3.0;
/// Number of intervals used for the timing uncertainty.
const INTERVALS: usize = 10;

/// The bounds of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CorrectionBounds {
    angle: f64,
    rate: f64,
    jerk: f64,
}

impl CorrectionBounds {
    fn union(self, other: Self) -> Self {
        Self {
            angle: self.angle.max(other.angle),
            rate: self.rate.max(other.rate),
            jerk: self.jerk.max(other.jerk),
        }
    }

    /// The longest braking time between any two states within the limits, s: each way across the
    /// whole position range, at the rate or by jerk alone, whichever is slower.
    fn longest_s(self) -> f64 {
        let Self { angle, rate, jerk } = self;
        2.0 * (2.0 * angle / rate + 2.0 * (rate / jerk).sqrt() + (64.0 * angle / jerk).cbrt())
    }

    /// The longest time to ramp a correction to zero that initially moves away at the rate limit,
    /// s.
    fn out_s(self, correction: f64) -> f64 {
        let further = self.rate * (self.rate / self.jerk).sqrt();
        Self { angle: self.angle.min(correction + further), ..self }.longest_s()
    }
}

/// One tick.
#[derive(Clone, Copy, Debug)]
struct CheckedTick {
    t_s: f64,
    correction: [f64; JOINTS],
    /// Rounding error of each, rad.
    rounding: [f64; JOINTS],
}

/// The oracle.
#[derive(Clone, Debug)]
pub struct Oracle {
    bounds: [CorrectionBounds; JOINTS],
    /// Former bounds that still apply during braking, and until when, s.
    former: Vec<(f64, [CorrectionBounds; JOINTS])>,
    /// The newest nodes, oldest first, and the tick after the last of them.
    nodes: VecDeque<CheckedTick>,
    last: Option<CheckedTick>,
    /// The correction at the start of a run.
    first: [f64; JOINTS],
    /// Whether the robot is at rest at the next correction.
    is_at_rest: bool,
    /// Intervals since a silence, s; and the last two, including silences.
    intervals: VecDeque<f64>,
    before_s: [f64; 2],
    /// Time from which the rule of shadow mode applies, s.
    shadow_from_s: Option<f64>,
    /// Time for which the sender may not know of a change, s.
    delay_s: f64,
    start_ns: Option<u64>,
    /// The newest stamp, and the offset of the stamps, ns.
    stamp_ns: u64,
    ahead_ns: i64,
    /// Resolution of the correction by the numbers that transmit it, rad.
    resolution: f64,
}

impl Oracle {
    /// Before the first tick, with these limits; the sender may learn of a change up to `delay_s`
    /// late.
    #[must_use]
    pub fn new(bounds: &JointBounds, delay_s: f64) -> Self {
        Self {
            bounds: of(bounds),
            former: Vec::new(),
            nodes: VecDeque::new(),
            last: None,
            first: [0.0; JOINTS],
            // The first stamps may be known later than the first times: until then the robot is not
            // at rest.
            is_at_rest: false,
            intervals: VecDeque::new(),
            before_s: [0.0; 2],
            shadow_from_s: None,
            delay_s,
            start_ns: None,
            stamp_ns: 0,
            ahead_ns: 0,
            resolution: ROUNDING,
        }
    }

    /// The same for targets with this resolution, rad.
    #[must_use]
    pub fn with_resolution(self, resolution: f64) -> Self {
        Self { resolution: self.resolution + resolution, ..self }
    }

    /// Sets new bounds.
    pub fn set_bounds(&mut self, t_ns: u64, bounds: &JointBounds) {
        let (t_s, new) = (self.seconds(t_ns), of(bounds));
        if new == self.bounds {
            return;
        }
        let former = std::mem::replace(&mut self.bounds, new);
        let longest_s = former
            .iter()
            .zip(new)
            .map(|(old, new)| old.longest_s().max(new.longest_s()).max(old.union(new).longest_s()));
        let until_s = t_s + self.delay_s + longest_s.fold(0.0, f64::max);
        self.former.push((until_s, former));
    }

    /// Shadow mode begins or ends.
    pub fn set_shadow(&mut self, t_ns: u64, is_shadow: bool) {
        // Before the first tick there was no correction to ramp out.
        let ramp_s = self.last.map_or(0.0, |last| {
            let longest_s = |i: usize| self.in_force(i).out_s(last.correction[i].abs());
            self.delay_s + (0..JOINTS).map(longest_s).fold(0.0, f64::max)
        });
        let from_s = self.seconds(t_ns) + ramp_s;
        self.shadow_from_s = match (self.shadow_from_s, is_shadow) {
            (_, false) => None,
            (Some(from_s), true) => Some(from_s),
            (None, true) => Some(from_s),
        };
    }

    /// The robot begins a run at its command plus this correction.
    pub fn begin(&mut self, correction: &[f64]) {
        self.nodes.clear();
        self.intervals.clear();
        self.before_s = [0.0; 2];
        (self.stamp_ns, self.ahead_ns) = (0, 0);
        self.first = std::array::from_fn(|i| correction.get(i).copied().unwrap_or(0.0));
        self.last = None;
        self.is_at_rest = true;
    }

    /// The robot has not used the last target, and is at rest.
    pub fn rests(&mut self) {
        self.nodes.clear();
    }

    /// Checks a tick.
    ///
    /// # Errors
    /// The violated rule, as text.
    pub fn take(
        &mut self,
        now_ns: u64,
        stamp_ns: u64,
        command: &[f64],
        sent: &[f64],
    ) -> Result<(), String> {
        let by_stamp_ns = stamp_ns.saturating_add_signed(self.ahead_ns);
        let is_near = by_stamp_ns.abs_diff(now_ns) <= STAMPED_NS;
        let is_new = stamp_ns != std::mem::replace(&mut self.stamp_ns, stamp_ns);
        if is_new && !is_near {
            self.ahead_ns = now_ns.cast_signed().wrapping_sub(stamp_ns.cast_signed());
        }
        let t_s = self.seconds(if is_new && is_near { by_stamp_ns } else { now_ns });
        let t_s = self.last.map_or(t_s, |last| last.t_s.max(t_s));
        if command.len() != sent.len() || sent.len() != JOINTS {
            return Err(format!("{} joints sent for {}", sent.len(), command.len()));
        }
        if command.iter().any(|q| !q.is_finite()) {
            return Err("a command that is not a number was answered".to_owned());
        }
        let correction: [f64; JOINTS] = std::array::from_fn(|i| sent[i] - command[i]);
        self.former.retain(|(until_s, _)| *until_s >= t_s);
        let mut broken = Ok(());
        if self.shadow_from_s.is_some_and(|from_s| t_s >= from_s)
            && sent.iter().zip(command).any(|(a, b)| a.to_bits() != b.to_bits())
        {
            broken = Err(format!("shadow mode sends {sent:?} for {command:?}"));
        }
        let rounding = std::array::from_fn(|i| self.resolution + RELATIVE * command[i].abs());
        let now = CheckedTick { t_s, correction, rounding };
        let judged = self.judge(&now);
        self.remember(now);
        broken.and(judged)
    }

    fn judge(&self, now: &CheckedTick) -> Result<(), String> {
        for i in 0..JOINTS {
            let bounds = self.in_force(i);
            let (c, rounding) = (now.correction[i], 2.0 * now.rounding[i]);
            if !c.is_finite() || c.abs() > bounds.angle * (1.0 + 1e-9) + rounding {
                return Err(format!("joint {i} is corrected by {c:e}, bound {:e}", bounds.angle));
            }
            let Some(last) = &self.last else {
                if (c - self.first[i]).abs() > rounding {
                    return Err(format!("joint {i} begins with a correction of {c:e}"));
                }
                continue;
            };
            let (moved, dt_s) = ((c - last.correction[i]).abs(), now.t_s - last.t_s);
            let most = if self.is_silence(dt_s) { 0.0 } else { bounds.rate * dt_s * (1.0 + 1e-9) };
            if moved > most + rounding + last.rounding[i] {
                return Err(format!("joint {i} moved by {moved:e} in {dt_s:.6} s, bound {most:e}"));
            }
            self.judge_jerk(now, i, bounds.jerk)?;
        }
        Ok(())
    }

    fn judge_jerk(&self, now: &CheckedTick, i: usize, bound: f64) -> Result<(), String> {
        let dt_s = self.last.as_ref().map_or(0.0, |last| now.t_s - last.t_s);
        if self.is_silence(dt_s) || self.nodes.len() < 3 {
            return Ok(());
        }
        let mut four = [*now; 4];
        let nodes = self.nodes.iter().rev().take(3).rev();
        four.iter_mut().zip(nodes).for_each(|(slot, node)| *slot = *node);
        let (mut jerk, mut weights, mut rounding) = (0.0, 0.0, 0.0);
        for (k, node) in four.iter().enumerate() {
            let gaps = (0..4).filter(|j| *j != k).map(|j| node.t_s - four[j].t_s);
            let weight = 6.0 / gaps.product::<f64>();
            jerk += weight * node.correction[i];
            weights += weight.abs();
            rounding += weight.abs() * node.rounding[i];
        }
        let uncertain = self.fastest(i) * self.spread_s(dt_s);
        let most = bound * (1.0 + 1e-6) + uncertain * weights + rounding;
        if jerk.abs() > most {
            let row = |node: &CheckedTick| format!("{:.6} s {:e}", node.t_s, node.correction[i]);
            let rows: Vec<String> = self.nodes.iter().chain([now]).map(row).collect();
            let text = format!("jerk of {jerk:e}, bound {bound:e} ({most:e})");
            return Err(format!("joint {i} has a {text}: {}", rows.join(", ")));
        }
        Ok(())
    }

    fn remember(&mut self, now: CheckedTick) {
        if let Some(last) = self.last {
            let dt_s = now.t_s - last.t_s;
            if self.is_silence(dt_s) {
                self.nodes.clear();
                self.intervals.clear();
                self.is_at_rest = true;
            } else if dt_s > 0.0 {
                self.intervals.push_back(dt_s);
            }
            if dt_s > 0.0 {
                self.before_s = [dt_s, self.before_s[0]];
            }
        }
        if self.intervals.len() > INTERVALS {
            self.intervals.pop_front();
        }
        if std::mem::take(&mut self.is_at_rest) {
            for times in [2.0, 1.0] {
                let mut stood = now;
                stood.t_s -= times * STOOD_S;
                self.nodes.push_back(stood);
            }
        }
        if self.nodes.back().is_none_or(|node| now.t_s - node.t_s >= NODES_S) {
            self.nodes.push_back(now);
        }
        if self.nodes.len() > INTERVALS {
            self.nodes.pop_front();
        }
        self.last = Some(now);
    }

    fn is_silence(&self, dt_s: f64) -> bool {
        let [last_s, before_s] = self.before_s;
        dt_s > SILENCE_S.max(SILENT_INTERVALS * last_s.min(before_s)) * (1.0 + 1e-9)
    }

    fn spread_s(&self, dt_s: f64) -> f64 {
        let mut all: Vec<f64> = self.intervals.iter().copied().chain([dt_s]).collect();
        all.sort_by(f64::total_cmp);
        (all[all.len() - 1] - all[0]).min(all[all.len() / 2])
    }

    /// The largest rate of the newest nodes, at their ends too.
    fn fastest(&self, i: usize) -> f64 {
        let rates: Vec<(f64, f64)> = self
            .nodes
            .iter()
            .zip(self.nodes.iter().skip(1))
            .map(|(a, b)| {
                let dt_s = b.t_s - a.t_s;
                (dt_s, (b.correction[i] - a.correction[i]) / dt_s)
            })
            .collect();
        let mean = rates.iter().fold(0.0, |most: f64, (_, rate)| most.max(rate.abs()));
        let changes = rates.windows(2).map(|two| (two[1].1 - two[0].1).abs());
        mean + 3.0 * changes.fold(0.0, f64::max)
    }

    fn in_force(&self, i: usize) -> CorrectionBounds {
        self.former.iter().fold(self.bounds[i], |all, (_, former)| all.union(former[i]))
    }

    /// Time since the first one: small numbers, so that differences are exact to ns.
    fn seconds(&mut self, t_ns: u64) -> f64 {
        let start_ns = *self.start_ns.get_or_insert(t_ns);
        t_ns.saturating_sub(start_ns) as f64 * 1e-9
    }
}

fn of(bounds: &JointBounds) -> [CorrectionBounds; JOINTS] {
    std::array::from_fn(|i| CorrectionBounds {
        angle: bounds.angle[i],
        rate: bounds.rate[i],
        jerk: bounds.jerk[i],
    })
}

#[cfg(test)]
mod tests;
