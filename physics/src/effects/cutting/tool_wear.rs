//! Tool wear: the edge force increases along the cut.
//!
//! `F_edge ← F_edge (1 + g s)`    g: `growth`, 1/m, ≥ 0 · s: metres that the tool was fed through the work since the segment began.
//! Source: docs/reference/effects.md. Acts on all edge forces, including `edge_force`. Memoryless: the distance comes with the sample.

use crate::cut::ForceTerm;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Parameter, EffectScope, Range, Spec, Unit};

/// `tool_wear`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolWear {
    values: [f64; 1],
}

impl Effect for ToolWear {
    const SPEC: Spec = Spec {
        kind: "tool_wear",
        scope: EffectScope::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear("growth", Unit::PerMetre, Range::NotNegative)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: [site.one("growth")] })
    }

    of_robot!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        Contribution::ToolForce(ForceTerm::Wear(self.values[0]))
    }
}
