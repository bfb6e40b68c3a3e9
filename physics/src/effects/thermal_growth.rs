//! Thermal growth of a link.
//!
//! The vector from joint i's point to joint i+1's (to the TCP for the last) grows along itself by
//! `k (T − T₀)`, T followed with the lag where `lag` is given; or, where no temperature was recorded, by `A (1 − e^(−t/t₀))`.
//! k: `growth`, m/K · T₀: `reference`, °C, 20 unless given · A: `amplitude`, m · t₀: `time_constant`, s · `direction`: base axes at
//! the zero configuration, needed where the points coincide. Source: docs/reference/effects.md; for a link of length L, k = αL.
//! Uniform warming only: bending by temperature gradients is not modelled.

use crate::Inputs;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::thermal::{ThermalInput, ThermalLaw, LAG, REFERENCE, TIME_CONSTANT};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Count, Need, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

const GROWTH: Parameter =
    Parameter::linear("growth", Unit::MicrometrePerKelvin, Range::Any).optional();
const AMPLITUDE: Parameter =
    Parameter::linear("amplitude", Unit::Micrometre, Range::Any).optional();

/// `thermal_growth`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalGrowth {
    joint: usize,
    values: [f64; 2],
    heat: ThermalLaw,
    direction: DVec3,
}

impl Effect for ThermalGrowth {
    const SPEC: Spec = Spec {
        kind: "thermal_growth",
        scope: EffectScope::Joint,
        acts_on: ActsOn::Geometry,
        needs: &[Need::Temperature, Need::Time],
        has_memory: true,
        parameters: &[
            GROWTH,
            LAG,
            AMPLITUDE,
            TIME_CONSTANT,
            REFERENCE,
            Parameter::setting("direction", Unit::One, Range::Any).of(Count::Exactly(3)),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let (heat, values) = ThermalLaw::of_joint(site, "growth")?;
        Ok(Self { joint: site.joint, values, heat, direction: direction(site)? })
    }

    fn fitted(&self) -> &'static [Parameter] {
        let law: &[Parameter; 2] = match self.heat.cause {
            ThermalInput::WarmUp => &[AMPLITUDE, TIME_CONSTANT],
            _ => &[GROWTH, LAG],
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

impl ThermalGrowth {
    fn grown(&self, length: f64) -> Contribution {
        Contribution::LinkShift { link: self.joint + 1, shift: self.direction * length }
    }
}

fn direction(site: &BuildContext<'_>) -> Result<DVec3, BuildError> {
    if let Some(direction) = site.vector("direction") {
        return direction
            .try_normalize()
            .ok_or(BuildError::Combination("`direction` of a length above zero"));
    }
    let along = site.arm.next_point(site.joint) - site.arm.joints()[site.joint].point;
    if along.length_squared() < 1e-12 { Err(BuildError::NeedsDirection) } else { Ok(along.normalize()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Model;
    use crate::effects::AnyEffect;
    use crate::effects::conformance::scene;
    use crate::{ParameterValues, Memories};

    #[test]
    fn an_aluminium_upper_arm_of_0_7_m_grows_16_5_um_per_kelvin() {
        let (length_m, per_kelvin) = (0.7, 23.6e-6);
        let mut scene = scene();
        scene.inputs.q = [0.0; crate::JOINTS_MAX];
        scene.inputs.ambient_celsius = 21.0;
        let growth = [per_kelvin * length_m];
        let given = ParameterValues(&[("growth", &growth)]);
        let effect = AnyEffect::build("thermal_growth", &scene.arm, Some(1), given).expect("sound");
        let model = Model::new(scene.arm, &[effect]).expect("one effect");
        let evaluation = model.evaluate(&scene.inputs, &Memories::default());
        let moved = evaluation.real.base_from_tool.origin - evaluation.nominal.base_from_tool.origin;
        assert!((moved - DVec3::Z * 16.52e-6).length() < 1e-12, "{moved}");
    }

    #[test]
    fn a_link_without_length_needs_a_direction() {
        let mut joints = [scene().arm.joints()[0]; 2];
        joints[1].axis = DVec3::Y;
        let arm = crate::Arm::new(&joints, scene().arm.tool, crate::arm::GRAVITY).expect("sound");
        let growth = [1e-6];
        let build = |given: ParameterValues<'_>| AnyEffect::build("thermal_growth", &arm, Some(0), given);
        assert_eq!(build(ParameterValues(&[("growth", &growth)])), Err(BuildError::NeedsDirection));
        let up = [0.0, 0.0, 2.0];
        assert!(build(ParameterValues(&[("growth", &growth), ("direction", &up)])).is_ok());
    }
}
