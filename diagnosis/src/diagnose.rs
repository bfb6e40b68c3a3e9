//! Diagnosis of positions: where model and recording differ, which effects explain it with which parameters, and the error on a test set.
//!
//! Steps and modules, in the order in which to read them: `ingest` (screening of recordings), `ready` (rows to use), `library` (candidate effects),
//! `noise` (AR noise model), `selection` with `stepwise`, `starts` and `outer_iteration` (which effects, and their alternatives), `prove` (validation
//! and test), `unknown` (structure that no effect explains), `judge` (verdict, posterior probabilities), `findings` (the result). The method with its
//! mathematics: `docs/diagnosis.md`.
//!
//! Input: a campaign (poses with measurements, SI units) and a model. Output: a [`Diagnosis`]. The module opens no file.
//!
//! Invariants: the same input and seed give the same result, bit for bit; rows of the test set take no part in selection or fit.

mod calibration;
pub mod experiment;
mod features;
mod findings;
mod flexible;
mod gram;
mod hysteresis;
mod ingest;
mod jacobian_cache;
mod judge;
mod library;
mod locate;
mod look;
mod modes;
mod noise;
mod outer_iteration;
mod prove;
mod ready;
pub mod says;
mod selection;
mod springs;
mod starts;
mod stepwise;
mod substitution;
mod terms;
mod thinning;
mod unknown;
mod untested;
mod view;

use crate::campaign::{Campaign, Reading};
use crate::colour::stream;
use crate::engine::verdict::{VerdictSettings, claimed};
use crate::fit::{Effort, Settings, fit};
use crate::hypothesis::Hypothesis;
use crate::proof::Split;
use crate::readback;
use crate::result::Fit;
use crate::robust::Influence;
use crate::score::Fitted;
use crate::size::Size;
use experiment::Proposed;
use features::Word;
use flexible::Taken;
use glam::DVec3;
use jacobian_cache::JacobianCache;
use physics::{AnyEffect, Model};
use prove::Held;
use selection::{Search, Selection as Selected};

use std::collections::BTreeMap;

pub use crate::engine::verdict::Verdict;
pub use calibration::{Chosen, Selection, select};
pub use ingest::{Ingested, ingest};
pub use locate::{Cell, Seen};
pub use look::Thinned;
pub use prove::Proof;
pub use selection::Rival;
pub use untested::Untested;
pub use view::{Beside, Over, Spectra, Trace};

/// Relative standard uncertainty of a parameter that remains whatever the noise: scale of the instrument, nominal lever arms, simplified equation of
/// the effect.
const FLOOR: f64 = 5e-3;

/// Half-width of a normal 95 % interval, in standard deviations.
const QUANTILE: f64 = 1.96;

/// Largest share of outlier rows (of the final fit) at which findings are claimed; 0 to 1.
const FAR_MOST: f64 = 0.2;
/// Exception to [`FAR_MOST`]: without findings, a smooth function that reduces the RMS error on the test set below this share explains the outlying
/// rows.
const FOLLOWS: f64 = 0.5;

/// An effect that the model lacks, or whose stated parameters are wrong.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The effect with its estimated parameters, SI; for a correction, the effect with the corrected parameters.
    pub effect: AnyEffect,
    /// Index among the effects of the model in [`Diagnosis::fit`].
    pub place: usize,
    /// For a correction: the parameters that the model states, SI. `None` for an effect that the model lacks.
    pub had: Option<Vec<f64>>,
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
    pub rivals: Vec<(Rival, f64)>,
    /// RMS error on the test set without it (but with all findings before it in order of importance) and with it, m or rad.
    pub heldout: [f64; 2],
    /// RMS error on the test set when this effect is removed and all others are refitted, m or rad.
    pub heldout_without: f64,
    /// Change of the measured quantities by this effect alone, with frames and targets refitted; m or rad.
    pub size: Size,
    /// Where in the recording it is largest.
    pub seen: Seen,
    /// Findings with the same group number (from 1) have strongly correlated parameters and are determined only together; `None` if it correlates
    /// with no other.
    pub group: Option<usize>,
}

/// Structure in the residual that no effect of the library explains, modelled as a smooth function of one or two covariates.
#[derive(Clone, Debug)]
pub struct Unexplained {
    /// Names of the covariates, as in docs/reference/results.md.
    pub depends_on: Vec<String>,
    /// Index of the joint to whose error the structure is attributed, from 0.
    pub joint: usize,
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
    /// Effects with too low a posterior probability to be claimed. `fit` and `proof` include them.
    pub candidates: Vec<Finding>,
    /// Structure that findings and candidates leave unexplained.
    pub unexplained: Option<Unexplained>,
    /// Errors on the test set.
    pub proof: Proof,
    /// Fit of the model as given: only frames and targets are estimated.
    pub given: Fit,
    /// Fit with findings and candidates.
    pub fit: Fit,
    /// RMS of the measured values about their means, m or rad.
    pub signal_rms: f64,
    /// Proposed experiment that would distinguish indistinguishable alternatives.
    pub next_experiment: Option<Proposed>,
    /// Map of the differences between the model as given and the recording.
    pub map: Vec<Cell>,
    /// Effects that this recording cannot show.
    pub not_tested: Vec<Untested>,
    /// Messages for the user about the processing of the data.
    pub notes: Vec<String>,
    /// Message if the joint positions appear to have been recorded before the arm had settled.
    early: Option<String>,
    /// The campaign as it was used, after exclusion and subsampling of rows.
    pub campaign: Campaign,
    /// Split into training and test poses.
    pub split: Split,
}

/// Diagnoses `model` from the measurements of `campaign`.
///
/// - `sigma`: standard uncertainties that the model states of its effects' parameters, SI, one list per effect.
/// - `held_out`: test poses that the recordings reserve; `None`: chosen in blocks by `seed`.
#[must_use]
pub fn diagnose(
    mut campaign: Campaign,
    model: &Model,
    sigma: &[Vec<f64>],
    held_out: Option<Vec<bool>>,
    seed: u64,
) -> Diagnosis {
    let mut notes = Vec::new();
    ready::set_moving(&mut campaign, model.arm.count());
    let kept = ready::thin(&mut campaign, model.arm.count(), &mut notes);
    let held_out = held_out.map(|held| {
        held.iter().zip(kept).filter(|(_, kept)| *kept).map(|(held, _)| *held).collect()
    });
    of_chosen(campaign, notes, model, sigma, held_out, seed)
}

/// [`diagnose`] for a campaign whose rows are already subsampled and have their speeds.
fn of_chosen(
    mut campaign: Campaign,
    mut notes: Vec<String>,
    model: &Model,
    sigma: &[Vec<f64>],
    held_out: Option<Vec<bool>>,
    seed: u64,
) -> Diagnosis {
    ready::set_begun(&mut campaign, model, &mut notes);
    let split = match held_out {
        Some(held) => Split {
            says: "what the recordings reserve for validation".to_owned(),
            training: held.iter().map(|held| !held).collect(),
        },
        None => Split::in_blocks(&campaign, seed),
    };
    let selection_split = split.keeping_some(&campaign, seed);
    prove::set_apart(&mut campaign, [&split, &selection_split]);
    let words = features::words(&campaign, model);
    let influence = Influence::Redescending;
    let used = selection_split.training.as_slice();
    let settings = Settings { used, influence, from: None, effort: Effort::Full };
    let known = ready::known(model, sigma);
    let base = fit(&campaign, &known, &settings);
    let library = library::library(model, &campaign);
    let cache = JacobianCache::default();
    let base =
        whiten(&mut campaign, &known, &settings, &base, (&words, Taken::All)).unwrap_or(base);
    let search =
        Search { campaign: &campaign, known: &known, settings, library: &library, cache: &cache };
    let validation = split.training.iter().zip(used).map(|(trains, used)| *trains && !used);
    let validation: Vec<bool> = validation.collect();
    let (preselected, also) = selection::preselected(&search, &base, unknown::PATCHES);
    let (selection, law) = match unknown::ahead_at_once(&search, &preselected, &words, &validation)
    {
        Some((few, law)) => (few, Some(law)),
        None => {
            // The alternatives of each effect are not needed yet: this selection only serves to separate effects from noise.
            let first = search.until_stable(preselected, &also);
            let taken = (words.as_slice(), Taken::Validated);
            let again = whiten(&mut campaign, &known, &settings, &first.fit, taken);
            let (known, library, cache) = (&known, library.as_slice(), &cache);
            let search = Search { campaign: &campaign, known, settings, library, cache };
            let selection = match again {
                None => selection::select(&search, first),
                Some(bare) => selection::restarted(&search, &bare, first),
            };
            let looks = (&selection_split, validation.as_slice());
            let selection = prove::confirmed(&campaign, model, looks, selection);
            match unknown::instead_of_names(&search, &selection, &words, &validation) {
                Some((few, law)) => (few, Some(law)),
                None => {
                    let law = unknown::confirmed(&search, &selection, &words, &validation);
                    (selection, law)
                }
            }
        }
    };
    // The selection is complete; its parameters and alternatives are now estimated on all rows outside the test set.
    let around = selection.fit.surroundings.clone();
    let settings = Settings { used: &split.training, from: Some(&around), ..settings };
    let selection =
        Selected { fit: fit(&campaign, &selection.fit.hypothesis, &settings), ..selection };
    let search =
        Search { campaign: &campaign, known: &known, settings, library: &library, cache: &cache };
    let selection = substitution::with_rivals(&search, selection);
    let not_tested = untested::untested(&model.arm, &library, &words);
    finish(campaign, model, selection, law, split, &words, (not_tested, notes))
}

/// Sets the campaign's AR noise models to those of the residual of `seen` and refits the known model with them; `None` if the noise models are
/// unchanged.
fn whiten(
    campaign: &mut Campaign,
    known: &Hypothesis,
    settings: &Settings<'_>,
    seen: &Fit,
    (words, taken): (&[Word], Taken),
) -> Option<Fit> {
    let colours = noise::colours(campaign, seen, settings.used, (words, taken));
    if colours.iter().zip(&campaign.instruments).all(|(a, b)| *a == b.colour) {
        return None;
    }
    campaign.instruments.iter_mut().zip(colours).for_each(|(i, colour)| i.colour = colour);
    let around = seen.surroundings.clone();
    Some(fit(campaign, known, &Settings { from: Some(&around), ..*settings }))
}

/// Assembles the result: errors on the test set, verdict, findings, map and proposed experiment.
fn finish(
    campaign: Campaign,
    model: &Model,
    selection: Selected,
    law: Option<unknown::Law>,
    split: Split,
    words: &[Word],
    (not_tested, mut notes): (Vec<Untested>, Vec<String>),
) -> Diagnosis {
    let settings = Settings {
        used: &split.training,
        influence: Influence::Redescending,
        from: None,
        effort: Effort::Full,
    };
    let Selected { fit: last, named } = selection;
    let held_out = split.held_out();
    let held = Held::new(&campaign, (&split, &held_out), &last);
    let given = held.beside(&Hypothesis::fixed(*model), &last);
    let fitted = Fitted::new(&campaign, &last, &settings);
    let (before, after) = (held.rms(&given), held.rms(&last));
    // A smooth function is reported only if it reduces the error on the test set, by as much as is required of the validation set.
    let rest = law.and_then(|law| {
        let [without, with] = law.on(&fitted, words, &held_out);
        let is_supported = law.is_supported(last.design_effect, [without, with]);
        (is_supported && with < without).then(|| Unexplained {
            depends_on: law.depends_on(words),
            joint: law.joint,
            heldout: [after, after * (with / without).sqrt()],
        })
    });
    let carried = rest.as_ref().map(|rest| {
        let left = after.powi(2) - rest.heldout[1].powi(2);
        (before.powi(2) - after.powi(2)) / (before.powi(2) - after.powi(2) + left).max(1e-30)
    });
    let verdict = judge::verdict(&named, &last, carried);
    let map = locate::map(&campaign, &given, &settings, words);
    let uncertainty = fitted.uncertainty();
    let findings = findings::findings(&held, model, (&last, &uncertainty), &named, &given);
    let (findings, candidates) =
        claimed(verdict, findings, &VerdictSettings::POSITION, |one| one.confidence);
    let unexplained = rest;
    let proof = held.proof(before, after, &last);
    let design = experiment::Design::of(&campaign, model, &last, &split.training);
    let next_experiment = design.proposed(&named);
    let early = readback::ahead(&campaign, &last, &settings).map(|suspicion| suspicion.says);
    let (far, rows) = far(&last, &campaign);
    if far > 0 {
        notes.push(format!(
            "{far} of {rows} rows are outliers of the final model and have little or no weight"
        ));
    }
    Diagnosis {
        verdict,
        findings,
        candidates,
        unexplained,
        proof,
        given,
        fit: last,
        signal_rms: signal_rms(&campaign, held.is_length),
        next_experiment,
        map,
        not_tested,
        notes,
        early,
        campaign,
        split,
    }
}

/// Number of outlier rows of the final fit, and number of measured rows.
fn far(last: &Fit, campaign: &Campaign) -> (usize, usize) {
    let rows = campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
    (last.outliers(campaign).len(), rows)
}

impl Diagnosis {
    /// Reason why no finding may be claimed; `None` if there is none.
    #[must_use]
    pub fn doubt(&self) -> Option<String> {
        if self.early.is_some() {
            return self.early.clone();
        }
        let (far, rows) = far(&self.fit, &self.campaign);
        // Rows that a single smooth function explains are not inconsistent with the others.
        let [without, with] = self.unexplained.as_ref().map_or([0.0; 2], |rest| rest.heldout);
        let follows = self.findings.is_empty() && with < FOLLOWS * without;
        (far as f64 > FAR_MOST * rows as f64 && !follows).then(|| {
            format!(
                "{far} of {rows} rows are not consistent with the others: the recording mixes different setups, or its readings are not of this robot"
            )
        })
    }
}

/// RMS of the measured values about the mean of each channel: positions, m, if `lengths`, else joint positions, rad or m.
fn signal_rms(campaign: &Campaign, lengths: bool) -> f64 {
    let mut streams: BTreeMap<usize, Vec<DVec3>> = BTreeMap::new();
    for reading in campaign.poses.iter().flat_map(|p| p.seen.iter().map(|seen| &seen.reading)) {
        let value = match reading {
            Reading::Point { at, .. } if lengths => *at,
            Reading::JointPosition { position, .. } if !lengths => DVec3::X * *position,
            _ => continue,
        };
        streams.entry(stream(reading)).or_default().push(value);
    }
    let (mut sum, mut count) = (0.0, 0.0);
    for values in streams.values() {
        let mean = values.iter().sum::<DVec3>() / values.len() as f64;
        sum += values.iter().map(|value| (*value - mean).length_squared()).sum::<f64>();
        count += if lengths { 3.0 } else { 1.0 } * values.len() as f64;
    }
    if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
}
