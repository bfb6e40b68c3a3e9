//! A spring between a joint's link and its predecessor.
//!
//! `τ = K (q − q₀)`    K: `stiffness`, Nm/rad or N/m · q₀: `rest_position`, rad or m. Source: docs/reference/effects.md. Far from its rest position
//! it is a constant plus a slope. `spring_hardening` adds to it. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Parameter, EffectScope, Range, Spec, Unit};

/// `spring`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    joint: usize,
    values: [f64; 2],
}

impl Effect for Spring {
    const SPEC: Spec = Spec {
        kind: "spring",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("stiffness", Unit::One, Range::Any),
            Parameter::nonlinear("rest_position", Unit::One, Range::Any),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let values = [site.one("stiffness"), site.one("rest_position")];
        Ok(Self { joint: site.joint, values })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [stiffness, rest] = self.values;
        let torque = stiffness * (signals.inputs.q[self.joint] - rest);
        Contribution::DriveTorque { joint: self.joint, term: DriveTerm::Spring { torque, rest } }
    }

    fn derivative(&self, k: usize, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [stiffness, rest] = self.values;
        let term = match k {
            0 => DriveTerm::Spring { torque: signals.inputs.q[self.joint] - rest, rest: 0.0 },
            _ => DriveTerm::Spring { torque: -stiffness, rest: 1.0 },
        };
        Contribution::DriveTorque { joint: self.joint, term }
    }
}
