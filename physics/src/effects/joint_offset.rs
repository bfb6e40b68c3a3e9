//! A joint whose zero is not where the controller believes it.
//!
//! `δθᵢ = a`    a: `offset`, rad or m, any sign. Source: contract `effects.md`.
//! Memoryless, independent of everything.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, Site};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Parameter, Place, Range, Spec, Unit};

/// `joint_offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointOffset {
    joint: usize,
    values: [f64; 1],
}

impl Effect for JointOffset {
    const SPEC: Spec = Spec {
        kind: "joint_offset",
        place: Place::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear("offset", Unit::Milliradian, Range::Any)],
    };

    fn build(site: &Site<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("offset")] })
    }

    of_joint!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [offset] = self.values;
        Contribution::Joint { joint: self.joint, delta: offset }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Steady
    }
}
