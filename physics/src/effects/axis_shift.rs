//! Displacement of a joint's axis and of everything that the joint carries.
//!
//! `Oᵢ' = Oᵢ + s`, likewise all points beyond    s: `shift`, m, base axes at the zero configuration. A component along the axis
//! is allowed only at the last joint (otherwise it is equivalent to a shift of the next joint): above 1 µm it is refused, below it
//! is ignored. Source: docs/reference/effects.md; thesis 3.1 to 3.4. Exact for any shift.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Count, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

const ROUNDING_M: f64 = 1e-6;

/// `axis_shift`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisShift {
    joint: usize,
    values: [f64; 3],
    /// The axis at the zero configuration; zero for the last joint, whose shift is not restricted.
    barred: DVec3,
}

impl Effect for AxisShift {
    const SPEC: Spec = Spec {
        kind: "axis_shift",
        scope: EffectScope::Joint,
        acts_on: ActsOn::Geometry,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("shift", Unit::Millimetre, Range::Any).of(Count::Exactly(3))
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let is_last = site.joint + 1 == site.arm.count();
        let barred = if is_last { DVec3::ZERO } else { site.arm.joints()[site.joint].axis };
        let values = site.array("shift");
        if barred.dot(DVec3::from_array(values)).abs() > ROUNDING_M {
            return Err(BuildError::Combination(
                "`shift` normal to the axis to 1 µm: only the last joint's may have a part along it",
            ));
        }
        Ok(Self { joint: site.joint, values, barred })
    }

    of_joint!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let shift = DVec3::from_array(self.values);
        let shift = shift - self.barred * self.barred.dot(shift);
        Contribution::LinkShift { link: self.joint, shift }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Zero
    }
}
