//! Effects of the contract that files may hold and that nothing predicts yet.
//!
//! Promises: names, entries and units are the contract's (`effects.md`), so that such a file is checked like any other and
//! its reader can list what is not compensated.
//! Never: an equation. An effect that gets one leaves this list for a file of its own in [`crate::effects`].
//!
//! Three names need a word: `hysteresis` of a torque stands here, of a position among the effects, told apart by their
//! entries (`amplitude_Nm` or `amplitude_mrad`); `payload` acts through the loads on both, so it exists once, there;
//! an entry that a prismatic joint calls otherwise (`inertia`: `inertia_kgm2`, `mass_kg`) is two optional ones.

use super::{ActsOn, Count, Need, Parameter, Place, Range, Spec, Unit};
use crate::heat::REFERENCE;

/// See the module. In the order of the contract's tables.
pub static NOT_MODELLED: &[Spec] = &[
    // Torques: what the motors feel.
    Spec {
        kind: "coulomb_friction",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity],
        has_memory: false,
        parameters: &[Parameter::linear("level", Unit::NewtonMetre, Range::NotNegative)],
    },
    Spec {
        kind: "viscous_friction",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity],
        has_memory: false,
        parameters: &[Parameter::linear("coefficient", Unit::One, Range::NotNegative)],
    },
    Spec {
        kind: "stribeck_friction",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity],
        has_memory: false,
        parameters: &[
            Parameter::linear("level", Unit::NewtonMetre, Range::NotNegative),
            Parameter::nonlinear("stribeck_speed", Unit::One, Range::Positive),
        ],
    },
    Spec {
        kind: "friction_asymmetry",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity],
        has_memory: false,
        parameters: &[
            Parameter::linear("offset", Unit::NewtonMetre, Range::Any).optional(),
            Parameter::linear("coefficient", Unit::One, Range::Any).optional(),
        ],
    },
    Spec {
        kind: "load_friction",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity, Need::Acceleration, Need::Masses],
        has_memory: false,
        parameters: &[Parameter::linear("coefficient", Unit::One, Range::NotNegative)],
    },
    Spec {
        kind: "friction_temperature",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Velocity, Need::Temperature],
        has_memory: false,
        parameters: &[Parameter::nonlinear("per_K", Unit::One, Range::Any), REFERENCE],
    },
    Spec {
        kind: "inertia",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Acceleration],
        has_memory: false,
        parameters: &[
            Parameter::linear("inertia", Unit::KilogramSquareMetre, Range::Any).optional(),
            Parameter::linear("mass", Unit::Kilogram, Range::Any).optional(),
        ],
    },
    Spec {
        kind: "gravity_torque",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("cos", Unit::NewtonMetre, Range::Any).optional(),
            Parameter::linear("sin", Unit::NewtonMetre, Range::Any).optional(),
            Parameter::linear("first_moment", Unit::KilogramMetre, Range::Any)
                .of(Count::Exactly(3))
                .optional(),
        ],
    },
    Spec {
        kind: "torque_ripple",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("amplitude", Unit::NewtonMetre, Range::Any),
            Parameter::nonlinear("cycles", Unit::CyclesPerRevolution, Range::Positive),
            Parameter::nonlinear("phase", Unit::PhaseRadian, Range::Any),
        ],
    },
    Spec {
        kind: "spring",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[],
        has_memory: false,
        parameters: &[
            Parameter::linear("stiffness", Unit::One, Range::Any),
            Parameter::nonlinear("rest_position", Unit::One, Range::Any),
        ],
    },
    Spec {
        kind: "spring_hardening",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear("cubic_stiffness", Unit::One, Range::Any)],
    },
    Spec {
        kind: "hysteresis",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Direction],
        has_memory: true,
        parameters: &[
            Parameter::linear("amplitude", Unit::NewtonMetre, Range::NotNegative),
            Parameter::nonlinear("reversal", Unit::Milliradian, Range::Positive),
        ],
    },
    Spec {
        kind: "drive_gain",
        place: Place::Joint,
        acts_on: ActsOn::DriveTorque,
        needs: &[],
        has_memory: false,
        parameters: &[Parameter::linear("gain", Unit::One, Range::Any)],
    },
    Spec {
        kind: "torque_delay",
        place: Place::Robot,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Time],
        has_memory: true,
        parameters: &[Parameter::nonlinear("delay", Unit::Millisecond, Range::Any)],
    },
    // Forces: what the cutter does.
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
