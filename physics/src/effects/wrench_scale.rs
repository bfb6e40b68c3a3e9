//! Scale error of the force sensor.
//!
//! `measured = (1 + s) actual + bias`, axis by axis    s: `scale`, six values (forces, then moments), sensor axes, which are taken as the
//! tool's; above −0.5 and below 1, since a larger error means a defective sensor. Source: docs/reference/effects.md. It combines as
//! described at [`Contribution::Sensor`] and acts on the tool only through compliances.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Need, Parameter, EffectScope, Range, Spec, Unit};
use crate::Wrench;
use glam::DVec3;

/// `wrench_scale`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchScale {
    values: [f64; 6],
}

impl Effect for WrenchScale {
    const SPEC: Spec = Spec {
        kind: "wrench_scale",
        scope: EffectScope::Robot,
        acts_on: ActsOn::Loads,
        needs: &[Need::Wrench],
        has_memory: false,
        parameters: &[
            Parameter::linear("scale", Unit::One, Range::Between(-0.5, 1.0)).of(Count::Exactly(6)),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: site.array("scale") })
    }

    of_robot!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [x, y, z, a, b, c] = self.values;
        let scale = Wrench { force: DVec3::new(x, y, z), moment: DVec3::new(a, b, c) };
        Contribution::Sensor { bias: Wrench::ZERO, scale, turn: DVec3::ZERO }
    }
}
