//! A spring that stiffens, or softens, as it is stretched.
//!
//! `τ = K₃ (q − q₀)³`    K₃: `cubic_stiffness`, Nm/rad³ or N/m³ · q₀: the rest position of the joint's `spring`, 0 where it has none. Source:
//! docs/reference/effects.md; Duffing, 1918. Memoryless.

use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Parameter, EffectScope, Range, Spec, Unit};

/// `spring_hardening`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringHardening {
    joint: usize,
    values: [f64; 1],
}

impl Effect for SpringHardening {
    const SPEC: Spec = Spec {
        kind: "spring_hardening",
        scope: EffectScope::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear("cubic_stiffness", Unit::One, Range::Any)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        let values = [site.one("cubic_stiffness")];
        Ok(Self { joint: site.joint, values })
    }

    of_joint!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [cubic] = self.values;
        Contribution::DriveTorque { joint: self.joint, term: DriveTerm::SpringCubic(cubic) }
    }
}
