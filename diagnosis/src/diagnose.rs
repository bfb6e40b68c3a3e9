//! Diagnosis of positions: where model and recording differ, which effects explain it with which parameters, and the error on a test set.
//!
//! Steps and modules, in the order in which to read them: `ingest` (screening of recordings), `ready` (rows to use), `library` (candidate effects),
//! `noise` (AR noise model), `selection` with `stepwise`, `starts` and `outer_iteration` (which effects, and their alternatives), `prove` (validation and test),
//! `unknown` (structure that no effect explains), `judge` (verdict, posterior probabilities), `findings` (the result). The method with its mathematics:
//! `docs/diagnosis.md`.
//!
//! The same input and seed give the same bits. Rows of the test set take part in no selection and no fit. Knows no files.

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

/// The share of a number that stays open whatever the noise: scales, the geometry that levers are taken from, the form of a law.
const FLOOR: f64 = 5e-3;

/// Standard uncertainties from the middle to the end of a 95 % interval.
const QUANTILE: f64 = 1.96;

/// Where more than this share of the rows lies far from the model with all that was found, nothing is claimed.
const FAR_MOST: f64 = 0.2;
/// But where one law alone leaves less than this share of the error of unseen rows, these rows follow it.
const FOLLOWS: f64 = 0.5;

/// Something that is missing in the model, or wrong in it.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The effect with its numbers, SI; for a change the effect as it should be.
    pub effect: AnyEffect,
    /// Its place among the effects of the fit's model.
    pub place: usize,
    /// For a change: the numbers that the model had.
    pub had: Option<Vec<f64>>,
    /// The standard uncertainty of each number, SI; none for one that was not fitted.
    pub sigma: Vec<Option<f64>>,
    /// Whether the data determine each number; the uncertainty of one that they do not is that of its prior.
    pub determined: Vec<bool>,
    /// Settings of the effect, SI.
    pub settings: Vec<(&'static str, Vec<f64>)>,
    /// The probability that the name is right.
    pub confidence: f64,
    /// By how much log-likelihood is higher with it than without.
    pub gain: f64,
    /// Other names, with their probabilities.
    pub rivals: Vec<(Rival, f64)>,
    /// Held-out root mean square without it (all before it in the list at work) and with it, m or rad.
    pub heldout: [f64; 2],
    /// Held-out root mean square where it alone is left out and all else is fitted anew, m or rad.
    pub heldout_without: f64,
    /// What it alone does to the readings, frames and targets fitted to the rest; m or rad.
    pub size: Size,
    /// Where it shows.
    pub seen: Seen,
    /// Findings of one number here, from 1, are determined only together; none where it is determined by itself.
    pub group: Option<usize>,
}

/// Structure that no effect explains.
#[derive(Clone, Debug)]
pub struct Unexplained {
    /// The contract's words for what it follows.
    pub depends_on: Vec<String>,
    /// The joint whose error it looks like, from 0.
    pub joint: usize,
    /// Root mean square held out without and with the smooth law, m or rad.
    pub heldout: [f64; 2],
}

/// All that was found.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// What is claimed, most important first.
    pub findings: Vec<Finding>,
    /// Less probable than that: no claims. The fit, the proof and the model hold them too.
    pub candidates: Vec<Finding>,
    /// Structure beyond them.
    pub unexplained: Option<Unexplained>,
    /// Held-out errors.
    pub proof: Proof,
    /// The model as given, frames and targets fitted.
    pub given: Fit,
    /// With all that was found.
    pub fit: Fit,
    /// Root mean square of the measured values about their means, m or rad.
    pub signal_rms: f64,
    /// The motion or load that would tell rivals apart.
    pub next_experiment: Option<Proposed>,
    /// Where the model as given and the recording differ.
    pub map: Vec<Cell>,
    /// What could not have shown.
    pub not_tested: Vec<Untested>,
    /// What was done with the data, in words.
    pub notes: Vec<String>,
    /// That the joint positions were read before the arm stood; none where they were not.
    early: Option<String>,
    /// The campaign as it was used.
    pub campaign: Campaign,
    /// Which poses trained.
    pub split: Split,
}

/// Diagnoses `model` by `campaign`. `sigma`: what the model states of its effects' uncertainty, one list per effect; `held_out`: what recordings keep for
/// validation; none: chosen by `seed`.
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

/// The same where rows are chosen already, and have their speeds.
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
            // Without a look at rivals: enough to tell what is noise.
            let first = search.until_stable(preselected, &also);
            // What is named tells what is noise, and what is noise tells what can be named.
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
    // Names and laws stand; their numbers, and which rivals come near, are told by all that is not held out.
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

/// Gives the campaign the noise that `seen` leaves, and the fit of what is known with it; none where it has it already.
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
    // A law that does not reduce the held-out error is not claimed.
    let rest = law.and_then(|law| {
        let [without, with] = law.on(&fitted, words, &held_out);
        (with < without).then(|| Unexplained {
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

/// Rows that lie far from the model with all that was found, and all that were read.
fn far(last: &Fit, campaign: &Campaign) -> (usize, usize) {
    let rows = campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
    (last.outliers(campaign).len(), rows)
}

impl Diagnosis {
    /// Why nothing of this may be claimed; none where it may.
    #[must_use]
    pub fn doubt(&self) -> Option<String> {
        if self.early.is_some() {
            return self.early.clone();
        }
        let (far, rows) = far(&self.fit, &self.campaign);
        // What one law brings near the model belongs to it.
        let [without, with] = self.unexplained.as_ref().map_or([0.0; 2], |rest| rest.heldout);
        let follows = self.findings.is_empty() && with < FOLLOWS * without;
        (far as f64 > FAR_MOST * rows as f64 && !follows).then(|| {
            format!(
                "{far} of {rows} rows are not consistent with the others: the recording mixes different setups, or its readings are not of this robot"
            )
        })
    }
}

/// Root mean square of what was read about the mean of each axis or joint.
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
