//! One blind case of the position domain: robot, its model, hidden effects, measurements.
//!
//! Everything follows from the case and its seed. The solver gets only the files of [`mod@crate::case_files`].

use crate::effect::{self, BlindCase, EffectKind};
use crate::instrument::{Instrument, Measurements, Noise};
use crate::kinds::{Effect, Kind};
use crate::laws::Run;
use crate::rng::Rng;
use crate::scene::{Excitation, Scene};

/// Class of a case: what the solver has to find.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Tier {
    /// No hidden effect.
    Null,
    /// One hidden effect.
    Single,
    /// Two or three hidden effects.
    Multiple,
    /// An effect that is not in the candidate dictionary.
    Outside,
    /// Effects that the motion cannot distinguish.
    Ambiguous,
    /// One effect near the limit of detection.
    Limit,
}

impl Tier {
    /// All tiers.
    pub const ALL: [Self; 6] =
        [Self::Null, Self::Single, Self::Multiple, Self::Outside, Self::Ambiguous, Self::Limit];

    /// Name in results.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Null => "null",
            Self::Single => "single",
            Self::Multiple => "multiple",
            Self::Outside => "outside",
            Self::Ambiguous => "ambiguous",
            Self::Limit => "limit",
        }
    }

    /// Tier of case `index` of a mixed challenge, and the number of preceding cases of that tier: of twenty cases, five null, eight single, three
    /// multiple, two outside, one ambiguous, one near the limit.
    #[must_use]
    pub fn mixed(index: usize) -> (Self, usize) {
        let tier_at = |place: usize| match place {
            0 | 4 | 8 | 12 | 16 => Self::Null,
            2 | 10 | 18 => Self::Multiple,
            6 | 14 => Self::Outside,
            11 => Self::Ambiguous,
            15 => Self::Limit,
            _ => Self::Single,
        };
        let (round, place) = (index / 20, index % 20);
        let tier = tier_at(place);
        let before = |places: usize| (0..places).filter(|k| tier_at(*k) == tier).count();
        (tier, round * before(20) + before(place))
    }
}

/// An effect of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelledEffect<K: EffectKind = Kind> {
    /// As stated in the model.
    pub nominal: effect::Effect<K>,
    /// The true effect, within the stated uncertainty.
    pub true_effect: effect::Effect<K>,
    /// Standard uncertainties of the first parameters, SI; the others are exact.
    pub sigma: Vec<f64>,
}

/// A case.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionCase {
    /// Its tier.
    pub tier: Tier,
    /// Motion, loads and temperatures.
    pub scene: Scene,
    /// Excitation of the motion.
    pub excitation: Excitation,
    /// Instrument.
    pub instrument: Instrument,
    /// Noise of the instrument.
    pub noise: Noise,
    /// Effects in the model.
    pub modelled: Vec<ModelledEffect>,
    /// Effects missing from the model.
    pub hidden: Vec<Effect>,
    /// Seed of the noise and of the unseen motion.
    pub seed: u64,
}

impl PositionCase {
    /// Measured values without noise, for a robot with these effects on `scene`.
    #[must_use]
    pub fn exact_values(&self, scene: &Scene, effects: &[Effect]) -> Vec<f64> {
        let run = Run::new(scene, effects);
        self.instrument.values(scene, &run.motor_positions(), &run.deviations(effects))
    }

    /// Measured values of `scene` with noise; `part` selects the noise stream of one recording.
    #[must_use]
    pub fn simulate_measurements(&self, scene: &Scene, part: u64) -> Measurements {
        let exact = self.exact_values(scene, &self.true_effects());
        let mut rng = Rng::new(self.seed, 100 + part);
        self.noise.measure(scene, &exact, self.instrument.values_per_row(scene), &mut rng)
    }

    /// Another motion of the same robot, which the solver never sees.
    #[must_use]
    pub fn unseen_scene(&self) -> Scene {
        self.scene.new_motion(&mut Rng::new(self.seed, 50), self.excitation)
    }

    /// The point about which the measuring frame is rotated, measuring axes, m: position of the tool at the home configuration.
    #[must_use]
    pub fn home_point(&self) -> crate::transform::Vector3 {
        let arm = &self.scene.arm;
        let home = crate::transform::origin(&arm.tool_pose(&arm.home));
        crate::transform::transform_point(&self.instrument.measuring_from_base, home)
    }

    /// Whether the model has a compliance of `joint` (0-based).
    #[must_use]
    pub fn has_modelled_compliance(&self, joint: usize) -> bool {
        self.modelled_effect(Kind::JointCompliance, joint).is_some()
    }
}

impl BlindCase for PositionCase {
    type Kind = Kind;

    fn tier(&self) -> Tier {
        self.tier
    }

    fn modelled(&self) -> &[ModelledEffect] {
        &self.modelled
    }

    fn hidden(&self) -> &[Effect] {
        &self.hidden
    }

    fn covariates(&self, effect: &Effect) -> Vec<String> {
        let (joint, other) = (effect.joint + 1, effect.other_joint + 1);
        match effect.kind {
            Kind::CableDrag => vec![format!("q{joint}"), format!("v{joint}")],
            Kind::VaryingDelay => vec![format!("q{other}"), format!("v{joint}")],
            Kind::SpeedCube => vec![format!("v{joint}")],
            Kind::CrossJoint => vec![format!("q{other}")],
            Kind::VaryingPlay => vec![format!("direction_{joint}"), format!("q{joint}")],
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
            let turns = (0..200)
                .map(Tier::mixed)
                .filter(|(tier_of_case, _)| *tier_of_case == tier)
                .map(|(_, turn)| turn);
            assert!(turns.enumerate().all(|(k, turn)| k == turn), "{tier:?}");
        }
    }
}
