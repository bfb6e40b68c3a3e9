//! Removal of the effects that the test set refutes: effects without which the error on the test set would be smaller. The test set can remove an effect,
//! never select one.
//!
//! An effect of many parameters may describe the training rows and still predict wrong values in other places: a sag of nine coefficients that one path
//! does not determine.

use super::selection::{
    EffectSelection, SelectedEffect, hypothesis_without, is_needed, shift_indices_after,
};
use super::validation::FitEvaluator;
use crate::campaign::Campaign;
use crate::chord::RefitsWithout;
use crate::hold_out::HoldOutSplit;
use physics::Model;
use rayon::prelude::*;

/// When an effect is refuted.
struct RefutationSettings {
    /// Least relative decrease of the RMS error on the test set by removal of the effect; 0 to 1. Default 0.05, chosen: an effect that is in the data and
    /// small changes this error by less, in either direction.
    decrease_min: f64,
}

impl Default for RefutationSettings {
    fn default() -> Self {
        Self { decrease_min: 0.05 }
    }
}

/// Removes the effects that the test set refutes, worst first; returns a note on each. The description of the test set then says so.
pub(super) fn remove_refuted(
    campaign: &Campaign,
    model: &Model,
    split: &mut HoldOutSplit,
    selection: &mut EffectSelection,
) -> Vec<String> {
    let settings = RefutationSettings::default();
    let held_out = split.held_out();
    let mut notes = Vec::new();
    while !selection.selected.is_empty() && held_out.contains(&true) {
        let last = &selection.fit;
        let held = FitEvaluator::new(campaign, (split, &held_out), last);
        let refits = RefitsWithout::of(campaign, last, &split.training);
        let error_without = |one: &SelectedEffect| {
            if is_needed(one, last) {
                return f64::INFINITY;
            }
            let hypothesis = hypothesis_without(last, model, &[one]);
            let state = refits.state_without(&hypothesis, &[one.effect]);
            held.rms_of(&state.residuals(campaign))
        };
        let errors: Vec<f64> = selection.selected.par_iter().map(error_without).collect();
        let least = errors.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let limit = (1.0 - settings.decrease_min) * held.rms(last);
        let Some((k, _)) = least.filter(|(_, error)| *error < limit) else { break };
        let hypothesis = hypothesis_without(last, model, &[&selection.selected[k]]);
        let fit = held.compared(&hypothesis, last);
        let removed = selection.selected.remove(k);
        notes.push(note(&removed, selection));
        shift_indices_after(&mut selection.selected, &removed);
        selection.fit = fit;
    }
    if !notes.is_empty() {
        split.description += ", but for the removal of what increases the error on them";
    }
    notes
}

/// Note on an effect that was removed from `selection`, whose fit still has it.
fn note(removed: &SelectedEffect, selection: &EffectSelection) -> String {
    let effect = selection.fit.hypothesis.model.effects().nth(removed.effect);
    let name = effect.map_or("effect", |effect| effect.spec().kind);
    let joint = effect.and_then(physics::AnyEffect::joint);
    let of_joint = joint.map_or(String::new(), |joint| format!(" of joint {}", joint + 1));
    format!(
        "`{name}`{of_joint} was selected but increases the error on held-out rows: it is not reported"
    )
}
