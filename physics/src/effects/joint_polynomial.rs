//! Polynomial regression of a joint's error on its position, without physical meaning.
//!
//! `δθᵢ = Σ c_k T_k(x)`, x: qᵢ mapped from `range` to [−1, 1] and clamped    c: `coefficients`, rad or m, 1 to 16 ·
//! `T_k`: Chebyshev polynomials of the first kind, T₀ = 1 · `range`: two positions, rad or m, the lower first.
//! Source: docs/reference/effects.md. Holds within `range`; outside it is constant.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Count, Parameter, EffectScope, Range, Spec, Unit};

const TERMS_MAX: usize = 16;

/// `joint_polynomial`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPolynomial {
    joint: usize,
    values: [f64; TERMS_MAX],
    count: usize,
    range: [f64; 2],
}

impl Effect for JointPolynomial {
    const SPEC: Spec = Spec {
        kind: "joint_polynomial",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("coefficients", Unit::Milliradian, Range::Any)
                .of(Count::UpTo(TERMS_MAX)),
            Parameter::setting("range", Unit::JointDegree, Range::Any)
                .of(Count::Exactly(2))
                .needed(),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let range: [f64; 2] = site.array("range");
        if range[0] >= range[1] {
            return Err(BuildError::Combination("`range` with the lower position first"));
        }
        let count = site.list("coefficients").len();
        Ok(Self { joint: site.joint, values: site.array("coefficients"), count, range })
    }

    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn values(&self) -> &[f64] {
        &self.values[..self.count]
    }

    fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.count]
    }

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [low, high] = self.range;
        let q = signals.inputs.q[self.joint];
        let x = (2.0 * (q - low) / (high - low) - 1.0).clamp(-1.0, 1.0);
        let (mut term, mut next, mut delta) = (1.0, x, 0.0);
        for coefficient in self.values() {
            delta += coefficient * term;
            (term, next) = (next, 2.0 * x * next - term);
        }
        Contribution::Joint { joint: self.joint, delta }
    }

    fn slope(&self, signals: &Signals<'_>) -> Slope {
        let [low, high] = self.range;
        let per_joint = 2.0 / (high - low);
        let x = per_joint * (signals.inputs.q[self.joint] - low) - 1.0;
        if x.abs() >= 1.0 {
            return Slope::Zero;
        }
        let (mut term, mut next, mut position) = ((1.0, 0.0), (x, 1.0), 0.0);
        for coefficient in self.values() {
            position += coefficient * term.1;
            let slope = 2.0 * (next.0 + x * next.1) - term.1;
            (term, next) = (next, (2.0 * x * next.0 - term.0, slope));
        }
        Slope::Position(position * per_joint)
    }
}
