//! The hidden truth of a case of any domain, as sealed and published.
//!
//! Promises: numbers in the units of the contract's keys; of a revised effect the difference to what the model says. Never: an answer.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::bench::{APART, Judged, Name};
use crate::case::Tier;
use crate::draw::Drawn;
use crate::law::{Effect, Law, Trial};

/// Below this z nothing can be asked (docs/diagnosis.md).
pub const LEAST_Z: f64 = 8.0;

/// The truth about one hidden effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Hidden {
    /// Name in the contract; none outside the library.
    pub effect: Option<&'static str>,
    /// The law, by its name here.
    pub law: String,
    /// From 1.
    pub joint: Option<usize>,
    /// `new` or `revised`.
    pub change: &'static str,
    /// By key, each with its numbers.
    pub parameters: BTreeMap<&'static str, Vec<f64>>,
    /// Keys and places of numbers on which intervals are counted.
    pub counted: Vec<(&'static str, usize)>,
    /// What is known of it before anyone answers.
    #[serde(flatten)]
    pub judged: Judged,
}

impl Hidden {
    /// Whether it counts towards a bar.
    #[must_use]
    pub fn counts(&self) -> bool {
        self.judged.z >= LEAST_Z && self.judged.least_gain >= APART && self.effect.is_some()
    }

    /// Its name in answers.
    #[must_use]
    pub fn name(&self) -> Option<Name> {
        Some((self.effect?, self.joint))
    }
}

/// The truth about one case.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Truth {
    /// Its folder's name.
    pub case: String,
    /// What it asks.
    pub tier: Tier,
    /// What is hidden.
    pub hidden: Vec<Hidden>,
    /// Outside the library: the words of what it follows.
    pub depends_on: Vec<String>,
}

impl Truth {
    /// The truth about a drawn case.
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

    /// The hidden effect that shows most.
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

/// The text that is sealed.
#[must_use]
pub fn text(truths: &[Truth]) -> String {
    serde_json::to_string_pretty(truths).unwrap_or_default()
}
