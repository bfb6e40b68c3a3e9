//! Deviation of the edge force: a force proportional to the depth of cut, independent of the feed.
//!
//! `F += k a`    k: `coefficient`, tangential, radial, axial, N/m; in addition to the recording's `[cut]`.
//! Source: docs/reference/effects.md; Altintas, Manufacturing Automation, 2012, 2.3. Memoryless.

use crate::cut::ForceTerm;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::spec::{ActsOn, Count, Parameter, EffectScope, Range, Spec, Unit};
use glam::DVec3;

/// `edge_force`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeForce {
    values: [f64; 3],
}

impl Effect for EdgeForce {
    const SPEC: Spec = Spec {
        kind: "edge_force",
        scope: EffectScope::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear("coefficient", Unit::NewtonPerMillimetre, Range::Any)
            .of(Count::Exactly(3))],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { values: site.array("coefficient") })
    }

    of_robot!();

    fn predict(&self, _signals: &Signals<'_>, _memory: &Memory) -> Contribution {
        Contribution::ToolForce(ForceTerm::Edge(DVec3::from_array(self.values)))
    }
}
