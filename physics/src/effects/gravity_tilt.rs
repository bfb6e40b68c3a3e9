//! Tilt of the robot's base relative to gravity.
//!
//! Gravity in its base is `R(t)ᵀ g`    t: `tilt`, rotation vector about base x and y, rad, two numbers. Source: docs/reference/effects.md.
//! The geometry is unchanged, since poses are measured relative to the base: only gravity loads change.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Count, Need, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

/// `gravity_tilt`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GravityTilt {
    values: [f64; 2],
}

impl Effect for GravityTilt {
    const SPEC: Spec = Spec {
        kind: "gravity_tilt",
        scope: EffectScope::Robot,
        acts_on: ActsOn::Loads,
        needs: &[Need::Masses],
        has_memory: false,
        parameters: &[
            Parameter::linear("tilt", Unit::TurnMilliradian, Range::Any).of(Count::Exactly(2))
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: site.array("tilt") })
    }

    of_robot!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [x, y] = self.values;
        Contribution::GravityTurn { turn: DVec3::new(x, y, 0.0) }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Zero
    }
}
