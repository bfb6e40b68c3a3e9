//! A drive train that winds up under what the environment does to the tool.
//!
//! `δθᵢ = C (JᵀW)ᵢ`    C: `compliance`, rad/Nm or m/N, ≥ 0 · W: the wrench ON the tool at the TCP · J: Jacobian at the TCP,
//! on the controller's geometry. Source: contract `effects.md`; Salisbury 1980. Linear.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, Site};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, Place, Range, Spec, Unit};

/// `load_compliance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadCompliance {
    joint: usize,
    values: [f64; 1],
}

impl Effect for LoadCompliance {
    const SPEC: Spec = Spec {
        kind: "load_compliance",
        place: Place::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Wrench],
        has_memory: false,
        parameters: &[Parameter::linear("compliance", Unit::Compliance, Range::NotNegative)],
    };

    fn build(site: &Site<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("compliance")] })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [compliance] = self.values;
        let delta = compliance * signals.loads.wrench_torque[self.joint];
        Contribution::Joint { joint: self.joint, delta }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Load { gravity: 0.0, wrench: self.values[0] }
    }
}
