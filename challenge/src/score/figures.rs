//! The figures of a challenge: `trued.challenge/1` and what stands beside its fixed keys.
//!
//! Promises: a figure over no case is null, never a number. Never: a case weighed.

use serde::Serialize;

use super::Outcome;
use crate::case::Tier;
use crate::truth::LEAST_Z;

/// Cases of a range.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Bin {
    /// From (included).
    pub from: f64,
    /// To (excluded); none: without end.
    pub to: Option<f64>,
    /// How many.
    pub cases: usize,
    /// Share of them with the first answer right.
    pub first_right: Option<f64>,
    /// Share with the truth among the first three names.
    pub first_three_right: Option<f64>,
}

/// Claims by what they said of themselves.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Calibration {
    /// From (included).
    pub from: f64,
    /// To (excluded).
    pub to: f64,
    /// How many claims.
    pub claims: usize,
    /// Mean of their confidence.
    pub said: Option<f64>,
    /// Share that was right.
    pub right: Option<f64>,
}

/// A kind of effect, with how it went.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ByEffect {
    /// Its name.
    pub effect: &'static str,
    /// Cases where it alone is hidden and counts.
    pub cases: usize,
    /// First answer right.
    pub right: usize,
    /// What was said instead, most often first.
    pub instead: Vec<(String, usize)>,
}

/// All figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Figures {
    /// Of everything that chance decided.
    pub seed: u64,
    /// How many.
    pub cases: usize,
    /// Of the truth, told before anyone answered.
    pub sealed_sha256: String,
    /// Of the answers, told before the truth was opened.
    pub answers_sha256: String,
    /// Cases without an answer.
    pub unanswered: usize,
    /// Cases that count towards a bar.
    pub counting: usize,
    /// By ρ, of those that count.
    pub by_effect_to_noise: Vec<Bin>,
    /// By z, of those that count.
    pub by_z: Vec<Bin>,
    /// Of those that count, where z is at least 20, 40, 80.
    pub first_right_at_z: Vec<Bin>,
    /// First claim right, of all that count.
    pub first_right: Option<f64>,
    /// Nulls.
    pub nulls: usize,
    /// Nulls that were answered with physics.
    pub false_findings: usize,
    /// Their share.
    pub false_findings_on_nulls: Option<f64>,
    /// Wrong claims among claims under `missing_physics`, nulls aside.
    pub named_wrong: Option<f64>,
    /// Claims that this is of.
    pub named: usize,
    /// Physics outside the library that was called so.
    pub unknown_recognised: Option<f64>,
    /// Cases that this is of.
    pub unknown: usize,
    /// Cases that cannot be decided and were called so.
    pub undetermined_recognised: Option<f64>,
    /// Cases that this is of.
    pub undetermined: usize,
    /// Intervals that hold, what was not found counted as not held.
    pub coverage95: Option<f64>,
    /// The same where the effect was found.
    pub coverage95_found: Option<f64>,
    /// Numbers that were found.
    pub intervals: usize,
    /// Share of the oracle's gain, median.
    pub gain_vs_oracle_median: Option<f64>,
    /// Share of the oracle's gain, tenth of a hundred from below.
    pub gain_vs_oracle_p10: Option<f64>,
    /// Joint right, given the effect is right.
    pub joint_right: Option<f64>,
    /// Truth among the first three names, of those that count.
    pub first_three_right: Option<f64>,
    /// What unknown structure follows, of those that were called unknown.
    pub depends_on_right: Option<f64>,
    /// Several effects: share of those that count that were named.
    pub all_named: Option<f64>,
    /// Claims by confidence.
    pub calibration: Vec<Calibration>,
    /// Mean distance of confidence from truth.
    pub calibration_error: Option<f64>,
    /// By kind.
    pub by_effect: Vec<ByEffect>,
    /// Cases by tier.
    pub tiers: Vec<(Tier, usize)>,
    /// Of the solver, s.
    pub seconds_median: Option<f64>,
}

/// The figures of all outcomes.
#[must_use]
pub fn figures(seed: u64, sealed_sha256: &str, answers_sha256: &str, all: &[Outcome]) -> Figures {
    let counting: Vec<&Outcome> = all.iter().filter(|o| o.counts()).collect();
    let nulls: Vec<&Outcome> = all.iter().filter(|o| o.truth.tier == Tier::Null).collect();
    let false_findings = nulls.iter().filter(|o| o.false_finding()).count();
    let named = named(all);
    let unknown: Vec<&Outcome> = all.iter().filter(|o| o.is_unknown()).collect();
    let ambiguous: Vec<&Outcome> = all.iter().filter(|o| o.is_ambiguous()).collect();
    let intervals: Vec<Option<bool>> = all.iter().flat_map(Outcome::intervals).collect();
    let found: Vec<bool> = intervals.iter().flatten().copied().collect();
    let covered = found.iter().filter(|held| **held).count();
    let gains: Vec<f64> = counting.iter().filter_map(|o| o.errors?.share()).collect();
    let joints: Vec<bool> = counting.iter().filter_map(|o| o.joint_right()).collect();
    let called: Vec<&&Outcome> = unknown.iter().filter(|o| o.called_unknown()).collect();
    let (calibration, calibration_error) = calibration(all);
    Figures {
        seed,
        cases: all.len(),
        sealed_sha256: sealed_sha256.to_owned(),
        answers_sha256: answers_sha256.to_owned(),
        unanswered: all.iter().filter(|o| o.answer.is_none()).count(),
        counting: counting.len(),
        by_effect_to_noise: bins(&counting, &doubling(0.05, 9), Outcome::rho),
        by_z: bins(&counting, &[LEAST_Z, 20.0, 40.0, 80.0, 160.0], Outcome::z),
        first_right_at_z: [20.0, 40.0, 80.0]
            .iter()
            .map(|z| bin(&counting, *z, None, Outcome::z))
            .collect(),
        first_right: share(&counting, Outcome::first_right),
        nulls: nulls.len(),
        false_findings,
        false_findings_on_nulls: ratio(false_findings, nulls.len()),
        named_wrong: ratio(named.iter().filter(|right| !**right).count(), named.len()),
        named: named.len(),
        unknown_recognised: share(&unknown, Outcome::called_unknown),
        unknown: unknown.len(),
        undetermined_recognised: share(&ambiguous, Outcome::called_ambiguous),
        undetermined: ambiguous.len(),
        coverage95: ratio(covered, intervals.len()),
        coverage95_found: ratio(covered, found.len()),
        intervals: found.len(),
        gain_vs_oracle_median: quantile(&gains, 0.5),
        gain_vs_oracle_p10: quantile(&gains, 0.1),
        joint_right: ratio(joints.iter().filter(|right| **right).count(), joints.len()),
        first_three_right: share(&counting, Outcome::first_three_right),
        depends_on_right: ratio(
            called.iter().filter(|o| o.depends_on_right()).count(),
            called.len(),
        ),
        all_named: all_named(&counting),
        calibration,
        calibration_error,
        by_effect: by_effect(&counting),
        tiers: Tier::ALL
            .iter()
            .map(|t| (*t, all.iter().filter(|o| o.truth.tier == *t).count()))
            .collect(),
        seconds_median: quantile(&all.iter().filter_map(|o| o.seconds).collect::<Vec<_>>(), 0.5),
    }
}

fn ratio(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

fn share(cases: &[&Outcome], is: impl Fn(&Outcome) -> bool) -> Option<f64> {
    ratio(cases.iter().filter(|o| is(o)).count(), cases.len())
}

fn quantile(values: &[f64], at: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let place = at * last as f64;
    let (low, high) = (place.floor() as usize, place.ceil() as usize);
    Some(sorted[low] + (sorted[high] - sorted[low]) * (place - low as f64))
}

fn doubling(from: f64, count: i32) -> Vec<f64> {
    (0..count).map(|k| from * 2.0_f64.powi(k)).collect()
}

fn bins(cases: &[&Outcome], edges: &[f64], of: impl Fn(&Outcome) -> f64 + Copy) -> Vec<Bin> {
    let ends = edges.iter().skip(1).copied().map(Some).chain([None]);
    edges.iter().zip(ends).map(|(from, to)| bin(cases, *from, to, of)).collect()
}

fn bin(cases: &[&Outcome], from: f64, to: Option<f64>, of: impl Fn(&Outcome) -> f64) -> Bin {
    let within = |o: &&&Outcome| of(o) >= from && to.is_none_or(|to| of(o) < to);
    let here: Vec<&Outcome> = cases.iter().filter(within).copied().collect();
    Bin {
        from,
        to,
        cases: here.len(),
        first_right: share(&here, Outcome::first_right),
        first_three_right: share(&here, Outcome::first_three_right),
    }
}

/// Whether each claim under `missing_physics` is right, nulls aside.
fn named(all: &[Outcome]) -> Vec<bool> {
    let names = |o: &&Outcome| o.truth.tier != Tier::Null && !o.called_unknown();
    all.iter().filter(names).flat_map(|o| o.claims().iter().map(|claim| o.right(claim))).collect()
}

fn all_named(counting: &[&Outcome]) -> Option<f64> {
    let several = counting.iter().filter(|o| o.truth.tier == Tier::Multiple);
    let mut found = Vec::new();
    for outcome in several {
        for hidden in outcome.truth.hidden.iter().filter(|hidden| hidden.counts()) {
            found.push(outcome.claims().iter().any(|claim| super::right_about(claim, hidden)));
        }
    }
    ratio(found.iter().filter(|named| **named).count(), found.len())
}

fn calibration(all: &[Outcome]) -> (Vec<Calibration>, Option<f64>) {
    let said = |o: &Outcome| {
        let claims = o.claims().iter();
        claims.filter_map(|claim| Some((claim.confidence?, o.right(claim)))).collect::<Vec<_>>()
    };
    let claims: Vec<(f64, bool)> = all.iter().flat_map(said).collect();
    let mut off = 0.0;
    let mut bins = Vec::new();
    for pair in [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.000_001].windows(2) {
        let here: Vec<&(f64, bool)> =
            claims.iter().filter(|(c, _)| *c >= pair[0] && *c < pair[1]).collect();
        let right = ratio(here.iter().filter(|(_, right)| *right).count(), here.len());
        let said = (!here.is_empty())
            .then(|| here.iter().map(|(c, _)| c).sum::<f64>() / here.len() as f64);
        if let (Some(right), Some(said)) = (right, said) {
            off += (right - said).abs() * here.len() as f64;
        }
        bins.push(Calibration {
            from: pair[0],
            to: pair[1].min(1.0),
            claims: here.len(),
            said,
            right,
        });
    }
    let error = (!claims.is_empty()).then(|| off / claims.len() as f64);
    (bins, error)
}

fn by_effect(counting: &[&Outcome]) -> Vec<ByEffect> {
    let mut all: Vec<ByEffect> = Vec::new();
    for outcome in counting.iter().filter(|o| o.truth.hidden.len() == 1) {
        let Some(effect) = outcome.truth.hidden[0].effect else { continue };
        let at = all.iter().position(|known| known.effect == effect).unwrap_or_else(|| {
            all.push(ByEffect { effect, cases: 0, right: 0, instead: Vec::new() });
            all.len() - 1
        });
        let entry = &mut all[at];
        entry.cases += 1;
        if outcome.first_right() {
            entry.right += 1;
            continue;
        }
        let said = match (&outcome.answer, outcome.claims().first()) {
            (None, _) => "no answer".to_owned(),
            (_, Some(first)) if first.named.effect == effect => "another joint".to_owned(),
            (_, Some(first)) => first.named.effect.clone(),
            (Some(answer), None) => format!("{:?}", answer.verdict),
        };
        match entry.instead.iter_mut().find(|(word, _)| *word == said) {
            Some((_, count)) => *count += 1,
            None => entry.instead.push((said, 1)),
        }
    }
    all.sort_by_key(|entry| entry.effect);
    all.iter_mut().for_each(|entry| {
        entry.instead.sort_by_key(|(word, count)| (usize::MAX - count, word.clone()));
    });
    all
}
