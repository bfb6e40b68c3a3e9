//! The kinds of hidden effects: their names and keys in the contract (`effects.md`), their limits, and what they need to show.
//!
//! Promises: numbers are SI in the order of the keys. Never: a law; see [`crate::laws`].

mod facts;

/// Kinds that the library of the contract has, one per set of parameters, and kinds that it has not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(
    missing_docs,
    reason = "the names are the contract's; what stands outside it is told in `laws`"
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

/// A key of an effect in a model file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Key with its unit.
    pub key: &'static str,
    /// Numbers.
    pub count: usize,
    /// SI of one such unit.
    pub si: f64,
    /// Whether intervals are counted on it: not where the contract's law and the one here have no common number.
    pub counted: bool,
}

/// What is said of a kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facts {
    /// Name in the contract; none outside the library.
    pub name: Option<&'static str>,
    /// Whether it belongs to a joint.
    pub of_joint: bool,
    /// Keys in order.
    pub entries: &'static [Entry],
    /// How many numbers, from the first, the effect is proportional to.
    pub leads: usize,
    /// The largest magnitude of a leading number, SI.
    pub most: f64,
    /// Whether the leading number may not be negative.
    pub not_negative: bool,
    /// What it needs.
    pub needs: &'static [Need],
}

/// What must be there for an effect to show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Motion in time.
    Path,
    /// Settled poses.
    Poses,
    /// A wrench that changes.
    Wrench,
    /// A temperature that changes.
    Temperature,
    /// A spindle that changes its speed.
    Spindle,
    /// A compliance of joints that the model knows.
    Compliance,
    /// A compliance of this very joint that the model knows.
    OwnCompliance,
    /// Masses of the links.
    Masses,
    /// No temperature recorded.
    NoTemperature,
}

impl Kind {
    /// Every kind of the contract's library.
    pub const LIBRARY: [Self; 36] = [
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

    /// Physics that no library of the contract has.
    pub const OUTSIDE: [Self; 5] =
        [Self::CableDrag, Self::VaryingDelay, Self::SpeedCube, Self::CrossJoint, Self::VaryingPlay];

    /// What is said of it.
    #[must_use]
    pub fn facts(self) -> &'static Facts {
        &facts::FACTS[self as usize].1
    }

    /// Its name in answers; outside the library none.
    #[must_use]
    pub fn name(self) -> Option<&'static str> {
        self.facts().name
    }

    /// How many numbers it has.
    #[must_use]
    pub fn count(self) -> usize {
        self.facts().entries.iter().map(|entry| entry.count).sum()
    }

    /// Whether it needs this.
    #[must_use]
    pub fn needs(self, need: Need) -> bool {
        self.facts().needs.contains(&need)
    }
}

/// An effect with its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// Which law.
    pub kind: Kind,
    /// From 0; 0 for effects of the whole robot.
    pub joint: usize,
    /// The other joint of a coupling, from 0.
    pub other: usize,
    /// SI, in the order of the keys.
    pub numbers: Vec<f64>,
}

impl Effect {
    /// The same with its leading numbers times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        scaled.numbers.iter_mut().take(self.kind.facts().leads).for_each(|x| *x *= factor);
        scaled
    }

    /// The largest of its leading numbers.
    #[must_use]
    pub fn lead(&self) -> f64 {
        let leads = self.numbers.iter().take(self.kind.facts().leads);
        leads.fold(0.0, |most, x| most.max(x.abs()))
    }

    /// The joint as answers name it, from 1.
    #[must_use]
    pub fn joint_said(&self) -> Option<usize> {
        self.kind.facts().of_joint.then_some(self.joint + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_own_facts() {
        for kind in Kind::LIBRARY.iter().chain(&Kind::OUTSIDE) {
            assert_eq!(facts::FACTS[*kind as usize].0, *kind);
            assert_eq!(kind.name().is_some(), Kind::LIBRARY.contains(kind));
            assert!((1..=kind.count()).contains(&kind.facts().leads));
        }
    }
}
