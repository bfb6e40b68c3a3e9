//! What is hidden in a case of torques, as it is sealed and opened: in the words of [`crate::truth`].
//!
//! Promises: numbers in the units of the contract's keys; of a revised effect the difference to what the model says. Never: an answer.

use std::collections::BTreeMap;

use crate::truth::{Hidden, Truth};
use crate::weigh::Judged;

use super::case::Case;
use super::draw::Drawn;
use super::kinds::{Effect, Kind};
use super::write::entries;

/// The truth about a drawn case.
#[must_use]
pub fn of(name: &str, drawn: &Drawn) -> Truth {
    let case = &drawn.case;
    let hidden = case.hidden.iter().zip(&drawn.judged);
    Truth {
        case: name.to_owned(),
        tier: case.tier,
        hidden: hidden.map(|(effect, judged)| hidden_of(case, effect, judged)).collect(),
        depends_on: case.hidden.iter().flat_map(depends_on).collect(),
    }
}

fn hidden_of(case: &Case, effect: &Effect, judged: &Judged) -> Hidden {
    let mut whole = effect.clone();
    let revised = case.revised(effect);
    if let Some(known) = revised {
        whole.numbers[0] += known.real.numbers[0] - known.nominal.numbers[0];
    }
    let mut parameters = BTreeMap::new();
    let mut counted = Vec::new();
    let mut number = 0;
    for (key, entry, numbers) in entries(&whole, case.rig.slides) {
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

/// The words of the contract for what a law outside the library follows.
fn depends_on(effect: &Effect) -> Vec<String> {
    let (own, other) = (effect.joint + 1, effect.other + 1);
    match effect.kind {
        Kind::SpeedCube => vec![format!("v{own}")],
        Kind::PlaceFriction => vec![format!("q{own}"), format!("direction_{own}")],
        Kind::PlaceDamping => vec![format!("q{own}"), format!("v{own}")],
        Kind::CrossTorque => vec![format!("q{other}")],
        Kind::Wander => vec!["t_s".to_owned()],
        _ => Vec::new(),
    }
}
