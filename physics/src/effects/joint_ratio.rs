//! Gear ratio error.
//!
//! `δθᵢ = k qᵢ`    k: `ratio`, dimensionless, any sign · qᵢ: commanded position, rad or m. Source: docs/reference/effects.md;
//! thesis equation 3.5 (its k₂, printed k₁). Memoryless; holds over the whole range.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::laws::Law;
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Parameter, EffectScope, Range, Spec, Unit};

/// `joint_ratio`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointRatio {
    joint: usize,
    values: [f64; 1],
}

impl Effect for JointRatio {
    const SPEC: Spec = Spec {
        kind: "joint_ratio",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear("ratio", Unit::One, Range::Any)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("ratio")] })
    }

    of_joint!();

    by_law!();
}

impl JointRatio {
    fn law_of_joint(&self) -> Law {
        let [ratio] = self.values;
        Law::Ratio(ratio)
    }
}
