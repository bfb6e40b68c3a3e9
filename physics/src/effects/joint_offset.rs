//! Zero offset of a joint.
//!
//! `δθᵢ = a`    a: `offset`, rad or m, any sign. Source: docs/reference/effects.md.
//! Memoryless, independent of everything.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::laws::Law;
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Parameter, EffectScope, Range, Spec, Unit};

/// `joint_offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointOffset {
    joint: usize,
    values: [f64; 1],
}

impl Effect for JointOffset {
    const SPEC: Spec = Spec {
        kind: "joint_offset",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear("offset", Unit::Milliradian, Range::Any)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("offset")] })
    }

    of_joint!();

    by_law!();
}

impl JointOffset {
    fn law_of_joint(&self) -> Law {
        let [offset] = self.values;
        Law::Offset(offset)
    }
}
