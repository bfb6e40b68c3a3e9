//! Stribeck friction: additional friction at low speed, before hydrodynamic lubrication.
//!
//! `τ = F exp(−(v/w)²) sign(v)`    F: `level`, the additional friction (`F_s − F_c`), Nm or N, ≥ 0 · w: `stribeck_speed`, rad/s or m/s, > 0.
//! Source: docs/reference/effects.md; Stribeck, 1902; Bo and Pavelescu, 1982. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `stribeck_friction`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StribeckFriction {
    joint: usize,
    values: [f64; 2],
}

impl Effect for StribeckFriction {
    const SPEC: Spec = Spec {
        kind: "stribeck_friction",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity],
        has_memory: false,
        parameters: &[
            Parameter::linear("level", Unit::NewtonMetre, Range::NotNegative),
            Parameter::nonlinear("stribeck_speed", Unit::One, Range::Positive),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let values = [site.one("level"), site.one("stribeck_speed")];
        Ok(Self { joint: site.joint, values })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [level, speed] = self.values;
        let ratio = signals.inputs.velocity[self.joint] / speed;
        let share = libm::exp(-ratio * ratio) * signals.inputs.sign_of_velocity(self.joint);
        Contribution::DriveTorque { joint: self.joint, term: DriveTerm::Torque(level * share) }
    }
}
