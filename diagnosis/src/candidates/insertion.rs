//! Adding a candidate to a hypothesis with its estimated parameters, and checking that these are physically possible.
//!
//! Linear parameters get a prior with mean zero, as wide as the estimate.

use super::Candidate;
use crate::hypothesis::{Hypothesis, parameter_key};
use physics::AnyEffect;
use physics::spec::Role;

/// Factor of the prior width over the estimate.
const PRIOR_WIDTH_FACTOR: f64 = 3.0;

/// Adds the effect of a candidate with the estimated parameters, all free except those of the stems `kept`; returns its index, `None` if the model
/// has no room.
pub(crate) fn insert(
    hypothesis: &mut Hypothesis,
    candidate: &Candidate,
    kept: &[&str],
    found: &[f64],
) -> Option<usize> {
    let effect = candidate.effect(&hypothesis.model.arm, found)?;
    let place = hypothesis.model.effects().len();
    hypothesis.add(effect, kept).ok()?;
    hypothesis.free.retain(|free| free.effect != place || candidate.may_fit(free.value));
    set_zero_mean_priors(hypothesis, place, &effect);
    Some(place)
}

/// The estimate is the initial value; the prior mean of linear parameters is zero.
fn set_zero_mean_priors(hypothesis: &mut Hypothesis, place: usize, effect: &AnyEffect) {
    for free in hypothesis.free.iter_mut().filter(|free| free.effect == place) {
        let named = parameter_key(effect, free.value);
        let linear = named.is_some_and(|named| named.parameter.role == Role::Linear);
        free.mean = if linear { 0.0 } else { free.mean };
        // A grid value is no prior knowledge; and the prior must not be narrower than the estimate.
        let size = if linear {
            PRIOR_WIDTH_FACTOR * largest_value_of_key(effect, free.value)
        } else {
            free.mean.abs()
        };
        free.sigma = free.sigma.max(size);
    }
}

/// Largest absolute value among the parameters of the same key.
fn largest_value_of_key(effect: &AnyEffect, value: usize) -> f64 {
    let stem = |value| parameter_key(effect, value).map(|named| named.parameter.stem);
    let of_same_key = effect.values().iter().enumerate().filter(|(k, _)| stem(*k) == stem(value));
    of_same_key.map(|(_, x)| x.abs()).fold(0.0, f64::max)
}

/// Whether the parameters are in their physical range: a backlash or a compliance is not negative.
pub(crate) fn is_physical(candidate: &Candidate, found: &[f64]) -> bool {
    let ranges = candidate.probes.iter().map(|probe| parameter_key(&probe.effect, probe.value));
    if candidate.is_one_mass() {
        let mut ranges = ranges.flatten().map(|named| named.parameter.range);
        return ranges.all(|range| range.holds(found.iter().sum()));
    }
    candidate.changes().is_some()
        || candidate.probes.iter().zip(found).all(|(probe, value)| {
            let range =
                parameter_key(&probe.effect, probe.value).map(|named| named.parameter.range);
            range.is_none_or(|range| range.holds(*value))
        })
}
