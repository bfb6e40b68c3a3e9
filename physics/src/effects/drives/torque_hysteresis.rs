//! Hysteresis of the drive torque, building up over a distance after each reversal.
//!
//! `τ = z`, `dz/d|q| = −(z − (h/2) sign(dq))/s`    h: `amplitude_N` (`amplitude_Nm`), Nm or N, ≥ 0 · s: `reversal`, rad or m, > 0 · dq: the joint's
//! motion. Source: docs/reference/effects.md; the law is Dahl's, 1968. Rate-independent. With a distance below the step of the data it is
//! indistinguishable from `coulomb_friction`; unlike that one it persists at rest.
//!
//! Memory: that of [`super::super::hysteresis`], whose position lags as this force resists: `z = −h u`.

use crate::Inputs;
use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};
use crate::effects::hysteresis::{carry, settle};

/// `hysteresis` of a torque, `amplitude_Nm`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueHysteresis {
    joint: usize,
    values: [f64; 2],
}

impl Effect for TorqueHysteresis {
    const SPEC: Spec = Spec {
        kind: "hysteresis",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Direction],
        has_memory: true,
        parameters: &[
            // Two effects have this name: the unit is part of the stem, to distinguish them.
            Parameter::linear("amplitude_N", Unit::MetreAfterNewton, Range::NotNegative),
            Parameter::nonlinear("reversal", Unit::Milliradian, Range::Positive),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let values = [site.one("amplitude_N"), site.one("reversal")];
        Ok(Self { joint: site.joint, values })
    }

    of_joint!();

    fn predict(&self, _signals: &Signals<'_>, memory: &Memory) -> Contribution {
        let [amplitude, _] = self.values;
        let term = DriveTerm::Torque(-amplitude * memory.0[0]);
        Contribution::DriveTorque { joint: self.joint, term }
    }

    fn derivative(&self, k: usize, _signals: &Signals<'_>, memory: &Memory) -> Contribution {
        let [amplitude, _] = self.values;
        let term = DriveTerm::Torque([-memory.0[0], -amplitude * memory.0[1]][k]);
        Contribution::DriveTorque { joint: self.joint, term }
    }

    fn settle(&self, inputs: &Inputs, memory: &mut Memory) {
        settle(inputs.direction[self.joint], memory);
    }

    fn advance(&self, inputs: &Inputs, memory: &mut Memory) {
        let [_, reversal] = self.values;
        carry(inputs.q[self.joint] - inputs.q_before[self.joint], reversal, memory);
    }
}
