//! Selection of effects for a calibration: the search of a diagnosis ([`super::selection`]) beside the geometry of every joint, without alternatives
//! and without a verdict.
//!
//! The candidates are all effects that the data can show, and finally polynomials that describe the error of a joint. If no varying wrench separates
//! them, the compliances of all drives are added first and together: a single one would absorb the others and part of the geometry.
//!
//! Invariants: only training poses are used; the same input gives the same selection.

use super::gram_matrix::LinearisedCandidate;
use super::jacobian_cache::JacobianCache;
use super::selection::{EffectSelection, Search};
use crate::campaign::Campaign;
use crate::candidates::{Candidate, candidates, insert, joint_polynomials, loaded_compliances};
use crate::fit::{FitEffort, FitSettings, fit};
use crate::fit_result::Fit;
use crate::geometry::Tolerances;
use crate::hypothesis::PriorSource;
use crate::progress::{Listener, Stage, StageProgress};
use crate::score_test::ScoreTest;
use physics::{AnyEffect, Model};
use std::mem::discriminant;

/// An effect that was added.
#[derive(Clone, Debug)]
pub struct AddedEffect {
    /// Index among the model's effects.
    pub effect: usize,
    /// Reduction of the sum of squares, in units of the noise variance.
    pub gain: f64,
    /// Parameters that are held fixed in every fit: name and values, SI.
    pub settings: Vec<(&'static str, Vec<f64>)>,
}

/// A fit with the effects that were selected.
#[derive(Clone, Debug)]
pub struct ExtendedModel {
    /// The fit with the selected effects.
    pub fit: Fit,
    /// The selected effects, in the order in which they were added.
    pub chosen: Vec<AddedEffect>,
}

/// Adds the effects to `calibrated` that the training poses require; `listener` is told of the progress.
#[must_use]
pub fn select_effects(
    campaign: &Campaign,
    calibrated: &Fit,
    settings: &FitSettings<'_>,
    listener: Listener<'_>,
) -> ExtendedModel {
    let progress = StageProgress::begin(listener, Stage::CalibrationSearch);
    let (base, mut chosen) = with_compliances(campaign, calibrated, settings)
        .unwrap_or_else(|| (calibrated.clone(), Vec::new()));
    let model = &base.hypothesis.model;
    let mut library = candidates(&model.arm, campaign);
    // Counterbalance springs are searched for separately; see `springs`.
    library.retain(|candidate| !candidate.is_spring() && is_new(candidate, model));
    let EffectSelection { fit, selected: named } = loop {
        let selected = select_from(campaign, &base, settings, &library, progress);
        let refused: Vec<_> = implausible_effects(&selected).map(discriminant).collect();
        let count = library.len();
        library.retain(|one| {
            one.probes.iter().all(|probe| !refused.contains(&discriminant(&probe.effect)))
        });
        if library.len() == count {
            break selected;
        }
    };
    let together = fit.design_effect;
    chosen.extend(named.into_iter().map(|one| AddedEffect {
        effect: one.effect,
        gain: 2.0 * one.gain * together,
        settings: one.candidate.settings,
    }));
    ExtendedModel { fit, chosen }
}

/// Selection from a dictionary, beside the effects of `base`.
fn select_from(
    campaign: &Campaign,
    base: &Fit,
    settings: &FitSettings<'_>,
    dictionary: &[Candidate],
    progress: StageProgress<'_>,
) -> EffectSelection {
    let model = &base.hypothesis.model;
    let cache = JacobianCache::default();
    let search = Search {
        campaign,
        known: &base.hypothesis,
        settings: *settings,
        dictionary,
        cache: &cache,
        progress,
    };
    let start = EffectSelection::none(base);
    let also = search.searched_candidates(&start);
    let named = search.merge_effects(search.iterate_until_stable(start, &also));
    let described = joint_polynomials(&model.arm, campaign, settings.used);
    let described = described
        .into_iter()
        .filter(|one| is_new(one, model))
        .map(|one| LinearisedCandidate::unfitted(&[], one));
    let also: Vec<LinearisedCandidate> =
        search.searched_candidates(&named).into_iter().chain(described).collect();
    search.iterate_until_stable(named, &also)
}

/// Whether a model has no effect that describes the same error as a candidate.
fn is_new(candidate: &Candidate, model: &Model) -> bool {
    !model.effects().any(|effect| candidate.excludes_effect(effect))
}

/// Largest plausible tilt of the base against gravity, rad; above 0. Default 0.06: three times the width of its prior.
const TILT_MAX_RAD: f64 = 0.06;

/// Selected effects with implausible parameters: a negative mass, a tilt beyond [`TILT_MAX_RAD`]. They absorb errors that the dictionary does not
/// contain.
fn implausible_effects(selected: &EffectSelection) -> impl Iterator<Item = &AnyEffect> {
    let effect = |index: usize| selected.fit.hypothesis.model.effects().nth(index);
    let effects = selected.selected.iter().filter_map(move |one| effect(one.effect));
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
    settings: &FitSettings<'_>,
) -> Option<(Fit, Vec<AddedEffect>)> {
    let model = &calibrated.hypothesis.model;
    let mut group = loaded_compliances(&model.arm, campaign);
    group.retain(|one| !model.effects().any(|effect| one.excludes_effect(effect)));
    let whole = Candidate::of_group(&group)?;
    let fitted = ScoreTest::new(campaign, calibrated, settings);
    let score = fitted.scores(std::slice::from_ref(&whole)).pop()?;
    let readings = (calibrated.readings as f64 / calibrated.design_effect).max(2.0);
    if score.gain / calibrated.design_effect <= score.parameter_count as f64 * readings.ln() {
        return None;
    }
    let mut hypothesis = calibrated.hypothesis.clone();
    let mut chosen = Vec::with_capacity(group.len());
    for (candidate, found) in group.iter().zip(&score.values) {
        let effect = insert(&mut hypothesis, candidate, &[], &[found.max(0.0)])?;
        for free in hypothesis.free.iter_mut().filter(|free| free.effect == effect) {
            (free.mean, free.sigma) = (0.0, Tolerances::default().compliance);
            free.prior_source = PriorSource::Tolerance;
        }
        let gain = score.gain / group.len() as f64;
        chosen.push(AddedEffect { effect, gain, settings: Vec::new() });
    }
    let settings =
        FitSettings { from: Some(&calibrated.surroundings), effort: FitEffort::Full, ..*settings };
    Some((fit(campaign, &hypothesis, &settings), chosen))
}

#[cfg(test)]
mod tests;
