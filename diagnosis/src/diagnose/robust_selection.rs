//! Removes effects whose gain in log-likelihood depends on the noise model being right over long times.
//!
//! An autoregression underestimates noise that varies as slowly as the motion (a drift, air turbulence), and effects then gain by describing the noise.
//! For each effect the Wald statistic `θᵀ C⁻¹ θ` of its parameters is computed with the covariance of the noise model and with the cluster-robust one
//! ([`crate::cluster_robust`]); their ratio is a design effect of this effect alone, by which its gain is divided. It must still exceed its penalty.
//!
//! The covariance of `k` parameters from `n` blocks has the mean inverse `(n − 1)/(n − k − 2)` times too large (inverse Wishart distribution), which is
//! corrected. An effect whose rows lie in few blocks cannot be judged so and is kept. Uses training rows only; no effect is ever added.

use super::selection::{
    EffectSelection, Search, SelectedEffect, hypothesis_without, is_needed, lacks_its_base,
    shift_indices_after,
};
use crate::engine::sandwich::{BlockSettings, BlockSums};
use crate::fit::refit_with_fixed_weights;
use crate::fit_result::Fit;
use crate::hypothesis::parameter_key;
use crate::score_test::ScoreTest;
use nalgebra::{DMatrix, DVector};
use physics::spec::Role;

/// Least share of the Wald statistic that the correction for the number of blocks leaves; no unit, 0 to 1. Default 0.05: with as many parameters as
/// blocks the statistic is no evidence.
const CORRECTION_MIN: f64 = 0.05;

/// The selection without the effects, the least supported removed first, whose gain does not exceed their penalty under the cluster-robust covariance
/// too; `None` if there are none.
///
/// White noise needs no such test: rows that are not correlated with the next ones are not correlated over longer times either.
pub(super) fn without_inflated(
    search: &Search<'_>,
    selection: &EffectSelection,
) -> Option<EffectSelection> {
    if search.campaign.instruments.iter().all(|one| one.noise_model.is_white()) {
        return None;
    }
    let count = selection.selected.len();
    let mut selection =
        EffectSelection { fit: selection.fit.clone(), selected: selection.selected.clone() };
    while !selection.selected.is_empty() {
        let fitted = ScoreTest::new(search.campaign, &selection.fit, &search.settings);
        let blocks = fitted.block_sums();
        let robust = fitted.covariance(blocks.clone());
        let margins = selection.selected.iter().map(|one| {
            if lacks_its_base(one, &selection.fit) {
                return f64::NEG_INFINITY;
            }
            if is_needed(one, &selection.fit) {
                return f64::INFINITY;
            }
            let penalty = one.gain - one.margin;
            one.gain / design_effect(one, &selection.fit, &robust, &blocks, search) - penalty
        });
        let worst = margins.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((k, _)) = worst.filter(|(_, margin)| *margin < 0.0) else { break };
        let removed = selection.selected.remove(k);
        let hypothesis = hypothesis_without(&selection.fit, &search.known.model, &[&removed]);
        shift_indices_after(&mut selection.selected, &removed);
        selection.fit = refit_with_fixed_weights(
            search.campaign,
            &hypothesis,
            &selection.fit,
            search.settings.used,
        );
        search.progress.selected(selection.selected.len());
    }
    (selection.selected.len() < count).then_some(selection)
}

/// Ratio of the Wald statistics of an effect under the noise model and under the covariance `robust` of all columns, which was estimated from `blocks`;
/// at least 1.
fn design_effect(
    one: &SelectedEffect,
    fit: &Fit,
    robust: &DMatrix<f64>,
    blocks: &[BlockSums],
    search: &Search<'_>,
) -> f64 {
    let Some(effect) = fit.hypothesis.model.effects().nth(one.effect) else { return 1.0 };
    // At zero of a nonlinear parameter (phase, time constant) the effect does not vanish.
    let is_size = |value: usize| {
        parameter_key(effect, value).is_some_and(|key| key.parameter.role != Role::Nonlinear)
    };
    let stated =
        one.previous_priors.as_ref().and_then(|_| search.known.model.effects().nth(one.effect));
    let mut places = Vec::new();
    let mut changes = Vec::new();
    for (k, free) in fit.hypothesis.free.iter().enumerate() {
        let column = fit.column_of(k);
        let place = fit.columns().iter().position(|fitted| *fitted == column);
        if let Some(place) = place.filter(|_| free.effect == one.effect && is_size(free.value)) {
            places.push(place);
            let before = stated.map_or(0.0, |stated| stated.values()[free.value]);
            changes.push(effect.values()[free.value] - before);
        }
    }
    if places.is_empty() {
        return 1.0;
    }
    let changes = DVector::from_vec(changes);
    let information = |BlockSums { gram, .. }: &BlockSums| {
        let own = gram.select_rows(&places).select_columns(&places);
        changes.dot(&(own * &changes))
    };
    if effective_number(blocks.iter().map(information))
        < BlockSettings::POSITION.blocks_least as f64
    {
        return 1.0;
    }
    let columns: Vec<usize> = places.iter().map(|place| fit.columns()[*place]).collect();
    let of_model = DMatrix::from_fn(columns.len(), columns.len(), |i, k| {
        fit.covariance(columns[i], columns[k]).unwrap_or_default()
    });
    let of_blocks = robust.select_rows(&places).select_columns(&places);
    let wald = |covariance: DMatrix<f64>| {
        covariance.cholesky().map(|factor| changes.dot(&factor.solve(&changes)))
    };
    let (Some(by_model), Some(by_blocks)) = (wald(of_model), wald(of_blocks)) else { return 1.0 };
    let free = blocks.iter().filter(|block| block.has_rows()).count() as f64 - 1.0;
    let correction = ((free - 1.0 - columns.len() as f64) / free).max(CORRECTION_MIN);
    (by_model / (correction * by_blocks).max(f64::MIN_POSITIVE)).max(1.0)
}

/// Number of equal shares with the same concentration as these (Kish 1965); 0 if there are none.
fn effective_number(shares: impl Iterator<Item = f64>) -> f64 {
    let (sum, squares) =
        shares.fold((0.0, 0.0), |(sum, squares), share| (sum + share, squares + share * share));
    if squares > 0.0 { sum * sum / squares } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::effective_number;

    #[test]
    fn unequal_shares_count_less_than_their_number() {
        assert_eq!(effective_number([2.0; 5].into_iter()), 5.0);
        assert_eq!(effective_number([0.0, 3.0, 0.0].into_iter()), 1.0);
        assert_eq!(effective_number(std::iter::empty()), 0.0);
        assert!(effective_number([4.0, 1.0, 1.0].into_iter()) < 2.1);
    }
}
