//! Compliance of the foundation: the whole robot tilts.
//!
//! `ω = C (M_x, M_y, 0)` about the base frame's origin    C: `compliance`, rad/Nm, ≥ 0, the same about x and y · M: moment of
//! gravity and wrench about the origin, base axes, Nm. Source: docs/reference/effects.md. Linear; its mean over
//! the poses of a recording is part of an unknown measuring frame. Inertia does not act on it.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

/// `base_compliance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseCompliance {
    values: [f64; 1],
}

impl Effect for BaseCompliance {
    const SPEC: Spec = Spec {
        kind: "base_compliance",
        scope: EffectScope::Robot,
        acts_on: ActsOn::Geometry,
        needs: &[Need::Masses, Need::Wrench],
        has_memory: false,
        parameters: &[Parameter::linear("compliance", Unit::TurnCompliance, Range::NotNegative)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: [site.one("compliance")] })
    }

    of_robot!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [compliance] = self.values;
        let moment = signals.loads.base_moment;
        Contribution::BaseTurn { turn: DVec3::new(moment.x, moment.y, 0.0) * compliance }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Base(self.values[0])
    }
}
