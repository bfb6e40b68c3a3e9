//! Unmodelled mass at the flange.
//!
//! It joins the last body: m: `mass`, kg, negative if the model's mass is too large · c: `com`, centre of mass at the zero configuration,
//! base frame, m. Source: docs/reference/effects.md. A point mass. It acts through compliances and
//! drive torques; with free compliances only the product is identifiable.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Count, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

/// `payload`, of positions and of torques.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Payload {
    values: [f64; 4],
}

impl Effect for Payload {
    const SPEC: Spec = Spec {
        kind: "payload",
        scope: EffectScope::Robot,
        acts_on: ActsOn::Loads,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("mass", Unit::Kilogram, Range::Any),
            Parameter::nonlinear("com", Unit::Millimetre, Range::Any).of(Count::Exactly(3)),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let [x, y, z] = site.array("com");
        Ok(Self { values: [site.one("mass"), x, y, z] })
    }

    of_robot!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [mass, x, y, z] = self.values;
        Contribution::Mass { mass, first_moment: DVec3::new(x, y, z) * mass }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Zero
    }

    fn derivative(&self, k: usize, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [mass, x, y, z] = self.values;
        let (mass, first_moment) = match k {
            0 => (1.0, DVec3::new(x, y, z)),
            1 => (0.0, DVec3::X * mass),
            2 => (0.0, DVec3::Y * mass),
            _ => (0.0, DVec3::Z * mass),
        };
        Contribution::Mass { mass, first_moment }
    }
}
