//! Tilt of a main bearing under the moment perpendicular to its axis.
//!
//! Everything that joint i carries rotates by `C (M − (M·eᵢ) eᵢ)` about the pivot    C: `compliance`, rad/Nm, ≥ 0, the same about both normals ·
//! M: moment of gravity and wrench about the pivot, Nm · `pivot`: on the axis, the joint's point unless given.
//! Source: docs/reference/effects.md; Abele's virtual joints (thesis 1.10). Linear. Inertia and a counterbalance's spring do not act on it.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Need, Parameter, EffectScope, Range, Spec, Unit};
use crate::Frame;
use glam::DVec3;

/// `bearing_compliance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingCompliance {
    joint: usize,
    values: [f64; 1],
    pivot: DVec3,
}

impl Effect for BearingCompliance {
    const SPEC: Spec = Spec {
        kind: "bearing_compliance",
        scope: EffectScope::Joint,
        acts_on: ActsOn::Geometry,
        needs: &[Need::Masses, Need::Wrench],
        has_memory: false,
        parameters: &[
            Parameter::linear("compliance", Unit::TurnCompliance, Range::NotNegative),
            Parameter::setting("pivot", Unit::Millimetre, Range::Any).of(Count::Exactly(3)),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("compliance")], pivot: site.pivot()? })
    }

    of_joint!();

    /// The tilt is applied before the joint's own motion; since it is normal to the axis and its
    /// pivot is on the axis, the order does not matter.
    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let i = self.joint;
        let (loads, chain) = (signals.loads, signals.chain);
        let carrier = if i == 0 { Frame::IDENTITY } else { chain.body(i - 1) };
        let (point, pivot) = (chain.point(i), carrier.point(self.pivot));
        let moment = loads.gravity_at(i).moment_about(point, pivot)
            + loads.wrench_at(i, chain).moment_about(point, pivot);
        let across = moment - chain.axis(i) * chain.axis(i).dot(moment);
        let turn = carrier.rotation.transpose() * across * self.values[0];
        Contribution::LinkTurn { link: i, turn, pivot: self.pivot }
    }
}
