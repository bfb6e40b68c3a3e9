//! Gain error of the recorded drive torque.
//!
//! The recorded torque is `1 + g` times the actual one    g: `gain`. Source: docs/reference/effects.md. With free masses a gain common to all joints
//! is indistinguishable from them. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Parameter, EffectScope, Range, Spec, Unit};

/// `drive_gain`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveGain {
    joint: usize,
    values: [f64; 1],
}

impl Effect for DriveGain {
    const SPEC: Spec = Spec {
        kind: "drive_gain",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear("gain", Unit::One, Range::Any)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let values = [site.one("gain")];
        Ok(Self { joint: site.joint, values })
    }

    of_joint!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [gain] = self.values;
        Contribution::DriveTorque { joint: self.joint, term: DriveTerm::Recorded(gain) }
    }
}
