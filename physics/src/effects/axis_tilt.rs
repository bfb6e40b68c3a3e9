//! Tilt of a joint's axis about its pivot; the rest of the zero configuration is unchanged.
//!
//! `eᵢ' = exp(t₁ n₁ + t₂ n₂) eᵢ`    t: `tilt`, rad, two numbers · n₁, n₂: the normals of [`crate::frame::normals`]
//! · `pivot`: on the axis, the joint's point unless given. Source: docs/reference/effects.md.
//! Meant for small tilts; exact for any.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::frame::normals;
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Count, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

/// `axis_tilt`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisTilt {
    joint: usize,
    values: [f64; 2],
    normals: (DVec3, DVec3),
    pivot: DVec3,
}

impl Effect for AxisTilt {
    const SPEC: Spec = Spec {
        kind: "axis_tilt",
        scope: EffectScope::Joint,
        acts_on: ActsOn::Geometry,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("tilt", Unit::TurnMilliradian, Range::Any).of(Count::Exactly(2)),
            Parameter::setting("pivot", Unit::Millimetre, Range::Any).of(Count::Exactly(3)),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let axis = site.arm.joints()[site.joint].axis;
        Ok(Self {
            joint: site.joint,
            values: site.array("tilt"),
            normals: normals(axis),
            pivot: site.pivot()?,
        })
    }

    of_joint!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [t1, t2] = self.values;
        let turn = self.normals.0 * t1 + self.normals.1 * t2;
        Contribution::Axis { joint: self.joint, turn, pivot: self.pivot }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Zero
    }
}
