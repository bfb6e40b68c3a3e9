//! Kinds of hidden effects of cutter and sensor: names and keys in the model format (docs/reference/effects.md), and the conditions for them to be
//! observable. Parameters are SI, in the order of the keys. Their laws: [`super::laws`].

use crate::effect::{self, EffectKind, ParameterKey};

/// Kinds of the force dictionary, and kinds outside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(
    missing_docs,
    reason = "the names are the contract's; `laws` documents the kinds outside it"
)]
pub enum Kind {
    EdgeForce,
    CuttingForce,
    ToolWear,
    Runout,
    Chatter,
    CrossTalk,
    WrenchBias,
    WrenchScale,
    WrenchMisalignment,
    BrokenTooth,
    PloughingSpeed,
    BuiltUpEdge,
    TableFriction,
    SensorCreep,
}

/// Condition for an effect to be observable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Requirement {
    /// A milling cutter with several teeth.
    Teeth,
    /// A milling cutter with four or more teeth.
    ManyTeeth,
    /// A milling cutter.
    Mill,
    /// Several spindle speeds.
    Speeds,
    /// Rows without contact.
    Air,
}

/// Specification of a kind of effect.
pub type KindSpec = effect::KindSpec<Requirement>;
/// An effect with its parameters.
pub type Effect = effect::Effect<Kind>;

const fn of(
    name: &'static str,
    keys: &'static [ParameterKey],
    linear_count: usize,
    non_negative: bool,
    needs: &'static [Requirement],
) -> KindSpec {
    let max_linear = f64::INFINITY;
    KindSpec {
        name: Some(name),
        per_joint: false,
        keys,
        linear_count,
        max_linear,
        non_negative,
        needs,
    }
}

const fn outside(needs: &'static [Requirement]) -> KindSpec {
    const SIZE: &[ParameterKey] = &[ParameterKey::of("size", 1, 1.0)];
    KindSpec { name: None, ..of("", SIZE, 1, false, needs) }
}

const EDGE: &[ParameterKey] = &[ParameterKey::of("coefficient_N_per_mm", 3, 1e3)];
const CHIP: &[ParameterKey] = &[ParameterKey::of("coefficient_N_per_mm2", 3, 1e6)];
const WEAR: &[ParameterKey] = &[ParameterKey::of("growth_per_m", 1, 1.0)];
const RUNOUT: &[ParameterKey] =
    &[ParameterKey::of("radial_um", 1, 1e-6), ParameterKey::of("phase_rad", 1, 1.0)];
const CHATTER: &[ParameterKey] =
    &[ParameterKey::of("amplitude_N", 1, 1.0), ParameterKey::of("frequency_Hz", 1, 1.0)];
const LEAK: &[ParameterKey] = &[ParameterKey::of("matrix", 9, 1.0)];
const BIAS: &[ParameterKey] =
    &[ParameterKey::of("bias_N", 3, 1.0), ParameterKey::of("bias_Nm", 3, 1.0)];
const SCALE: &[ParameterKey] = &[ParameterKey::of("scale", 6, 1.0)];
const TURN: &[ParameterKey] = &[ParameterKey::of("turn_mrad", 3, 1e-3)];

impl Kind {
    /// Every kind of the force dictionary.
    pub const DICTIONARY: [Self; 9] = [
        Self::EdgeForce,
        Self::CuttingForce,
        Self::ToolWear,
        Self::Runout,
        Self::Chatter,
        Self::CrossTalk,
        Self::WrenchBias,
        Self::WrenchScale,
        Self::WrenchMisalignment,
    ];

    /// Kinds outside the candidate dictionary.
    pub const OUTSIDE: [Self; 5] = [
        Self::BrokenTooth,
        Self::PloughingSpeed,
        Self::BuiltUpEdge,
        Self::TableFriction,
        Self::SensorCreep,
    ];
}

impl EffectKind for Kind {
    type Requirement = Requirement;

    fn spec(self) -> KindSpec {
        match self {
            Self::EdgeForce => of("edge_force", EDGE, 3, false, &[]),
            Self::CuttingForce => of("cutting_force", CHIP, 3, false, &[]),
            Self::ToolWear => of("tool_wear", WEAR, 1, true, &[]),
            Self::Runout => of("runout", RUNOUT, 1, true, &[Requirement::Teeth]),
            Self::Chatter => of("chatter", CHATTER, 1, true, &[]),
            Self::CrossTalk => of("cross_talk", LEAK, 9, false, &[]),
            Self::WrenchBias => of("wrench_bias", BIAS, 6, false, &[]),
            Self::WrenchScale => of("wrench_scale", SCALE, 6, false, &[]),
            Self::WrenchMisalignment => of("wrench_misalignment", TURN, 3, false, &[]),
            Self::BrokenTooth => outside(&[Requirement::ManyTeeth]),
            Self::PloughingSpeed => outside(&[Requirement::Speeds]),
            Self::TableFriction => outside(&[Requirement::Mill, Requirement::Air]),
            Self::BuiltUpEdge | Self::SensorCreep => outside(&[]),
        }
    }

    fn step(effect: &Effect, number: usize) -> f64 {
        match (effect.kind, number) {
            // A zero phase needs a finite step; and over a second a tone is sensitive to a few hertz.
            (Self::Runout | Self::Chatter, 1) => 1.0,
            _ => effect.parameters[number].abs().max(effect.linear_magnitude()).max(1e-9),
        }
    }

    fn bounded(effect: &Effect, number: usize, wanted: f64) -> f64 {
        let spec = effect.kind.spec();
        if spec.non_negative && number < spec.linear_count { wanted.max(0.0) } else { wanted }
    }
}
