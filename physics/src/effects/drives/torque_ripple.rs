//! Periodic torque: motor cogging, gear ripple.
//!
//! `τ = A sin(n q + φ)`    A: `amplitude`, Nm or N · n: `cycles` per revolution of the joint, > 0 (prismatic: per metre, as `transmission_error` has
//! it) · φ: `phase`, rad. Source: docs/reference/effects.md. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Parameter, EffectScope, Range, Spec, Unit};
use crate::trig::sin_cos;

/// `torque_ripple`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueRipple {
    joint: usize,
    values: [f64; 3],
}

impl Effect for TorqueRipple {
    const SPEC: Spec = Spec {
        kind: "torque_ripple",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("amplitude", Unit::NewtonMetre, Range::Any),
            Parameter::nonlinear("cycles", Unit::CyclesPerRevolution, Range::Positive),
            Parameter::nonlinear("phase", Unit::PhaseRadian, Range::Any),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let values = [site.one("amplitude"), site.one("cycles"), site.one("phase")];
        Ok(Self { joint: site.joint, values })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [amplitude, cycles, phase] = self.values;
        let torque = amplitude * sin_cos(cycles * signals.inputs.q[self.joint] + phase).0;
        Contribution::DriveTorque { joint: self.joint, term: DriveTerm::Torque(torque) }
    }
}
