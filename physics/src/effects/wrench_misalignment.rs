//! Misalignment of the force sensor.
//!
//! `actual = R(t) measured`, forces and moments alike    t: `turn`, rotation vector, rad, sensor axes, which are taken as the tool's; about the
//! TCP. Source: docs/reference/effects.md. It combines as described at [`Contribution::Sensor`] and acts on the tool only through compliances.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Need, Parameter, EffectScope, Range, Spec, Unit};
use crate::Wrench;
use glam::DVec3;

/// `wrench_misalignment`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchMisalignment {
    values: [f64; 3],
}

impl Effect for WrenchMisalignment {
    const SPEC: Spec = Spec {
        kind: "wrench_misalignment",
        scope: EffectScope::Robot,
        acts_on: ActsOn::Loads,
        needs: &[Need::Wrench],
        has_memory: false,
        parameters: &[
            Parameter::linear("turn", Unit::TurnMilliradian, Range::Any).of(Count::Exactly(3)),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: site.array("turn") })
    }

    of_robot!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let turn = DVec3::from_array(self.values);
        Contribution::Sensor { bias: Wrench::ZERO, scale: Wrench::ZERO, turn }
    }
}
