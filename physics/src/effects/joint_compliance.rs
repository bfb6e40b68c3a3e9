//! A drive train that winds up under all that pulls at its joint.
//!
//! `δθᵢ = C τᵢ`, `τᵢ = τ_grav,i + (JᵀW)ᵢ − (M q̈ + C q̇)ᵢ`    C: `compliance`, rad/Nm or m/N, ≥ 0.
//! Source: contract `effects.md`; Spong 1987, flexible joints. Not beside `gravity_compliance` or `load_compliance` on one joint,
//! which are its two halves. Linear: holds well below the torque at which a gear train stiffens.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, Site};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, Place, Range, Spec, Unit};

/// `joint_compliance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCompliance {
    joint: usize,
    values: [f64; 1],
}

impl Effect for JointCompliance {
    const SPEC: Spec = Spec {
        kind: "joint_compliance",
        place: Place::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Masses, Need::Wrench],
        has_memory: false,
        parameters: &[Parameter::linear("compliance", Unit::Compliance, Range::NotNegative)],
    };

    fn build(site: &Site<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("compliance")] })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [compliance] = self.values;
        Contribution::Joint { joint: self.joint, delta: compliance * signals.loads.torque(self.joint) }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        let [compliance] = self.values;
        Slope::Load { gravity: compliance, wrench: compliance }
    }
}
