//! Limiters for all joints of an arm.
//!
//! Each joint keeps its own limits as [`Limiter`] does. Joints that ramp at the same time move
//! along a straight line in joint space, as far as their initial motions allow: joints whose
//! corrections cancel at the tool would otherwise cause a larger tool error during the ramp than at
//! either end. No clock, no heap, no panic.

use crate::elapsed::Elapsed;
use crate::limiter::LimitShares;
use crate::motion::Motion;
use crate::{Limiter, Limits};

/// Least distance of a ramping joint, as a share of the longest one: a small remainder does not
/// wait for the others.
const DISTANCE_SHARE_MIN: f64 = 0.01;
/// Least distance, as a share of the joint's position limit; a joint closer to its target is
/// tracking it, not ramping, and waits for no other.
const TRACKING_SHARE: f64 = 2e-3;
/// A rate or an acceleration takes as long to come to rest as the distance that it covers in this
/// multiple of a ramp's own time (the cube root of its distance over the jerk): 2.1 for a rate, 1.5
/// for an acceleration, by the fastest plan of each.
const STOP_TIME_FACTOR: f64 = 2.1;

/// Limits the corrections of `N` joints; see [`Limiter`] for each.
#[derive(Clone, Copy, Debug)]
pub struct Limiters<const N: usize> {
    joints: [Limiter; N],
    /// Joints that ramp along a common line and have not arrived yet.
    on_line: [bool; N],
}

impl<const N: usize> Limiters<N> {
    /// No correction, at rest.
    #[must_use]
    pub const fn at_rest() -> Self {
        Self { joints: [Limiter::at_rest(); N], on_line: [false; N] }
    }

    /// Continues corrections from other limiters: value, rate and acceleration of each joint.
    #[must_use]
    pub fn from_motion(motion: impl Fn(usize) -> (f64, f64, f64)) -> Self {
        let joint = |i| {
            let (value, rate, acceleration) = motion(i);
            Limiter::from_motion(value, rate, acceleration)
        };
        Self { joints: core::array::from_fn(joint), on_line: [false; N] }
    }

    /// The limiter of each joint.
    #[must_use]
    pub fn joints(&self) -> &[Limiter; N] {
        &self.joints
    }

    /// Sets these values at once, without limits: for settled poses, which are not connected by
    /// motion. Returns the values set: zero for those that are not finite.
    pub fn jump(&mut self, values: &[f64; N]) -> [f64; N] {
        self.joints.iter_mut().zip(values).for_each(|(joint, value)| joint.jump(*value));
        self.values()
    }

    fn values(&self) -> [f64; N] {
        core::array::from_fn(|i| self.joints[i].value())
    }

    /// All joints come to rest at their values: nothing was sent for so long that the robot has
    /// stopped.
    pub fn rest(&mut self) {
        self.joints.iter_mut().for_each(Limiter::rest);
    }

    /// The next outputs, by the rule of [`Limiter::step`], each joint as fast as it can: for
    /// tracking a correction that moves by itself.
    pub fn step_independently(
        &mut self,
        wanted: &[f64; N],
        limits: impl Fn(usize) -> Option<Limits>,
        elapsed: Elapsed,
    ) -> [f64; N] {
        let were_on_line = core::mem::replace(&mut self.on_line, [false; N]);
        for (i, joint) in self.joints.iter_mut().enumerate() {
            let Some(limits) = limits(i) else { continue };
            if were_on_line[i] {
                // Its plan has the pace of a group in which some joints may now move faster.
                joint.drop_plan();
            }
            if !joint.try_follow(wanted[i], &limits, elapsed) {
                joint.step_on_plan(&limits, LimitShares::FULL, elapsed);
            }
        }
        self.values()
    }

    /// The next outputs, by the rule of [`Limiter::step`]; ramping joints move along one line. A
    /// joint without limits keeps its value.
    pub fn step(
        &mut self,
        wanted: &[f64; N],
        limits: impl Fn(usize) -> Option<Limits>,
        elapsed: Elapsed,
    ) -> [f64; N] {
        let (mut behind, mut any, mut has_arrived) = ([false; N], false, false);
        for (i, joint) in self.joints.iter_mut().enumerate() {
            let Some(limits) = limits(i) else { continue };
            behind[i] = !joint.try_follow(wanted[i], &limits, elapsed);
            any |= behind[i];
            if self.on_line[i] && !joint.is_ramping() {
                (self.on_line[i], has_arrived) = (false, true);
            }
        }
        if any {
            self.step_coordinated(&behind, limits, elapsed);
        }
        if has_arrived {
            // The others moved at a pace that allowed it to keep up.
            let others = self.joints.iter_mut().zip(self.on_line).filter(|(_, is_on)| *is_on);
            others.for_each(|(joint, _)| joint.drop_plan());
        }
        self.values()
    }

    /// Steps the joints that are `behind`, each at the same share of its distance as the others.
    fn step_coordinated(
        &mut self,
        behind: &[bool; N],
        limits: impl Fn(usize) -> Option<Limits>,
        elapsed: Elapsed,
    ) {
        // A joint that brakes into new limits uses the old ones: its distance does not determine
        // how long the others may take.
        let brakes =
            |i: usize| limits(i).is_some_and(|limits| self.joints[i].is_braking_into(&limits));
        let brakes: [bool; N] = core::array::from_fn(brakes);
        let offsets: [Motion; N] = core::array::from_fn(|i| self.joints[i].offset(elapsed.dt_s));
        let fastest = |ways: &[f64; N]| {
            let bound =
                (0..N).filter(|i| ways[*i] > 0.0).filter_map(|i| Some((limits(i)?, ways[i])));
            bound.fold(LimitShares { rate: f64::MAX, jerk: f64::MAX }, |smallest, (limits, way)| {
                LimitShares {
                    rate: smallest.rate.min(limits.rate() / way),
                    jerk: smallest.jerk.min(limits.jerk() / way),
                }
            })
        };
        // Just after a jump the trend has hardly moved: the jump itself gives the distance.
        let distance = |i: usize| offsets[i].value.abs().max(self.joints[i].distance());
        // A joint that has arrived tracks its target: this motion is not a distance that others
        // have to wait for.
        let ramps: [bool; N] = core::array::from_fn(|i| behind[i] || self.joints[i].is_ramping());
        let counts = |i: usize| ramps[i] && !brakes[i];
        let distances: [f64; N] =
            core::array::from_fn(|i| if counts(i) { distance(i) } else { 0.0 });
        let LimitShares { rate, jerk } = fastest(&distances);
        let time_s = STOP_TIME_FACTOR * libm::cbrt(1.0 / jerk).max(1.0 / rate);
        // A motion counts as the distance that takes as long: at a slower pace it would overshoot
        // far.
        let reach = |i: usize| distances[i].max(offsets[i].largest_distance(time_s));
        let ways: [f64; N] = core::array::from_fn(|i| if counts(i) { reach(i) } else { 0.0 });
        let longest = ways.iter().fold(0.0_f64, |longest, way| longest.max(*way));
        let no_ramp = |i: usize| limits(i).map_or(0.0, |limits| TRACKING_SHARE * limits.angle());
        // The pace depends on the distances of all ramping joints, so the arrival of any changes it
        // for the others.
        for i in (0..N).filter(|i| ramps[*i]) {
            self.on_line[i] = ways[i] >= no_ramp(i);
        }
        let ways: [f64; N] =
            core::array::from_fn(|i| ways[i].max(DISTANCE_SHARE_MIN * longest).max(no_ramp(i)));
        let LimitShares { rate, jerk } = fastest(&ways);
        for (i, joint) in self.joints.iter_mut().enumerate().filter(|(i, _)| behind[*i]) {
            let Some(limits) = limits(i) else { continue };
            let share = |requested: f64, limit: f64| (requested * ways[i] / limit).min(1.0);
            let pace = if distances[i] < no_ramp(i) {
                LimitShares::FULL
            } else {
                LimitShares { rate: share(rate, limits.rate()), jerk: share(jerk, limits.jerk()) }
            };
            joint.step_on_plan(&limits, pace, elapsed);
        }
    }
}

#[cfg(test)]
mod tests;
