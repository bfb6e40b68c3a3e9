//! Effects of the contract that files may hold and that nothing predicts yet.
//!
//! Promises: names, entries and units are the contract's (`effects.md`), so that such a file is checked like any other and
//! its reader can list what is not compensated.
//! Never: an equation. An effect that gets one leaves this list for a file of its own in [`crate::effects`].

use super::{ActsOn, Count, Need, Parameter, Place, Range, Spec, Unit};

/// See the module: what the cutter does, in the order of the contract's table.
pub static NOT_MODELLED: &[Spec] = &[
    Spec {
        kind: "edge_force",
        place: Place::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear("coefficient", Unit::NewtonPerMillimetre, Range::Any)
            .of(Count::Exactly(3))],
    },
    Spec {
        kind: "cutting_force",
        place: Place::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear(
            "coefficient",
            Unit::NewtonPerSquareMillimetre,
            Range::Any,
        )
        .of(Count::Exactly(3))],
    },
    Spec {
        kind: "tool_wear",
        place: Place::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[],
        has_memory: true,
        parameters: &[Parameter::linear("growth", Unit::PerMetre, Range::NotNegative)],
    },
    Spec {
        kind: "runout",
        place: Place::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[Need::SpindleSpeed],
        has_memory: false,
        parameters: &[
            Parameter::linear("radial", Unit::Micrometre, Range::NotNegative),
            Parameter::nonlinear("phase", Unit::PhaseRadian, Range::Any),
        ],
    },
    Spec {
        kind: "chatter",
        place: Place::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[Need::Time],
        has_memory: false,
        parameters: &[
            Parameter::nonlinear("frequency", Unit::Hertz, Range::Positive),
            Parameter::linear("amplitude", Unit::Newton, Range::NotNegative),
        ],
    },
    Spec {
        kind: "cross_talk",
        place: Place::Robot,
        acts_on: ActsOn::ToolForce,
        needs: &[Need::Wrench],
        has_memory: false,
        parameters: &[Parameter::linear("matrix", Unit::One, Range::Any).of(Count::Exactly(9))],
    },
];
