//! Identifies physical effects in recorded drive torques: friction, inertia, gravity, springs, ripple, hysteresis, load friction, drive gain, delay,
//! payload.
//!
//! Method: torque and motion are filtered into one frequency band, the torque that the model predicts is subtracted, and the residual is regressed on
//! a dictionary of candidate effects (linear in their parameters, except a few searched ones) by stepwise selection with an information criterion and
//! an AR noise model. Selected effects are confirmed on a validation set and tested on a test set. Inputs: a model and recordings. Outputs:
//! [`Diagnosis`], in SI units, joints from 0.
//!
//! Reading order: `motion` (torque and motion in one band), `rigid_body`, `regressors` and `library` (candidates), `case` (rows and
//! normal equations), `crate::engine` (selection), `nonlinear_parameters`, `low_speed_zone`, `fit_quality`, `covariates`, `parameters`, `finish`.
//!
//! Invariants: the same input and seed give the same bits; no selection and no fit uses test rows; the controller's tracking error is not a
//! covariate.

mod case;
mod covariates;
mod filter;
mod final_checks;
mod finish;
mod fit_quality;
mod library;
mod load_dependent;
mod low_speed_zone;
mod motion;
mod nonlinear_parameters;
mod parameters;
mod payload;
mod regressors;
mod reinterpretation;
mod resample;
mod rest_detection;
mod result;
mod rigid_body;
mod stated_effects;
mod stationary_joints;
mod subsampling;
#[cfg(test)]
mod tests;
mod variance_floor;
mod varying_coefficients;
mod view;

use recording::series::Recording;
use std::borrow::Cow;

use crate::engine::dictionary::CoefficientForm;
use crate::engine::stepwise::{TermSearch, TermSelection, without_term};
use crate::progress::{Listener, Stage, StageProgress};
use case::Case;
pub use covariates::UnexplainedTorque;
pub use low_speed_zone::Zone;
pub use motion::has_torque;
pub use parameters::{AlternativeEffect, FittedParameter};
use reinterpretation::{hardening_as_spring, hysteresis_as_friction, spring_as_asymmetry};
pub use result::{Diagnosis, Finding, JointValidation};
pub use stated_effects::{RefittedParameter, StatedModel};
pub use view::Trace;

/// Smallest relative increase of the residual on the validation set, when an effect is removed, for which the effect is kept.
const RESIDUAL_INCREASE_LEAST: f64 = 1e-3;
/// An effect that raises the predictive log-likelihood of the validation set (given the fit of the training set, with its parameter covariance) by at
/// least this much is kept.
const PREDICTIVE_GAIN_LEAST: f64 = 1.0;
/// Penalty, in log-likelihood, for fitting the stated masses too, although the model states no uncertainty for them.
const FITTED_MASSES_PENALTY: f64 = 20.0;
/// A zone is dropped if its residual, with the effects selected without its rows, exceeds this multiple of the zone's earlier residual: the exclusion
/// has then removed the evidence for a known effect.
const ZONE_RESIDUAL_RATIO_MOST: f64 = 4.0;
/// Repetitions of the selection for which new ripple frequencies are searched.
const RIPPLE_ROUNDS: usize = 2;

/// Why a diagnosis is impossible.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DiagnosisError {
    /// Too few rows remain after filtering.
    #[error(
        "{rows} rows of torque and motion without gaps are left, expected at least {least}: record more, or longer stretches"
    )]
    FewRows {
        /// Rows that remain.
        rows: usize,
        /// Rows that are required.
        least: usize,
    },
    /// No joint with recorded torque moves.
    #[error("no joint whose torque was recorded moves: move the arm")]
    NoMotion,
}

/// Minimum number of rows for a diagnosis, and of moving rows for a joint to be diagnosed.
const ROWS_LEAST: usize = 200;

/// Diagnoses the drive torques of the arm of `stated` from `recordings`.
///
/// `band_hz`: edge of the low-pass filter, Hz; `None` selects it from the sampling rate. `seed` determines the split of the data. Owned recordings
/// are dropped as soon as the motion has been extracted, to save memory. `listener` is told of the progress, by [`Stage::TORQUES`].
///
/// # Errors
/// [`DiagnosisError`] if too few rows of torque and motion remain, or no joint with recorded torque moves.
pub fn diagnose<'r>(
    stated: &StatedModel<'_>,
    recordings: impl Into<Cow<'r, [Recording]>>,
    band_hz: Option<f64>,
    seed: u64,
    listener: Listener<'_>,
) -> Result<Diagnosis, DiagnosisError> {
    let begin = |stage| StageProgress::begin(listener, stage);
    begin(Stage::TorqueRows);
    let recordings = recordings.into();
    let mut case = Case::new(stated, &recordings, band_hz, seed);
    drop(recordings);
    let rows = case.table.rows();
    if rows < ROWS_LEAST {
        return Err(DiagnosisError::FewRows { rows, least: ROWS_LEAST });
    }
    if case.table.joints().next().is_none() {
        return Err(DiagnosisError::NoMotion);
    }
    begin(Stage::TorqueNoise);
    case.estimate_noise();
    let train = case.row_sets.train.clone();
    let progress = begin(Stage::TorqueFirstSearch);
    let (_, selection) = select_effects(&mut case, &[], &train, progress);
    let progress = begin(Stage::TorqueSecondSearch);
    case.update_load_columns(&selection);
    case.estimate_noise();
    let (always, selection) = select_effects(&mut case, &selection.terms, &train, progress);
    let progress = begin(Stage::TorqueZones);
    let mut zones = zones(&mut case, &selection, &train);
    let (always, selection) = if zones.is_empty() {
        (always, selection)
    } else {
        case.estimate_noise();
        // Selected from scratch: effects selected because of rows in zones may be spurious.
        let zoned = select_effects(&mut case, &[], &train, progress);
        if reopen_zones(&mut case, &mut zones, &zoned.1, &train) {
            case.estimate_noise();
            select_effects(&mut case, &selection.terms, &train, progress)
        } else {
            zoned
        }
    };
    begin(Stage::TorqueValidation);
    let names = hardening_as_spring(
        &case,
        stated,
        &confirmed_by_validation(&case, &always, selection).terms,
    );
    begin(Stage::TorqueAlternatives);
    let used = case.row_sets.fitted();
    let products = case.products(&used);
    let search = nonlinear_parameters::search(&case, &products, &always);
    let names = spring_as_asymmetry(&search, names);
    let selection = search.solve(&names);
    nonlinear_parameters::search_parameters(&mut case, &selection, &always, &used);
    nonlinear_parameters::iterate_dependent_columns(&mut case, &selection.terms, &always, &used);
    let names = with_likelier_alternatives(&case, &assess_effects(&case, &always, &names));
    let names = hysteresis_as_friction(&case, &always, names);
    let names = without_warm_friction_alone(&mut case, stated, &always, &names, &used);
    let weighed = assess_effects(&case, &always, &names);
    case.ignore_autocorrelation();
    refit_nonlinear(&mut case, stated, &always, &weighed);
    begin(Stage::TorqueTestErrors);
    Ok(finish::finish(&case, stated, (&always, &weighed), zones))
}

/// Final fit of the parameters that are not linear: searched parameters, temperature coefficients, and columns that depend on other parameters, with
/// the row weights of the final fit.
fn refit_nonlinear(
    case: &mut Case,
    stated: &StatedModel<'_>,
    always: &[usize],
    weighed: &[AssessedEffect],
) {
    let fitted_rows = case.row_sets.fitted();
    let names: Vec<usize> = weighed.iter().map(|one| one.candidate).collect();
    let products = case.products(&fitted_rows);
    let selection = nonlinear_parameters::search(case, &products, always).solve(&names);
    nonlinear_parameters::search_parameters(case, &selection, always, &fitted_rows);
    nonlinear_parameters::iterate_dependent_columns(case, &names, always, &fitted_rows);
    nonlinear_parameters::fit_temperature_coefficients(
        case,
        &names,
        always,
        &fitted_rows,
        &|joint| stated.first_value("viscous_friction", joint),
    );
}

/// Removes a temperature dependence of friction where the joint's viscous friction, stated plus found, is not positive.
fn without_warm_friction_alone(
    case: &mut Case,
    stated: &StatedModel<'_>,
    always: &[usize],
    names: &[usize],
    used: &[bool],
) -> Vec<usize> {
    let products = case.products(used);
    let solved = nonlinear_parameters::search(case, &products, always).solve(names).solved;
    let has_friction = |name: &usize| {
        let family = &case.library.terms[*name];
        let viscous = |joint: usize| {
            stated.first_value("viscous_friction", joint)
                + nonlinear_parameters::found_viscous(case, names, &solved, joint)
        };
        family.form != CoefficientForm::Warmth
            || family.joint.is_some_and(|joint| viscous(joint) > 0.0)
    };
    let kept: Vec<usize> = names.iter().copied().filter(has_friction).collect();
    nonlinear_parameters::fit_temperature_coefficients(case, &kept, always, used, &|joint| {
        stated.first_value("viscous_friction", joint)
    });
    kept
}

/// A selected effect with its gain in log-likelihood and its alternatives, evaluated with the autocorrelated noise model.
#[derive(Clone)]
struct AssessedEffect {
    candidate: usize,
    gain: f64,
    confidence: f64,
    alternatives: Vec<AlternativeEffect>,
}

/// Replaces each effect by its most probable alternative if that is more probable. An effect is dropped if its replacement, or another form of it, is
/// selected already.
fn with_likelier_alternatives(case: &Case, weighed: &[AssessedEffect]) -> Vec<usize> {
    let families = &case.library.terms;
    let mut names: Vec<usize> = Vec::new();
    for one in weighed {
        let best = one.alternatives.first().filter(|rival| rival.confidence > one.confidence);
        let name = best.map_or(one.candidate, |rival| rival.candidate);
        let is_selected =
            |other: &usize| *other == name || families[*other].is_same_effect(&families[name]);
        let is_there = names.iter().any(is_selected)
            || weighed.iter().any(|w| w.candidate != one.candidate && is_selected(&w.candidate));
        if name == one.candidate || !is_there {
            names.push(name);
        }
    }
    names
}

fn assess_effects(case: &Case, always: &[usize], names: &[usize]) -> Vec<AssessedEffect> {
    let products = case.products(&case.row_sets.fitted());
    let search = nonlinear_parameters::search(case, &products, always);
    let selection = search.solve(names);
    let one = |name: &usize| {
        let (confidence, alternatives) = parameters::alternatives(&search, &selection, *name);
        AssessedEffect {
            candidate: *name,
            gain: search.gain_of(&selection, *name),
            confidence,
            alternatives,
        }
    };
    let pays = |one: &AssessedEffect| one.gain > search.penalty(&case.library.terms[one.candidate]);
    names.iter().map(one).filter(pays).collect()
}

/// Selects effects on the rows `used`, once with stated masses exact and once fitted within their prior; returns the always-fitted columns and the
/// selection of the variant with the better score.
fn select_effects(
    case: &mut Case,
    start: &[usize],
    used: &[bool],
    progress: StageProgress<'_>,
) -> (Vec<usize>, TermSelection) {
    let exact = case.always_fitted.clone();
    let mut doubted = case.always_fitted.clone();
    doubted.extend(&case.stated_mass_columns);
    let mut best: Option<(f64, Vec<usize>, TermSelection)> = None;
    let column_sets =
        if case.stated_mass_columns.is_empty() { vec![exact] } else { vec![exact, doubted] };
    for always in column_sets {
        let mut names = start.to_vec();
        let mut selection = None;
        for round in 0..=RIPPLE_ROUNDS {
            let products = case.products(used);
            let search = nonlinear_parameters::search(case, &products, &always);
            let chosen = search.select(&names);
            progress.selected(chosen.terms.len());
            let moved = case.recentre_payloads(&chosen) | case.update_delay(&chosen);
            let has_changed = round < RIPPLE_ROUNDS
                && (nonlinear_parameters::find_ripple(case, &chosen, used) || moved);
            names.clone_from(&chosen.terms);
            selection = Some(chosen);
            if !has_changed {
                break;
            }
        }
        let Some(selection) = selection else { continue };
        nonlinear_parameters::search_parameters(case, &selection, &always, used);
        let products = case.products(used);
        let search = nonlinear_parameters::search(case, &products, &always);
        let selection = search.select(&selection.terms);
        let masses_penalty =
            if always.len() > case.always_fitted.len() { FITTED_MASSES_PENALTY } else { 0.0 };
        let score = search.score(&selection) - products.log_occam_factor(&always) - masses_penalty;
        if best.as_ref().is_none_or(|(most, ..)| score > *most) {
            best = Some((score, always, selection));
        }
    }
    match best {
        Some((_, always, selection)) => (always, selection),
        None => {
            let products = case.products(used);
            let selection = nonlinear_parameters::search(case, &products, &[]).solve(&[]);
            (Vec::new(), selection)
        }
    }
}

/// Finds low-speed zones that no candidate effect describes, and excludes their rows from the fit.
fn zones(case: &mut Case, selection: &TermSelection, used: &[bool]) -> Vec<Zone> {
    let joints: Vec<usize> = case.table.joints().collect();
    let mut zones = Vec::new();
    for joint in joints {
        let left = case.residual(&selection.solved, joint);
        if let Some(zone) = low_speed_zone::find(&case.motion, &case.table, joint, &left, used) {
            let speeds = low_speed_zone::speeds(&case.motion, joint);
            let counts = case.table.counts[joint].iter_mut();
            counts.zip(speeds).for_each(|(counts, speed)| *counts &= speed >= zone.speed_limit);
            zones.push(zone);
        }
    }
    zones
}

/// Includes the rows of a zone again if effects selected without them leave a much larger residual there than those selected with them: a known
/// effect acts there. Returns whether any zone was reopened.
fn reopen_zones(
    case: &mut Case,
    zones: &mut Vec<Zone>,
    selection: &TermSelection,
    used: &[bool],
) -> bool {
    let before = zones.len();
    zones.retain(|zone| {
        let left = case.residual(&selection.solved, zone.joint);
        let speeds = low_speed_zone::speeds(&case.motion, zone.joint);
        let moves = &case.table.moves[zone.joint];
        let within: Vec<f64> = (0..left.len())
            .filter(|row| used[*row] && moves[*row] && speeds[*row] < zone.speed_limit)
            .map(|row| left[row])
            .collect();
        let rms =
            libm::sqrt(within.iter().map(|x| x * x).sum::<f64>() / within.len().max(1) as f64);
        let is_lawless = rms < ZONE_RESIDUAL_RATIO_MOST * zone.residual_rms[0];
        if !is_lawless {
            case.table.counts[zone.joint].clone_from(&case.table.moves[zone.joint]);
        }
        is_lawless
    });
    zones.len() < before
}

/// Drops the effects that the validation set does not support, by the residual itself and by the whitened residual; then selects again, since the
/// dropped effects may have displaced others.
fn confirmed_by_validation(
    case: &Case,
    always: &[usize],
    mut selection: TermSelection,
) -> TermSelection {
    let products = case.products(&case.row_sets.train);
    let search = nonlinear_parameters::search(case, &products, always);
    let Some(fell) = drop_unsupported(case, &search, &mut selection) else { return selection };
    let renamed = search.exchanged_everywhere(selection).terms;
    let never: Vec<usize> = fell.into_iter().filter(|name| !renamed.contains(name)).collect();
    let mut selection = search.select_excluding(&renamed, &never);
    match drop_unsupported(case, &search, &mut selection) {
        Some(_) => search.exchanged_everywhere(selection),
        None => selection,
    }
}

/// Removes unsupported effects one by one, the least supported first; returns them, or `None` if all are supported.
fn drop_unsupported(
    case: &Case,
    search: &TermSearch<'_>,
    selection: &mut TermSelection,
) -> Option<Vec<usize>> {
    let validation = &case.row_sets.validation;
    let left = |selection: &TermSelection| {
        [
            fit_quality::rms_outside(case, &selection.solved, validation),
            fit_quality::innovation_rms(case, &selection.solved, validation),
        ]
    };
    let both = case.products(&case.row_sets.fitted());
    let predictive_gain = |selection: &TermSelection| {
        let columns = &selection.solved.columns;
        both.log_marginal_likelihood(columns) - search.products.log_marginal_likelihood(columns)
    };
    let mut fell = Vec::new();
    loop {
        let whole = left(selection);
        let predicted_gain = predictive_gain(selection);
        let tested =
            selection.terms.iter().filter(|name| !case.is_exempt_from_test(**name, search.always));
        let tested = tested.filter(|name| {
            predictive_gain(&search.solve(&without_term(&selection.terms, **name)))
                > predicted_gain - PREDICTIVE_GAIN_LEAST
        });
        let harm = |name: &usize| {
            let without = left(&search.solve(&without_term(&selection.terms, *name)));
            (without[0] / whole[0]).max(without[1] / whole[1]) - 1.0
        };
        let worst = tested.map(|name| (*name, harm(name)));
        match worst.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((name, harm)) if harm < RESIDUAL_INCREASE_LEAST => {
                *selection = search.solve(&without_term(&selection.terms, name));
                fell.push(name);
            }
            _ => return (!fell.is_empty()).then_some(fell),
        }
    }
}
