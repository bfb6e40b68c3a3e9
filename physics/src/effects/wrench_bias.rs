//! Bias of the force sensor.
//!
//! `actual = measured − b`    b: `bias`, N and Nm, three values each, sensor axes, which are taken as the tool's; either may be missing
//! and is then zero. Source: docs/reference/effects.md. With `wrench_scale` and `wrench_misalignment` it combines as
//! described at [`Contribution::Sensor`]. It acts on the tool only through compliances.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Need, Parameter, EffectScope, Range, Spec, Unit};
use crate::Wrench;
use glam::DVec3;

/// `wrench_bias`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchBias {
    values: [f64; 6],
    /// Range of the values that were given.
    given: (usize, usize),
}

impl Effect for WrenchBias {
    const SPEC: Spec = Spec {
        kind: "wrench_bias",
        scope: EffectScope::Robot,
        acts_on: ActsOn::Loads,
        needs: &[Need::Wrench],
        has_memory: false,
        parameters: &[
            Parameter::linear("bias", Unit::Newton, Range::Any).of(Count::Exactly(3)).optional(),
            // Two entries would have the same stem: the unit is part of this one.
            Parameter::linear("bias_Nm", Unit::One, Range::Any).of(Count::Exactly(3)).optional(),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let given = match (site.vector("bias"), site.vector("bias_Nm")) {
            (Some(_), Some(_)) => (0, 6),
            (Some(_), None) => (0, 3),
            (None, Some(_)) => (3, 6),
            (None, None) => return Err(BuildError::Combination("`bias_N` or `bias_Nm`, or both")),
        };
        let ([x, y, z], [a, b, c]) = (site.array("bias"), site.array("bias_Nm"));
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
        let bias = Wrench { force: DVec3::new(x, y, z), moment: DVec3::new(a, b, c) };
        Contribution::Sensor { bias, scale: Wrench::ZERO, turn: DVec3::ZERO }
    }
}
