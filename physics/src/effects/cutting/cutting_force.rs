//! Deviation of the specific cutting force: a force proportional to chip thickness.
//!
//! `F += k a h`, `h = f_t sin φ`    k: `coefficient`, tangential, radial, axial, N/m²; in addition to the recording's `[cut]`.
//! Source: docs/reference/effects.md; thesis 4.7. Memoryless.

use crate::cut::ForceTerm;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

/// `cutting_force`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CuttingForce {
    values: [f64; 3],
}

impl Effect for CuttingForce {
    const SPEC: Spec = Spec {
        kind: "cutting_force",
        scope: EffectScope::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear(
            "coefficient",
            Unit::NewtonPerSquareMillimetre,
            Range::Any,
        )
        .of(Count::Exactly(3))],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: site.array("coefficient") })
    }

    of_robot!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        Contribution::ToolForce(ForceTerm::Chip(DVec3::from_array(self.values)))
    }
}
