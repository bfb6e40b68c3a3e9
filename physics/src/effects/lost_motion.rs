//! Lost motion: low stiffness of the gear train around zero load.
//!
//! `δθᵢ = (b/2) tanh(τᵢ/τ₀)`    b: `width`, rad or m, ≥ 0 · τ₀: `torque`, Nm or N, > 0 · τᵢ: gravity, wrench and
//! inertia at the joint. Source: docs/reference/effects.md. Depends on the load, not on the direction of motion; memoryless.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `lost_motion`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LostMotion {
    joint: usize,
    values: [f64; 2],
}

impl Effect for LostMotion {
    const SPEC: Spec = Spec {
        kind: "lost_motion",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Masses, Need::Wrench],
        has_memory: false,
        parameters: &[
            Parameter::linear("width", Unit::Milliradian, Range::NotNegative),
            Parameter::nonlinear("torque", Unit::NewtonMetre, Range::Positive),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("width"), site.one("torque")] })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [width, torque] = self.values;
        let pressed = libm::tanh(signals.loads.torque(self.joint) / torque);
        Contribution::Joint { joint: self.joint, delta: 0.5 * width * pressed }
    }

    fn derivative(&self, k: usize, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [width, torque] = self.values;
        let ratio = signals.loads.torque(self.joint) / torque;
        let pressed = libm::tanh(ratio);
        let by_torque = -width * (1.0 - pressed * pressed) * ratio / torque;
        Contribution::Joint { joint: self.joint, delta: 0.5 * [pressed, by_torque][k] }
    }
}
