//! Coupling between joints: wrist gears, parallel rods.
//!
//! `δθᵢ = k qⱼ`    k: `ratio`, joint i's unit per joint j's unit, any sign · j: `from_joint`, another joint, counted from 1.
//! Source: docs/reference/effects.md. Memoryless; holds over the whole range.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Parameter, EffectScope, Range, Spec, Unit};

/// `joint_coupling`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCoupling {
    joint: usize,
    from: usize,
    values: [f64; 1],
}

impl JointCoupling {
    /// Index of the joint whose motion is coupled in, from 0.
    #[must_use]
    pub fn from_joint(&self) -> usize {
        self.from
    }
}

impl Effect for JointCoupling {
    const SPEC: Spec = Spec {
        kind: "joint_coupling",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("ratio", Unit::One, Range::Any),
            Parameter::setting("from_joint", Unit::One, Range::Positive).needed(),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let (number, count) = (site.one("from_joint"), site.arm.count());
        let from = (0..count).find(|&j| (j + 1) as f64 == number && j != site.joint);
        let from = from.ok_or(BuildError::Combination(
            "`from_joint` to be another joint of the arm, a whole number counted from 1",
        ))?;
        Ok(Self { joint: site.joint, from, values: [site.one("ratio")] })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [ratio] = self.values;
        Contribution::Joint { joint: self.joint, delta: ratio * signals.inputs.q[self.from] }
    }
}
