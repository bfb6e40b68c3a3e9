//! Undetermined parameters as text: one sentence per reason, instead of one per parameter.
//!
//! Invariant: every undetermined parameter is in exactly one sentence, named by joint and effect, however long the list is.

use std::collections::BTreeMap;

use diagnosis::{Fit, UndeterminedParameter};
use physics::AnyEffect;

use super::text::effect_name;

/// Why a parameter is undetermined, in the order of the sentences.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Reason {
    /// No measurement depends on it.
    Unmeasured,
    /// Its estimate would be negative.
    AtZero,
    /// Confounded with the pose of the instrument.
    Frame,
    /// Confounded with the positions of the reflectors.
    Target,
    /// Confounded with other parameters of the robot.
    Others,
}

impl Reason {
    fn of(open: &UndeterminedParameter) -> Self {
        let with = |what: &str| open.confounded_with.iter().any(|partner| partner.contains(what));
        match open.confounded_with.as_slice() {
            [] if open.name.contains("negative") => Self::AtZero,
            [] => Self::Unmeasured,
            _ if with("measuring frame") => Self::Frame,
            _ if with("on the tool") => Self::Target,
            _ => Self::Others,
        }
    }

    fn sentence(self, names: &str) -> String {
        match self {
            Self::Unmeasured => format!("these poses do not determine {names}"),
            Self::AtZero => format!("{names} would be negative and were set to zero"),
            Self::Frame => format!(
                "{names} cannot be separated from the pose of the instrument, which was estimated along"
            ),
            Self::Target => format!(
                "{names} cannot be separated from the positions of the reflectors on the tool, which were estimated along"
            ),
            Self::Others => {
                format!(
                    "{names} cannot be separated from other parameters with the same effect in these poses"
                )
            }
        }
    }
}

/// One sentence per reason.
pub(super) fn sentences<'a>(
    fit: &Fit,
    open: impl Iterator<Item = &'a UndeterminedParameter>,
) -> Vec<String> {
    let first = fit.column_of(0);
    // By reason, joint (those of the whole robot and extrinsic ones last), and effect; in the order of the joints.
    let mut groups: BTreeMap<Reason, BTreeMap<usize, Vec<String>>> = BTreeMap::new();
    for one in open {
        let free = one.column.checked_sub(first).and_then(|k| fit.hypothesis.free.get(k));
        let effect = free.and_then(|free| fit.hypothesis.effect_of(free));
        let joint = effect.and_then(AnyEffect::joint);
        let name =
            effect.map_or_else(|| one.name.clone(), |effect| effect_name(effect.spec().kind));
        let of_joint = groups.entry(Reason::of(one)).or_default();
        let names = of_joint.entry(joint.unwrap_or(usize::MAX)).or_default();
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let sentence = |(reason, joints): (Reason, BTreeMap<usize, Vec<String>>)| {
        let of_joint = |(joint, names): (&usize, &Vec<String>)| match joint {
            &usize::MAX => joined(names),
            joint => format!("joint {}'s {}", joint + 1, joined(names)),
        };
        reason.sentence(&joints.iter().map(of_joint).collect::<Vec<_>>().join("; "))
    };
    groups.into_iter().map(sentence).collect()
}

/// Joins names: `a, b and c`.
fn joined(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
