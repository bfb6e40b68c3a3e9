//! What a joint yields under the weight of the bodies beyond it, where their masses are unknown.
//!
//! `δθᵢ = eᵢ · Σ_{k≥i} (R_k s_k × ĝ)`    `s_k`: three numbers of `sag` for each body that the joint carries, its own first,
//! rad (compliance times mass times lever times g, zero configuration, base axes) · `R_k`: rotation of body k from the zero configuration ·
//! eᵢ: the axis now · ĝ: unit gravity. Source: contract `effects.md`; thesis 3.10. Linear. Some of the numbers
//! cannot be told apart (those along an axis, those of bodies whose joint never turns): a fit sees that as missing rank.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, Site, VALUES_MAX};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Parameter, Place, Range, Spec, Unit};
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
        place: Place::RevoluteJoint,
        acts_on: ActsOn::JointPosition,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("sag", Unit::Milliradian, Range::Any).of(Count::ThreePerCarriedBody)
        ],
    };

    fn build(site: &Site<'_>) -> Result<Self, BuildError> {
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
        let bodies = &signals.chain.bodies[self.joint..];
        let levers = self.values().chunks_exact(3).map(DVec3::from_slice);
        let sum: DVec3 = bodies.iter().zip(levers).map(|(body, s)| body.rotation * s).sum();
        let down = signals.loads.gravity.normalize_or_zero();
        let delta = signals.chain.axes[self.joint].dot(sum.cross(down));
        Contribution::Joint { joint: self.joint, delta }
    }
}
