//! Viscous friction, proportional to speed.
//!
//! `τ = f v`    f: `coefficient`, Nm s/rad or N s/m, ≥ 0. Source: docs/reference/effects.md. `friction_temperature` changes it. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `viscous_friction`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousFriction {
    joint: usize,
    values: [f64; 1],
}

impl Effect for ViscousFriction {
    const SPEC: Spec = Spec {
        kind: "viscous_friction",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity],
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
        let term = DriveTerm::Viscous(coefficient * signals.inputs.velocity[self.joint]);
        Contribution::DriveTorque { joint: self.joint, term }
    }
}
