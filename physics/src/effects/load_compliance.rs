//! Drive-train compliance under the wrench on the tool.
//!
//! `δθᵢ = C (JᵀW)ᵢ`    C: `compliance`, rad/Nm or m/N, ≥ 0 · W: the wrench ON the tool at the TCP · J: Jacobian at the TCP,
//! on the controller's geometry. Source: docs/reference/effects.md; Salisbury 1980. Linear.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::laws::Law;
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `load_compliance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadCompliance {
    joint: usize,
    values: [f64; 1],
}

impl Effect for LoadCompliance {
    const SPEC: Spec = Spec {
        kind: "load_compliance",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Wrench],
        has_memory: false,
        parameters: &[Parameter::linear("compliance", Unit::Compliance, Range::NotNegative)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("compliance")] })
    }

    of_joint!();

    by_law!();
}

impl LoadCompliance {
    fn law_of_joint(&self) -> Law {
        let [compliance] = self.values;
        Law::Compliance { gravity: 0.0, wrench: compliance, inertia: 0.0 }
    }
}
