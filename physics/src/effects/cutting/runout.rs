//! Runout: the tool axis is offset from the spindle axis, so that teeth cut unequal chips and forces repeat with the spindle revolution.
//!
//! Tooth j protrudes by `r_j = ρ cos(λ − 2πj/N)` and cuts `h + r_j − r_{j+1}`, where tooth `j + 1` is the preceding one.
//! ρ: `radial`, m, ≥ 0 · λ: `phase`, rad, from tooth 0 towards tooth 1. With two teeth `ρ cos λ` alone acts; with one tooth nothing does.
//! Source: docs/reference/effects.md; Kline, 1983. Holds while every tooth still cuts. Memoryless.

use crate::cut::ForceTerm;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `runout`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Runout {
    values: [f64; 2],
}

impl Effect for Runout {
    const SPEC: Spec = Spec {
        kind: "runout",
        scope: EffectScope::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[Need::SpindleSpeed],
        has_memory: false,
        parameters: &[
            Parameter::linear("radial", Unit::Micrometre, Range::NotNegative),
            Parameter::nonlinear("phase", Unit::PhaseRadian, Range::Any),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: [site.one("radial"), site.one("phase")] })
    }

    of_robot!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [radial, phase] = self.values;
        let (sin, cos) = libm::sincos(phase);
        Contribution::ToolForce(ForceTerm::Runout([radial * cos, radial * sin]))
    }
}
