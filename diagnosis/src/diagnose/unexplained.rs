//! Structure that no effect of the dictionary explains: whether there is any above the noise, and on which covariates it depends.
//!
//! The error of each joint is modelled as a smooth function (Chebyshev polynomials) of each covariate, and of pairs of covariates that are physically
//! related; the function with the best criterion is reported (an additive model with few terms, Hastie and Tibshirani 1990). The size of each
//! selected effect is also modelled as a function of a covariate (a varying-coefficient model, Hastie and Tibshirani 1993): if it varies, the
//! selected effect is not the cause.
//!
//! Not every structure is the robot's: the instrument or the robot's base may move during the recording, or the measured points on the tool. Both are
//! tried as motions over time (six or three coordinates, each a polynomial of time).
//!
//! The criterion includes penalties for the coefficients and for the number of functions tried.

use super::covariates::{Covariate, all_covariates};
use super::local_errors;
use super::modulated_motion::{DEGREE, ModulatedMotion};
use super::residual_map::displacements;
use super::selection::{EffectSelection, Search, SelectedEffect, hypothesis_without};
use super::terms::{count, pairs, singles, terms};
use super::validation::{FitEvaluator, RESIDUAL_SIGMAS_MAX, validation_margin};
use super::{JointSection, StructureLocation, Unexplained};
use crate::campaign::Campaign;
use crate::fit::{FitSettings, refit_with_fixed_weights};
use crate::fit_result::Fit;
use crate::robust_weights::Influence;
use crate::score_test::{ColumnGroups, ScoreTest};
use crate::simd::dot;
use crate::tool_motion::ToolMotion;
use physics::spec::Need;
use physics::{AnyEffect, Arm, Inputs};

/// Degrees of the polynomials of a motion over time: a steady drift, and any slow motion.
const DEGREES_OVER_TIME: [usize; 2] = [1, DEGREE];
/// Relative margin by which the improvement of a smooth function has to exceed that of the selected effects that it replaces: their equations are
/// simplified, too.
const REPLACEMENT_MARGIN: f64 = 0.02;
/// The same before the selection is complete, for selections of at least [`IMITATING_EFFECTS_MIN`] effects.
const EARLY_REPLACEMENT_MARGIN: f64 = 0.1;
/// Least number of selected effects that together may imitate an error of another kind.
pub(super) const IMITATING_EFFECTS_MIN: usize = 4;
/// Share of the total gain below which a selected effect is a minor one.
const MAJOR_GAIN_SHARE: f64 = 0.1;
/// Improvement of a smooth function, in the sum of squares, from which it is far above the noise: needed where the AR noise model is uncertain, before the
/// selection is complete and with noise as slow as the motion.
const CERTAIN_IMPROVEMENT_MIN: f64 = 200.0;

/// A smooth function that models the error of a joint, the size of an effect selected there, or a motion of the measuring frame or of the measured points.
#[derive(Clone, Debug)]
pub(super) struct SmoothFunction {
    /// What it models.
    pub(super) location: StructureLocation,
    carrier: ModulatedMotion,
    /// Indices of its covariates: one or two; none of local errors.
    covariates: Vec<usize>,
    /// Coefficients of the terms of each motion: rad or m, relative for the size of a selected effect.
    coefficients: Vec<f64>,
    /// Reduction of the sum of squares less the penalty; a function above zero is significant.
    pub(super) improvement: f64,
    /// Whether effects were removed in favour of it.
    pub(super) replaces_effects: bool,
}

/// The function with the best criterion beside the selected effects, if the validation set supports it.
fn supported_function(
    search: &Search<'_>,
    selection: &EffectSelection,
    covariates: &[Covariate],
    kept: &[bool],
) -> Option<SmoothFunction> {
    let fitted = ScoreTest::new(search.campaign, &selection.fit, &search.settings);
    let best = best_varying_size(
        &fitted,
        covariates,
        search,
        selection,
        best_function(&fitted, covariates),
    );
    if_supported(&fitted, covariates, kept, best.filter(|law| law.improvement > 0.0)?)
}

/// The function if the validation set supports it, or if there is no validation set.
fn if_supported(
    fitted: &ScoreTest<'_>,
    covariates: &[Covariate],
    kept: &[bool],
    law: SmoothFunction,
) -> Option<SmoothFunction> {
    if !kept.contains(&true) {
        return Some(law);
    }
    let sums = law.sums_of_squares(fitted, covariates, kept);
    law.is_supported(fitted.fit.design_effect, sums).then_some(law)
}

/// The selection, or the few effects that a smooth function replaces most of it with; and the function that describes what remains, if the validation
/// set supports it.
pub(super) fn with_structure(
    search: &Search<'_>,
    selection: EffectSelection,
    covariates: &[Covariate],
    validation: &[bool],
) -> (EffectSelection, Option<SmoothFunction>) {
    match instead_of_effects(search, &selection, covariates, validation) {
        Some((few, law)) => (few, Some(law)),
        None => {
            let law = supported_function(search, &selection, covariates, validation);
            (selection, law)
        }
    }
}

/// A smooth function that improves the criterion more than all selected effects do, or more than the minor ones do beside the others. In the first
/// case the major effects alone must not be better either. Returns the remaining selection with the function: the effects that it replaces only
/// imitated it together.
fn instead_of_effects(
    search: &Search<'_>,
    selection: &EffectSelection,
    covariates: &[Covariate],
    kept: &[bool],
) -> Option<(EffectSelection, SmoothFunction)> {
    replacement(search, selection, covariates, kept, REPLACEMENT_MARGIN)
}

/// The same after the preselection, for many effects far behind the smooth function: further selection would take long and not catch up. Needs a
/// validation set: on few rows a function of many coefficients is ahead of effects whose selection is not complete.
pub(super) fn early_replacement(
    search: &Search<'_>,
    selection: &EffectSelection,
    covariates: &[Covariate],
    kept: &[bool],
) -> Option<(EffectSelection, SmoothFunction)> {
    let are_many = selection.selected.len() >= IMITATING_EFFECTS_MIN && kept.contains(&true);
    let (few, law) = are_many
        .then(|| replacement(search, selection, covariates, kept, EARLY_REPLACEMENT_MARGIN))??;
    law.replaces_certain_effects().then_some((few, law))
}

/// The smooth function that exceeds all selected effects by the relative margin `share`, or, if the minor effects are many, exceeds these beside the
/// others.
fn replacement(
    search: &Search<'_>,
    selection: &EffectSelection,
    covariates: &[Covariate],
    kept: &[bool],
    share: f64,
) -> Option<(EffectSelection, SmoothFunction)> {
    let all: f64 = selection.selected.iter().map(|one| one.gain).sum();
    let is_major = |one: &&SelectedEffect| one.gain >= MAJOR_GAIN_SHARE * all;
    let (few, minor): (Vec<&SelectedEffect>, Vec<&SelectedEffect>) =
        selection.selected.iter().partition(is_major);
    let every: Vec<&SelectedEffect> = selection.selected.iter().collect();
    replacement_of(search, selection, [&every, &few], share, (covariates, kept)).or_else(|| {
        let are_patches = minor.len() >= IMITATING_EFFECTS_MIN && minor.len() < every.len();
        are_patches.then(|| {
            replacement_of(search, selection, [&minor, &minor], share, (covariates, kept))
        })?
    })
}

/// The smooth function that exceeds the effects `replaced`, and the effects `few` among them alone, beside the remaining ones.
fn replacement_of(
    search: &Search<'_>,
    selection: &EffectSelection,
    [replaced, few]: [&[&SelectedEffect]; 2],
    share: f64,
    (covariates, kept): (&[Covariate], &[bool]),
) -> Option<(EffectSelection, SmoothFunction)> {
    if replaced.is_empty() {
        return None;
    }
    let Search { campaign, known, settings, dictionary, .. } = search;
    let beside = |replaced: &[&SelectedEffect]| {
        let left = hypothesis_without(&selection.fit, &known.model, replaced);
        refit_with_fixed_weights(campaign, &left, &selection.fit, settings.used)
    };
    // The design effect of the full selection holds for all: without the effects, the values of a pose appear correlated.
    let mut without = beside(replaced);
    without.design_effect = selection.fit.design_effect;
    let fitted = ScoreTest::new(campaign, &without, settings);
    let worth = |sum: f64, names: &[&SelectedEffect]| {
        let choice = names.len() as f64 * penalty(&fitted, 0, dictionary.len());
        (without.sum_of_squares - sum) / without.design_effect
            - penalty(&fitted, parameter_count(names), 1)
            - choice
    };
    let mut rival = (worth(selection.fit.sum_of_squares, replaced), parameter_count(replaced));
    if few.len() < replaced.len() {
        let is_few = |one: &&SelectedEffect| few.iter().any(|few| std::ptr::eq(*few, *one));
        let others: Vec<&SelectedEffect> =
            replaced.iter().copied().filter(|one| !is_few(one)).collect();
        let alone = worth(beside(&others).sum_of_squares, few);
        if alone > rival.0 {
            rival = (alone, parameter_count(few));
        }
    }
    let few = selection.without_effects(replaced, without.clone());
    let best =
        best_varying_size(&fitted, covariates, search, &few, best_function(&fitted, covariates));
    let law = if_supported(&fitted, covariates, kept, best.filter(|law| law.improvement > 0.0)?)?;
    if kept.contains(&true) {
        // On the validation set the function must leave a smaller residual than the effects that it replaces.
        let named = ScoreTest::new(campaign, &selection.fit, settings);
        if law.sums_of_squares(&fitted, covariates, kept)[1]
            >= law.sums_of_squares(&named, covariates, kept)[0]
        {
            return None;
        }
    }
    let law = SmoothFunction { replaces_effects: true, ..law };
    // A function of half as many parameters that describes as much needs no margin.
    let share = if 2 * law.parameter_count() <= rival.1 { 0.0 } else { share };
    (law.improvement > (1.0 + share) * rival.0).then_some((few, law))
}

/// Number of parameters of some selected effects.
fn parameter_count(effects: &[&SelectedEffect]) -> usize {
    effects.iter().map(|one| one.parameter_count).sum()
}

/// The function with the best criterion; `None` if none is significant.
pub(super) fn best_function(
    fitted: &ScoreTest<'_>,
    covariates: &[Covariate],
) -> Option<SmoothFunction> {
    let mut best = best_over_joints(fitted, covariates, |joint| singles(covariates, joint), None);
    best = best_over_joints(fitted, covariates, |joint| pairs(covariates, joint), best);
    // The covariate of the best function may interact with any other covariate.
    if let Some(one) = best.clone() {
        let with = |joint: usize| {
            let is_there = StructureLocation::Joint(joint) == one.location;
            let all = (0..covariates.len()).filter(|_| is_there);
            all.filter(|w| !one.covariates.contains(w))
                .map(|w| vec![one.covariates[0], w])
                .collect()
        };
        best = best_over_joints(fitted, covariates, with, best);
    }
    best = best_motion_over_time(fitted, covariates, best);
    best = best_local_errors(fitted, covariates, best);
    best.filter(|law| law.improvement > 0.0)
}

/// Whether the measuring frame or the measured point moves during the recordings, by the residuals of a fit to the poses `used`; `None` also where a joint's
/// error over time describes them as well.
#[must_use]
pub fn motion_over_time(
    campaign: &Campaign,
    fit: &Fit,
    used: &[bool],
) -> Option<StructureLocation> {
    let settings = FitSettings::full(used, Influence::Redescending);
    let covariates = all_covariates(campaign, &fit.hypothesis.model);
    let fitted = ScoreTest::new(campaign, fit, &settings);
    let law = best_function(&fitted, &covariates)?;
    Some(law.location).filter(|location| !matches!(location, StructureLocation::Joint(_)))
}

/// The best motion over time of the measuring frame or of the measured points on the tool, or `before` if that is better.
fn best_motion_over_time(
    fitted: &ScoreTest<'_>,
    covariates: &[Covariate],
    before: Option<SmoothFunction>,
) -> Option<SmoothFunction> {
    let Some(time) = covariates.iter().position(|one| one.name == "t_s") else { return before };
    let motions: Vec<(StructureLocation, ModulatedMotion)> = DEGREES_OVER_TIME
        .into_iter()
        .flat_map(|degree| {
            [
                (StructureLocation::MeasuringFrame, ModulatedMotion::FrameShift(degree)),
                (StructureLocation::MeasuringFrame, ModulatedMotion::FrameMotion(degree)),
                (StructureLocation::MeasuredPoint, ModulatedMotion::ToolShift(degree)),
            ]
        })
        .collect();
    let tried = motions.len();
    motions.iter().fold(before, |best, (location, carrier)| {
        best_in_groups(fitted, covariates, (*location, carrier), (&[vec![time]], tried), best)
    })
}

/// The best sum of local errors of a joint, or `before` if that is better.
fn best_local_errors(
    fitted: &ScoreTest<'_>,
    covariates: &[Covariate],
    before: Option<SmoothFunction>,
) -> Option<SmoothFunction> {
    let Some(found) = local_errors::best(fitted, |tried, count| {
        penalty(fitted, count, 1) + count as f64 * penalty(fitted, 0, tried)
    }) else {
        return before;
    };
    let name = format!("q{}", found.joint + 1);
    let Some(position) = covariates.iter().position(|one| one.name == name) else { return before };
    if before.as_ref().is_some_and(|best| best.improvement >= found.improvement) {
        return before;
    }
    Some(SmoothFunction {
        location: StructureLocation::Joint(found.joint),
        carrier: ModulatedMotion::LocalErrors(found.bumps.into(), position),
        covariates: Vec::new(),
        coefficients: found.heights,
        improvement: found.improvement,
        replaces_effects: false,
    })
}

/// The best function of `groups` of covariates (per joint), or `before` if that is better.
fn best_over_joints(
    fitted: &ScoreTest<'_>,
    covariates: &[Covariate],
    groups: impl Fn(usize) -> Vec<Vec<usize>>,
    before: Option<SmoothFunction>,
) -> Option<SmoothFunction> {
    let joints = fitted.state.hypothesis.model.arm.count();
    let groups: Vec<Vec<Vec<usize>>> = (0..joints).map(groups).collect();
    let tried = groups.iter().map(Vec::len).sum();
    groups.iter().enumerate().fold(before, |best, (joint, groups)| {
        best_in_groups(
            fitted,
            covariates,
            (StructureLocation::Joint(joint), &ModulatedMotion::JointError),
            (groups, tried),
            best,
        )
    })
}

/// The best function by which the size of a selected effect varies, or `before` if that is better.
fn best_varying_size(
    fitted: &ScoreTest<'_>,
    covariates: &[Covariate],
    search: &Search<'_>,
    selection: &EffectSelection,
    before: Option<SmoothFunction>,
) -> Option<SmoothFunction> {
    let whole = &selection.fit.hypothesis.model;
    let tried = selection.selected.len() * covariates.len();
    selection.selected.iter().fold(before, |best, one| {
        let effect = whole.effects().nth(one.effect);
        let Some((effect, joint)) = effect.and_then(|e| Some((e, e.joint()?))) else { return best };
        let without = hypothesis_without(&selection.fit, &search.known.model, &[one]).model;
        let own_index = own_covariate(effect, joint, covariates);
        let groups: Vec<Vec<usize>> =
            (0..covariates.len()).filter(|w| Some(*w) != own_index).map(|w| vec![w]).collect();
        let carrier = ModulatedMotion::EffectSize(
            displacements(search.campaign, &without, whole).into(),
            own_index,
        );
        let location = StructureLocation::Joint(joint);
        best_in_groups(fitted, covariates, (location, &carrier), (&groups, tried), best)
    })
}

/// The best function of `groups` of covariates that multiplies `carrier`, or `before` if that is better.
fn best_in_groups(
    fitted: &ScoreTest<'_>,
    covariates: &[Covariate],
    (location, carrier): (StructureLocation, &ModulatedMotion),
    (groups, tried): (&[Vec<usize>], usize),
    before: Option<SmoothFunction>,
) -> Option<SmoothFunction> {
    let arm = &fitted.state.hypothesis.model.arm;
    let terms_in = |group: &Vec<usize>| count(covariates, group, carrier.degree());
    let column_counts: Vec<usize> =
        groups.iter().map(|group| carrier.unit_count() * terms_in(group)).collect();
    let column_groups = ColumnGroups {
        sigmas: vec![carrier.coefficient_sigma(); column_counts.iter().sum()],
        column_counts,
    };
    let units = |pose: usize, into: &mut Vec<ToolMotion>| {
        let inputs = &fitted.campaign.poses[pose].inputs;
        carrier.units(arm, location, inputs, pose, |unit| into.push(unit));
    };
    let scores = fitted.scores_of_multiples(&column_groups, units, |pose, into| {
        groups.iter().for_each(|group| {
            terms(covariates, group, (pose, carrier.degree()), |term| into.push(term));
        });
    });
    let mut best = before;
    for score in scores {
        let improvement =
            score.gain / fitted.fit.design_effect - penalty(fitted, score.parameter_count, tried);
        if best.as_ref().is_none_or(|best| improvement > best.improvement) {
            let (carrier, covariates) = (carrier.clone(), groups[score.candidate].clone());
            best = Some(SmoothFunction {
                location,
                carrier,
                covariates,
                coefficients: score.values,
                improvement,
                replaces_effects: false,
            });
        }
    }
    best
}

/// Index of the covariate that an effect depends on by its equation.
fn own_covariate(effect: &AnyEffect, joint: usize, covariates: &[Covariate]) -> Option<usize> {
    let needs = |need: Need| effect.spec().needs.contains(&need);
    let n = joint + 1;
    let name = match effect {
        AnyEffect::OverPath(_) => format!("v{n}"),
        _ if needs(Need::Direction) => format!("direction_{n}"),
        _ if needs(Need::Temperature) => format!("temp{n}_C"),
        _ if needs(Need::Time) => "t_s".to_owned(),
        _ if needs(Need::Masses) => format!("tau{n}"),
        _ if needs(Need::Wrench) => "wrench".to_owned(),
        _ => format!("q{n}"),
    };
    covariates.iter().position(|covariate| covariate.name == name)
}

/// Penalty in the sum of squares: of `numbers` coefficients, and of the choice among `tried` functions.
fn penalty(fitted: &ScoreTest<'_>, numbers: usize, tried: usize) -> f64 {
    let readings = fitted.fit.readings as f64 / fitted.fit.design_effect;
    numbers as f64 * readings.max(2.0).ln() + 2.0 * (tried.max(1) as f64).ln()
}

impl SmoothFunction {
    /// Number of its parameters; of a local error its height, position and width.
    fn parameter_count(&self) -> usize {
        let is_local = matches!(self.carrier, ModulatedMotion::LocalErrors(..));
        self.coefficients.len() * if is_local { 3 } else { 1 }
    }

    /// Names of the covariates that it depends on (docs/reference/results.md), each once.
    pub(super) fn covariate_names(&self, covariates: &[Covariate]) -> Vec<String> {
        let own_index = match &self.carrier {
            ModulatedMotion::EffectSize(_, own_index) => *own_index,
            ModulatedMotion::LocalErrors(_, position) => Some(*position),
            _ => None,
        };
        let all = own_index.iter().chain(&self.covariates);
        let mut names: Vec<String> = all.map(|index| covariates[*index].name.clone()).collect();
        names.dedup();
        names
    }

    /// The section of the joint's range that has local errors, if it consists of these.
    fn section(&self, arm: &Arm) -> Option<JointSection> {
        let (StructureLocation::Joint(joint), ModulatedMotion::LocalErrors(bumps, _)) =
            (self.location, &self.carrier)
        else {
            return None;
        };
        let (limits, largest) = local_errors::extent(bumps, &self.coefficients);
        Some(JointSection { limits, largest, kind: arm.joints()[joint].kind })
    }

    /// Whether rows outside the fit support it: the gain in log-likelihood there, from their sums of squares without it and with it, must be what selection
    /// and validation together require.
    pub(super) fn is_supported(&self, design_effect: f64, [without, with]: [f64; 2]) -> bool {
        let gain = 0.5 * (without - with) / design_effect;
        validation_margin(0.5 * self.improvement, gain) > 0.0
    }

    /// Whether it is far above the noise, also of an uncertain noise model ([`CERTAIN_IMPROVEMENT_MIN`]).
    pub(super) fn is_far_above_noise(&self) -> bool {
        self.improvement > CERTAIN_IMPROVEMENT_MIN
    }

    /// Whether effects far above the noise were removed in favour of it.
    pub(super) fn replaces_certain_effects(&self) -> bool {
        self.replaces_effects && self.is_far_above_noise()
    }

    /// The function as structure that the test set of `held` confirms: it must reduce the error there, by as much as is required of the validation set.
    /// `error`: the RMS error on the test set without it, m or rad.
    pub(super) fn confirmed(
        &self,
        fitted: &ScoreTest<'_>,
        covariates: &[Covariate],
        held: &FitEvaluator<'_>,
        error: f64,
    ) -> Option<Unexplained> {
        let [without, with] = self.sums_of_squares(fitted, covariates, held.evaluated());
        let is_supported = self.is_supported(fitted.fit.design_effect, [without, with]);
        (is_supported && with < without).then(|| Unexplained {
            depends_on: self.covariate_names(covariates),
            location: self.location,
            section: self.section(&fitted.state.hypothesis.model.arm),
            heldout: [error, error * self.remaining_share(fitted, covariates, held)],
        })
    }

    /// Its tool displacement, pose by pose, for [`ScoreTest::rows`].
    fn motions<'a>(
        &'a self,
        fitted: &'a ScoreTest<'_>,
        covariates: &'a [Covariate],
    ) -> impl Fn(usize, &mut Vec<ToolMotion>) + Copy + 'a {
        let (arm, poses) = (&fitted.state.hypothesis.model.arm, &fitted.campaign.poses);
        move |pose, into| *into = vec![self.motion(arm, &poses[pose].inputs, covariates, pose)]
    }

    /// Response of the fitted parameters to it, as on the training rows.
    fn response(&self, fitted: &ScoreTest<'_>, covariates: &[Covariate]) -> Vec<f64> {
        let mut pull = vec![0.0; fitted.fit.columns().len()];
        fitted.rows(1, self.motions(fitted, covariates), |row, law, _| {
            pull.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * law[0]);
        });
        let triangle = &fitted.fit.triangle;
        triangle.back(triangle.forward(pull))
    }

    /// RMS error on the counted measurements of the test set with it, as a share of that without it, in units of the noise of each measurement.
    fn remaining_share(
        &self,
        fitted: &ScoreTest<'_>,
        covariates: &[Covariate],
        held: &FitEvaluator<'_>,
    ) -> f64 {
        let response = self.response(fitted, covariates);
        let on_held_poses = fitted.on_poses(held.evaluated());
        let (columns, width) = (fitted.fit.columns(), fitted.state.width());
        let (arm, poses) = (&fitted.state.hypothesis.model.arm, &fitted.campaign.poses);
        let mut sums = [0.0; 2];
        on_held_poses.linearisation.for_each_reading(|reading, slopes| {
            if !held.counts(reading.reading) {
                return;
            }
            let motion = self.motion(arm, &poses[reading.pose].inputs, covariates, reading.pose);
            let along = reading.rows.derivative_along(&motion);
            for part in 0..reading.rows.count {
                let slopes = &slopes[part * width..];
                let follows: f64 = columns.iter().zip(&response).map(|(k, x)| slopes[*k] * x).sum();
                let left = reading.rows.residual[part];
                sums[0] += left.powi(2);
                sums[1] += (left - along[part] + follows).powi(2);
            }
        });
        (sums[1] / sums[0].max(f64::MIN_POSITIVE)).sqrt()
    }

    /// Tool displacement by it at a pose.
    fn motion(
        &self,
        arm: &Arm,
        inputs: &Inputs,
        covariates: &[Covariate],
        pose: usize,
    ) -> ToolMotion {
        let mut motion = ToolMotion::default();
        let mut found = self.coefficients.iter();
        let degree = self.carrier.degree();
        self.carrier.units(arm, self.location, inputs, pose, |unit| {
            let mut sum = 0.0;
            terms(covariates, &self.covariates, (pose, degree), |term| {
                sum += term * found.next().unwrap_or(&0.0);
            });
            motion = motion.plus(&unit.scaled(sum));
        });
        motion
    }

    /// Sums of squares of the whitened residuals on the poses `held`, each limited to [`RESIDUAL_SIGMAS_MAX`], without and with the function.
    pub(super) fn sums_of_squares(
        &self,
        fitted: &ScoreTest<'_>,
        covariates: &[Covariate],
        held: &[bool],
    ) -> [f64; 2] {
        let motion = self.motions(fitted, covariates);
        let response = self.response(fitted, covariates);
        let on_held_poses = fitted.on_poses(held);
        let mut sums = [0.0; 2];
        on_held_poses.rows(1, motion, |row, law, left| {
            let with = left - law[0] + dot(row, &response);
            for (sum, left) in sums.iter_mut().zip([left, with]) {
                *sum += left.powi(2).min(RESIDUAL_SIGMAS_MAX.powi(2));
            }
        });
        sums
    }
}
