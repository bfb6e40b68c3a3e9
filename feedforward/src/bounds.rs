//! Limits of a correction and of the commands that contain it, for one joint of a whole path.
//!
//! The correction keeps its own limits of position, rate and jerk (`envelope`, the limiter of the daemon); the
//! command, which is path plus correction, keeps the position and speed limits that the model states for the
//! joint. A path that exceeds these by itself is not slowed down: there the command is at most as fast as the path.
//!
//! The speed is limited by the mean of two passes, forwards and backwards in time: each changes the position by at
//! most the speed limit per row, hence so does their mean, and it is neither late nor early. Its corners would exceed the
//! jerk; therefore the change is smoothed, and repeated for what is left. What the limiter of the correction still leaves
//! scales the whole correction: the commands that keep the limits are a convex set, which contains the path.

use envelope::{Limiter, Limits};
use physics::Arm;
use serde::Serialize;

/// Speeds are compared within this share: positions of a table are rounded.
const SPEED_TOLERANCE: f64 = 1e-3;
/// Rounding of a position, rad or m.
pub(crate) const POSITION_ROUNDING: f64 = 1e-12;
/// Iterations that bring commands within the speed limit, each by what exceeds it, smoothed so that the correction keeps its
/// jerk.
const ITERATIONS: usize = 200;
/// Share of the speed limit for these iterations; the rest is left for rounding and for the limiter of the correction.
const SPEED_SHARE: f64 = 0.98;
/// Half the window of the smoothing, which is applied twice, s: a period of the default bandwidth in all.
const SMOOTHING_S: f64 = 0.006;

/// What limited a correction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LimitedBy {
    /// The largest dynamic correction.
    MaxMrad,
    /// Its largest rate.
    MaxRate,
    /// Its largest jerk.
    MaxJerk,
    /// The position limits of the joint.
    JointLimit,
    /// The speed limit of the joint.
    JointSpeed,
}

impl LimitedBy {
    /// As in a table: `max_mrad`, `max_rate`, `max_jerk`, `joint_limit`, `joint_speed`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::MaxMrad => "max_mrad",
            Self::MaxRate => "max_rate",
            Self::MaxJerk => "max_jerk",
            Self::JointLimit => "joint_limit",
            Self::JointSpeed => "joint_speed",
        }
    }

    /// What to change so that it limits no more.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        match self {
            Self::MaxMrad => "raise --max-mrad",
            Self::MaxRate => "raise --max-rate-mrad-s",
            Self::MaxJerk => "raise --max-jerk-mrad-s3",
            Self::JointLimit => "move the path away from the joint's limits",
            Self::JointSpeed => "slow the path down, or check the joint's max_speed in the model",
        }
    }
}

/// Limits of a joint's commands by the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointBounds {
    /// Least and largest position, rad or m.
    pub position: (f64, f64),
    /// Largest speed, rad/s or m/s; infinite where unknown.
    pub speed: f64,
}

impl JointBounds {
    /// No limits.
    pub const NONE: Self =
        Self { position: (f64::NEG_INFINITY, f64::INFINITY), speed: f64::INFINITY };

    /// Of the joints of an arm.
    #[must_use]
    pub fn of(arm: &Arm) -> Vec<Self> {
        let of_joint =
            |joint: &physics::Joint| Self { position: joint.limits, speed: joint.max_speed };
        arm.joints().iter().map(of_joint).collect()
    }

    /// Rows, from 0, in which a path is faster than the joint by itself, and its largest speed there.
    #[must_use]
    pub fn too_fast(&self, path: &[f64], step_s: f64) -> (Vec<usize>, f64) {
        let speeds = path.windows(2).map(|ends| (ends[1] - ends[0]).abs() / step_s).enumerate();
        let beyond: Vec<(usize, f64)> =
            speeds.filter(|(_, speed)| *speed > (1.0 + SPEED_TOLERANCE) * self.speed).collect();
        let largest = beyond.iter().fold(0.0, |largest: f64, (_, speed)| largest.max(*speed));
        (beyond.into_iter().map(|(row, _)| row + 1).collect(), largest)
    }

    /// Largest steps of the commands to each row of a path, rad or m: by the speed limit, or that of the path.
    fn steps_max(&self, path: &[f64], speed: f64, step_s: f64) -> Vec<f64> {
        let own = path.windows(2).map(|ends| (ends[1] - ends[0]).abs());
        std::iter::once(0.0).chain(own).map(|own| own.max(speed * step_s)).collect()
    }

    /// A request with which the commands keep the position limits, and the speed limit but for rounding, as smooth
    /// as before; bit for bit the same where nothing exceeds them.
    fn slowed(&self, path: &[f64], request: &[f64], step_s: f64) -> Vec<f64> {
        let steps_max = self.steps_max(path, self.speed, step_s);
        let steps = self.steps_max(path, SPEED_SHARE * self.speed, step_s);
        let mut allowed = request.to_vec();
        let half = (SMOOTHING_S / step_s).round().max(1.0) as usize;
        for _ in 0..ITERATIONS {
            let is_slow = excesses(path, &allowed, &steps_max).all(|e| e <= POSITION_ROUNDING);
            if !self.speed.is_finite() || is_slow {
                break;
            }
            let commands = self.nearest(path, &allowed, &steps);
            let beyond = commands.iter().zip(path).zip(&allowed).map(|((c, p), a)| c - p - a);
            let change = smoothed(&smoothed(&beyond.collect::<Vec<_>>(), half), half);
            allowed.iter_mut().zip(change).for_each(|(allowed, change)| *allowed += change);
        }
        let (lower, upper) = self.position;
        let inside = |(path, allowed): (&f64, &f64)| {
            let (lower, upper) = (lower.min(*path), upper.max(*path));
            let command = path + allowed;
            // A command inside is kept bit for bit.
            if (lower..=upper).contains(&command) {
                *allowed
            } else {
                command.clamp(lower, upper) - path
            }
        };
        path.iter().zip(&allowed).map(inside).collect()
    }

    /// The commands next to those requested that keep the position limits and largest steps to each row.
    fn nearest(&self, path: &[f64], request: &[f64], steps: &[f64]) -> Vec<f64> {
        let (lower, upper) = self.position;
        let clamped = |(path, request): (&f64, &f64)| {
            (path + request).clamp(lower.min(*path), upper.max(*path))
        };
        let commands: Vec<f64> = path.iter().zip(request).map(clamped).collect();
        let (mut forward, mut backward) = (commands.clone(), commands);
        for row in 1..path.len() {
            let (step, from) = (steps[row], forward[row - 1]);
            forward[row] = forward[row].clamp(from - step, from + step);
        }
        for row in (1..path.len()).rev() {
            let (step, from) = (steps[row], backward[row]);
            backward[row - 1] = backward[row - 1].clamp(from - step, from + step);
        }
        forward.iter().zip(backward).map(|(f, b)| 0.5 * (f + b)).collect()
    }

    /// The largest share of a correction with which the commands keep the limits: the path keeps them, and the
    /// set of commands that do is convex.
    fn share(&self, path: &[f64], correction: &[f64], steps: &[f64]) -> f64 {
        let keeps = |share: f64| {
            let scaled: Vec<f64> = correction.iter().map(|c| share * c).collect();
            let (lower, upper) = self.position;
            let inside = path.iter().zip(&scaled).all(|(path, c)| {
                let (lower, upper) = (lower.min(*path), upper.max(*path));
                (lower - POSITION_ROUNDING..=upper + POSITION_ROUNDING).contains(&(path + c))
            });
            inside && excesses(path, &scaled, steps).all(|excess| excess <= POSITION_ROUNDING)
        };
        if keeps(1.0) {
            return 1.0;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if keeps(middle) { low = middle } else { high = middle }
        }
        low
    }
}

/// A correction within its limits.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bounded {
    /// rad or m.
    pub(crate) correction: Vec<f64>,
    /// What reduced it, row by row.
    pub(crate) limited: Vec<Option<LimitedBy>>,
}

/// The correction `request` of a path, within the limits of the correction and of the joint.
pub(crate) fn bounded(
    path: &[f64],
    request: &[f64],
    (bounds, limits): (&JointBounds, &Limits),
    step_s: f64,
) -> Bounded {
    let steps_max = bounds.steps_max(path, bounds.speed, step_s);
    let allowed = bounds.slowed(path, request, step_s);
    let mut correction = limited_correction(&allowed, limits, step_s);
    let share = bounds.share(path, &correction, &steps_max);
    if share < 1.0 {
        correction.iter_mut().for_each(|c| *c *= share);
    }
    let limited = causes(path, request, &allowed, &correction, (bounds, limits), step_s, share);
    Bounded { correction, limited }
}

/// The mean over so many neighbours to each side; beyond the ends as at the ends.
fn smoothed(values: &[f64], half: usize) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    let count = (2 * half + 1) as f64;
    let at = |row: usize| {
        let sum: f64 =
            (0..=2 * half).map(|k| values[(row + k).saturating_sub(half).min(last)]).sum();
        sum / count
    };
    (0..values.len()).map(at).collect()
}

/// By how much the step of the commands to each row exceeds the largest one, rad or m; the first row has none.
fn excesses<'a>(
    path: &'a [f64],
    correction: &'a [f64],
    steps_max: &'a [f64],
) -> impl Iterator<Item = f64> + 'a {
    (0..path.len()).map(|row| {
        let before = row.saturating_sub(1);
        let step = path[row] - path[before] + (correction[row] - correction[before]);
        step.abs() - steps_max[row]
    })
}

fn limited_correction(request: &[f64], limits: &Limits, step_s: f64) -> Vec<f64> {
    let mut limiter = Limiter::at_rest();
    request.iter().map(|request| limiter.step(*request, limits, step_s)).collect()
}

/// What reduced the correction, row by row.
fn causes(
    path: &[f64],
    request: &[f64],
    allowed: &[f64],
    correction: &[f64],
    (bounds, limits): (&JointBounds, &Limits),
    step_s: f64,
    share: f64,
) -> Vec<Option<LimitedBy>> {
    let exceeded = exceeded(allowed, limits, step_s);
    let (lower, upper) = bounds.position;
    let cause = |row: usize| {
        if correction[row] == request[row] {
            return None;
        }
        let command = path[row] + request[row];
        Some(if allowed[row] != request[row] && !(lower..=upper).contains(&command) {
            LimitedBy::JointLimit
        } else if allowed[row] != request[row] || share < 1.0 {
            LimitedBy::JointSpeed
        } else {
            exceeded[row]
        })
    };
    (0..request.len()).map(cause).collect()
}

/// The limit of the correction that a request exceeded last; before the first one, the one that it exceeds next.
fn exceeded(request: &[f64], limits: &Limits, step_s: f64) -> Vec<LimitedBy> {
    let at = |row: usize| {
        let back = |k: usize| request[row.saturating_sub(k)];
        let third = back(0) - 3.0 * back(1) + 3.0 * back(2) - back(3);
        if back(0).abs() > limits.angle() {
            Some(LimitedBy::MaxMrad)
        } else if (back(0) - back(1)).abs() > limits.rate() * step_s {
            Some(LimitedBy::MaxRate)
        } else if row >= 3 && third.abs() > limits.jerk() * step_s.powi(3) {
            Some(LimitedBy::MaxJerk)
        } else {
            None
        }
    };
    let found: Vec<Option<LimitedBy>> = (0..request.len()).map(at).collect();
    let mut last = found.iter().flatten().next().copied().unwrap_or(LimitedBy::MaxJerk);
    let carry = |found: Option<LimitedBy>| {
        last = found.unwrap_or(last);
        last
    };
    found.into_iter().map(carry).collect()
}

#[cfg(test)]
mod tests;
