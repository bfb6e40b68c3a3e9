//! Load-dependent gear friction.
//!
//! `τ = μ |τᵢ| sign(v)`    μ: `coefficient`, ≥ 0 · τᵢ: torque of the drive for gravity and inertia, Nm or N. Source: docs/reference/effects.md;
//! Hamon, Gautier and Garrec, 2010. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `load_friction`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadFriction {
    joint: usize,
    values: [f64; 1],
}

impl Effect for LoadFriction {
    const SPEC: Spec = Spec {
        kind: "load_friction",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity, Need::Acceleration, Need::Masses],
        has_memory: false,
        parameters: &[Parameter::linear("coefficient", Unit::One, Range::NotNegative)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let values = [site.one("coefficient")];
        Ok(Self { joint: site.joint, values })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [coefficient] = self.values;
        let carried = signals.loads.gravity_torque[self.joint] + signals.loads.inertia_torque[self.joint];
        let torque = coefficient * carried.abs() * signals.inputs.sign_of_velocity(self.joint);
        Contribution::DriveTorque { joint: self.joint, term: DriveTerm::Torque(torque) }
    }
}
