//! Thermal drift of a joint's zero.
//!
//! `δθᵢ = k (T − T₀)`, T followed with the lag where `lag` is given; or, where no temperature was recorded, `A (1 − e^(−t/t₀))`.
//! k: `drift`, rad/K or m/K · T₀: `reference`, °C, 20 unless given · A: `amplitude`, rad or m · t₀: `time_constant`, s.
//! Source: docs/reference/effects.md. A regression of thermal effects in a drive and its housing, valid near the temperatures of the identification.

use crate::Inputs;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::thermal::{ThermalInput, ThermalLaw, LAG, REFERENCE, TIME_CONSTANT};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

const DRIFT: Parameter =
    Parameter::linear("drift", Unit::MilliradianPerKelvin, Range::Any).optional();
const AMPLITUDE: Parameter =
    Parameter::linear("amplitude", Unit::Milliradian, Range::Any).optional();

/// `thermal_zero`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalZero {
    joint: usize,
    values: [f64; 2],
    heat: ThermalLaw,
}

impl Effect for ThermalZero {
    const SPEC: Spec = Spec {
        kind: "thermal_zero",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Temperature, Need::Time],
        has_memory: true,
        parameters: &[DRIFT, LAG, AMPLITUDE, TIME_CONSTANT, REFERENCE],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let (heat, values) = ThermalLaw::of_joint(site, "drift")?;
        Ok(Self { joint: site.joint, values, heat })
    }

    fn fitted(&self) -> &'static [Parameter] {
        let law: &[Parameter; 2] = match self.heat.cause {
            ThermalInput::WarmUp => &[AMPLITUDE, TIME_CONSTANT],
            _ => &[DRIFT, LAG],
        };
        &law[..self.heat.count]
    }

    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn values(&self) -> &[f64] {
        &self.values[..self.heat.count]
    }

    fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.heat.count]
    }

    fn predict(&self, signals: &Signals<'_>, memory: &Memory) -> Contribution {
        self.drifted(self.heat.response(self.values, signals.inputs, memory))
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Zero
    }

    fn derivative(&self, k: usize, signals: &Signals<'_>, memory: &Memory) -> Contribution {
        self.drifted(self.heat.slope(self.values, k, signals.inputs, memory))
    }

    fn settle(&self, inputs: &Inputs, memory: &mut Memory) {
        self.heat.settle(inputs, memory);
    }

    fn advance(&self, inputs: &Inputs, memory: &mut Memory) {
        self.heat.advance(self.values, inputs, memory);
    }
}

impl ThermalZero {
    fn drifted(&self, delta: f64) -> Contribution {
        Contribution::Joint { joint: self.joint, delta }
    }
}
