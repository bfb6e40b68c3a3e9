//! How a candidate enters a hypothesis with the numbers that were found for it, and whether a robot may have these numbers.
//!
//! Promises: linear parameters start at zero belief, with a prior as wide as what was found. Never: use of data.

use super::Candidate;
use crate::hypothesis::{Hypothesis, named};
use physics::AnyEffect;
use physics::spec::Role;

/// What is found may be this many times as large.
const BROAD: f64 = 3.0;

/// Adds the effect of a candidate with the numbers that were found for it, all free but those of `kept`; gives its place, none where there is no room.
pub(crate) fn put(
    hypothesis: &mut Hypothesis,
    candidate: &Candidate,
    kept: &[&str],
    found: &[f64],
) -> Option<usize> {
    let effect = candidate.effect(&hypothesis.model.arm, found)?;
    let place = hypothesis.model.effects().len();
    hypothesis.add(effect, kept).ok()?;
    hypothesis.free.retain(|free| free.effect != place || candidate.frees(free.value));
    believe_nothing(hypothesis, place, &effect);
    Some(place)
}

/// What was found is where the search starts; what is believed before the data is nothing.
fn believe_nothing(hypothesis: &mut Hypothesis, place: usize, effect: &AnyEffect) {
    for free in hypothesis.free.iter_mut().filter(|free| free.effect == place) {
        let named = named(effect, free.value);
        let linear = named.is_some_and(|named| named.parameter.role == Role::Linear);
        free.mean = if linear { 0.0 } else { free.mean };
        // A place on a grid is no belief; and what the data ask for is no more than a robot may have.
        let size = if linear { BROAD * size_of(effect, free.value) } else { free.mean.abs() };
        free.sigma = free.sigma.max(size);
    }
}

/// The largest number of the entry that a value belongs to.
fn size_of(effect: &AnyEffect, value: usize) -> f64 {
    let stem = |value| named(effect, value).map(|named| named.parameter.stem);
    let own = effect.values().iter().enumerate().filter(|(k, _)| stem(*k) == stem(value));
    own.map(|(_, x)| x.abs()).fold(0.0, f64::max)
}

/// Whether the numbers lie where they may: a gap or a compliance is not negative.
pub(crate) fn is_sound(candidate: &Candidate, found: &[f64]) -> bool {
    let ranges = candidate.probes.iter().map(|probe| named(&probe.effect, probe.value));
    if candidate.is_one_mass() {
        let mut ranges = ranges.flatten().map(|named| named.parameter.range);
        return ranges.all(|range| range.holds(found.iter().sum()));
    }
    candidate.changes().is_some()
        || candidate.probes.iter().zip(found).all(|(probe, value)| {
            let range = named(&probe.effect, probe.value).map(|named| named.parameter.range);
            range.is_none_or(|range| range.holds(*value))
        })
}
