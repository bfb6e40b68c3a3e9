//! Friction that depends on the direction of motion.
//!
//! `τ = o + c |v|`    o: `offset`, Nm or N · c: `coefficient`, Nm s/rad or N s/m; one of them or both. Source: docs/reference/effects.md. A constant
//! alone is indistinguishable from a bias of the torque sensor. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `friction_asymmetry`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionAsymmetry {
    joint: usize,
    values: [f64; 2],
    /// Range of the values that were given.
    given: (usize, usize),
}

impl Effect for FrictionAsymmetry {
    const SPEC: Spec = Spec {
        kind: "friction_asymmetry",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity],
        has_memory: false,
        parameters: &[
            Parameter::linear("offset", Unit::NewtonMetre, Range::Any).optional(),
            Parameter::linear("coefficient", Unit::One, Range::Any).optional(),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let given = match (site.optional_value("offset"), site.optional_value("coefficient")) {
            (Some(_), Some(_)) => (0, 2),
            (Some(_), None) => (0, 1),
            (None, Some(_)) => (1, 2),
            (None, None) => {
                return Err(BuildError::Combination("an offset or a `coefficient`, or both"));
            }
        };
        let values = [site.one("offset"), site.one("coefficient")];
        Ok(Self { joint: site.joint, values, given })
    }

    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn fitted(&self) -> &'static [Parameter] {
        &Self::SPEC.parameters[self.given.0..self.given.1]
    }

    fn values(&self) -> &[f64] {
        &self.values[self.given.0..self.given.1]
    }

    fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values[self.given.0..self.given.1]
    }

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [offset, coefficient] = self.values;
        let torque = offset + coefficient * signals.inputs.velocity[self.joint].abs();
        Contribution::DriveTorque { joint: self.joint, term: DriveTerm::Torque(torque) }
    }
}
