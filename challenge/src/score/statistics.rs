//! Statistics of a challenge: `trued.challenge/1` and additional keys. A statistic over no case is
//! null; all cases have equal weight.

use serde::Serialize;

use super::Outcome;
use crate::case::Tier;
use crate::truth::MIN_SCORED_Z;

/// Cases in a range of z or ρ.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Bin {
    /// Lower bound (inclusive).
    pub from: f64,
    /// Upper bound (exclusive); null: unbounded.
    pub to: Option<f64>,
    /// Number of cases.
    pub cases: usize,
    /// Fraction of cases with the first claim right.
    pub first_right: Option<f64>,
    /// Fraction of cases with the truth among the first three reported effects.
    pub first_three_right: Option<f64>,
}

/// Claims in a range of stated confidence.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ConfidenceBin {
    /// Lower bound (inclusive).
    pub from: f64,
    /// Upper bound (exclusive).
    pub to: f64,
    /// Number of claims.
    pub claims: usize,
    /// Mean stated confidence.
    pub said: Option<f64>,
    /// Fraction of claims that are right.
    pub right: Option<f64>,
}

/// Results of one kind of effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EffectStatistics {
    /// Its name.
    pub effect: &'static str,
    /// Cases in which it is the only hidden effect and is scored.
    pub cases: usize,
    /// Cases with the first claim right.
    pub right: usize,
    /// Effects reported instead, most frequent first.
    pub instead: Vec<(String, usize)>,
}

/// All statistics of a challenge.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ChallengeStatistics {
    /// Seed of all random draws.
    pub seed: u64,
    /// Number of cases.
    pub cases: usize,
    /// Hash of the truth, published before any answer.
    pub sealed_sha256: String,
    /// Hash of the answers, published before the truth was opened.
    pub answers_sha256: String,
    /// Cases without an answer.
    pub unanswered: usize,
    /// Cases that are scored against the acceptance limits.
    pub counting: usize,
    /// Scored cases by effect-to-noise ratio ρ.
    pub by_effect_to_noise: Vec<Bin>,
    /// Scored cases by z.
    pub by_z: Vec<Bin>,
    /// Scored cases with z of at least 20, 40, 80.
    pub first_right_at_z: Vec<Bin>,
    /// Fraction of scored cases with the first claim right.
    pub first_right: Option<f64>,
    /// Number of cases without hidden effects.
    pub nulls: usize,
    /// Cases without hidden effects in which effects were claimed.
    pub false_findings: usize,
    /// Their fraction.
    pub false_findings_on_nulls: Option<f64>,
    /// Fraction of wrong claims among claims under `missing_physics`, without null cases.
    pub named_wrong: Option<f64>,
    /// Number of claims in that fraction.
    pub named: usize,
    /// Fraction of cases with effects outside the dictionary that were reported as unknown
    /// structure.
    pub unknown_recognised: Option<f64>,
    /// Number of cases in that fraction.
    pub unknown: usize,
    /// Fraction of ambiguous cases that were reported as such.
    pub undetermined_recognised: Option<f64>,
    /// Number of cases in that fraction.
    pub undetermined: usize,
    /// Fraction of 95 % intervals that contain the truth; effects not found count as failures.
    pub coverage95: Option<f64>,
    /// The same fraction, only for effects that were found.
    pub coverage95_found: Option<f64>,
    /// Number of parameters that were found.
    pub intervals: usize,
    /// Median improvement of the prediction as a fraction of the oracle's.
    pub gain_vs_oracle_median: Option<f64>,
    /// 10th percentile of the improvement as a fraction of the oracle's.
    pub gain_vs_oracle_p10: Option<f64>,
    /// Fraction of claims with the right joint, given the right kind.
    pub joint_right: Option<f64>,
    /// Fraction of scored cases with the truth among the first three reported effects.
    pub first_three_right: Option<f64>,
    /// Fraction of cases reported as unknown structure with the right covariates.
    pub depends_on_right: Option<f64>,
    /// Fraction of scored cases with several effects in which all were reported.
    pub all_named: Option<f64>,
    /// Claims by stated confidence.
    pub calibration: Vec<ConfidenceBin>,
    /// Mean absolute difference between stated confidence and fraction right.
    pub calibration_error: Option<f64>,
    /// Results by kind of effect.
    pub by_effect: Vec<EffectStatistics>,
    /// Number of cases by tier.
    pub tiers: Vec<(Tier, usize)>,
    /// Median computing time of the solver, s.
    pub seconds_median: Option<f64>,
}

/// Statistics of all outcomes.
#[must_use]
pub fn compute_statistics(
    seed: u64,
    sealed_sha256: &str,
    answers_sha256: &str,
    all: &[Outcome],
) -> ChallengeStatistics {
    let counting: Vec<&Outcome> = all.iter().filter(|o| o.is_scored()).collect();
    let nulls: Vec<&Outcome> = all.iter().filter(|o| o.truth.tier == Tier::Null).collect();
    let false_findings = nulls.iter().filter(|o| o.has_false_finding()).count();
    let named = claim_correctness(all);
    let unknown: Vec<&Outcome> = all.iter().filter(|o| o.is_unknown()).collect();
    let ambiguous: Vec<&Outcome> = all.iter().filter(|o| o.is_ambiguous()).collect();
    let intervals: Vec<Option<bool>> = all.iter().flat_map(Outcome::intervals).collect();
    let found: Vec<bool> = intervals.iter().flatten().copied().collect();
    let covered = found.iter().filter(|held| **held).count();
    let gains: Vec<f64> = counting.iter().filter_map(|o| o.errors?.relative_gain()).collect();
    let joints: Vec<bool> = counting.iter().filter_map(|o| o.is_joint_correct()).collect();
    let called: Vec<&&Outcome> = unknown.iter().filter(|o| o.reported_unknown()).collect();
    let (calibration, calibration_error) = calibration(all);
    ChallengeStatistics {
        seed,
        cases: all.len(),
        sealed_sha256: sealed_sha256.to_owned(),
        answers_sha256: answers_sha256.to_owned(),
        unanswered: all.iter().filter(|o| o.answer.is_none()).count(),
        counting: counting.len(),
        by_effect_to_noise: bins(&counting, &doubling_edges(0.05, 9), Outcome::rho),
        by_z: bins(&counting, &[MIN_SCORED_Z, 20.0, 40.0, 80.0, 160.0], Outcome::z),
        first_right_at_z: [20.0, 40.0, 80.0]
            .iter()
            .map(|z| bin(&counting, *z, None, Outcome::z))
            .collect(),
        first_right: fraction(&counting, Outcome::is_first_correct),
        nulls: nulls.len(),
        false_findings,
        false_findings_on_nulls: ratio(false_findings, nulls.len()),
        named_wrong: ratio(named.iter().filter(|right| !**right).count(), named.len()),
        named: named.len(),
        unknown_recognised: fraction(&unknown, Outcome::reported_unknown),
        unknown: unknown.len(),
        undetermined_recognised: fraction(&ambiguous, Outcome::reported_undetermined),
        undetermined: ambiguous.len(),
        coverage95: ratio(covered, intervals.len()),
        coverage95_found: ratio(covered, found.len()),
        intervals: found.len(),
        gain_vs_oracle_median: quantile(&gains, 0.5),
        gain_vs_oracle_p10: quantile(&gains, 0.1),
        joint_right: ratio(joints.iter().filter(|right| **right).count(), joints.len()),
        first_three_right: fraction(&counting, Outcome::is_among_first_three),
        depends_on_right: ratio(
            called.iter().filter(|o| o.are_covariates_correct()).count(),
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

fn fraction(cases: &[&Outcome], is: impl Fn(&Outcome) -> bool) -> Option<f64> {
    ratio(cases.iter().filter(|o| is(o)).count(), cases.len())
}

fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let place = share * last as f64;
    let (low, high) = (place.floor() as usize, place.ceil() as usize);
    Some(sorted[low] + (sorted[high] - sorted[low]) * (place - low as f64))
}

fn doubling_edges(from: f64, count: i32) -> Vec<f64> {
    (0..count).map(|k| from * 2.0_f64.powi(k)).collect()
}

fn bins(cases: &[&Outcome], edges: &[f64], quantity: impl Fn(&Outcome) -> f64 + Copy) -> Vec<Bin> {
    let ends = edges.iter().skip(1).copied().map(Some).chain([None]);
    edges.iter().zip(ends).map(|(from, to)| bin(cases, *from, to, quantity)).collect()
}

fn bin(cases: &[&Outcome], from: f64, to: Option<f64>, quantity: impl Fn(&Outcome) -> f64) -> Bin {
    let within = |o: &&&Outcome| quantity(o) >= from && to.is_none_or(|to| quantity(o) < to);
    let members: Vec<&Outcome> = cases.iter().filter(within).copied().collect();
    Bin {
        from,
        to,
        cases: members.len(),
        first_right: fraction(&members, Outcome::is_first_correct),
        first_three_right: fraction(&members, Outcome::is_among_first_three),
    }
}

/// Whether each claim under `missing_physics` is right, without null cases.
fn claim_correctness(all: &[Outcome]) -> Vec<bool> {
    let names = |o: &&Outcome| o.truth.tier != Tier::Null && !o.reported_unknown();
    all.iter()
        .filter(names)
        .flat_map(|o| o.claims().iter().map(|claim| o.is_correct(claim)))
        .collect()
}

fn all_named(counting: &[&Outcome]) -> Option<f64> {
    let several = counting.iter().filter(|o| o.truth.tier == Tier::Multiple);
    let mut found = Vec::new();
    for outcome in several {
        for hidden in outcome.truth.hidden.iter().filter(|hidden| hidden.is_scored()) {
            found.push(outcome.claims().iter().any(|claim| super::is_correct_for(claim, hidden)));
        }
    }
    ratio(found.iter().filter(|named| **named).count(), found.len())
}

fn calibration(all: &[Outcome]) -> (Vec<ConfidenceBin>, Option<f64>) {
    let claims_of = |o: &Outcome| {
        let claims = o.claims().iter();
        claims
            .filter_map(|claim| Some((claim.confidence?, o.is_correct(claim))))
            .collect::<Vec<_>>()
    };
    let claims: Vec<(f64, bool)> = all.iter().flat_map(claims_of).collect();
    let mut deviation = 0.0;
    let mut bins = Vec::new();
    for pair in [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.000_001].windows(2) {
        let members: Vec<&(f64, bool)> =
            claims.iter().filter(|(c, _)| *c >= pair[0] && *c < pair[1]).collect();
        let right = ratio(members.iter().filter(|(_, right)| *right).count(), members.len());
        let stated = (!members.is_empty())
            .then(|| members.iter().map(|(c, _)| c).sum::<f64>() / members.len() as f64);
        if let (Some(right), Some(stated)) = (right, stated) {
            deviation += (right - stated).abs() * members.len() as f64;
        }
        bins.push(ConfidenceBin {
            from: pair[0],
            to: pair[1].min(1.0),
            claims: members.len(),
            said: stated,
            right,
        });
    }
    let error = (!claims.is_empty()).then(|| deviation / claims.len() as f64);
    (bins, error)
}

fn by_effect(counting: &[&Outcome]) -> Vec<EffectStatistics> {
    let mut all: Vec<EffectStatistics> = Vec::new();
    for outcome in counting.iter().filter(|o| o.truth.hidden.len() == 1) {
        let Some(effect) = outcome.truth.hidden[0].effect else { continue };
        let index =
            all.iter().position(|modelled| modelled.effect == effect).unwrap_or_else(|| {
                all.push(EffectStatistics { effect, cases: 0, right: 0, instead: Vec::new() });
                all.len() - 1
            });
        let entry = &mut all[index];
        entry.cases += 1;
        if outcome.is_first_correct() {
            entry.right += 1;
            continue;
        }
        let answered = match (&outcome.answer, outcome.claims().first()) {
            (None, _) => "no answer".to_owned(),
            (_, Some(first)) if first.effect.name == effect => "another joint".to_owned(),
            (_, Some(first)) => first.effect.name.clone(),
            (Some(answer), None) => format!("{:?}", answer.verdict),
        };
        match entry.instead.iter_mut().find(|(kind, _)| *kind == answered) {
            Some((_, count)) => *count += 1,
            None => entry.instead.push((answered, 1)),
        }
    }
    all.sort_by_key(|entry| entry.effect);
    all.iter_mut().for_each(|entry| {
        entry.instead.sort_by_key(|(kind, count)| (usize::MAX - count, kind.clone()));
    });
    all
}
