//! Assembles the result of a torque diagnosis: effects with parameters, improvement on the test set, residual, verdict. The test set is evaluated
//! here for the first time: it can remove an effect, but selects none.

use nalgebra::DMatrix;
use physics::{Arm, JointKind};

use crate::engine::dictionary::CandidateTerm;
use crate::engine::verdict::{FindingEvidence, Verdict, VerdictSettings, claimed, decide_verdict};

use super::case::Case;
use super::low_speed_zone::Zone;
use super::varying_coefficients::SmoothLaw;
use super::{
    AlternativeEffect, AssessedEffect, Diagnosis, Finding, JointValidation, RefittedParameter,
    StatedModel, final_checks, fit_quality, nonlinear_parameters, parameters, stationary_joints,
    varying_coefficients, view,
};
use crate::engine::dictionary::CoefficientForm;
use crate::engine::product_cache::ProductCache;
use crate::engine::stepwise::{TermSearch, TermSelection, without_term};
use crate::engine::validation::{self, RankedTerm};

/// RMS distance of a uniformly distributed value from one end of its interval, as a share of the interval: 1/√3.
const UNIFORM_RMS: f64 = 0.577_350_269_189_625_8;

pub(super) fn finish(
    case: &Case,
    stated: &StatedModel<'_>,
    (always, weighed): (&[usize], &[AssessedEffect]),
    zones: Vec<Zone>,
) -> Diagnosis {
    let arm = &stated.model.arm;
    let (fitted_rows, held) = (case.row_sets.fitted(), &case.row_sets.test);
    let products = case.products(&fitted_rows);
    let search = nonlinear_parameters::search(case, &products, always);
    let given = search.solve(&[]);
    let (weighed, refuted) = &final_checks::passing_effects(case, &search, weighed, &fitted_rows);
    let names: Vec<usize> = weighed.iter().map(|one| one.candidate).collect();
    let (mut fitted, names) = with_significant_size(case, stated, &search, names);
    fitted.with_zone_rows = fit_with_zone_rows(case, always, &names, &zones, &fitted_rows);
    let selection = &fitted.selection;
    let listed =
        validation::attributed(&search, selection, &|solved| fit_quality::rms(case, solved, held));
    let outside = match zones.is_empty() {
        true => Vec::new(),
        false => helpful_outside_zones_only(case, &search, selection, held),
    };
    let finding = |one: &RankedTerm| {
        let family = &case.library.terms[one.name];
        let own = search.own_columns(selection, one.name);
        let weighed = weighed.iter().find(|weighed| weighed.candidate == one.name);
        Finding {
            kind: family.kind,
            joint: family.joint,
            recording: family.recording,
            is_change: stated.states_correctable(family.kind, family.joint),
            parameters: fitted.parameters(case, stated, one.name),
            confidence: weighed.map_or(0.0, |one| one.confidence),
            gain: weighed.map_or(0.0, |one| one.gain),
            alternatives: weighed.map_or(Vec::new(), |one| one.alternatives.clone()),
            heldout: one.heldout,
            heldout_without: one.heldout_without,
            size: validation::size_of(&case.table, &case.library.columns, &selection.solved, &own),
        }
    };
    let findings: Vec<Finding> = listed.iter().map(finding).collect();
    let beyond = varying_coefficients::best_law(case, always, &names);
    let findings = or_stationary(case, stated, always, (findings, beyond.is_some()));
    let verdict = verdict(case, &findings, (&given, selection), beyond.as_ref());
    let joints: Vec<usize> = case.table.joints().collect();
    let by_joint: Vec<JointValidation> =
        joints.iter().map(|j| joint_validation(case, (&given, selection), *j)).collect();
    let notes = notes(arm, case, always, &zones, &findings, (refuted, &outside));
    let (findings, candidates) =
        claimed(verdict, findings, &VerdictSettings::DRIVE_OR_CUT, |one| one.confidence);
    Diagnosis {
        verdict,
        notes,
        findings,
        candidates,
        refits: refits(case, stated, selection, &fitted.covariance),
        unexplained: beyond.map(|beyond| beyond.law),
        heldout: [&given, selection].map(|one| fit_quality::rms(case, &one.solved, held)),
        noise: fit_quality::rms(case, &selection.solved, &fitted_rows),
        signal: signal(&by_joint),
        by_joint,
        band_hz: case.motion.band_hz,
        rows: case.table.rows(),
        heldout_description: case.row_sets.description.clone(),
        not_tested: case.library.untested.clone(),
        all_prismatic: arm.joints().iter().all(|joint| joint.kind == JointKind::Prismatic),
        traces: joints.iter().map(|j| view::trace(case, (&given, selection), *j)).collect(),
        zones,
    }
}

/// An alternative this far behind in log-likelihood is listed, but does not make the verdict ambiguous. If two hypotheses differ by 5 in expectation
/// (standard deviation √10), the observed difference is below 3 in one case of four; if they are equivalent, it seldom reaches 3.
const AMBIGUOUS_LOSS_MOST: f64 = 3.0;

/// The verdict. A smooth law that replaces selected effects refutes them, so the explained share is then zero.
fn verdict(
    case: &Case,
    findings: &[Finding],
    (given, selection): (&TermSelection, &TermSelection),
    rest: Option<&SmoothLaw>,
) -> Verdict {
    let held = &case.row_sets.test;
    let energy =
        |selection: &TermSelection| fit_quality::rms(case, &selection.solved, held).powi(2);
    let joints = case.table.joints().count().max(1) as f64;
    let scale = case.table.joints().map(|j| case.table.noise[j].1.ln()).sum::<f64>() / joints;
    let count = held.iter().filter(|held| **held).count() as f64 * joints;
    let (before, after) = (energy(given), energy(selection));
    let explained = rest.map(|SmoothLaw { law, replaced, .. }| {
        let noise = case.table.noise[law.joint].1;
        let left =
            (law.heldout_squares[0] - law.heldout_squares[1]) / (noise * noise * count.max(1.0));
        let left = left * libm::exp(2.0 * scale);
        let stand = replaced.is_empty();
        if stand { (before - after) / (before - after + left).max(1e-300) } else { 0.0 }
    });
    // Among effects that explain the same, the one with the fewest parameters is preferred (docs/reference/effects.md), claimed or not: a payload on
    // a single slide is its mass.
    let takes_more = |one: &Finding, rival: &AlternativeEffect| {
        let own_count: usize = one.parameters.iter().map(|number| number.values.len()).sum();
        let others = case.library.terms.get(rival.candidate).map_or(0, CandidateTerm::count);
        rival.extra_parameters > 0.0 || others > own_count
    };
    let is_alike = |one: &Finding| {
        let mut rivals = one.alternatives.iter();
        rivals.any(|r| {
            r.likelihood_loss < AMBIGUOUS_LOSS_MOST && r.kind != one.kind && !takes_more(one, r)
        })
    };
    let weight = |one: &Finding| FindingEvidence { gain: one.gain, is_ambiguous: is_alike(one) };
    let weights: Vec<FindingEvidence> = findings.iter().map(weight).collect();
    decide_verdict(&weights, explained, &VerdictSettings::DRIVE_OR_CUT)
}

/// A fit of selected effects with all contributions to the uncertainty of their parameters.
pub(super) struct FitWithUncertainty {
    selection: TermSelection,
    covariance: DMatrix<f64>,
    /// Relative standard uncertainty of the searched parameter, per effect.
    searched_sigmas: Vec<(usize, f64)>,
    /// The same effects fitted with the rows of zones included.
    with_zone_rows: Option<TermSelection>,
    /// Change of each hysteresis parameter under the alternative law, per column.
    hysteresis_changes: Vec<(usize, f64)>,
}

impl FitWithUncertainty {
    /// The fit without the rows of zones.
    fn of(case: &Case, stated: &StatedModel<'_>, search: &TermSearch<'_>, names: &[usize]) -> Self {
        let fitted_rows = case.row_sets.fitted();
        let selection = search.solve(names);
        let viscous = |joint| viscous(case, stated, &selection, joint);
        let (covariance, searched_sigmas) =
            fit_quality::covariance_with_searched(case, &selection, &fitted_rows, &viscous);
        let hysteresis_changes =
            nonlinear_parameters::changes_under_maxwell_slip(case, &selection, &fitted_rows);
        Self { selection, covariance, searched_sigmas, with_zone_rows: None, hysteresis_changes }
    }

    fn parameters(
        &self,
        case: &Case,
        stated: &StatedModel<'_>,
        name: usize,
    ) -> Vec<parameters::FittedParameter> {
        let (selection, family) = (&self.selection, &case.library.terms[name]);
        let share = |shares: &[(usize, f64)], key: usize| {
            shares.iter().find(|(other, _)| *other == key).map_or(0.0, |one| one.1)
        };
        let moved = |column: usize| {
            let form = share(&self.hysteresis_changes, column);
            zone_sigma(self.with_zone_rows.as_ref(), selection, column).hypot(UNIFORM_RMS * form)
        };
        let context = parameters::ParameterContext {
            covariance: &self.covariance,
            searched_sigma: share(&self.searched_sigmas, name),
            systematic_sigma: &moved,
            is_torque_from_current: case.motion.is_torque_from_current,
            gain: gain(case, selection, family.joint),
            viscous: family.joint.map_or(0.0, |joint| viscous(case, stated, selection, joint)),
        };
        parameters::parameters_of(family, &selection.solved, &context)
    }
}

/// Drops effects whose magnitude is not significant, the least significant first, refitting each time. The uncertainty includes searched parameters
/// and the form of a law, but not the influence of excluded rows.
pub(super) fn with_significant_size(
    case: &Case,
    stated: &StatedModel<'_>,
    search: &TermSearch<'_>,
    mut names: Vec<usize>,
) -> (FitWithUncertainty, Vec<usize>) {
    loop {
        let fitted = FitWithUncertainty::of(case, stated, search, &names);
        let has_size = |name: &&usize| match case.library.terms[**name].form {
            CoefficientForm::Plain(stems) => stems.len() == 1,
            CoefficientForm::Loop | CoefficientForm::Warmth | CoefficientForm::Wave => true,
            CoefficientForm::Spring | CoefficientForm::Moment | CoefficientForm::Payload { .. } => {
                false
            }
        };
        let sure = |name: &usize| {
            let numbers = fitted.parameters(case, stated, *name);
            let size = numbers.first().map(|one| (one.values[0] / one.sigma[0]).abs());
            (*name, size.unwrap_or(0.0))
        };
        let uncertain = names.iter().filter(has_size).map(sure);
        match uncertain.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((name, sure)) if sure < validation::SIGNIFICANCE_SIGMAS => {
                names = search.admissible(without_term(&names, name));
            }
            _ => return (fitted, names),
        }
    }
}

/// Effects whose removal would reduce the error on all test rows, those of zones included.
fn helpful_outside_zones_only(
    case: &Case,
    search: &TermSearch<'_>,
    selection: &TermSelection,
    held: &[bool],
) -> Vec<usize> {
    let whole = fit_quality::rms(case, &selection.solved, held);
    let without = |name: &usize| search.solve(&without_term(&selection.terms, *name)).solved;
    let harms = |name: &usize| fit_quality::rms(case, &without(name), held) < whole;
    selection.terms.iter().copied().filter(harms).collect()
}

/// The findings; if there are none and no smooth law either, the constant torques of joints that never move.
fn or_stationary(
    case: &Case,
    stated: &StatedModel<'_>,
    always: &[usize],
    (findings, is_law): (Vec<Finding>, bool),
) -> Vec<Finding> {
    if findings.is_empty() && !is_law {
        stationary_joints::findings(case, stated, always)
    } else {
        findings
    }
}

/// The parameters stated with an uncertainty, as refitted.
fn refits(
    case: &Case,
    stated: &StatedModel<'_>,
    selection: &TermSelection,
    covariance: &DMatrix<f64>,
) -> Vec<RefittedParameter> {
    let solved = &selection.solved;
    let one = |(column, parameter, _): &(usize, (usize, usize), _)| {
        let index = solved.columns.iter().position(|k| k == column)?;
        stated.refit(*parameter, solved.values[index], covariance[(index, index)].sqrt())
    };
    case.uncertain_parameters.iter().filter_map(one).collect()
}

/// Standard uncertainty of a column's parameter by excluded rows: its true value is taken as uniform between the fits without and with the rows of
/// zones.
fn zone_sigma(unzoned: Option<&TermSelection>, selection: &TermSelection, column: usize) -> f64 {
    let with = unzoned.and_then(|other| other.solved.value(column));
    let apart =
        with.zip(selection.solved.value(column)).map_or(0.0, |(with, without)| with - without);
    UNIFORM_RMS * apart
}

/// Viscous friction of a joint, stated plus found.
fn viscous(case: &Case, stated: &StatedModel<'_>, selection: &TermSelection, joint: usize) -> f64 {
    stated.first_value("viscous_friction", joint)
        + nonlinear_parameters::found_viscous(case, &selection.terms, &selection.solved, joint)
}

/// Fitted relative gain of a joint's drive.
fn gain(case: &Case, selection: &TermSelection, joint: Option<usize>) -> f64 {
    let families = selection.terms.iter().map(|name| &case.library.terms[*name]);
    let mut gains = families.filter(|f| f.kind == "drive_gain" && f.joint == joint);
    gains.next().and_then(|f| selection.solved.value(f.columns[0])).unwrap_or(0.0)
}

/// Notes on the processing of the data, for users.
fn notes(
    arm: &Arm,
    case: &Case,
    always: &[usize],
    zones: &[Zone],
    findings: &[Finding],
    (refuted, outside): (&[usize], &[usize]),
) -> Vec<String> {
    let mut notes = case.motion.notes.clone();
    let at_rest = |joint: usize| {
        let moves = &case.table.moves[joint];
        let still = moves.iter().filter(|moves| !**moves).count();
        100.0 * still as f64 / moves.len().max(1) as f64
    };
    let most = case.table.joints().map(at_rest).fold(0.0, f64::max);
    if most > 0.0 {
        notes.push(format!(
            "a joint at rest is held by static friction of unknown size: rows at rest are excluded, up to {most:.1} % of a joint's rows"
        ));
    }
    notes.extend(refuted.iter().map(|name| {
        let family = &case.library.terms[*name];
        let suffix = joint_suffix(family.joint);
        format!(
            "`{}`{suffix} was selected but increases the error on held-out rows: it is not reported",
            family.kind
        )
    }));
    notes.extend(zones.iter().map(|zone| zone.note(arm)));
    notes.extend(outside.iter().map(|name| {
        let family = &case.library.terms[*name];
        let suffix = joint_suffix(family.joint);
        format!("`{}`{suffix} reduces the error only outside the low-speed zones", family.kind)
    }));
    if always.len() > case.always_fitted.len() {
        notes.push("the stated masses do not match the torques exactly: they were estimated too, within 5 % and 20 mm".to_owned());
    } else if !case.always_fitted.is_empty() {
        notes.push("masses that the model does not state, and parameters with a stated uncertainty, were estimated too".to_owned());
    }
    if case.motion.is_torque_from_current && findings.iter().any(|one| one.kind == "payload") {
        notes.push("a mass is as uncertain as the motor constants, about 10 %: weigh the payload, or run once with a known mass".to_owned());
    }
    notes
}

fn joint_suffix(joint: Option<usize>) -> String {
    joint.map_or(String::new(), |joint| format!(" of joint {}", joint + 1))
}

/// The fit with the rows of zones included; its difference to the main fit contributes to the uncertainty.
fn fit_with_zone_rows(
    case: &Case,
    always: &[usize],
    names: &[usize],
    zones: &[Zone],
    fitted_rows: &[bool],
) -> Option<TermSelection> {
    if zones.is_empty() {
        return None;
    }
    let mut table = case.table.clone();
    table.counts.clone_from(&table.moves);
    // Reuses the buffer of the case's sums to save memory; they are recomputed when next needed.
    let sums = ProductCache::updated(case.sums.take(), &table, &case.library.columns, fitted_rows);
    let products = sums.products(case.library.prior.clone());
    case.sums.replace(Some(sums));
    Some(TermSearch { library: &case.library, products: &products, always }.solve(names))
}

fn joint_validation(
    case: &Case,
    (given, selection): (&TermSelection, &TermSelection),
    joint: usize,
) -> JointValidation {
    let held_and = |rows: &[bool]| -> Vec<bool> {
        case.row_sets.test.iter().zip(rows).map(|(held, counts)| *held && *counts).collect()
    };
    let held = &held_and(&case.table.moves[joint]);
    let outside = held_and(&case.table.counts[joint]);
    JointValidation {
        joint,
        torque: view::torque_rms(case, joint, held),
        before: fit_quality::joint_rms(case, &given.solved, joint, held),
        after: fit_quality::joint_rms(case, &selection.solved, joint, held),
        after_outside: fit_quality::joint_rms(case, &selection.solved, joint, &outside),
        noise: case.table.noise[joint].1,
    }
}

/// RMS torque over all joints.
fn signal(joints: &[JointValidation]) -> f64 {
    let sum: f64 = joints.iter().map(|joint| joint.torque * joint.torque).sum();
    libm::sqrt(sum / joints.len().max(1) as f64)
}
