//! Stiffening of the drive train under load.
//!
//! `δθᵢ = −D τᵢ³` on top of a linear compliance C of the same joint    D: `cubic`, rad/Nm³ or m/N³, ≥ 0 · τᵢ: gravity, wrench and
//! inertia at the joint. Source: docs/reference/effects.md; the first odd term of a stiffening characteristic. Physical only for
//! `|τ| < sqrt(C/3D)`, where more load still means more deflection: an effect has no access to others, so
//! [`crate::Model`] looks up the linear compliance and reports in [`crate::Evaluation`] when a load is beyond.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `stiffness_hardening`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StiffnessHardening {
    joint: usize,
    values: [f64; 1],
}

impl Effect for StiffnessHardening {
    const SPEC: Spec = Spec {
        kind: "stiffness_hardening",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Masses, Need::Wrench],
        has_memory: false,
        parameters: &[Parameter::linear("cubic", Unit::CubicCompliance, Range::NotNegative)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("cubic")] })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [cubic] = self.values;
        let torque = signals.loads.torque(self.joint);
        Contribution::Joint { joint: self.joint, delta: -cubic * torque * torque * torque }
    }

    fn slope(&self, signals: &Signals<'_>) -> Slope {
        let torque = signals.loads.torque(self.joint);
        let compliance = -3.0 * self.values[0] * torque * torque;
        Slope::Load { gravity: compliance, wrench: compliance }
    }
}
