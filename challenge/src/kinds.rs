//! Kinds of hidden position effects: names and keys in the model format (docs/reference/effects.md), limits, and the inputs they need to be
//! observable.
//!
//! Parameters are SI, in the order of the keys. Their laws: [`crate::laws`].

mod specs;

use crate::effect::{self, EffectKind};

/// Specification of a kind of effect.
pub type KindSpec = effect::KindSpec<Requirement>;
/// An effect with its parameters.
pub type Effect = effect::Effect<Kind>;

/// Kinds of the candidate dictionary, one per set of parameters, and kinds outside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(
    missing_docs,
    reason = "the names are the contract's; `laws` documents the kinds outside it"
)]
pub enum Kind {
    JointOffset,
    JointRatio,
    JointCoupling,
    TransmissionError,
    Backlash,
    LostMotion,
    Hysteresis,
    GravityCompliance,
    LoadCompliance,
    JointCompliance,
    StiffnessHardening,
    BearingCompliance,
    BaseCompliance,
    ToolCompliance,
    Counterbalance,
    AxisTilt,
    AxisShift,
    ToolOffset,
    GravityTilt,
    Payload,
    ThermalGrowth,
    ThermalGrowthLag,
    ThermalGrowthWarmUp,
    ThermalZero,
    ThermalZeroLag,
    ThermalZeroWarmUp,
    AxisWobble,
    SpindleGrowth,
    SpindleGrowthSpeed,
    TimeDelay,
    ServoLag,
    FlexibleMode,
    ReversalSpike,
    WrenchBias,
    WrenchScale,
    WrenchMisalignment,
    CableDrag,
    VaryingDelay,
    SpeedCube,
    CrossJoint,
    VaryingPlay,
}

/// Condition for an effect to be observable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Requirement {
    /// Motion along a path.
    Path,
    /// Settled poses.
    Poses,
    /// A wrench that varies.
    Wrench,
    /// A temperature that varies.
    Temperature,
    /// A spindle speed that varies.
    Spindle,
    /// The model has compliances of joints.
    Compliance,
    /// The model has a compliance of the same joint.
    OwnCompliance,
    /// Known masses of the links.
    Masses,
    /// No temperature recorded.
    NoTemperature,
}

impl Kind {
    /// Every kind of the candidate dictionary.
    pub const DICTIONARY: [Self; 36] = [
        Self::JointOffset,
        Self::JointRatio,
        Self::JointCoupling,
        Self::TransmissionError,
        Self::Backlash,
        Self::LostMotion,
        Self::Hysteresis,
        Self::GravityCompliance,
        Self::LoadCompliance,
        Self::JointCompliance,
        Self::StiffnessHardening,
        Self::BearingCompliance,
        Self::BaseCompliance,
        Self::ToolCompliance,
        Self::Counterbalance,
        Self::AxisTilt,
        Self::AxisShift,
        Self::ToolOffset,
        Self::GravityTilt,
        Self::Payload,
        Self::ThermalGrowth,
        Self::ThermalGrowthLag,
        Self::ThermalGrowthWarmUp,
        Self::ThermalZero,
        Self::ThermalZeroLag,
        Self::ThermalZeroWarmUp,
        Self::AxisWobble,
        Self::SpindleGrowth,
        Self::SpindleGrowthSpeed,
        Self::TimeDelay,
        Self::ServoLag,
        Self::FlexibleMode,
        Self::ReversalSpike,
        Self::WrenchBias,
        Self::WrenchScale,
        Self::WrenchMisalignment,
    ];

    /// Kinds outside the candidate dictionary.
    pub const OUTSIDE: [Self; 5] =
        [Self::CableDrag, Self::VaryingDelay, Self::SpeedCube, Self::CrossJoint, Self::VaryingPlay];
}

impl EffectKind for Kind {
    type Requirement = Requirement;

    fn spec(self) -> KindSpec {
        specs::SPECS[self as usize].1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_own_facts() {
        for kind in Kind::DICTIONARY.iter().chain(&Kind::OUTSIDE) {
            assert_eq!(specs::SPECS[*kind as usize].0, *kind);
            assert_eq!(kind.name().is_some(), Kind::DICTIONARY.contains(kind));
            assert!((1..=kind.count()).contains(&kind.spec().linear_count));
        }
    }
}
