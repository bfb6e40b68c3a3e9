//! The hidden truth of a case of any domain, as sealed and published.
//!
//! Parameters are in the units of the model format's keys; for a revised effect they are the difference from the model.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::case::Tier;
use crate::detectability::{DISTINGUISHABLE_GAIN, Detectability, EffectName};
use crate::effect::{BlindCase, Effect, EffectKind};
use crate::generate::GeneratedCase;

/// Effects with z below this are not scored (docs/diagnosis.md).
pub const MIN_SCORED_Z: f64 = 8.0;

/// Truth of one hidden effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct HiddenEffect {
    /// Name in the model format; `None` outside the candidate dictionary.
    pub effect: Option<&'static str>,
    /// Name of its law in this crate.
    pub law: String,
    /// 1-based; `None` for effects of the whole robot.
    pub joint: Option<usize>,
    /// `new` or `revised`.
    pub change: &'static str,
    /// Values of each key, in the key's unit.
    pub parameters: BTreeMap<&'static str, Vec<f64>>,
    /// Key and index of the parameters whose confidence intervals are scored.
    pub counted: Vec<(&'static str, usize)>,
    /// Detectability, known before any answer.
    #[serde(flatten)]
    pub detectability: Detectability,
}

impl HiddenEffect {
    /// Whether it is scored against the acceptance limits: detectable, and distinguishable from all alternatives.
    #[must_use]
    pub fn is_scored(&self) -> bool {
        self.detectability.z >= MIN_SCORED_Z
            && self.detectability.least_gain >= DISTINGUISHABLE_GAIN
            && self.effect.is_some()
    }

    /// The effect as answers report it.
    #[must_use]
    pub fn effect_name(&self) -> Option<EffectName> {
        Some((self.effect?, self.joint))
    }
}

/// Truth of one case.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Truth {
    /// Name of its folder.
    pub case: String,
    /// Its tier.
    pub tier: Tier,
    /// Hidden effects.
    pub hidden: Vec<HiddenEffect>,
    /// For effects outside the dictionary: names of the covariates they depend on.
    pub depends_on: Vec<String>,
}

impl Truth {
    /// Truth of a generated case.
    #[must_use]
    pub fn of<C: BlindCase>(name: &str, generated: &GeneratedCase<C>) -> Self {
        let case = &generated.case;
        let hidden = case.hidden().iter().zip(&generated.detectabilities);
        let depends_on = case.hidden().iter().flat_map(|effect| case.covariates(effect)).collect();
        Self {
            case: name.to_owned(),
            tier: case.tier(),
            hidden: hidden
                .map(|(effect, detectability)| hidden_effect(case, effect, detectability))
                .collect(),
            depends_on,
        }
    }

    /// The hidden effect with the largest z.
    #[must_use]
    pub fn strongest(&self) -> Option<&HiddenEffect> {
        self.hidden.iter().max_by(|a, b| a.detectability.z.total_cmp(&b.detectability.z))
    }
}

fn hidden_effect<C: BlindCase>(
    case: &C,
    effect: &Effect<C::Kind>,
    detectability: &Detectability,
) -> HiddenEffect {
    let revised = case.revised_effect(effect);
    let mut whole = effect.clone();
    if let Some(known) = revised {
        let changes =
            known.true_effect.parameters.iter().zip(&known.nominal.parameters).map(|(a, b)| a - b);
        whole.parameters.iter_mut().zip(changes).for_each(|(number, change)| *number += change);
    }
    let mut parameters = BTreeMap::new();
    let mut counted = Vec::new();
    let mut number = 0;
    for (entry, numbers) in whole.keyed_parameters() {
        let key = entry.key(case.is_prismatic());
        parameters.insert(key, numbers.iter().map(|x| x / entry.si).collect());
        for k in 0..numbers.len() {
            if entry.is_scored && detectability.determined.get(number).copied().unwrap_or(false) {
                counted.push((key, k));
            }
            number += 1;
        }
    }
    HiddenEffect {
        effect: effect.kind.name(),
        law: format!("{:?}", effect.kind),
        joint: effect.joint_number(),
        change: if revised.is_some() { "revised" } else { "new" },
        parameters,
        counted,
        detectability: detectability.clone(),
    }
}

/// The text that is hashed and sealed.
#[must_use]
pub fn to_json(truths: &[Truth]) -> String {
    serde_json::to_string_pretty(truths).unwrap_or_default()
}
