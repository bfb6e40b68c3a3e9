//! Chatter: a self-excited force oscillation near a mode of tool, workpiece or robot during the cut.
//!
//! `F_y += A sin(2π f t)` in the cut    A: `amplitude`, N, ≥ 0 · f: `frequency`, Hz, > 0 · t: since the segment began · y: perpendicular to the feed,
//! the direction of chip regeneration. Source: docs/reference/effects.md. A steady limit cycle; its growth is not modelled. Memoryless.

use crate::cut::ForceTerm;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};
use core::f64::consts::TAU;

/// `chatter`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chatter {
    values: [f64; 2],
}

impl Effect for Chatter {
    const SPEC: Spec = Spec {
        kind: "chatter",
        scope: EffectScope::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[Need::Time],
        has_memory: false,
        parameters: &[
            Parameter::nonlinear("frequency", Unit::Hertz, Range::Positive),
            Parameter::linear("amplitude", Unit::Newton, Range::NotNegative),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: [site.one("frequency"), site.one("amplitude")] })
    }

    of_robot!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let [frequency, amplitude] = self.values;
        let swing = libm::sin(TAU * frequency * signals.inputs.time_s);
        Contribution::ToolForce(ForceTerm::Oscillation(amplitude * swing))
    }
}
