//! Selection of effects for a calibration: the search of a diagnosis ([`super::selection`]) beside the geometry of every joint, without alternatives
//! and without a verdict.
//!
//! The candidates are all effects that the data can show, and finally polynomials that describe the error of a joint. If no varying wrench separates
//! them, the compliances of all drives are added first and together: a single one would absorb the others and part of the geometry.
//!
//! Invariants: only training poses are used; the same input gives the same selection.

use super::gram::Entry;
use super::jacobian_cache::JacobianCache;
use super::selection::{Search, Selection as Selected};
use crate::campaign::Campaign;
use crate::candidates::{Candidate, candidates, loaded_compliances, put, remainders};
use crate::fit::{Effort, Settings, fit};
use crate::geometry::Tolerances;
use crate::hypothesis::Belief;
use crate::result::Fit;
use crate::score::Fitted;
use physics::{AnyEffect, Model};
use std::mem::discriminant;

/// An effect that was added.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// Index among the model's effects.
    pub effect: usize,
    /// Reduction of the sum of squares, in units of the noise variance.
    pub gain: f64,
    /// Parameters that are held fixed in every fit: name and values, SI.
    pub settings: Vec<(&'static str, Vec<f64>)>,
}

/// A fit with the effects that were selected.
#[derive(Clone, Debug)]
pub struct Selection {
    /// The fit with the selected effects.
    pub fit: Fit,
    /// The selected effects, in the order in which they were added.
    pub chosen: Vec<Chosen>,
}

/// Adds the effects to `calibrated` that the training poses require.
#[must_use]
pub fn select(campaign: &Campaign, calibrated: &Fit, settings: &Settings<'_>) -> Selection {
    let (base, mut chosen) = with_compliances(campaign, calibrated, settings)
        .unwrap_or_else(|| (calibrated.clone(), Vec::new()));
    let model = &base.hypothesis.model;
    let mut library = candidates(&model.arm, campaign);
    // Counterbalance springs are searched for separately; see `springs`.
    library.retain(|candidate| !candidate.is_spring() && is_open(candidate, model));
    let Selected { fit, named } = loop {
        let selected = searched(campaign, &base, settings, &library);
        let refused: Vec<_> = impossible(&selected).map(discriminant).collect();
        let count = library.len();
        library.retain(|one| {
            one.probes.iter().all(|probe| !refused.contains(&discriminant(&probe.effect)))
        });
        if library.len() == count {
            break selected;
        }
    };
    let together = fit.design_effect;
    chosen.extend(named.into_iter().map(|one| Chosen {
        effect: one.effect,
        gain: 2.0 * one.gain * together,
        settings: one.candidate.settings,
    }));
    Selection { fit, chosen }
}

/// Selection from a library, beside the effects of `base`.
fn searched(
    campaign: &Campaign,
    base: &Fit,
    settings: &Settings<'_>,
    library: &[Candidate],
) -> Selected {
    let model = &base.hypothesis.model;
    let cache = JacobianCache::default();
    let search =
        Search { campaign, known: &base.hypothesis, settings: *settings, library, cache: &cache };
    let start = Selected::none(base);
    let also = search.searched(&start);
    let named = search.merged(search.until_stable(start, &also));
    let described = remainders(&model.arm, campaign, settings.used);
    let described =
        described.into_iter().filter(|one| is_open(one, model)).map(|one| Entry::open(&[], one));
    let also: Vec<Entry> = search.searched(&named).into_iter().chain(described).collect();
    search.until_stable(named, &also)
}

/// Whether a model has no effect that describes the same error as a candidate.
fn is_open(candidate: &Candidate, model: &Model) -> bool {
    !model.effects().any(|effect| candidate.is_rival_of(effect))
}

/// Largest plausible tilt of the base against gravity, rad; above 0. Default 0.06: three times the width of its prior.
const TILT_MAX_RAD: f64 = 0.06;

/// Selected effects with implausible parameters: a negative mass, a tilt beyond [`TILT_MAX_RAD`]. They absorb errors that the library does not
/// contain.
fn impossible(selected: &Selected) -> impl Iterator<Item = &AnyEffect> {
    let effect = |at: usize| selected.fit.hypothesis.model.effects().nth(at);
    let effects = selected.named.iter().filter_map(move |one| effect(one.effect));
    effects.filter(|effect| match effect {
        AnyEffect::Payload(_) => effect.values().first().is_some_and(|mass| *mass < 0.0),
        AnyEffect::GravityTilt(_) => effect.values().iter().any(|tilt| tilt.abs() > TILT_MAX_RAD),
        _ => false,
    })
}

/// The fit with the compliances of all loaded drives, if together they improve the criterion; each has a prior of the drives' tolerance.
fn with_compliances(
    campaign: &Campaign,
    calibrated: &Fit,
    settings: &Settings<'_>,
) -> Option<(Fit, Vec<Chosen>)> {
    let model = &calibrated.hypothesis.model;
    let mut group = loaded_compliances(&model.arm, campaign);
    group.retain(|one| !model.effects().any(|effect| one.is_rival_of(effect)));
    let whole = Candidate::of_group(&group)?;
    let fitted = Fitted::new(campaign, calibrated, settings);
    let score = fitted.scores(std::slice::from_ref(&whole)).pop()?;
    let readings = (calibrated.readings as f64 / calibrated.design_effect).max(2.0);
    if score.gain / calibrated.design_effect <= score.numbers as f64 * readings.ln() {
        return None;
    }
    let mut hypothesis = calibrated.hypothesis.clone();
    let mut chosen = Vec::with_capacity(group.len());
    for (candidate, found) in group.iter().zip(&score.found) {
        let effect = put(&mut hypothesis, candidate, &[], &[found.max(0.0)])?;
        for free in hypothesis.free.iter_mut().filter(|free| free.effect == effect) {
            (free.mean, free.sigma) = (0.0, Tolerances::default().compliance);
            free.belief = Belief::Tolerance;
        }
        let gain = score.gain / group.len() as f64;
        chosen.push(Chosen { effect, gain, settings: Vec::new() });
    }
    let settings =
        Settings { from: Some(&calibrated.surroundings), effort: Effort::Full, ..*settings };
    Some((fit(campaign, &hypothesis, &settings), chosen))
}

#[cfg(test)]
mod tests;
