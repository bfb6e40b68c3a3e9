//! Position and orientation error of the tool.
//!
//! `base_from_tool' = base_from_tool · (exp(turn), shift)`    `shift`: m, tool axes · `turn`: rotation vector, rad, tool axes;
//! at least one of the two, the other one is zero. Source: docs/reference/effects.md. Exact for any shift and turn.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Count, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

/// `tool_offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolOffset {
    values: [f64; 6],
    /// Range of the values that were given.
    given: (usize, usize),
}

impl Effect for ToolOffset {
    const SPEC: Spec = Spec {
        kind: "tool_offset",
        scope: EffectScope::Robot,
        acts_on: ActsOn::Geometry,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("shift", Unit::Millimetre, Range::Any).of(Count::Exactly(3)).optional(),
            Parameter::linear("turn", Unit::TurnMilliradian, Range::Any)
                .of(Count::Exactly(3))
                .optional(),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let given = match (site.vector("shift"), site.vector("turn")) {
            (Some(_), Some(_)) => (0, 6),
            (Some(_), None) => (0, 3),
            (None, Some(_)) => (3, 6),
            (None, None) => return Err(BuildError::Combination("`shift` or `turn`, or both")),
        };
        let ([x, y, z], [a, b, c]) = (site.array("shift"), site.array("turn"));
        Ok(Self { values: [x, y, z, a, b, c], given })
    }

    fn joint(&self) -> Option<usize> {
        None
    }

    fn fitted(&self) -> &'static [Parameter] {
        &Self::SPEC.parameters[self.given.0 / 3..self.given.1 / 3]
    }

    fn values(&self) -> &[f64] {
        &self.values[self.given.0..self.given.1]
    }

    fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values[self.given.0..self.given.1]
    }

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [x, y, z, a, b, c] = self.values;
        Contribution::Tool { shift: DVec3::new(x, y, z), turn: DVec3::new(a, b, c) }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Zero
    }
}
