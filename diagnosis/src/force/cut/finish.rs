//! Assembles the result of a comparison of forces with a cut: effects with parameters, improvement on the test set, residual, verdict.
//!
//! The test set is evaluated here for the first time; it can only remove an effect. Indistinguishable effects are not claimed.

use nalgebra::DMatrix;
use physics::Model;
use recording::series::Recording;
use std::collections::BTreeMap;

use super::beam_search;
use super::candidates::{KINDS, PERMANENT_TONE_KIND, SENSOR_ERROR_MOST};
use super::case::{Case, Estimates};
use super::cut_model::{CROSS_TALK, ROTATION, SCALE, Slot};
use super::parameters::{self, AssessedEffect, with_replacement};
use super::rows::Rows;
use super::unexplained::{self, UnexplainedForce};
use super::varying_coefficients;
use super::view::{ForceTrace, has_one_feed, not_tested, notes, signal_rms, traces};
use crate::engine::dictionary::CandidateTerm;
use crate::engine::normal_equations::LeastSquaresSolution;
use crate::engine::stepwise::{TermSearch, TermSelection, without_term};
use crate::engine::validation::{RankedTerm, attributed, significant, size_of, supported};
use crate::engine::verdict::{FindingEvidence, Verdict, VerdictSettings, claimed, decide_verdict};
use crate::torque::{Finding, RefittedParameter};

/// Posterior probability from which an effect is unambiguous; below it, its alternatives make the verdict ambiguous.
const UNAMBIGUOUS_PROBABILITY: f64 = 0.95;
/// Maximum number of replacements or removals after the fit to all rows but the test set.
const SWAPS: usize = 3;
/// Minimum relative advantage of a single smooth law over all selected effects, on training and test rows together; effects approximate such a law to
/// about this share.
const LAW_ADVANTAGE_LEAST: f64 = 0.01;
/// And minimum advantage in log-likelihood.
const LAW_GAIN_LEAST: f64 = 10.0;
/// Largest variance inflation, relative to a fit of the parameter alone, up to which an additional parameter is included.
const VARIANCE_INFLATION_MOST: f64 = 1e5;

/// Result of a comparison with the stated cut.
#[derive(Clone, Debug)]
pub struct CutComparison {
    /// Verdict.
    pub verdict: Verdict,
    /// Claimed effects, most important first; SI units.
    pub findings: Vec<Finding>,
    /// Selected effects with too low a probability to be claimed. They are part of the fit, of the tested residuals and of the written model.
    pub candidates: Vec<Finding>,
    /// Parameters that the model states with an uncertainty, as refitted. They are not findings, but part of the tested fit.
    pub refits: Vec<RefittedParameter>,
    /// Structure in the residual that no candidate effect explains.
    pub unexplained: Option<UnexplainedForce>,
    /// RMS residual on test rows of the stated cut, and with all findings, N.
    pub heldout: [f64; 2],
    /// RMS residual on training and validation rows, N.
    pub noise: f64,
    /// RMS recorded force, N.
    pub signal: f64,
    /// Number of compared rows.
    pub rows: usize,
    /// How the test rows were chosen, as text.
    pub heldout_description: String,
    /// Effects that this recording cannot show, with the reason.
    pub not_tested: Vec<(&'static str, &'static str)>,
    /// Notes on the processing of the data, as text.
    pub notes: Vec<String>,
    /// Whether the feed per tooth was constant in the cut.
    pub has_one_feed: bool,
    /// Whether the tool was ever in air.
    pub has_air: bool,
    /// Plot data of each recorded axis.
    pub traces: Vec<ForceTrace>,
}

pub(super) fn finish(
    mut case: Case,
    model: &Model,
    recording: &Recording,
    rows: &Rows,
    names: &[usize],
) -> CutComparison {
    let fitted_rows = case.row_sets.fitted();
    let (mut names, is_patched) = tested_effects(&mut case, names, &fitted_rows);
    // An effect is evaluated in its selected form, and reported with all of its parameters.
    let mut weighed = assess_and_replace(&mut case, &mut names, &fitted_rows);
    names = with_all_parameters(&mut case, names, &fitted_rows);
    let products = case.products(&fitted_rows);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    let selection = search.solve(&names);
    let rms = |solved: &LeastSquaresSolution| case.rms(solved, &case.row_sets.test);
    let listed = attributed(&search, &selection, &rms);
    let covariance = case.covariance(&selection.solved, &fitted_rows);
    let is_tone = |one: &&RankedTerm| case.library.terms[one.name].kind == PERMANENT_TONE_KIND;
    let tone = listed.iter().find(is_tone).map(|one| unexplained_line(&case, one.heldout));
    let parameters =
        |term| parameters::parameters_of(&case, model, &search, &selection, term, &covariance);
    let finding = |one: RankedTerm| {
        let family = &case.library.terms[one.name];
        let own_columns = search.own_columns(&selection, one.name);
        let weighed = weighed.remove(family.kind).filter(|_| family.kind != PERMANENT_TONE_KIND)?;
        Some(Finding {
            kind: family.kind,
            joint: None,
            recording: None,
            is_change: model.effects().any(|effect| effect.spec().kind == family.kind),
            parameters: parameters(family),
            confidence: weighed.confidence,
            gain: weighed.gain,
            alternatives: weighed.alternatives,
            heldout: one.heldout,
            heldout_without: one.heldout_without,
            size: size_of(&case.table, &case.library.columns, &selection.solved, &own_columns),
        })
    };
    let findings: Vec<Finding> = listed.into_iter().filter_map(finding).collect();
    let refits = refits(&case, model, &search, &selection, &covariance);
    let law = unexplained::strongest_structure(&case, &search.columns(&names));
    let given = search.solve(&[]);
    let heldout = [&given, &selection].map(|one| rms(&one.solved));
    let creeping = unexplained::excessive_drift(&case, &case.estimates);
    let is_odd = is_patched || tone.is_some() || creeping.is_some();
    let verdict = verdict(&case, &findings, (&given, &selection), law.as_ref(), is_odd);
    let (findings, candidates) =
        claimed(verdict, findings, &VerdictSettings::DRIVE_OR_CUT, |one| one.confidence);
    let nameless = is_patched.then(|| implausible_parameters(heldout));
    let unexplained = tone.or(law).or(creeping).or(nameless);
    CutComparison {
        verdict,
        findings,
        candidates,
        refits,
        unexplained,
        heldout,
        noise: case.rms(&selection.solved, &fitted_rows),
        signal: signal_rms(&case),
        rows: rows.indices.len(),
        heldout_description: case.row_sets.description.clone(),
        not_tested: not_tested(&case),
        notes: notes(&case, recording),
        has_one_feed: has_one_feed(&case),
        has_air: case.model.rows.iter().any(|state| !state.is_cutting),
        traces: traces(&case),
    }
}

/// The effects that all rows but the test set support. If they only approximate another structure: none, and `true`.
fn tested_effects(case: &mut Case, names: &[usize], fitted_rows: &[bool]) -> (Vec<usize>, bool) {
    let names = supported_effects(case, names, fitted_rows);
    let is_patched = is_only_approximation(case, &names);
    (if is_patched { supported_effects(case, &[], fitted_rows) } else { names }, is_patched)
}

/// Whether the parameters of an effect, fitted by the nonlinear model, are within their limits.
fn is_within(case: &Case, name: usize) -> bool {
    let family = &case.library.terms[name];
    family.columns.iter().zip(&family.signs).all(|(column, sign)| {
        let number = case.estimates.parameters.get(*column);
        number.is_none_or(|number| sign.admits(*number))
    })
}

/// An oscillation that is present at all times, as unmodelled structure.
fn unexplained_line(case: &Case, heldout: [f64; 2]) -> UnexplainedForce {
    let depends_on = vec!["t_s".to_owned()];
    UnexplainedForce {
        axis: 0,
        depends_on,
        heldout,
        tone_hz: Some(case.model.tone_hz),
        energy_explained: 0.0,
    }
}

/// A mismatch that the effects explain only with parameters that no sensor has.
fn implausible_parameters(heldout: [f64; 2]) -> UnexplainedForce {
    UnexplainedForce {
        axis: 0,
        depends_on: vec!["wrench".to_owned()],
        heldout,
        tone_hz: None,
        energy_explained: 0.0,
    }
}

/// Whether the effects only approximate another structure: a single smooth law explains more, or a parameter exceeds the range of a sensor.
fn is_only_approximation(case: &Case, names: &[usize]) -> bool {
    if names.is_empty() {
        return false;
    }
    let numbers = &case.estimates.parameters;
    let is_beyond =
        |slot: Slot| slot.of(numbers).iter().any(|number| number.abs() > SENSOR_ERROR_MOST);
    if [SCALE, ROTATION, CROSS_TALK].into_iter().any(is_beyond) {
        return true;
    }
    let products = case.products(&case.row_sets.train);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    let (given, selection) = (search.solve(&[]), search.solve(names));
    let penalties = names
        .iter()
        .map(|name| beam_search::penalty_with_forms(&search, &case.library.terms[*name]));
    let worth = selection.solved.gain - given.solved.gain - penalties.sum::<f64>();
    let as_stated =
        Case { estimates: Estimates::as_stated(case.estimates.spindle.clone()), ..case.clone() };
    let law =
        varying_coefficients::best_confirmed_law(&as_stated, &case.always, &as_stated.estimates);
    let evidence = |worth: f64, carried: f64| worth + 0.5 * carried;
    let carried = energy_explained(case, &given, &selection);
    let evidence_min = (1.0 + LAW_ADVANTAGE_LEAST) * evidence(worth, carried) + LAW_GAIN_LEAST;
    // The law must be ahead on test rows too: wear, which grows with feed travel, is hardly distinguishable from a law of time.
    let is_ahead = |law: &varying_coefficients::ConfirmedLaw| {
        law.structure.energy_explained > carried
            && evidence(law.score, law.structure.energy_explained) > evidence_min
    };
    law.is_some_and(|law| is_ahead(&law))
}

/// Reduction of the residual energy on test rows by a selection, in units of the innovation variance.
fn energy_explained(case: &Case, given: &TermSelection, selection: &TermSelection) -> f64 {
    let left = |selection: &TermSelection| {
        2.0 * case.negative_log_likelihood(&selection.solved, &case.row_sets.test)
    };
    (left(given) - left(selection)).max(0.0)
}

/// Effects that are significant and that the test set supports, after a fit to all other rows; adopts their parameters.
fn supported_effects(case: &mut Case, names: &[usize], fitted_rows: &[bool]) -> Vec<usize> {
    fit(case, names, fitted_rows);
    let mut names = names.to_vec();
    while let Some(wrong) = names.iter().position(|name| !is_within(case, *name)) {
        names.remove(wrong);
        fit(case, &names, fitted_rows);
    }
    let kept = {
        let products = case.products(fitted_rows);
        let search =
            TermSearch { library: &case.library, products: &products, always: &case.always };
        let covariance = |solved: &LeastSquaresSolution| case.covariance(solved, fitted_rows);
        let is_belief = |name: usize| case.library.terms[name].corrects_stated;
        let kept = significant(&search, names.clone(), &covariance, &is_belief);
        let left = |solved: &LeastSquaresSolution| {
            case.negative_log_likelihood(solved, &case.row_sets.test)
        };
        supported(&search, kept, &left, &is_belief).0
    };
    if kept != names {
        fit(case, &kept, fitted_rows);
    }
    kept
}

/// Fits effects by the nonlinear model to all rows but the test set and linearises there.
fn fit(case: &mut Case, names: &[usize], fitted_rows: &[bool]) {
    let products = case.products(fitted_rows);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    let columns = search.columns(names);
    let (estimates, _) = case.fit_nonlinear(&case.estimates, &columns, fitted_rows);
    case.estimates = estimates;
    case.linearise();
}

/// Gain and alternatives of each effect, by kind.
fn assess_effects(
    case: &Case,
    names: &[usize],
    fitted_rows: &[bool],
) -> BTreeMap<&'static str, AssessedEffect> {
    let products = case.products(fitted_rows);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    let selection = search.solve(names);
    let one = |name: &usize| {
        let kind = case.library.terms[*name].kind;
        (kind, parameters::assess_effect(case, &search, &selection, *name, fitted_rows))
    };
    names.iter().map(one).collect()
}

/// Gain and alternatives of each effect, after replacing effects by better alternatives and removing those below their penalty.
fn assess_and_replace(
    case: &mut Case,
    names: &mut Vec<usize>,
    fitted_rows: &[bool],
) -> BTreeMap<&'static str, AssessedEffect> {
    for _ in 0..SWAPS {
        let weighed = assess_effects(case, names, fitted_rows);
        let Some(better) = improved_selection(case, names, &weighed, fitted_rows) else {
            return weighed;
        };
        *names = supported_effects(case, &better, fitted_rows);
    }
    assess_effects(case, names, fitted_rows)
}

/// The effects with one replaced by a more probable alternative, or without one whose gain is below its penalty; `None` if there is neither.
fn improved_selection(
    case: &Case,
    names: &[usize],
    weighed: &BTreeMap<&'static str, AssessedEffect>,
    fitted_rows: &[bool],
) -> Option<Vec<usize>> {
    let products = case.products(fitted_rows);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    let families = &case.library.terms;
    let tested = || names.iter().filter(|name| !families[**name].corrects_stated);
    let assessed = |name: &usize| weighed.get(families[*name].kind);
    let swapped = tested().find_map(|name| {
        let better = assessed(name)?.better_alternative(&search)?;
        Some(with_replacement(names, *name, better))
    });
    let idle = || tested().find(|name| assessed(name).is_some_and(|one| one.is_below_penalty));
    swapped.or_else(|| idle().map(|name| without_term(names, *name)))
}

/// Refitted parameters with a stated uncertainty, of effects that are not findings.
fn refits(
    case: &Case,
    model: &Model,
    search: &TermSearch<'_>,
    selection: &TermSelection,
    covariance: &DMatrix<f64>,
) -> Vec<RefittedParameter> {
    let families = &case.library.terms;
    let is_named = |kind: &str| selection.terms.iter().any(|name| families[*name].kind == kind);
    let is_open = |slot: &Slot| {
        let parameters = slot.from..slot.from + slot.count;
        case.uncertain_parameters.iter().any(|uncertain| parameters.contains(&uncertain.parameter))
    };
    let open = KINDS.iter().filter(|(kind, slot)| is_open(slot) && !is_named(kind));
    let family = |(kind, _): &(&str, Slot)| families.iter().find(|family| family.kind == *kind);
    let changes = |family: &CandidateTerm| {
        let kind = family.kind;
        let numbers = parameters::parameters_of(case, model, search, selection, family, covariance);
        numbers.into_iter().map(move |parameter| RefittedParameter { kind, joint: None, parameter })
    };
    open.filter_map(family).flat_map(changes).collect()
}

/// Extends effects to all of their parameters, if these remain within their limits.
fn with_all_parameters(case: &mut Case, names: Vec<usize>, fitted_rows: &[bool]) -> Vec<usize> {
    let full = with_fullest_forms(case, &names, fitted_rows);
    if full == names {
        return names;
    }
    let chosen = case.clone();
    fit(case, &full, fitted_rows);
    if full.iter().all(|name| is_within(case, *name)) {
        return full;
    }
    *case = chosen;
    names
}

/// The effects with all parameters of their kind, where the data determine these: an omitted parameter would be reported as exactly zero.
fn with_fullest_forms(case: &Case, names: &[usize], fitted_rows: &[bool]) -> Vec<usize> {
    let families = &case.library.terms;
    let products = case.products(fitted_rows);
    let search = TermSearch { library: &case.library, products: &products, always: &case.always };
    let mut all = names.to_vec();
    for k in 0..all.len() {
        let effect = &families[all[k]];
        let same = |place: &usize| {
            families[*place].kind == effect.kind && families[*place].settings.is_empty()
        };
        let forms = (0..families.len()).filter(same);
        let Some(full) = forms.max_by_key(|place| families[*place].columns.len()) else { continue };
        let mut tried = all.clone();
        tried[k] = full;
        let solved = search.solve(&tried).solved;
        let is_apart = |(index, column): (usize, &usize)| {
            let spread = solved.covariance()[(index, index)] * products.gram[(*column, *column)];
            families[full].corrects_stated
                || !families[full].columns.contains(column)
                || spread < VARIANCE_INFLATION_MOST
        };
        if effect.settings.is_empty() && solved.columns.iter().enumerate().all(is_apart) {
            all = tried;
        }
    }
    all
}

fn verdict(
    case: &Case,
    findings: &[Finding],
    (given, selection): (&TermSelection, &TermSelection),
    rest: Option<&UnexplainedForce>,
    is_strange: bool,
) -> Verdict {
    let explained = energy_explained(case, given, selection);
    let share =
        rest.map(|rest| explained / (explained + rest.energy_explained).max(f64::MIN_POSITIVE));
    if is_strange {
        return Verdict::UnknownStructure;
    }
    let is_ambiguous =
        |one: &Finding| one.confidence < UNAMBIGUOUS_PROBABILITY && !one.alternatives.is_empty();
    let weight =
        |one: &Finding| FindingEvidence { gain: one.gain, is_ambiguous: is_ambiguous(one) };
    let weights: Vec<FindingEvidence> = findings.iter().map(weight).collect();
    decide_verdict(&weights, share, &VerdictSettings::DRIVE_OR_CUT)
}
