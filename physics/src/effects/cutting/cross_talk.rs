//! Cross-talk between the channels of a dynamometer.
//!
//! `measured += M F`    M: `matrix`, nine values, row by row; a row is a channel, a column the axis that leaks into it.
//! Source: docs/reference/effects.md. The diagonal acts as a scale. Before scale and bias of the sensor. Memoryless.

use crate::cut::ForceTerm;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Need, Parameter, EffectScope, Range, Spec, Unit};
use glam::DMat3;

/// `cross_talk`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossTalk {
    values: [f64; 9],
}

impl Effect for CrossTalk {
    const SPEC: Spec = Spec {
        kind: "cross_talk",
        scope: EffectScope::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[Need::Wrench],
        has_memory: false,
        parameters: &[Parameter::linear("matrix", Unit::One, Range::Any).of(Count::Exactly(9))],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: site.array("matrix") })
    }

    of_robot!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let leak = DMat3::from_cols_array(&self.values).transpose();
        Contribution::ToolForce(ForceTerm::CrossTalk(leak))
    }
}
