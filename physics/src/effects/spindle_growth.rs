//! Thermal growth of the spindle along the tool's z axis.
//!
//! `δz = k (T − T₀)`, or `k n` of the spindle's speed n; either followed with the lag where `lag` is given.
//! k: `growth`, m/K; or `growth_um` per krpm, in m/(rev/min) inside · T: ambient, °C · T₀: `reference`, 20 unless given.
//! Source: docs/reference/effects.md. Linearity in speed is valid for moderate speeds (bearing losses rise faster).

use crate::Inputs;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::thermal::{ThermalInput, ThermalLaw, LAG, REFERENCE};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

const BY_TEMPERATURE: Parameter =
    Parameter::linear("growth", Unit::MicrometrePerKelvin, Range::Any).optional();
const BY_SPEED: Parameter =
    Parameter::linear("growth_um", Unit::MicrometrePerKrpm, Range::Any).optional();

/// `spindle_growth`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpindleGrowth {
    values: [f64; 2],
    heat: ThermalLaw,
}

impl Effect for SpindleGrowth {
    const SPEC: Spec = Spec {
        kind: "spindle_growth",
        scope: EffectScope::Robot,
        acts_on: ActsOn::Geometry,
        needs: &[Need::Temperature, Need::SpindleSpeed],
        has_memory: true,
        parameters: &[BY_TEMPERATURE, BY_SPEED, LAG, REFERENCE],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let (cause, growth) = match (site.optional_value("growth"), site.optional_value("growth_um")) {
            (Some(growth), None) => (ThermalInput::Ambient, growth),
            (None, Some(growth)) => (ThermalInput::Spindle, growth),
            _ => return Err(BuildError::Combination("growth per kelvin or per krpm, one of them")),
        };
        Ok(Self { values: [growth, site.one("lag")], heat: ThermalLaw::new(site, cause) })
    }

    fn fitted(&self) -> &'static [Parameter] {
        let law: &[Parameter; 2] = match self.heat.cause {
            ThermalInput::Spindle => &[BY_SPEED, LAG],
            _ => &[BY_TEMPERATURE, LAG],
        };
        &law[..self.heat.count]
    }

    fn joint(&self) -> Option<usize> {
        None
    }

    fn values(&self) -> &[f64] {
        &self.values[..self.heat.count]
    }

    fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.heat.count]
    }

    fn predict(&self, signals: &Signals<'_>, memory: &Memory) -> Contribution {
        self.grown(self.heat.response(self.values, signals.inputs, memory))
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Zero
    }

    fn derivative(&self, k: usize, signals: &Signals<'_>, memory: &Memory) -> Contribution {
        self.grown(self.heat.slope(self.values, k, signals.inputs, memory))
    }

    fn settle(&self, inputs: &Inputs, memory: &mut Memory) {
        self.heat.settle(inputs, memory);
    }

    fn advance(&self, inputs: &Inputs, memory: &mut Memory) {
        self.heat.advance(self.values, inputs, memory);
    }
}

impl SpindleGrowth {
    fn grown(&self, length: f64) -> Contribution {
        Contribution::Tool { shift: DVec3::Z * length, turn: DVec3::ZERO }
    }
}
