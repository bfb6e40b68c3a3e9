//! The score of answers against the truth (docs/diagnosis.md, "How success is counted", and the end of `effects.md`).
//!
//! A finding is right if it is a hidden effect (or an equivalent effect of the same family), or a candidate that is indistinguishable from it, with
//! the truth among its alternatives. A case is scored against the acceptance limits if a hidden effect has z of at least 8 and an expected gain of at
//! least 5 over every alternative.
//!
//! A missing answer counts as wrong; no case is excluded.

mod figures;

pub use figures::{Bin, Calibration, Figures, figures};

use crate::answer::{Answer, Finding, Named, Verdict};
use crate::case::Tier;
use crate::truth::{Hidden, LEAST_Z, Truth};

/// Prediction errors on the unseen motion, m or rad (torques: Nm or N; forces: N).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Errors {
    /// Of the nominal model.
    pub before: f64,
    /// Of the model written by the solver.
    pub after: f64,
    /// Of the oracle: the true form with fitted parameters.
    pub oracle: f64,
}

impl Errors {
    /// Improvement as a fraction of the oracle's; `None` if the oracle improves by less than one percent.
    #[must_use]
    pub fn share(&self) -> Option<f64> {
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
    pub errors: Option<Errors>,
    /// Computing time of the solver, s.
    pub seconds: Option<f64>,
}

/// Summary of one case: hidden effects, answer, score.
#[derive(Clone, Debug, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Line {
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

fn words(effect: &str, joint: Option<usize>) -> String {
    joint.map_or_else(|| effect.to_owned(), |joint| format!("{effect} {joint}"))
}

fn is(named: &Named, name: &(&'static str, Option<usize>)) -> bool {
    named.effect == name.0 && named.joint == name.1
}

/// Whether a reported effect is this hidden effect or an equivalent one.
fn hits(named: &Named, hidden: &Hidden) -> bool {
    hidden.name().is_some_and(|name| is(named, &name))
        || hidden.judged.same.iter().any(|name| is(named, name))
}

/// Whether a finding is right about this hidden effect.
fn right_about(finding: &Finding, hidden: &Hidden) -> bool {
    let rival = hidden.judged.rivals.iter().any(|name| is(&finding.named, name));
    hits(&finding.named, hidden)
        || rival && finding.alternatives.iter().any(|named| hits(named, hidden))
}

impl Outcome {
    /// Summary of the case.
    #[must_use]
    pub fn line(&self) -> Line {
        let mut hidden: Vec<&Hidden> = self.truth.hidden.iter().collect();
        hidden.sort_by(|a, b| b.judged.z.total_cmp(&a.judged.z));
        let said = self.answer.iter().flat_map(|answer| &answer.findings);
        let strongest = hidden.first().map_or(0.0, |hidden| hidden.judged.z);
        Line {
            case: self.truth.case.clone(),
            tier: self.truth.tier,
            hidden: hidden.iter().map(|h| words(h.effect.unwrap_or(&h.law), h.joint)).collect(),
            counts: self.counts(),
            z: if self.counts() { self.z() } else { strongest },
            verdict: self.answer.as_ref().map(|answer| answer.verdict),
            said: said.map(|finding| words(&finding.named.effect, finding.named.joint)).collect(),
            first_right: self.first_right(),
            gain: self.errors.and_then(|errors| errors.share()),
            seconds: self.seconds,
        }
    }

    /// Whether a finding is right about any hidden effect.
    #[must_use]
    pub fn right(&self, finding: &Finding) -> bool {
        self.truth.hidden.iter().any(|hidden| right_about(finding, hidden))
    }

    /// The findings that count as claims.
    #[must_use]
    pub fn claims(&self) -> &[Finding] {
        match &self.answer {
            Some(answer) if answer.verdict.claims() => &answer.findings,
            _ => &[],
        }
    }

    /// Whether the case is scored against the acceptance limits.
    #[must_use]
    pub fn counts(&self) -> bool {
        self.truth.hidden.iter().any(Hidden::counts)
    }

    /// Largest z of the scored hidden effects; zero if none is scored.
    #[must_use]
    pub fn z(&self) -> f64 {
        let counting = self.truth.hidden.iter().filter(|hidden| hidden.counts());
        counting.map(|hidden| hidden.judged.z).fold(0.0, f64::max)
    }

    /// Largest effect-to-noise ratio ρ of the scored hidden effects.
    #[must_use]
    pub fn rho(&self) -> f64 {
        let counting = self.truth.hidden.iter().filter(|hidden| hidden.counts());
        counting.map(|hidden| hidden.judged.rho).fold(0.0, f64::max)
    }

    /// Whether the first claim is right.
    #[must_use]
    pub fn first_right(&self) -> bool {
        self.claims().first().is_some_and(|finding| self.right(finding))
    }

    /// Whether a hidden effect is among the first three reported effects (findings first, then their alternatives).
    #[must_use]
    pub fn first_three_right(&self) -> bool {
        let Some(answer) = &self.answer else { return false };
        let mut names = answer.names().take(3);
        names.any(|named| self.truth.hidden.iter().any(|hidden| hits(named, hidden)))
    }

    /// Whether the first claim reports the right joint; `None` unless its kind is right.
    #[must_use]
    pub fn joint_right(&self) -> Option<bool> {
        let first = self.claims().first()?;
        let of_kind = |hidden: &&Hidden| {
            let own = hidden.effect.is_some_and(|effect| effect == first.named.effect);
            own || hidden.judged.same.iter().any(|(effect, _)| *effect == first.named.effect)
        };
        let hidden: Vec<&Hidden> = self.truth.hidden.iter().filter(of_kind).collect();
        (!hidden.is_empty()).then(|| hidden.iter().any(|hidden| right_about(first, hidden)))
    }

    /// Whether effects were claimed in a case without hidden effects.
    #[must_use]
    pub fn false_finding(&self) -> bool {
        self.truth.tier == Tier::Null
            && self.answer.as_ref().is_some_and(|answer| answer.verdict.claims())
    }

    /// Whether an effect outside the dictionary leaves a detectable residual after every candidate.
    #[must_use]
    pub fn is_unknown(&self) -> bool {
        self.truth.tier == Tier::Outside
            && self.truth.hidden.iter().any(|hidden| hidden.judged.unexplained_z >= LEAST_Z)
    }

    /// Whether the verdict is unknown structure.
    #[must_use]
    pub fn called_unknown(&self) -> bool {
        self.answer.as_ref().is_some_and(|answer| answer.verdict == Verdict::UnknownStructure)
    }

    /// Whether the covariates were reported: all true ones, and at most as many others.
    #[must_use]
    pub fn depends_on_right(&self) -> bool {
        let Some(answer) = &self.answer else { return false };
        let wanted = &self.truth.depends_on;
        wanted.iter().all(|word| answer.depends_on.contains(word))
            && answer.depends_on.len() <= 2 * wanted.len()
    }

    /// Whether a detectable effect cannot be distinguished from an alternative.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        let alike =
            |hidden: &Hidden| hidden.judged.z >= LEAST_Z && !hidden.judged.rivals.is_empty();
        self.truth.tier != Tier::Multiple && self.truth.hidden.iter().any(alike)
    }

    /// Whether the ambiguity was reported: verdict undetermined, or the truth and an alternative in one finding.
    #[must_use]
    pub fn called_ambiguous(&self) -> bool {
        let Some(answer) = &self.answer else { return false };
        let set = |finding: &Finding, hidden: &Hidden| {
            let all: Vec<&Named> =
                std::iter::once(&finding.named).chain(&finding.alternatives).collect();
            let truth = all.iter().any(|named| hits(named, hidden));
            truth && all.iter().any(|named| hidden.judged.rivals.iter().any(|name| is(named, name)))
        };
        answer.verdict == Verdict::Undetermined
            || answer.findings.iter().any(|f| self.truth.hidden.iter().any(|hidden| set(f, hidden)))
    }

    /// For every scored parameter: whether its interval contains the truth; `None` if the effect was not found.
    #[must_use]
    pub fn intervals(&self) -> Vec<Option<bool>> {
        let mut all = Vec::new();
        for hidden in self.truth.hidden.iter().filter(|hidden| hidden.counts()) {
            let finding = self.claims().iter().find(|finding| hits(&finding.named, hidden));
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
    let number = finding.numbers.iter().find(|n| n.key == key && n.place == place)?;
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
