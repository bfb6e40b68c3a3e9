//! Unmodelled inertia of a joint: a motor's rotor behind its gear, a mass on a slide.
//!
//! `τ = J a`    J: `inertia`, kg m² (revolute) or `mass`, kg (prismatic), negative if the model's value is too large. Source:
//! docs/reference/effects.md. It acts on its own joint only. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};
use crate::JointKind;

/// `inertia`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    joint: usize,
    slides: bool,
    values: [f64; 1],
}

impl Effect for Inertia {
    const SPEC: Spec = Spec {
        kind: "inertia",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Acceleration],
        has_memory: false,
        parameters: &[
            Parameter::linear("inertia", Unit::KilogramSquareMetre, Range::Any).optional(),
            Parameter::linear("mass", Unit::Kilogram, Range::Any).optional(),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let slides = site.arm.joints()[site.joint].kind == JointKind::Prismatic;
        match (slides, site.optional_value("inertia"), site.optional_value("mass")) {
            (false, Some(value), None) | (true, None, Some(value)) => {
                Ok(Self { joint: site.joint, slides, values: [value] })
            }
            (false, ..) => Err(BuildError::Combination("`inertia_kgm2` alone on a revolute joint")),
            (true, ..) => Err(BuildError::Combination("`mass_kg` alone on a prismatic joint")),
        }
    }

    of_joint!();

    fn fitted(&self) -> &'static [Parameter] {
        let place = usize::from(self.slides);
        &Self::SPEC.parameters[place..=place]
    }

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [inertia] = self.values;
        let term = DriveTerm::Torque(inertia * signals.inputs.acceleration[self.joint]);
        Contribution::DriveTorque { joint: self.joint, term }
    }
}
