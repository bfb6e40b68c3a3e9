//! Limiters for all joints of an arm.
//!
//! Promises: each joint keeps its own limits as [`Limiter`] does. Joints that ramp at the same time do so along a straight line in
//! joint space, as far as their initial motions allow: joints whose corrections cancel at the tool
//! would otherwise cause a larger tool error during the ramp than at either end. Never reads a clock,
//! allocates or panics.

use crate::elapsed::Elapsed;
use crate::limiter::Pace;
use crate::motion::Motion;
use crate::{Limiter, Limits};

/// A way counts as this share of the longest at least: what little is left does not wait for the others.
const LEAST_WAY: f64 = 0.01;
/// And as this share of the joint's angle at least; what is nearer follows a target that moves: that is no ramp, and waits for nobody.
const NO_RAMP: f64 = 2e-3;
/// A rate or an acceleration takes as long to come to rest as the way that it makes in so many times a ramp's own time (the cube
/// root of its way over the jerk): 2.1 for a rate, 1.5 for an acceleration, by the fastest plan of each.
const TO_REST: f64 = 2.1;

/// Bounds the corrections of `N` joints; see [`Limiter`] for each.
#[derive(Clone, Copy, Debug)]
pub struct Limiters<const N: usize> {
    joints: [Limiter; N],
    /// Those that ramp along one line and have not arrived yet.
    on_line: [bool; N],
}

impl<const N: usize> Limiters<N> {
    /// No correction, at rest.
    #[must_use]
    pub const fn at_rest() -> Self {
        Self { joints: [Limiter::at_rest(); N], on_line: [false; N] }
    }

    /// Takes over corrections that others left: of each joint its value, rate and acceleration.
    #[must_use]
    pub fn from_motion(motion: impl Fn(usize) -> (f64, f64, f64)) -> Self {
        let joint = |i| {
            let (value, rate, acceleration) = motion(i);
            Limiter::from_motion(value, rate, acceleration)
        };
        Self { joints: core::array::from_fn(joint), on_line: [false; N] }
    }

    /// Each joint's.
    #[must_use]
    pub fn joints(&self) -> &[Limiter; N] {
        &self.joints
    }

    /// Stands at these values at once, without bounds: for settled poses, that no motion connects. Gives where it stands: zero for what is not finite.
    pub fn jump(&mut self, values: &[f64; N]) -> [f64; N] {
        self.joints.iter_mut().zip(values).for_each(|(joint, value)| joint.jump(*value));
        self.values()
    }

    fn values(&self) -> [f64; N] {
        core::array::from_fn(|i| self.joints[i].value())
    }

    /// All joints come to rest at their values: nothing was sent for so long that the robot has stopped.
    pub fn rest(&mut self) {
        self.joints.iter_mut().for_each(Limiter::rest);
    }

    /// The next outputs, by the rule of [`Limiter::step`], each joint as fast as it can be: for what follows a correction that moves by itself.
    pub fn step_apart(
        &mut self,
        wanted: &[f64; N],
        limits: impl Fn(usize) -> Option<Limits>,
        elapsed: Elapsed,
    ) -> [f64; N] {
        let were_on_line = core::mem::replace(&mut self.on_line, [false; N]);
        for (i, joint) in self.joints.iter_mut().enumerate() {
            let Some(limits) = limits(i) else { continue };
            if were_on_line[i] {
                // Its plan has the pace of others, of which some may now go faster.
                joint.plan_anew();
            }
            if !joint.step_with(wanted[i], &limits, elapsed) {
                joint.step_onto(&limits, Pace::ALONE, elapsed);
            }
        }
        self.values()
    }

    /// The next outputs, by the rule of [`Limiter::step`]; joints that ramp do so along one line. A joint without limits keeps its value.
    pub fn step(
        &mut self,
        wanted: &[f64; N],
        limits: impl Fn(usize) -> Option<Limits>,
        elapsed: Elapsed,
    ) -> [f64; N] {
        let (mut behind, mut any, mut has_arrived) = ([false; N], false, false);
        for (i, joint) in self.joints.iter_mut().enumerate() {
            let Some(limits) = limits(i) else { continue };
            behind[i] = !joint.step_with(wanted[i], &limits, elapsed);
            any |= behind[i];
            if self.on_line[i] && !joint.is_ramping() {
                (self.on_line[i], has_arrived) = (false, true);
            }
        }
        if any {
            self.step_together(&behind, limits, elapsed);
        }
        if has_arrived {
            // The others went at a pace that let it keep up.
            let others = self.joints.iter_mut().zip(self.on_line).filter(|(_, is_on)| *is_on);
            others.for_each(|(joint, _)| joint.plan_anew());
        }
        self.values()
    }

    /// Those that are `behind`, each as far in its share of the way as the others.
    fn step_together(
        &mut self,
        behind: &[bool; N],
        limits: impl Fn(usize) -> Option<Limits>,
        elapsed: Elapsed,
    ) {
        // A joint that brakes into new limits goes by the old ones: its way says nothing of how long the others may take.
        let brakes = |i: usize| limits(i).is_some_and(|limits| self.joints[i].brakes_into(&limits));
        let brakes: [bool; N] = core::array::from_fn(brakes);
        let offsets: [Motion; N] = core::array::from_fn(|i| self.joints[i].offset(elapsed.dt_s));
        let fastest = |ways: &[f64; N]| {
            let bound =
                (0..N).filter(|i| ways[*i] > 0.0).filter_map(|i| Some((limits(i)?, ways[i])));
            bound.fold(Pace { rate: f64::MAX, jerk: f64::MAX }, |least, (limits, way)| Pace {
                rate: least.rate.min(limits.rate() / way),
                jerk: least.jerk.min(limits.jerk() / way),
            })
        };
        // Just after a jump the trend has hardly moved: the jump itself tells how far it is.
        let distance = |i: usize| offsets[i].value.abs().max(self.joints[i].distance());
        // One that has arrived follows its target: how that moves is no way that others have to wait for.
        let ramps: [bool; N] = core::array::from_fn(|i| behind[i] || self.joints[i].is_ramping());
        let counts = |i: usize| ramps[i] && !brakes[i];
        let distances: [f64; N] =
            core::array::from_fn(|i| if counts(i) { distance(i) } else { 0.0 });
        let Pace { rate, jerk } = fastest(&distances);
        let time_s = TO_REST * libm::cbrt(1.0 / jerk).max(1.0 / rate);
        // A motion is worth the way that takes as long: slower, it would swing far beyond where it is.
        let reach = |i: usize| distances[i].max(offsets[i].reach(time_s));
        let ways: [f64; N] = core::array::from_fn(|i| if counts(i) { reach(i) } else { 0.0 });
        let longest = ways.iter().fold(0.0_f64, |longest, way| longest.max(*way));
        let no_ramp = |i: usize| limits(i).map_or(0.0, |limits| NO_RAMP * limits.angle());
        // The pace goes by the ways of all that ramp, so that the arrival of any is news for the others.
        for i in (0..N).filter(|i| ramps[*i]) {
            self.on_line[i] = ways[i] >= no_ramp(i);
        }
        let ways: [f64; N] =
            core::array::from_fn(|i| ways[i].max(LEAST_WAY * longest).max(no_ramp(i)));
        let Pace { rate, jerk } = fastest(&ways);
        for (i, joint) in self.joints.iter_mut().enumerate().filter(|(i, _)| behind[*i]) {
            let Some(limits) = limits(i) else { continue };
            let share = |of: f64, limit: f64| (of * ways[i] / limit).min(1.0);
            let pace = if distances[i] < no_ramp(i) {
                Pace::ALONE
            } else {
                Pace { rate: share(rate, limits.rate()), jerk: share(jerk, limits.jerk()) }
            };
            joint.step_onto(&limits, pace, elapsed);
        }
    }
}

#[cfg(test)]
mod tests;
