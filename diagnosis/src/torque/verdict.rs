//! The verdict on torques: consistent, missing physics, unknown structure, or undetermined.
//!
//! Promises: indistinguishable effects are never claimed. Never: an estimate of its own.

use crate::diagnose::Verdict;

use super::case::Case;
use super::library::Family;
use super::selection::Selection;
use super::smooth::Beyond;
use super::{Finding, Rival, prove};

/// Names must carry this share of what stands above the noise on held-out rows, as energy; else the structure is unknown.
const CARRIED: f64 = 0.98;
/// Where more than this share of what is named cannot be distinguished, nothing is claimed.
const CLEAR: f64 = 0.5;
/// A rival that is so much behind is listed, but the verdict no longer waits for it: where names differ by 5 in expectation, chance takes more than this of it only in
/// one case in four, and where they do not differ it seldom gives as much.
const BEHIND: f64 = 3.0;
/// Names that carry their share of what stands above the noise on held-out rows are the answer; else the structure is unknown, as it is where a law stands
/// in the place of names.
pub(super) fn verdict(
    case: &Case,
    findings: &[Finding],
    (given, selection): (&Selection, &Selection),
    rest: Option<&Beyond>,
) -> Verdict {
    let held = &case.rows.held;
    let energy = |selection: &Selection| {
        let rms = prove::rms(case, &selection.solved, held);
        rms * rms
    };
    let scale: f64 = case.table.joints().map(|j| case.table.noise[j].1.ln()).sum::<f64>()
        / case.table.joints().count().max(1) as f64;
    let count = held.iter().filter(|held| **held).count() as f64
        * case.table.joints().count().max(1) as f64;
    let (before, after) = (energy(given), energy(selection));
    let carried = rest.map(|Beyond { law, instead_of, .. }| {
        let noise = case.table.noise[law.joint].1;
        let left = (law.held[0] - law.held[1]) / (noise * noise * count.max(1.0));
        let left = left * libm::exp(2.0 * scale);
        let stand = instead_of.is_empty();
        if stand { (before - after) / (before - after + left).max(1e-300) } else { 0.0 }
    });
    let named: f64 = findings.iter().map(|one| one.gain).sum();
    // Of names that explain the same the one with the fewest numbers is preferred (docs/reference/effects.md), claimed or not: a payload on one slide is its mass.
    let takes_more = |one: &Finding, rival: &Rival| {
        let own: usize = one.numbers.iter().map(|number| number.values.len()).sum();
        let others = case.library.families.get(rival.place).map_or(0, Family::count);
        rival.dearer > 0.0 || others > own
    };
    let is_alike = |one: &&Finding| {
        let mut rivals = one.rivals.iter();
        rivals.any(|r| r.behind < BEHIND && r.kind != one.kind && !takes_more(one, r))
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

#[cfg(test)]
mod tests {
    use super::super::tests::{of, recording, slider};
    use super::*;
    use physics::JointKind;

    #[test]
    fn a_mass_that_rides_on_a_level_slide_is_told_by_the_name_with_the_fewest_numbers() {
        let given = slider(true);
        let mass = given.joints()[0].link.map_or(0.0, |link| link.mass);
        let force = |[_, v, a]: [f64; 3]| (mass + 7.0) * a + 20.0 * v.signum();
        let friction: &[(&str, &[f64])] = &[("level", &[20.0])];
        let friction = physics::Given(friction);
        let known = physics::AnyEffect::build("coulomb_friction", &given, Some(0), friction);
        let found = of(&given, &[known.unwrap()], recording(JointKind::Prismatic, 1.0, force));
        assert_eq!(found.verdict, Verdict::MissingPhysics, "{:?}", found.findings);
        let kinds: Vec<&str> = found.findings.iter().map(|finding| finding.kind).collect();
        assert_eq!(kinds, ["inertia"], "{:?}", found.findings);
        let is_payload = |rival: &Rival| rival.kind == "payload" && rival.alike;
        assert!(found.findings[0].rivals.iter().any(is_payload), "{:?}", found.findings);
    }
}
