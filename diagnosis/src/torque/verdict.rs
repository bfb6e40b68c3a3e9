//! The verdict on torques: consistent, named, unknown, or not to be told apart.
//!
//! Promises: what cannot be told apart is never claimed. Never: a number that was not found elsewhere.

use crate::diagnose::Verdict;

use super::Finding;
use super::smooth::Beyond;

/// Names must carry this share of what can be explained; else the structure is unknown.
const CARRIED: f64 = 0.98;
/// Where more than this share of what is named cannot be told apart, nothing is claimed.
const CLEAR: f64 = 0.5;
/// A rival that is so much behind is listed, but the verdict no longer waits for it: where names differ by 5 in expectation, chance takes more than this of it only in
/// one case in four, and where they do not differ it seldom gives as much.
const BEHIND: f64 = 3.0;
/// Names that carry their share of the log-likelihood are the answer; else the structure is unknown.
pub(super) fn verdict(findings: &[Finding], beyond: Option<&Beyond>) -> Verdict {
    let carried = beyond.map(|beyond| {
        let stand = beyond.instead_of.is_empty();
        if stand { beyond.of_names / (beyond.of_names + beyond.gain) } else { 0.0 }
    });
    let named: f64 = findings.iter().map(|one| one.gain).sum();
    let is_alike = |one: &&Finding| {
        one.rivals.iter().any(|r| r.behind < BEHIND && r.kind != one.kind && r.dearer <= 0.0)
    };
    let alike: f64 = findings.iter().filter(is_alike).map(|one| one.gain).sum();
    match (findings.is_empty(), carried) {
        (true, None) => Verdict::Consistent,
        (true, Some(_)) => Verdict::UnknownStructure,
        (false, Some(share)) if share < CARRIED => Verdict::UnknownStructure,
        _ if alike > CLEAR * named => Verdict::Undetermined,
        _ => Verdict::MissingPhysics,
    }
}
