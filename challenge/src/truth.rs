//! The hidden truth of a case of any domain, as sealed and published.
//!
//! Parameters are in the units of the model format's keys; for a revised effect they are the difference from the model.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::bench::{APART, Judged, Name};
use crate::case::Tier;
use crate::draw::Drawn;
use crate::law::{Effect, Law, Trial};

/// Effects with z below this are not scored (docs/diagnosis.md).
pub const LEAST_Z: f64 = 8.0;

/// Truth of one hidden effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Hidden {
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
    pub judged: Judged,
}

impl Hidden {
    /// Whether it is scored against the acceptance limits: detectable, and distinguishable from all alternatives.
    #[must_use]
    pub fn counts(&self) -> bool {
        self.judged.z >= LEAST_Z && self.judged.least_gain >= APART && self.effect.is_some()
    }

    /// The effect as answers report it.
    #[must_use]
    pub fn name(&self) -> Option<Name> {
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
    pub hidden: Vec<Hidden>,
    /// For effects outside the dictionary: names of the covariates they depend on.
    pub depends_on: Vec<String>,
}

impl Truth {
    /// Truth of a generated case.
    #[must_use]
    pub fn of<C: Trial>(name: &str, drawn: &Drawn<C>) -> Self {
        let case = &drawn.case;
        let hidden = case.hidden().iter().zip(&drawn.judged);
        let depends_on = case.hidden().iter().flat_map(|effect| case.follows(effect)).collect();
        Self {
            case: name.to_owned(),
            tier: case.tier(),
            hidden: hidden.map(|(effect, judged)| of(case, effect, judged)).collect(),
            depends_on,
        }
    }

    /// The hidden effect with the largest z.
    #[must_use]
    pub fn strongest(&self) -> Option<&Hidden> {
        self.hidden.iter().max_by(|a, b| a.judged.z.total_cmp(&b.judged.z))
    }
}

fn of<C: Trial>(case: &C, effect: &Effect<C::Kind>, judged: &Judged) -> Hidden {
    let revised = case.revised(effect);
    let mut whole = effect.clone();
    if let Some(known) = revised {
        let off = known.real.numbers.iter().zip(&known.nominal.numbers).map(|(a, b)| a - b);
        whole.numbers.iter_mut().zip(off).for_each(|(number, off)| *number += off);
    }
    let mut parameters = BTreeMap::new();
    let mut counted = Vec::new();
    let mut number = 0;
    for (entry, numbers) in whole.entries() {
        let key = entry.key(case.slides());
        parameters.insert(key, numbers.iter().map(|x| x / entry.si).collect());
        for k in 0..numbers.len() {
            if entry.counted && judged.determined.get(number).copied().unwrap_or(false) {
                counted.push((key, k));
            }
            number += 1;
        }
    }
    Hidden {
        effect: effect.kind.name(),
        law: format!("{:?}", effect.kind),
        joint: effect.joint_said(),
        change: if revised.is_some() { "revised" } else { "new" },
        parameters,
        counted,
        judged: judged.clone(),
    }
}

/// The text that is hashed and sealed.
#[must_use]
pub fn text(truths: &[Truth]) -> String {
    serde_json::to_string_pretty(truths).unwrap_or_default()
}
