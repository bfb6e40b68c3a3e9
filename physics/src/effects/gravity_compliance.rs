//! Drive-train compliance under gravity.
//!
//! `δθᵢ = C τ_grav,i`, `τ_grav,i = −∂V/∂qᵢ`    C: `compliance`, rad/Nm or m/N, ≥ 0 · V: potential of the known
//! masses and of counterbalance springs. Source: docs/reference/effects.md. Linear; needs the arm's masses, no effect without them.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::laws::Law;
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `gravity_compliance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GravityCompliance {
    joint: usize,
    values: [f64; 1],
}

impl Effect for GravityCompliance {
    const SPEC: Spec = Spec {
        kind: "gravity_compliance",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Masses],
        has_memory: false,
        parameters: &[Parameter::linear("compliance", Unit::Compliance, Range::NotNegative)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("compliance")] })
    }

    of_joint!();

    by_law!();
}

impl GravityCompliance {
    fn law_of_joint(&self) -> Law {
        let [compliance] = self.values;
        Law::Compliance { gravity: compliance, wrench: 0.0, inertia: 0.0 }
    }
}
