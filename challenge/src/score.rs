//! The score of answers against the truth (docs/diagnosis.md, "How success is counted", and the end of `effects.md`).
//!
//! A finding is right if it is a hidden effect (or an equivalent effect of the same family), or a candidate that is indistinguishable from it, with
//! the truth among its alternatives. A case is scored against the acceptance limits if a hidden effect has z of at least 8 and an expected gain of at
//! least 5 over every alternative.
//!
//! A missing answer counts as wrong; no case is excluded.

mod statistics;

pub use statistics::{Bin, ChallengeStatistics, ConfidenceBin, compute_statistics};

use crate::answer::{Answer, Finding, ReportedEffect, Verdict};
use crate::case::Tier;
use crate::truth::{HiddenEffect, MIN_SCORED_Z, Truth};

/// Prediction errors on the unseen motion, m or rad (torques: Nm or N; forces: N).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PredictionErrors {
    /// Of the nominal model.
    pub before: f64,
    /// Of the model written by the solver.
    pub after: f64,
    /// Of the oracle: the true form with fitted parameters.
    pub oracle: f64,
}

impl PredictionErrors {
    /// Improvement as a fraction of the oracle's; `None` if the oracle improves by less than one percent.
    #[must_use]
    pub fn relative_gain(&self) -> Option<f64> {
        let most = self.before - self.oracle;
        (most > 0.01 * self.before).then(|| (self.before - self.after) / most)
    }
}

/// Result of one case.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The hidden truth.
    pub truth: Truth,
    /// The answer, if any.
    pub answer: Option<Answer>,
    /// Prediction errors of the written model, if evaluated.
    pub errors: Option<PredictionErrors>,
    /// Computing time of the solver, s.
    pub seconds: Option<f64>,
}

/// Summary of one case: hidden effects, answer, score.
#[derive(Clone, Debug, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CaseSummary {
    /// Name of the case's folder.
    pub case: String,
    /// Tier of the case.
    pub tier: Tier,
    /// Hidden effects, largest z first.
    pub hidden: Vec<String>,
    /// Whether the case is scored against the acceptance limits.
    pub counts: bool,
    /// Largest z among the scored effects; among all hidden effects if none is scored.
    pub z: f64,
    /// The verdict; null without an answer.
    pub verdict: Option<Verdict>,
    /// Reported effects, in the order of the answer.
    pub said: Vec<String>,
    /// Whether the first claim is right.
    pub first_right: bool,
    /// Improvement of the prediction as a fraction of the oracle's.
    pub gain: Option<f64>,
    /// Computing time of the solver, s.
    pub seconds: Option<f64>,
}

fn effect_label(effect: &str, joint: Option<usize>) -> String {
    joint.map_or_else(|| effect.to_owned(), |joint| format!("{effect} {joint}"))
}

fn is_same_effect(named: &ReportedEffect, name: &(&'static str, Option<usize>)) -> bool {
    named.name == name.0 && named.joint == name.1
}

/// Whether a reported effect is this hidden effect or an equivalent one.
fn matches_hidden(named: &ReportedEffect, hidden: &HiddenEffect) -> bool {
    hidden.effect_name().is_some_and(|name| is_same_effect(named, &name))
        || hidden.detectability.same.iter().any(|name| is_same_effect(named, name))
}

/// Whether a finding is right about this hidden effect.
fn is_correct_for(finding: &Finding, hidden: &HiddenEffect) -> bool {
    let rival =
        hidden.detectability.rivals.iter().any(|name| is_same_effect(&finding.effect, name));
    matches_hidden(&finding.effect, hidden)
        || rival && finding.alternatives.iter().any(|named| matches_hidden(named, hidden))
}

impl Outcome {
    /// Summary of the case.
    #[must_use]
    pub fn summary(&self) -> CaseSummary {
        let mut hidden: Vec<&HiddenEffect> = self.truth.hidden.iter().collect();
        hidden.sort_by(|a, b| b.detectability.z.total_cmp(&a.detectability.z));
        let findings = self.answer.iter().flat_map(|answer| &answer.findings);
        let strongest = hidden.first().map_or(0.0, |hidden| hidden.detectability.z);
        CaseSummary {
            case: self.truth.case.clone(),
            tier: self.truth.tier,
            hidden: hidden
                .iter()
                .map(|h| effect_label(h.effect.unwrap_or(&h.law), h.joint))
                .collect(),
            counts: self.is_scored(),
            z: if self.is_scored() { self.z() } else { strongest },
            verdict: self.answer.as_ref().map(|answer| answer.verdict),
            said: findings
                .map(|finding| effect_label(&finding.effect.name, finding.effect.joint))
                .collect(),
            first_right: self.is_first_correct(),
            gain: self.errors.and_then(|errors| errors.relative_gain()),
            seconds: self.seconds,
        }
    }

    /// Whether a finding is right about any hidden effect.
    #[must_use]
    pub fn is_correct(&self, finding: &Finding) -> bool {
        self.truth.hidden.iter().any(|hidden| is_correct_for(finding, hidden))
    }

    /// The findings that count as claims.
    #[must_use]
    pub fn claims(&self) -> &[Finding] {
        match &self.answer {
            Some(answer) if answer.verdict.makes_claims() => &answer.findings,
            _ => &[],
        }
    }

    /// Whether the case is scored against the acceptance limits.
    #[must_use]
    pub fn is_scored(&self) -> bool {
        self.truth.hidden.iter().any(HiddenEffect::is_scored)
    }

    /// Largest z of the scored hidden effects; zero if none is scored.
    #[must_use]
    pub fn z(&self) -> f64 {
        let counting = self.truth.hidden.iter().filter(|hidden| hidden.is_scored());
        counting.map(|hidden| hidden.detectability.z).fold(0.0, f64::max)
    }

    /// Largest effect-to-noise ratio ρ of the scored hidden effects.
    #[must_use]
    pub fn rho(&self) -> f64 {
        let counting = self.truth.hidden.iter().filter(|hidden| hidden.is_scored());
        counting.map(|hidden| hidden.detectability.rho).fold(0.0, f64::max)
    }

    /// Whether the first claim is right.
    #[must_use]
    pub fn is_first_correct(&self) -> bool {
        self.claims().first().is_some_and(|finding| self.is_correct(finding))
    }

    /// Whether a hidden effect is among the first three reported effects (findings first, then their alternatives).
    #[must_use]
    pub fn is_among_first_three(&self) -> bool {
        let Some(answer) = &self.answer else { return false };
        let mut names = answer.reported_effects().take(3);
        names.any(|named| self.truth.hidden.iter().any(|hidden| matches_hidden(named, hidden)))
    }

    /// Whether the first claim reports the right joint; `None` unless its kind is right.
    #[must_use]
    pub fn is_joint_correct(&self) -> Option<bool> {
        let first = self.claims().first()?;
        let of_kind = |hidden: &&HiddenEffect| {
            let is_own_name = hidden.effect.is_some_and(|effect| effect == first.effect.name);
            is_own_name
                || hidden.detectability.same.iter().any(|(effect, _)| *effect == first.effect.name)
        };
        let hidden: Vec<&HiddenEffect> = self.truth.hidden.iter().filter(of_kind).collect();
        (!hidden.is_empty()).then(|| hidden.iter().any(|hidden| is_correct_for(first, hidden)))
    }

    /// Whether effects were claimed in a case without hidden effects.
    #[must_use]
    pub fn has_false_finding(&self) -> bool {
        self.truth.tier == Tier::Null
            && self.answer.as_ref().is_some_and(|answer| answer.verdict.makes_claims())
    }

    /// Whether an effect outside the dictionary leaves a detectable residual after every candidate.
    #[must_use]
    pub fn is_unknown(&self) -> bool {
        self.truth.tier == Tier::Outside
            && self
                .truth
                .hidden
                .iter()
                .any(|hidden| hidden.detectability.unexplained_z >= MIN_SCORED_Z)
    }

    /// Whether the verdict is unknown structure.
    #[must_use]
    pub fn reported_unknown(&self) -> bool {
        self.answer.as_ref().is_some_and(|answer| answer.verdict == Verdict::UnknownStructure)
    }

    /// Whether the covariates were reported: all true ones, and at most as many others.
    #[must_use]
    pub fn are_covariates_correct(&self) -> bool {
        let Some(answer) = &self.answer else { return false };
        let wanted = &self.truth.depends_on;
        wanted.iter().all(|covariate| answer.depends_on.contains(covariate))
            && answer.depends_on.len() <= 2 * wanted.len()
    }

    /// Whether a detectable effect cannot be distinguished from an alternative.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        let has_rivals = |hidden: &HiddenEffect| {
            hidden.detectability.z >= MIN_SCORED_Z && !hidden.detectability.rivals.is_empty()
        };
        self.truth.tier != Tier::Multiple && self.truth.hidden.iter().any(has_rivals)
    }

    /// Whether the ambiguity was reported: verdict undetermined, or the truth and an alternative in one finding.
    #[must_use]
    pub fn reported_undetermined(&self) -> bool {
        let Some(answer) = &self.answer else { return false };
        let set = |finding: &Finding, hidden: &HiddenEffect| {
            let all: Vec<&ReportedEffect> =
                std::iter::once(&finding.effect).chain(&finding.alternatives).collect();
            let truth = all.iter().any(|named| matches_hidden(named, hidden));
            truth
                && all.iter().any(|named| {
                    hidden.detectability.rivals.iter().any(|name| is_same_effect(named, name))
                })
        };
        answer.verdict == Verdict::Undetermined
            || answer.findings.iter().any(|f| self.truth.hidden.iter().any(|hidden| set(f, hidden)))
    }

    /// For every scored parameter: whether its interval contains the truth; `None` if the effect was not found.
    #[must_use]
    pub fn intervals(&self) -> Vec<Option<bool>> {
        let mut all = Vec::new();
        for hidden in self.truth.hidden.iter().filter(|hidden| hidden.is_scored()) {
            let finding =
                self.claims().iter().find(|finding| matches_hidden(&finding.effect, hidden));
            for (key, place) in &hidden.counted {
                let truth = hidden.parameters.get(key).and_then(|list| list.get(*place));
                all.push(
                    finding
                        .zip(truth)
                        .and_then(|(finding, truth)| covers(finding, key, *place, *truth)),
                );
            }
        }
        all
    }
}

/// Whether a finding's interval of a parameter contains the truth; phases are compared modulo full turns.
fn covers(finding: &Finding, key: &str, place: usize, truth: f64) -> Option<bool> {
    let number = finding.parameters.iter().find(|n| n.key == key && n.index == place)?;
    let (low, high) = number.ci95?;
    let turn = std::f64::consts::TAU;
    let truth = if key == "phase_rad" {
        truth + turn * ((number.value - truth) / turn).round()
    } else {
        truth
    };
    Some(low <= truth && truth <= high)
}

#[cfg(test)]
mod tests;
