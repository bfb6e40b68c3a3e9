//! A spring between two pivots that carries part of a joint's weight.
//!
//! `M = k (1 − s₀/s) a L sin(α + qᵢ)`, `s² = a² + L² + 2 a L cos(α + qᵢ)`, added to `τ_grav,i = −∂V/∂qᵢ` with `V = k (s − s₀)²/2`
//! k: `stiffness`, N/m, ≥ 0 · s₀: `free_length`, m · a: distance of the fixed pivot from the axis, m · L: of the carried one, m · α: `angle`, rad.
//! Source: docs/reference/effects.md; Klimchik 2013 (arXiv 1311.6810). It acts on the tool only through compliances.
//! Its force on the joint's bearing and on the base is not modelled.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Parameter, EffectScope, Range, Spec, Unit};
use crate::trig::sin_cos;

/// `counterbalance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counterbalance {
    joint: usize,
    values: [f64; 5],
}

impl Effect for Counterbalance {
    const SPEC: Spec = Spec {
        kind: "counterbalance",
        scope: EffectScope::RevoluteJoint,
        acts_on: ActsOn::Loads,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("stiffness", Unit::NewtonPerMetre, Range::NotNegative),
            Parameter::nonlinear("free_length", Unit::Millimetre, Range::NotNegative),
            Parameter::nonlinear("a", Unit::Millimetre, Range::Positive),
            Parameter::nonlinear("L", Unit::Millimetre, Range::Positive),
            Parameter::nonlinear("angle", Unit::Degree, Range::Any),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let stems = ["stiffness", "free_length", "a", "L", "angle"];
        Ok(Self { joint: site.joint, values: stems.map(|stem| site.one(stem)) })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [stiffness, free_length, a, l, angle] = self.values;
        let (sin, cos) = sin_cos(angle + signals.inputs.q[self.joint]);
        let lever = a * l * sin;
        let length = libm::sqrt((a * a + l * l + 2.0 * a * l * cos).max(0.0));
        // If the two pivots coincide, the spring has no direction, and no lever arm either.
        let stretched = if length > 0.0 { lever - free_length * (lever / length) } else { 0.0 };
        Contribution::JointLoad { joint: self.joint, load: stiffness * stretched }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::conformance::{scene, with_inputs};

    #[test]
    fn its_load_is_minus_the_slope_of_the_springs_energy() {
        let [k, s0, a, l, angle] = [8e4, 0.45, 0.2, 0.6, 0.3];
        let effect = Counterbalance { joint: 1, values: [k, s0, a, l, angle] };
        // The carried pivot rotates about the axis at radius L; the fixed one is at a on the far
        // side.
        let energy = |q: f64| {
            let carried = glam::DVec2::from_angle(angle + q) * l;
            let s = carried.distance(glam::DVec2::new(-a, 0.0));
            0.5 * k * (s - s0) * (s - s0)
        };
        for step in -12..12 {
            let mut inputs = scene().inputs;
            inputs.q[1] = f64::from(step) * 0.25 + 0.01;
            let contribution = with_inputs(&inputs, |signals| effect.predict(signals, &Memory::default()));
            let h = 1e-5;
            let slope = (energy(inputs.q[1] + h) - energy(inputs.q[1] - h)) / (2.0 * h);
            let Contribution::JointLoad { joint: 1, load } = contribution else { panic!("{contribution:?}") };
            assert!((load + slope).abs() < 1e-5 * k * a, "{load} against {}", -slope);
        }
    }
}
