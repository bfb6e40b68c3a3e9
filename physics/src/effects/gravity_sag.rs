//! Joint deflection under gravity with unknown masses of the carried bodies.
//!
//! `δθᵢ = eᵢ · Σ_{k≥i} (R_k s_k × ĝ)`    `s_k`: three values of `sag` for each body that the joint carries, its own first,
//! rad (compliance times mass times lever times g, zero configuration, base axes) · `R_k`: rotation of body k from the zero configuration ·
//! eᵢ: the axis now · ĝ: unit gravity. Source: docs/reference/effects.md; thesis 3.10. Linear. Some of the parameters
//! are not identifiable (components along an axis, bodies whose joint never moves): rank deficiency in a fit.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext, VALUES_MAX};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Count, Parameter, EffectScope, Range, Spec, Unit};
use crate::{JOINTS_MAX, JointKind};
use glam::DVec3;

/// `gravity_sag`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GravitySag {
    joint: usize,
    values: [f64; VALUES_MAX],
    count: usize,
}

impl Effect for GravitySag {
    const SPEC: Spec = Spec {
        kind: "gravity_sag",
        scope: EffectScope::RevoluteJoint,
        acts_on: ActsOn::JointPosition,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("sag", Unit::Milliradian, Range::Any).of(Count::ThreePerCarriedBody)
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let count = site.list("sag").len();
        Ok(Self { joint: site.joint, values: site.array("sag"), count })
    }

    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn values(&self) -> &[f64] {
        &self.values[..self.count]
    }

    fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.count]
    }

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let sum: DVec3 = self.levers(signals).sum();
        Contribution::Joint { joint: self.joint, delta: sum.dot(self.pull(signals)) }
    }

    fn slope(&self, signals: &Signals<'_>) -> Slope {
        self.predict_and_slope(signals, &Memory::default()).1
    }

    /// A joint turns the lever arms of the bodies beyond it; a joint before this one also turns
    /// this axis.
    fn predict_and_slope(&self, signals: &Signals<'_>, _memory: &Memory) -> (Contribution, Slope) {
        let (chain, joints, joint) = (signals.chain, signals.arm.joints(), self.joint);
        let turns = |k: usize| {
            joints.get(k).is_some_and(|joint| joint.kind == JointKind::Revolute).then(|| chain.axis(k))
        };
        let (mut slopes, mut sum, pull) = ([0.0; JOINTS_MAX], DVec3::ZERO, self.pull(signals));
        for (k, lever) in self.levers(signals).enumerate().map(|(k, s)| (joint + k, s)).rev() {
            sum += lever;
            slopes[k] = turns(k).map_or(0.0, |by| by.dot(sum.cross(pull)));
        }
        let all = sum.cross(pull) + chain.axis(joint).cross(sum.cross(down(signals)));
        for (k, slope) in slopes[..joint].iter_mut().enumerate() {
            *slope = turns(k).map_or(0.0, |by| by.dot(all));
        }
        (Contribution::Joint { joint, delta: sum.dot(pull) }, Slope::Positions(slopes))
    }
}

/// Unit gravity, base axes.
fn down(signals: &Signals<'_>) -> DVec3 {
    signals.loads.gravity.normalize_or_zero()
}

impl GravitySag {
    /// Deflection of the joint per unit of the sum of lever arms: `ĝ × eᵢ`.
    fn pull(&self, signals: &Signals<'_>) -> DVec3 {
        down(signals).cross(signals.chain.axis(self.joint))
    }

    /// The present lever arm of each carried body, its own first, rad.
    fn levers<'s>(
        &'s self,
        signals: &'s Signals<'_>,
    ) -> impl DoubleEndedIterator<Item = DVec3> + ExactSizeIterator + 's {
        let levers = self.values().chunks_exact(3).map(DVec3::from_slice);
        (self.joint..JOINTS_MAX).zip(levers).map(|(i, s)| signals.chain.body(i).rotation * s)
    }
}
