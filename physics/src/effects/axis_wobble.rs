//! Periodic tilt of a joint's axis with the joint angle: bearing runout.
//!
//! As `axis_tilt`, with `t_m = A_m sin(n qᵢ + φ_m)`, m = 1, 2    A: `amplitude`, rad, two numbers · φ: `phase`, rad, two numbers · n: `cycles` per
//! revolution of the joint, > 0 (prismatic: per metre, `sin(2π n q + φ)`) · `pivot`: on the axis, the joint's point unless given.
//! Source: docs/reference/effects.md. Meant for small tilts; exact for any.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Parameter, EffectScope, Range, Spec, Unit};
use crate::trig::sin_cos;
use crate::frame::normals;
use glam::DVec3;

/// `axis_wobble`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisWobble {
    joint: usize,
    values: [f64; 5],
    normals: (DVec3, DVec3),
    pivot: DVec3,
}

impl Effect for AxisWobble {
    const SPEC: Spec = Spec {
        kind: "axis_wobble",
        scope: EffectScope::Joint,
        acts_on: ActsOn::Geometry,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("amplitude", Unit::TurnMilliradian, Range::Any).of(Count::Exactly(2)),
            Parameter::nonlinear("phase", Unit::PhaseRadian, Range::Any).of(Count::Exactly(2)),
            Parameter::nonlinear("cycles", Unit::CyclesPerRevolution, Range::Positive),
            Parameter::setting("pivot", Unit::Millimetre, Range::Any).of(Count::Exactly(3)),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let ([a1, a2], [p1, p2]) = (site.array("amplitude"), site.array("phase"));
        Ok(Self {
            joint: site.joint,
            values: [a1, a2, p1, p2, site.one("cycles")],
            normals: normals(site.arm.joints()[site.joint].axis),
            pivot: site.pivot()?,
        })
    }

    of_joint!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [a1, a2, p1, p2, cycles] = self.values;
        let angle = cycles * signals.inputs.q[self.joint];
        self.tilted(a1 * sin_cos(angle + p1).0, a2 * sin_cos(angle + p2).0)
    }

    fn derivative(&self, k: usize, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [a1, a2, p1, p2, cycles] = self.values;
        let q = signals.inputs.q[self.joint];
        let ((sin1, cos1), (sin2, cos2)) =
            (sin_cos(cycles * q + p1), sin_cos(cycles * q + p2));
        match k {
            0 => self.tilted(sin1, 0.0),
            1 => self.tilted(0.0, sin2),
            2 => self.tilted(a1 * cos1, 0.0),
            3 => self.tilted(0.0, a2 * cos2),
            _ => self.tilted(a1 * q * cos1, a2 * q * cos2),
        }
    }
}

impl AxisWobble {
    fn tilted(&self, t1: f64, t2: f64) -> Contribution {
        let turn = self.normals.0 * t1 + self.normals.1 * t2;
        Contribution::Axis { joint: self.joint, turn, pivot: self.pivot }
    }
}
