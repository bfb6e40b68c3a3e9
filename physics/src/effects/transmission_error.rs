//! Periodic transmission error: an eccentric gear, mesh, or resolver.
//!
//! `δθᵢ = A sin(n qᵢ + φ)`    A: `amplitude`, rad or m · n: `cycles` per revolution of the joint, > 0 (prismatic: the
//! term is `sin(2π n q + φ)`, n per metre; inside, n is in radians of phase per unit of joint) · φ: `phase`, rad.
//! Source: docs/reference/effects.md; thesis equation 3.5. Memoryless.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::laws::Law;
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Parameter, EffectScope, Range, Spec, Unit};
use crate::trig::sin_cos;

/// `transmission_error`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransmissionError {
    joint: usize,
    values: [f64; 3],
}

impl Effect for TransmissionError {
    const SPEC: Spec = Spec {
        kind: "transmission_error",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("amplitude", Unit::Milliradian, Range::Any),
            Parameter::nonlinear("cycles", Unit::CyclesPerRevolution, Range::Positive),
            Parameter::nonlinear("phase", Unit::PhaseRadian, Range::Any),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let values = [site.one("amplitude"), site.one("cycles"), site.one("phase")];
        Ok(Self { joint: site.joint, values })
    }

    of_joint!();

    by_law!();

    fn derivative(&self, k: usize, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [amplitude, cycles, phase] = self.values;
        let q = signals.inputs.q[self.joint];
        let (sin, cos) = sin_cos(cycles * q + phase);
        let delta = [sin, amplitude * q * cos, amplitude * cos][k];
        Contribution::Joint { joint: self.joint, delta }
    }
}

impl TransmissionError {
    fn law_of_joint(&self) -> Law {
        let [amplitude, cycles, phase] = self.values;
        Law::Wave { amplitude, cycles, phase }
    }
}
