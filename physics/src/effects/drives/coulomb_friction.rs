//! Coulomb friction, independent of speed.
//!
//! `τ = F sign(v)`    F: `level`, Nm or N, ≥ 0. Source: docs/reference/effects.md; Coulomb, 1785. Zero at rest, because static friction is not
//! determined by the motion. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `coulomb_friction`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoulombFriction {
    joint: usize,
    values: [f64; 1],
}

impl Effect for CoulombFriction {
    const SPEC: Spec = Spec {
        kind: "coulomb_friction",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity],
        has_memory: false,
        parameters: &[Parameter::linear("level", Unit::NewtonMetre, Range::NotNegative)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let values = [site.one("level")];
        Ok(Self { joint: site.joint, values })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [level] = self.values;
        let term = DriveTerm::Torque(level * signals.inputs.sign_of_velocity(self.joint));
        Contribution::DriveTorque { joint: self.joint, term }
    }
}
