//! Compliance of tool, holder or spindle at the TCP.
//!
//! `δx = C_t F`, axis by axis in tool axes    `C_t`: `compliance`, three numbers, m/N, ≥ 0 · F: force ON the tool, N.
//! Source: docs/reference/effects.md. Linear; moments have no effect, and the tool does not rotate.

use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Need, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

/// `tool_compliance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolCompliance {
    values: [f64; 3],
}

impl Effect for ToolCompliance {
    const SPEC: Spec = Spec {
        kind: "tool_compliance",
        scope: EffectScope::Robot,
        acts_on: ActsOn::Geometry,
        needs: &[Need::Wrench],
        has_memory: false,
        parameters: &[
            Parameter::linear("compliance", Unit::MicrometrePerNewton, Range::NotNegative)
                .of(Count::Exactly(3)),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: site.array("compliance") })
    }

    of_robot!();

    fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        let tool_from_base = signals.chain.base_from_tool.rotation.transpose();
        let force_tool = tool_from_base * signals.loads.wrench.force;
        let shift = DVec3::from_array(self.values) * force_tool;
        Contribution::Tool { shift, turn: DVec3::ZERO }
    }
}
