//! What is hidden in a case, as it is sealed and opened.
//!
//! Promises: numbers in the units of the contract's keys; of a revised effect the difference to what the model says. Never: an answer.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::bench::{APART, Judged, Name};
use crate::case::{Case, Tier};
use crate::draw::Drawn;
use crate::kinds::{Effect, Kind};
use crate::write::entries;

/// Below this z nothing can be asked (contract `diagnosis.md`).
pub const LEAST_Z: f64 = 8.0;

/// The truth about one hidden effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
    pub fn of(name: &str, drawn: &Drawn) -> Self {
        let case = &drawn.case;
        let hidden = case.hidden.iter().zip(&drawn.judged);
        let depends_on = case.hidden.iter().flat_map(depends_on).collect();
        Self {
            case: name.to_owned(),
            tier: case.tier,
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

fn of(case: &Case, effect: &Effect, judged: &Judged) -> Hidden {
    let revised = case.revises(effect);
    let mut whole = effect.clone();
    if revised {
        let same = |k: &&crate::case::Known| {
            k.nominal.kind == effect.kind && k.nominal.joint == effect.joint
        };
        if let Some(known) = case.known.iter().find(same) {
            whole.numbers[0] += known.real.numbers[0] - known.nominal.numbers[0];
        }
    }
    let mut parameters = BTreeMap::new();
    let mut counted = Vec::new();
    let mut number = 0;
    for (entry, numbers) in entries(&whole) {
        parameters.insert(entry.key, numbers.iter().map(|x| x / entry.si).collect());
        for k in 0..numbers.len() {
            if entry.counted && judged.determined.get(number).copied().unwrap_or(false) {
                counted.push((entry.key, k));
            }
            number += 1;
        }
    }
    Hidden {
        effect: effect.kind.name(),
        law: format!("{:?}", effect.kind),
        joint: effect.joint_said(),
        change: if revised { "revised" } else { "new" },
        parameters,
        counted,
        judged: judged.clone(),
    }
}

/// The words of the contract for what a law outside the library follows.
fn depends_on(effect: &Effect) -> Vec<String> {
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

/// The text that is sealed.
#[must_use]
pub fn text(truths: &[Truth]) -> String {
    serde_json::to_string_pretty(truths).unwrap_or_default()
}
