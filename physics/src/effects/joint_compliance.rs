//! Drive-train compliance under gravity, wrench and inertia.
//!
//! `δθᵢ = C τᵢ`, `τᵢ = τ_grav,i + (JᵀW)ᵢ − (M q̈ + C q̇)ᵢ`    C: `compliance`, rad/Nm or m/N, ≥ 0.
//! Source: docs/reference/effects.md; Spong 1987, flexible joints. Not to be combined with `gravity_compliance` or `load_compliance` on one joint,
//! which are its two parts. Linear: valid well below the torque at which a gear train stiffens.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::laws::Law;
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `joint_compliance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCompliance {
    joint: usize,
    values: [f64; 1],
}

impl Effect for JointCompliance {
    const SPEC: Spec = Spec {
        kind: "joint_compliance",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Masses, Need::Wrench],
        has_memory: false,
        parameters: &[Parameter::linear("compliance", Unit::Compliance, Range::NotNegative)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("compliance")] })
    }

    of_joint!();

    by_law!();
}

impl JointCompliance {
    fn law_of_joint(&self) -> Law {
        let [compliance] = self.values;
        Law::Compliance { gravity: compliance, wrench: compliance, inertia: compliance }
    }
}
