//! One blind case: robot, its model, hidden effects, measurements.
//!
//! Promises: everything follows from it and its seed. Never: what the solver is told beyond the files.

use crate::chance::Chance;
use crate::kinds::{Effect, Kind};
use crate::law::{self, Law, Trial};
use crate::laws::Run;
use crate::scene::{Richness, Scene};
use crate::view::{Measured, Noise, View};

/// Which question a case asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Tier {
    /// Nothing is missing.
    Null,
    /// One effect.
    Single,
    /// Two or three.
    Multiple,
    /// Physics that no library has.
    Outside,
    /// Effects that the motion cannot part.
    Ambiguous,
    /// One effect near the limit of detection.
    Limit,
}

impl Tier {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Null, Self::Single, Self::Multiple, Self::Outside, Self::Ambiguous, Self::Limit];

    /// Its word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Null => "null",
            Self::Single => "single",
            Self::Multiple => "multiple",
            Self::Outside => "outside",
            Self::Ambiguous => "ambiguous",
            Self::Limit => "limit",
        }
    }

    /// The tier of case `index` of a mixed challenge, and how many of that tier came before it: of twenty, five nulls, eight singles,
    /// three multiples, two outside, one ambiguous, one near the limit.
    #[must_use]
    pub fn mixed(index: usize) -> (Self, usize) {
        let at = |place: usize| match place {
            0 | 4 | 8 | 12 | 16 => Self::Null,
            2 | 10 | 18 => Self::Multiple,
            6 | 14 => Self::Outside,
            11 => Self::Ambiguous,
            15 => Self::Limit,
            _ => Self::Single,
        };
        let (round, place) = (index / 20, index % 20);
        let tier = at(place);
        let before = |places: usize| (0..places).filter(|k| at(*k) == tier).count();
        (tier, round * before(20) + before(place))
    }
}

/// An effect that the model has.
#[derive(Clone, Debug, PartialEq)]
pub struct Known<K: Law = Kind> {
    /// As the model says.
    pub nominal: law::Effect<K>,
    /// As it is, within its uncertainty.
    pub real: law::Effect<K>,
    /// Standard uncertainties of the first numbers, SI; the others are certain.
    pub sigma: Vec<f64>,
}

/// A case.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What it asks.
    pub tier: Tier,
    /// What the robot does.
    pub scene: Scene,
    /// How rich its motion is.
    pub richness: Richness,
    /// What is looked at.
    pub view: View,
    /// How well.
    pub noise: Noise,
    /// What the model knows.
    pub known: Vec<Known>,
    /// What it does not.
    pub hidden: Vec<Effect>,
    /// Seed of its noise and of its unseen motion.
    pub seed: u64,
}

impl Case {
    /// What would be seen of a robot with these effects doing `scene`, without noise.
    #[must_use]
    pub fn exact(&self, scene: &Scene, effects: &[Effect]) -> Vec<f64> {
        let run = Run::of(scene, effects);
        self.view.values(scene, &run.motors(), &run.bends(effects))
    }

    /// What the instrument read of `scene`; `part` tells one recording's noise from another's.
    #[must_use]
    pub fn measured(&self, scene: &Scene, part: u64) -> Measured {
        let exact = self.exact(scene, &self.real());
        let mut chance = Chance::new(self.seed, 100 + part);
        self.noise.read(scene, &exact, self.view.width(scene), &mut chance)
    }

    /// A motion of the same robot that the solver never sees.
    #[must_use]
    pub fn unseen(&self) -> Scene {
        self.scene.again(&mut Chance::new(self.seed, 50), self.richness)
    }

    /// A point about which the measuring frame is turned, measuring axes, m: where the tool is when the arm is at home.
    #[must_use]
    pub fn middle(&self) -> crate::space::V3 {
        let arm = &self.scene.arm;
        let home = crate::space::origin(&arm.tool(&arm.home));
        crate::space::point(&self.view.measuring_from_base, home)
    }

    /// Whether the joint `joint` (from 0) has a compliance that the model knows.
    #[must_use]
    pub fn knows_compliance(&self, joint: usize) -> bool {
        self.known_of(Kind::JointCompliance, joint).is_some()
    }
}

impl Trial for Case {
    type Kind = Kind;

    fn tier(&self) -> Tier {
        self.tier
    }

    fn known(&self) -> &[Known] {
        &self.known
    }

    fn hidden(&self) -> &[Effect] {
        &self.hidden
    }

    fn follows(&self, effect: &Effect) -> Vec<String> {
        let (own, other) = (effect.joint + 1, effect.other + 1);
        match effect.kind {
            Kind::CableDrag => vec![format!("q{own}"), format!("v{own}")],
            Kind::VaryingDelay => vec![format!("q{other}"), format!("v{own}")],
            Kind::SpeedCube => vec![format!("v{own}")],
            Kind::CrossJoint => vec![format!("q{other}")],
            Kind::VaryingPlay => vec![format!("direction_{own}"), format!("q{own}")],
            _ => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tier_counts_its_cases_without_a_gap() {
        for tier in Tier::ALL {
            let turns =
                (0..200).map(Tier::mixed).filter(|(of, _)| *of == tier).map(|(_, turn)| turn);
            assert!(turns.enumerate().all(|(k, turn)| k == turn), "{tier:?}");
        }
    }
}
