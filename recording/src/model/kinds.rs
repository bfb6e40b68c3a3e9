//! All kinds of effects of a model: those implemented in `physics`, and further ones of the file
//! format.
//!
//! Format: docs/reference/effects.md. The specification in `physics` takes precedence; the table
//! here only allows files with other effects to be loaded, so that these can be listed as not
//! compensated.

use physics::JointKind;
use physics::effects::{CUTTING, DRIVES, SPECS};
use physics::spec::{Count, EffectScope, Parameter, Range, Spec, Unit};

use super::EffectEntry;

/// Specification of one kind of effect in files.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    pub(crate) place: EffectScope,
    pub(crate) parameters: &'static [Parameter],
    pub(crate) has_channel: bool,
    /// Its specification in `physics`, if it is modelled there.
    pub(super) spec: Option<&'static Spec>,
    /// Sets of stems of which one is required; empty if the required parameters suffice.
    pub(crate) alternatives: &'static [&'static [&'static str]],
}

impl Kind {
    /// Every kind, those of the physics first.
    #[cfg(feature = "schema")]
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        at_a_sample().map(modelled).chain(OTHERS.iter().copied())
    }

    /// `Err` names what is missing.
    pub(super) fn check_alternatives(&self, entry: &EffectEntry) -> Result<(), String> {
        let has = |stem: &&str| entry.parameters.iter().any(|p| p.key.starts_with(*stem));
        if self.alternatives.is_empty() || self.alternatives.iter().any(|set| set.iter().all(has)) {
            return Ok(());
        }
        let sets: Vec<String> = self.alternatives.iter().map(|set| set.join(" and ")).collect();
        Err(sets.join(", or "))
    }
}

/// The kind with this name at a joint of this kind. One name may mean two effects (hysteresis of
/// position and of torque): the one that has most of the keys is chosen, those of `physics` first.
pub(super) fn find(name: &str, joint: JointKind, has: impl Fn(&str) -> bool) -> Option<Kind> {
    let modelled = at_a_sample().filter(|spec| spec.kind == name).map(modelled);
    let others = OTHERS.iter().copied().filter(|kind| kind.name == name);
    let unknown = |kind: &Kind| {
        let known = |spec: &&Parameter| has(&spec.key(joint).to_string());
        usize::MAX - kind.parameters.iter().filter(known).count()
    };
    modelled.chain(others).min_by_key(unknown)
}

fn modelled(spec: &'static Spec) -> Kind {
    Kind {
        name: spec.kind,
        place: spec.scope,
        parameters: spec.parameters,
        has_channel: spec.kind == "time_delay" || spec.kind == "torque_delay",
        spec: Some(spec),
        alternatives: &[],
    }
}

/// All names.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    let others = OTHERS.iter().map(|kind| kind.name);
    at_a_sample().map(|spec| spec.kind).chain(others)
}

/// Specifications of the effects that `physics` predicts sample by sample.
fn at_a_sample() -> impl Iterator<Item = &'static Spec> {
    SPECS.iter().chain(DRIVES).chain(CUTTING)
}

const fn kind(name: &'static str, place: EffectScope, parameters: &'static [Parameter]) -> Kind {
    Kind { name, place, parameters, has_channel: false, spec: None, alternatives: &[] }
}

const fn either(kind: Kind, alternatives: &'static [&'static [&'static str]]) -> Kind {
    Kind { alternatives, ..kind }
}

const fn any(stem: &'static str, unit: Unit) -> Parameter {
    Parameter::linear(stem, unit, Range::Any)
}

const fn positive(stem: &'static str, unit: Unit) -> Parameter {
    Parameter::linear(stem, unit, Range::Positive)
}

const fn not_negative(stem: &'static str, unit: Unit) -> Parameter {
    Parameter::linear(stem, unit, Range::NotNegative)
}

const ROBOT: EffectScope = EffectScope::Robot;
const JOINT: EffectScope = EffectScope::Joint;
const THREE: Count = Count::Exactly(3);
const REFERENCE: Parameter = Parameter::setting("reference", Unit::Celsius, Range::Any);
const LAG: Parameter = positive("lag", Unit::Second).optional();
const TIME: Parameter = positive("time_constant", Unit::Second).optional();

/// Further kinds of docs/reference/effects.md; those of `physics` are found first.
const OTHERS: &[Kind] = &[
    // Effects on the tool's pose and on the measured wrench.
    kind("joint_coupling", JOINT, &[any("ratio", Unit::One), positive("from_joint", Unit::One)]),
    kind(
        "lost_motion",
        JOINT,
        &[not_negative("width", Unit::Milliradian), positive("torque", Unit::NewtonMetre)],
    ),
    kind(
        "hysteresis",
        JOINT,
        &[not_negative("amplitude", Unit::Milliradian), positive("reversal", Unit::Milliradian)],
    ),
    kind("stiffness_hardening", JOINT, &[positive("cubic", Unit::CubicCompliance)]),
    kind(
        "bearing_compliance",
        JOINT,
        &[
            not_negative("compliance", Unit::TurnCompliance),
            any("pivot", Unit::Millimetre).of(THREE).optional(),
        ],
    ),
    kind(
        "tool_compliance",
        ROBOT,
        &[not_negative("compliance", Unit::MicrometrePerNewton).of(THREE)],
    ),
    kind(
        "counterbalance",
        EffectScope::RevoluteJoint,
        &[
            positive("stiffness", Unit::NewtonPerMetre),
            positive("free_length", Unit::Millimetre),
            positive("a", Unit::Millimetre),
            positive("L", Unit::Millimetre),
            any("angle", Unit::Degree),
        ],
    ),
    kind("gravity_tilt", ROBOT, &[any("tilt", Unit::TurnMilliradian).of(Count::Exactly(2))]),
    kind(
        "payload",
        ROBOT,
        &[any("mass", Unit::Kilogram), any("com", Unit::Millimetre).of(THREE).optional()],
    ),
    either(
        kind(
            "thermal_zero",
            JOINT,
            &[
                any("drift", Unit::MilliradianPerKelvin).optional(),
                any("amplitude", Unit::Milliradian).optional(),
                LAG,
                TIME,
                REFERENCE,
            ],
        ),
        &[&["drift"], &["amplitude", "time_constant"]],
    ),
    kind(
        "axis_wobble",
        JOINT,
        &[
            any("amplitude", Unit::TurnMilliradian).of(Count::Exactly(2)),
            any("phase", Unit::PhaseRadian).of(Count::Exactly(2)),
            positive("cycles", Unit::CyclesPerRevolution),
        ],
    ),
    either(
        kind(
            "spindle_growth",
            ROBOT,
            &[
                any("growth", Unit::MicrometrePerKelvin).optional(),
                any("growth_um", Unit::MicrometrePerKrpm).optional(),
                LAG,
                REFERENCE,
            ],
        ),
        &[&["growth"]],
    ),
    Kind { has_channel: true, ..kind("time_delay", ROBOT, &[any("delay", Unit::Millisecond)]) },
    kind("servo_lag", JOINT, &[positive("time_constant", Unit::Millisecond)]),
    kind(
        "flexible_mode",
        EffectScope::JointOrBase,
        &[
            positive("frequency", Unit::Hertz),
            not_negative("damping_ratio", Unit::One),
            any("participation", Unit::One).optional(),
            not_negative("dynamic_compliance", Unit::Compliance).optional(),
            any("axis", Unit::One).of(THREE).optional(),
        ],
    ),
    kind(
        "reversal_spike",
        JOINT,
        &[any("amplitude", Unit::Milliradian), positive("time_constant", Unit::Millisecond)],
    ),
    kind(
        "wrench_bias",
        ROBOT,
        &[any("bias", Unit::Newton).of(THREE), any("bias", Unit::Moment).of(THREE)],
    ),
    kind("wrench_scale", ROBOT, &[any("scale", Unit::One).of(Count::Exactly(6))]),
    kind("wrench_misalignment", ROBOT, &[any("turn", Unit::TurnMilliradian).of(THREE)]),
    kind(
        "thermal_growth",
        JOINT,
        &[
            any("growth", Unit::MicrometrePerKelvin).optional(),
            any("amplitude", Unit::Micrometre).optional(),
            any("direction", Unit::One).of(THREE).optional(),
            LAG,
            TIME,
            REFERENCE,
        ],
    ),
    // Effects on the drive torques.
    Kind { has_channel: true, ..kind("torque_delay", ROBOT, &[any("delay", Unit::Millisecond)]) },
];
