//! Unmodelled gravity torque.
//!
//! `τ = c cos q + s sin q`    c, s: `cos`, `sin`, Nm or N, of the joint alone; or, for arms, the unknown first moment `m` of the body that the joint
//! moves: `first_moment`, three numbers, kg m, base axes, zero configuration: then each revolute joint up to this one carries `g × R m`, R how the
//! body is turned. Source: docs/reference/effects.md. A first moment without a mass has no effect on prismatic joints. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Parameter, EffectScope, Range, Spec, Unit};
use crate::trig::sin_cos;
use glam::DVec3;

/// `gravity_torque`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GravityTorque {
    joint: usize,
    of_body: bool,
    values: [f64; 3],
}

impl Effect for GravityTorque {
    const SPEC: Spec = Spec {
        kind: "gravity_torque",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("cos", Unit::NewtonMetre, Range::Any).optional(),
            Parameter::linear("sin", Unit::NewtonMetre, Range::Any).optional(),
            Parameter::linear("first_moment", Unit::KilogramMetre, Range::Any)
                .of(Count::Exactly(3))
                .optional(),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let given = |stem| site.optional_value(stem).is_some();
        match (given("cos"), given("sin"), given("first_moment")) {
            (true, true, false) => {
                let values = [site.one("cos"), site.one("sin"), 0.0];
                Ok(Self { joint: site.joint, of_body: false, values })
            }
            (false, false, true) => {
                let values = site.array("first_moment");
                Ok(Self { joint: site.joint, of_body: true, values })
            }
            _ => Err(BuildError::Combination("either both of `cos` and `sin`, or `first_moment_kgm`")),
        }
    }

    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn fitted(&self) -> &'static [Parameter] {
        let (of_joint, of_body) = Self::SPEC.parameters.split_at(2);
        if self.of_body { of_body } else { of_joint }
    }

    fn values(&self) -> &[f64] {
        &self.values[..if self.of_body { 3 } else { 2 }]
    }

    fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values[..if self.of_body { 3 } else { 2 }]
    }

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [a, b, c] = self.values;
        let term = if self.of_body {
            let first_moment = signals.chain.body(self.joint).rotation * DVec3::new(a, b, c);
            DriveTerm::Carried(signals.loads.gravity.cross(first_moment))
        } else {
            let (sin, cos) = sin_cos(signals.inputs.q[self.joint]);
            DriveTerm::Torque(a * cos + b * sin)
        };
        Contribution::DriveTorque { joint: self.joint, term }
    }
}
