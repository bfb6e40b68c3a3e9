//! Diagnosis of positions: where model and recording differ, which effects explain it with which parameters, and the error on a test set.
//!
//! Steps and modules, in the order in which to read them: `screening` (of recordings), `preparation` (rows to use), `dictionary` (candidate effects),
//! `noise_models` (AR noise models), `selection` with `stepwise`, `multistart` and `outer_iteration` (which effects, and their alternatives),
//! `validation` (validation and test), `robust_selection` (effects that slow noise may explain), `unexplained` with `modulated_motion` and `local_errors`
//! (structure that no effect explains), `refutation` (effects that the test set refutes), `verdict` (verdict, posterior probabilities), `findings` (the
//! result). The method with its mathematics: `docs/diagnosis.md`.
//!
//! Input: a campaign (poses with measurements, SI units) and a model. Output: a [`Diagnosis`]. The module opens no file.
//!
//! Invariants: the same input and seed give the same result, bit for bit; rows of the test set take no part in the fit and select no effect; they may
//! remove one.

mod additive_regression;
mod calibration;
mod covariates;
mod dictionary;
pub mod experiment;
mod findings;
mod gram_matrix;
mod hysteresis;
mod jacobian_cache;
mod local_errors;
mod modes;
mod modulated_motion;
mod multistart;
mod noise_models;
mod outer_iteration;
mod plot_data;
mod preparation;
mod refutation;
mod residual_map;
mod robust_selection;
mod screening;
mod selection;
pub mod sentences;
mod springs;
mod stepwise;
mod substitution;
mod terms;
#[cfg(test)]
mod tests;
mod thinned_recordings;
mod thinning;
mod unexplained;
mod untested;
mod validation;
mod verdict;

use crate::autocorrelation::{ArModel, series_index};
use crate::campaign::{Campaign, Reading};
use crate::effect_size::EffectSize;
use crate::engine::verdict::{VerdictSettings, claimed};
use crate::fit::{FitSettings, fit};
use crate::fit_result::Fit;
use crate::hold_out::HoldOutSplit;
use crate::hypothesis::Hypothesis;
use crate::joint_readback;
use crate::progress::{Listener, Stage, StageProgress};
use crate::robust_weights::Influence;
use crate::score_test::ScoreTest;
use additive_regression::CovariateChoice;
use covariates::Covariate;
use experiment::ProposedExperiment;
use glam::DVec3;
use jacobian_cache::JacobianCache;
use physics::{AnyEffect, JointKind, Model};
use selection::{EffectSelection, Search};
use unexplained::SmoothFunction;
use validation::FitEvaluator;

use std::collections::BTreeMap;

pub use crate::engine::verdict::Verdict;
pub use calibration::{AddedEffect, ExtendedModel, select_effects};
pub use plot_data::{CovariatePlot, CovariatePoint, ResidualSeries, Spectra};
pub use residual_map::{MapCell, Visibility};
pub use screening::{ScreeningReport, screen_recordings};
pub use selection::AlternativeEffect;
pub use thinned_recordings::ThinnedRecordings;
pub use unexplained::motion_over_time;
pub use untested::UntestedEffect;
pub use validation::{TestErrors, TestExcess};

/// Relative standard uncertainty of a parameter that remains whatever the noise: scale of the instrument, nominal lever arms, simplified equation of
/// the effect.
const RELATIVE_SIGMA_FLOOR: f64 = 5e-3;

/// Half-width of a normal 95 % interval, in standard deviations.
const NORMAL_QUANTILE_95: f64 = 1.96;

/// Largest share of outlier rows (of the final fit) at which findings are claimed; 0 to 1.
const OUTLIER_SHARE_MAX: f64 = 0.2;
/// Exception to [`OUTLIER_SHARE_MAX`]: without findings, a smooth function that reduces the RMS error on the test set below this share explains the outlying
/// rows.
const EXPLAINED_RMS_SHARE: f64 = 0.5;

/// Least ratio of the residuals to an instrument's stated noise that is noted; above 1. Default 1.5: five standard deviations above 1 for an estimate from
/// 50 values, whose relative standard deviation is 1/√(2·50).
const STATED_NOISE_RATIO: f64 = 1.5;

/// Why nothing is claimed if a smooth function was preferred to effects and the test set does not confirm it.
const NOT_CONFIRMED: &str = "there are errors above the noise, but the poses that were held out do not confirm what explains the fitted ones; measure more poses, spread over the workspace";

/// Least share of the selected effects that pass the test by blocks, if structure near the noise remains without the others; 0 to 1. Default 0.5, chosen:
/// where most effects may be noise, the others are not trusted either.
const CERTAIN_SHARE_MIN: f64 = 0.5;

/// Why nothing is claimed if slow noise explains the errors as well as the effects do.
const SLOW_NOISE: &str = "there are errors above the noise, but they vary as slowly as the noise of the instrument, and whether they are the robot's cannot be determined; measure more, with the same positions at different times";

/// Where noise is autocorrelated: least reduction of the mean squared error on the test set by the findings, as a share of the mean square of what they
/// predict there; 0 to 1. Default 1/3: findings that are in the data reduce it by all of that, overfitted ones by nothing.
const PREDICTED_SHARE_MIN: f64 = 1.0 / 3.0;
/// Why nothing is claimed if the findings do not reduce the error on the test set.
const NOT_PREDICTED: &str = "there are errors above the noise, but the effects that explain the fitted poses reduce the error on those that were held out too little or not at all: slowly varying noise, such as a drift of the instrument or air turbulence, looks like this; measure the same poses again in another order";

/// An effect that the model lacks, or whose stated parameters are wrong.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The effect with its estimated parameters, SI; for a correction, the effect with the corrected parameters.
    pub effect: AnyEffect,
    /// Index among the effects of the model in [`Diagnosis::fit`].
    pub effect_index: usize,
    /// For a correction: the parameters that the model states, SI. `None` for an effect that the model lacks.
    pub stated: Option<Vec<f64>>,
    /// Standard uncertainty of each parameter, SI units; `None` if the parameter was not fitted.
    pub sigma: Vec<Option<f64>>,
    /// Whether the data determine each parameter; otherwise its standard uncertainty is that of its prior.
    pub determined: Vec<bool>,
    /// Parameters that were set rather than fitted: name and values, SI.
    pub settings: Vec<(&'static str, Vec<f64>)>,
    /// Posterior probability of this effect beside its alternatives, 0 to 1.
    pub confidence: f64,
    /// Gain in log-likelihood on the training rows by this effect.
    pub gain: f64,
    /// Alternatives with their posterior probabilities.
    pub alternatives: Vec<(AlternativeEffect, f64)>,
    /// RMS error on the test set without it (but with all findings before it in order of importance) and with it, m or rad.
    pub held_out_rms: [f64; 2],
    /// RMS error on the test set when this effect is removed and all others are refitted, m or rad.
    pub held_out_rms_without: f64,
    /// Change of the measured quantities by this effect alone, with frames and targets refitted; m or rad.
    pub size: EffectSize,
    /// Where in the recording it is largest.
    pub seen: Visibility,
    /// Findings with the same group number (from 1) have strongly correlated parameters and are determined only together; `None` if it correlates
    /// with no other.
    pub group: Option<usize>,
}

/// What a structure in the residual is attributed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StructureLocation {
    /// The error of a joint; index from 0.
    Joint(usize),
    /// A motion of the measuring frame against the robot's base.
    MeasuringFrame,
    /// A motion of the measured points on the tool.
    MeasuredPoint,
}

/// Section of a joint's range that has an error of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSection {
    /// Its limits, rad or m.
    pub limits: [f64; 2],
    /// The largest error in it, rad or m.
    pub largest: f64,
    /// The kind of the joint.
    pub kind: JointKind,
}

/// Structure in the residual that no effect of the dictionary explains, modelled as a smooth function of one or two covariates.
#[derive(Clone, Debug)]
pub struct Unexplained {
    /// Names of the covariates, as in docs/reference/results.md.
    pub depends_on: Vec<String>,
    /// What it is attributed to.
    pub location: StructureLocation,
    /// Where the error of the joint is, if it is local.
    pub section: Option<JointSection>,
    /// RMS error on the test set without and with the smooth function, m or rad.
    pub heldout: [f64; 2],
}

/// Result of a diagnosis.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// Claimed findings, most important first.
    pub findings: Vec<Finding>,
    /// Effects with too low a posterior probability to be claimed. `fit` and `test_errors` include them.
    pub candidates: Vec<Finding>,
    /// Structure that findings and candidates leave unexplained.
    pub unexplained: Option<Unexplained>,
    /// Errors on the test set.
    pub test_errors: TestErrors,
    /// Fit of the model as given: only frames and targets are estimated.
    pub given: Fit,
    /// Fit with findings and candidates.
    pub fit: Fit,
    /// RMS of the measured values about their means, m or rad.
    pub signal_rms: f64,
    /// Proposed experiment that would distinguish indistinguishable alternatives.
    pub next_experiment: Option<ProposedExperiment>,
    /// Map of the differences between the model as given and the recording.
    pub map: Vec<MapCell>,
    /// Effects that this recording cannot show.
    pub not_tested: Vec<UntestedEffect>,
    /// Messages for the user about the processing of the data.
    pub notes: Vec<String>,
    /// Why nothing may be claimed: joint positions recorded before the arm had settled, or structure that the test set does not confirm.
    objection: Option<String>,
    /// Whether a validation set confirmed the findings: with few poses there is none.
    has_validation_set: bool,
    /// The campaign as it was used, after exclusion and subsampling of rows.
    pub campaign: Campaign,
    /// Split into training and test poses.
    pub split: HoldOutSplit,
}

/// Diagnoses `model` from the measurements of `campaign`.
///
/// - `sigma`: standard uncertainties that the model states of its effects' parameters, SI, one list per effect.
/// - `held_out`: test poses that the recordings reserve; `None`: chosen in blocks by `seed`.
/// - `listener`: told of the progress, by [`Stage::POSITIONS`]; [`ignore`](crate::progress::ignore) if nobody is.
#[must_use]
pub fn diagnose(
    mut campaign: Campaign,
    model: &Model,
    sigma: &[Vec<f64>],
    held_out: Option<Vec<bool>>,
    seed: u64,
    listener: Listener<'_>,
) -> Diagnosis {
    let mut notes = Vec::new();
    preparation::set_velocities(&mut campaign, model.arm.count());
    let kept = preparation::subsample(&mut campaign, model.arm.count(), &mut notes);
    let held_out = held_out.map(|held| {
        held.iter().zip(kept).filter(|(_, kept)| *kept).map(|(held, _)| *held).collect()
    });
    diagnose_selected_rows(campaign, notes, model, sigma, held_out, seed, listener)
}

/// [`diagnose`] for a campaign whose rows are already subsampled and have their speeds.
fn diagnose_selected_rows(
    mut campaign: Campaign,
    mut notes: Vec<String>,
    model: &Model,
    sigma: &[Vec<f64>],
    held_out: Option<Vec<bool>>,
    seed: u64,
    listener: Listener<'_>,
) -> Diagnosis {
    let begin = |stage| StageProgress::begin(listener, stage);
    begin(Stage::GivenModel);
    preparation::exclude_path_starts(&mut campaign, model, &mut notes);
    let reserved = held_out.map(|held_out| HoldOutSplit::reserved(&held_out));
    let mut split = reserved.unwrap_or_else(|| HoldOutSplit::in_blocks(&campaign, seed));
    let selection_split = split.with_validation_set(&campaign, seed);
    validation::remove_rows_at_boundaries(&mut campaign, [&split, &selection_split]);
    let covariates = covariates::all_covariates(&campaign, model);
    let influence = Influence::Redescending;
    let used = selection_split.training.as_slice();
    let settings = FitSettings::full(used, influence);
    let known = preparation::stated_hypothesis(model, sigma);
    let base = fit(&campaign, &known, &settings);
    let dictionary = dictionary::candidate_dictionary(model, &campaign);
    let (known, dictionary, cache) = (&known, dictionary.as_slice(), &JacobianCache::default());
    begin(Stage::NoiseModel);
    let chosen = (covariates.as_slice(), CovariateChoice::All);
    let base = update_noise_models(&mut campaign, known, &settings, &base, chosen).unwrap_or(base);
    let progress = begin(Stage::FirstSearch);
    let search = Search { campaign: &campaign, known, settings, dictionary, cache, progress };
    let validation = split.training.iter().zip(used).map(|(trains, used)| *trains && !used);
    let validation = validation.collect::<Vec<bool>>();
    let (preselected, also) =
        selection::preselect(&search, &base, unexplained::IMITATING_EFFECTS_MIN);
    let SupportedEffects { selection, law, is_slow_noise } =
        match unexplained::early_replacement(&search, &preselected, &covariates, &validation) {
            Some((selection, law)) => {
                SupportedEffects { selection, law: Some(law), is_slow_noise: false }
            }
            None => {
                // The alternatives of each effect are not needed yet: this selection only serves to separate effects from noise.
                let first = search.iterate_until_stable(preselected, &also);
                let progress = begin(Stage::SecondSearch);
                let chosen = (covariates.as_slice(), CovariateChoice::Validated);
                let again =
                    update_noise_models(&mut campaign, known, &settings, &first.fit, chosen);
                let search =
                    Search { campaign: &campaign, known, settings, dictionary, cache, progress };
                let selection = match again {
                    None => selection::select(&search, first),
                    Some(refitted) => selection::restart(&search, &refitted, first),
                };
                let splits = (&selection_split, validation.as_slice());
                supported_effects(&search, splits, selection, &covariates, listener)
            }
        };
    // The selection is complete; its parameters and alternatives are now estimated on all rows outside the test set.
    let progress = begin(Stage::Alternatives);
    let search = Search { campaign: &campaign, known, settings, dictionary, cache, progress };
    let mut selection = estimated_on(&search, &split.training, selection);
    let has_validation_set = validation.contains(&true);
    // Without a validation set, the test set alone confirms what was selected, and can therefore not select.
    if has_validation_set {
        notes.extend(refutation::remove_refuted(&campaign, model, &mut split, &mut selection));
    }
    let not_tested = untested::untested_effects(&model.arm, dictionary, &covariates);
    let found = finish(campaign, model, selection, law, split, &covariates, listener);
    notes.extend(found.notes);
    let objection = found.objection.or_else(|| is_slow_noise.then(|| SLOW_NOISE.to_owned()));
    Diagnosis { not_tested, notes, has_validation_set, objection, ..found }
}

/// The selection with parameters and alternatives estimated on the poses `training`.
fn estimated_on(
    search: &Search<'_>,
    training: &[bool],
    selection: EffectSelection,
) -> EffectSelection {
    let around = selection.fit.surroundings.clone();
    let settings = FitSettings { used: training, from: Some(&around), ..search.settings };
    let fit = fit(search.campaign, &selection.fit.hypothesis, &settings);
    let selection = EffectSelection { fit, ..selection };
    substitution::with_alternatives(&Search { settings, ..*search }, selection)
}

/// The selected effects after validation, with the structure that they leave.
struct SupportedEffects {
    selection: EffectSelection,
    law: Option<SmoothFunction>,
    /// Whether noise as slow as the motion may be what they describe.
    is_slow_noise: bool,
}

/// The effects that the validation set and the scatter of blocks support, and the structure that they leave. `splits`: the split of the selection, and
/// the validation set.
fn supported_effects(
    search: &Search<'_>,
    splits: (&HoldOutSplit, &[bool]),
    selection: EffectSelection,
    covariates: &[Covariate],
    listener: Listener<'_>,
) -> SupportedEffects {
    let progress = StageProgress::begin(listener, Stage::Validation);
    let search = Search { progress, ..*search };
    let model = &search.known.model;
    let selection =
        validation::drop_unsupported(search.campaign, model, splits, selection, progress);
    let reduced = robust_selection::without_inflated(&search, &selection);
    StageProgress::begin(listener, Stage::Structure);
    let structure =
        |selection| unexplained::with_structure(&search, selection, covariates, splits.1);
    let (is_slow_noise, (selection, law)) = match reduced.map(structure) {
        None => (false, structure(selection)),
        Some((few, None)) => (false, (few, None)),
        // Effects without which structure remains describe more than noise, unless most are not certain and the structure is not far above slow noise.
        Some((few, Some(left))) => {
            let certain = few.selected.len() as f64 / selection.selected.len() as f64;
            let is_slow_noise = certain < CERTAIN_SHARE_MIN && !left.is_far_above_noise();
            (is_slow_noise, structure(selection))
        }
    };
    SupportedEffects { selection, law, is_slow_noise }
}

/// Sets the campaign's AR noise models to those of the residual of `current` and refits the known model with them; `None` if the noise models are
/// unchanged.
fn update_noise_models(
    campaign: &mut Campaign,
    known: &Hypothesis,
    settings: &FitSettings<'_>,
    current: &Fit,
    (covariates, taken): (&[Covariate], CovariateChoice),
) -> Option<Fit> {
    let colours = noise_models::noise_models(campaign, current, settings.used, (covariates, taken));
    if colours.iter().zip(&campaign.instruments).all(|(a, b)| *a == b.noise_model) {
        return None;
    }
    campaign.instruments.iter_mut().zip(colours).for_each(|(i, colour)| i.noise_model = colour);
    let around = current.surroundings.clone();
    Some(fit(campaign, known, &FitSettings { from: Some(&around), ..*settings }))
}

/// Assembles the result: errors on the test set, verdict, findings, map and proposed experiment. Its list of untested effects is empty, and its notes
/// are only those on the final fit.
fn finish(
    campaign: Campaign,
    model: &Model,
    selection: EffectSelection,
    law: Option<SmoothFunction>,
    split: HoldOutSplit,
    covariates: &[Covariate],
    listener: Listener<'_>,
) -> Diagnosis {
    let progress = StageProgress::begin(listener, Stage::TestErrors);
    let settings = FitSettings::full(&split.training, Influence::Redescending);
    let EffectSelection { fit: last, selected } = selection;
    let held_out = split.held_out();
    let held = FitEvaluator::new(&campaign, (&split, &held_out), &last);
    let given = held.compared(&Hypothesis::fixed(*model), &last);
    let fitted = ScoreTest::new(&campaign, &last, &settings);
    let (before, after) = (held.rms(&given), held.rms(&last));
    let is_replaced = law.as_ref().is_some_and(SmoothFunction::replaces_certain_effects);
    let unexplained = law.and_then(|law| law.confirmed(&fitted, covariates, &held, after));
    let carried = unexplained.as_ref().map(|rest| {
        let left = after.powi(2) - rest.heldout[1].powi(2);
        (before.powi(2) - after.powi(2)) / (before.powi(2) - after.powi(2) + left).max(1e-30)
    });
    let verdict = verdict::decide(&selected, &last, carried);
    let map = residual_map::map(&campaign, &given, &settings, covariates);
    let uncertainty = fitted.uncertainty();
    let findings =
        findings::findings(&held, model, (&last, &uncertainty), &selected, &given, progress);
    let (findings, candidates) =
        claimed(verdict, findings, &VerdictSettings::POSITION, |one| one.confidence);
    let test_errors = held.test_errors(&given, &last);
    let design = experiment::Design::of(&campaign, model, &last, &split.training);
    let progress = StageProgress::begin(listener, Stage::Experiment);
    let next_experiment = design.propose(&selected, progress);
    let objection = joint_readback::detect_early_readback(&campaign, &last, &settings)
        .map(|suspected| suspected.message)
        .or_else(|| (is_replaced && unexplained.is_none()).then(|| NOT_CONFIRMED.to_owned()));
    let notes = outlier_note(&last, &campaign).into_iter();
    let notes = notes.chain(gross_error_note(&held, &last)).chain(noise_notes(&last, &campaign));
    let notes = notes.collect();
    Diagnosis {
        verdict,
        findings,
        candidates,
        unexplained,
        test_errors,
        given,
        fit: last,
        signal_rms: signal_rms(&campaign, held.is_length),
        next_experiment,
        map,
        not_tested: Vec::new(),
        notes,
        objection,
        has_validation_set: false,
        campaign,
        split,
    }
}

/// Number of outlier rows of the final fit, and number of measured rows.
fn outlier_counts(last: &Fit, campaign: &Campaign) -> (usize, usize) {
    let rows = campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
    (last.outliers(campaign).len(), rows)
}

/// Note on the outlier rows of the final fit, if there are any.
fn outlier_note(last: &Fit, campaign: &Campaign) -> Option<String> {
    let (outliers, rows) = outlier_counts(last, campaign);
    (outliers > 0).then(|| {
        format!(
            "{outliers} of {rows} rows are outliers of the final model and have little or no weight"
        )
    })
}

/// Note on the gross errors of the test set, if there are any.
fn gross_error_note(held: &FitEvaluator<'_>, last: &Fit) -> Option<String> {
    let (gross, all) = held.gross_errors(last);
    (gross > 0).then(|| {
        format!(
            "the held-out error does not count {gross} of {all} held-out measurements: single large deviations, as gross errors of the instrument cause"
        )
    })
}

/// Notes on instruments whose stated noise the residuals exceed by [`STATED_NOISE_RATIO`] or more.
fn noise_notes<'a>(last: &'a Fit, campaign: &'a Campaign) -> impl Iterator<Item = String> + 'a {
    let stated = campaign.instruments.iter().zip(&last.factors);
    let stated = stated.filter(|(instrument, _)| instrument.noise_is_known);
    stated.filter(|(_, factor)| **factor >= STATED_NOISE_RATIO).map(|(instrument, factor)| {
        format!(
            "{}: the residuals are {factor:.1} times as large as the stated noise (`sigma`): the noise is larger than stated, or there are errors that no known effect describes",
            instrument.name
        )
    })
}

impl Diagnosis {
    /// Reason why no finding may be claimed; `None` if there is none.
    #[must_use]
    pub fn reason_not_to_claim(&self) -> Option<String> {
        if self.objection.is_some() {
            return self.objection.clone();
        }
        let (outliers, rows) = outlier_counts(&self.fit, &self.campaign);
        // Rows that a single smooth function explains are not inconsistent with the others.
        let [without, with] = self.unexplained.as_ref().map_or([0.0; 2], |rest| rest.heldout);
        let follows = self.findings.is_empty() && with < EXPLAINED_RMS_SHARE * without;
        if outliers as f64 > OUTLIER_SHARE_MAX * rows as f64 && !follows {
            return Some(format!(
                "{outliers} of {rows} rows are not consistent with the others: the recording mixes different setups, or its readings are not of this robot"
            ));
        }
        let TestErrors { before, after, difference, .. } = self.test_errors;
        let is_slow =
            self.campaign.instruments.iter().any(|one| one.noise_model != ArModel::default());
        let share = if is_slow { PREDICTED_SHARE_MIN } else { 0.0 };
        if !self.findings.is_empty() && before.powi(2) - after.powi(2) <= share * difference.powi(2)
        {
            return Some(NOT_PREDICTED.to_owned());
        }
        // Without a finding, the model would be said to agree with the recording; without a validation set, nothing else has confirmed the findings.
        let is_unconfirmed = self.verdict == Verdict::Consistent || !self.has_validation_set;
        let excess = self.test_errors.excess.filter(|_| is_unconfirmed)?;
        Some(format!(
            "the model does not predict the poses that were held out: their RMS error is {:.1} times that of the fitted poses, more than scatter explains, and known effects do not account for it; measure more poses, spread over the workspace",
            excess.ratio
        ))
    }
}

/// RMS of the measured values about the mean of each channel: positions, m, if `lengths`, else joint positions, rad or m.
fn signal_rms(campaign: &Campaign, lengths: bool) -> f64 {
    let mut streams: BTreeMap<usize, Vec<DVec3>> = BTreeMap::new();
    for reading in
        campaign.poses.iter().flat_map(|p| p.seen.iter().map(|observation| &observation.reading))
    {
        let value = match reading {
            Reading::Point { at, .. } if lengths => *at,
            Reading::JointPosition { position, .. } if !lengths => DVec3::X * *position,
            _ => continue,
        };
        streams.entry(series_index(reading)).or_default().push(value);
    }
    let (mut sum, mut count) = (0.0, 0.0);
    for values in streams.values() {
        let mean = values.iter().sum::<DVec3>() / values.len() as f64;
        sum += values.iter().map(|value| (*value - mean).length_squared()).sum::<f64>();
        count += if lengths { 3.0 } else { 1.0 } * values.len() as f64;
    }
    if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
}
