//! Temperature dependence of viscous friction (lubricant viscosity).
//!
//! The joint's viscous friction times `exp(−k (T − T₀))`    k: `per_K`, 1/K · T₀: `reference`, °C, 20 unless given · T: the joint's own temperature,
//! or the ambient one; no effect if unknown (NaN). Source: docs/reference/effects.md; the law is Reynolds', 1886. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};
use crate::thermal::{REFERENCE, REFERENCE_C};

/// `friction_temperature`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionTemperature {
    joint: usize,
    reference_celsius: f64,
    values: [f64; 1],
}

impl Effect for FrictionTemperature {
    const SPEC: Spec = Spec {
        kind: "friction_temperature",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity, Need::Temperature],
        has_memory: false,
        parameters: &[Parameter::nonlinear("per_K", Unit::One, Range::Any), REFERENCE],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let reference_celsius = site.optional_value("reference").unwrap_or(REFERENCE_C);
        Ok(Self { joint: site.joint, reference_celsius, values: [site.one("per_K")] })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [per_kelvin] = self.values;
        let warmer = signals.inputs.celsius(self.joint) - self.reference_celsius;
        let share = if warmer.is_nan() { 0.0 } else { libm::expm1(-per_kelvin * warmer) };
        Contribution::DriveTorque { joint: self.joint, term: DriveTerm::ViscousShare(share) }
    }
}
