//! The score of answers against the truth (docs/diagnosis.md, "How success is counted", and the end of `effects.md`).
//!
//! A finding is right if it is a hidden effect (or its other name in one family); or a candidate that cannot be distinguished from it, with the truth among
//! its alternatives. A case counts towards a bar where a hidden effect has z of at least 8 and an expected gain of at least 5 over every rival.
//!
//! Promises: an answer that is missing counts as wrong. Never: a case left out because it went badly.

mod figures;

pub use figures::{Bin, Calibration, Figures, figures};

use crate::answer::{Answer, Finding, Named, Verdict};
use crate::case::Tier;
use crate::truth::{Hidden, LEAST_Z, Truth};

/// Errors on the motion that nobody saw, m or rad.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Errors {
    /// Of the model as given.
    pub before: f64,
    /// Of the model that the solver wrote.
    pub after: f64,
    /// Of the true form with its numbers fitted.
    pub oracle: f64,
}

impl Errors {
    /// Share of the oracle's gain; none where the oracle gains nothing worth a share.
    #[must_use]
    pub fn share(&self) -> Option<f64> {
        let most = self.before - self.oracle;
        (most > 0.01 * self.before).then(|| (self.before - self.after) / most)
    }
}

/// What came of one case.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What was hidden.
    pub truth: Truth,
    /// What was answered; none where there was no answer.
    pub answer: Option<Answer>,
    /// What the written model is worth, where it was asked.
    pub errors: Option<Errors>,
    /// How long the solver took, s.
    pub seconds: Option<f64>,
}

/// One case in a line: what was hidden, what was said, how it went.
#[derive(Clone, Debug, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Line {
    /// Its folder's name.
    pub case: String,
    /// What it asked.
    pub tier: Tier,
    /// What was hidden, strongest first.
    pub hidden: Vec<String>,
    /// Whether it counts towards a bar.
    pub counts: bool,
    /// Of the strongest that counts; of the strongest where none does.
    pub z: f64,
    /// The verdict; none without an answer.
    pub verdict: Option<Verdict>,
    /// What was found, in its order.
    pub said: Vec<String>,
    /// Whether the first claim is right.
    pub first_right: bool,
    /// Share of the oracle's gain.
    pub gain: Option<f64>,
    /// How long it took, s.
    pub seconds: Option<f64>,
}

fn words(effect: &str, joint: Option<usize>) -> String {
    joint.map_or_else(|| effect.to_owned(), |joint| format!("{effect} {joint}"))
}

fn is(named: &Named, name: &(&'static str, Option<usize>)) -> bool {
    named.effect == name.0 && named.joint == name.1
}

/// Whether a name is this hidden effect.
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
    /// The case in a line.
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

    /// Whether a finding is right about anything that is hidden.
    #[must_use]
    pub fn right(&self, finding: &Finding) -> bool {
        self.truth.hidden.iter().any(|hidden| right_about(finding, hidden))
    }

    /// The findings that are claims.
    #[must_use]
    pub fn claims(&self) -> &[Finding] {
        match &self.answer {
            Some(answer) if answer.verdict.claims() => &answer.findings,
            _ => &[],
        }
    }

    /// Whether the case counts towards a bar.
    #[must_use]
    pub fn counts(&self) -> bool {
        self.truth.hidden.iter().any(Hidden::counts)
    }

    /// Its z: the largest of what is hidden and counts.
    #[must_use]
    pub fn z(&self) -> f64 {
        let counting = self.truth.hidden.iter().filter(|hidden| hidden.counts());
        counting.map(|hidden| hidden.judged.z).fold(0.0, f64::max)
    }

    /// Its ρ, of the same.
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

    /// Whether the truth stands among the first three names of the answer, findings first, then their rivals.
    #[must_use]
    pub fn first_three_right(&self) -> bool {
        let Some(answer) = &self.answer else { return false };
        let mut names = answer.names().take(3);
        names.any(|named| self.truth.hidden.iter().any(|hidden| hits(named, hidden)))
    }

    /// Where the first claim names the right effect: whether its joint is right too.
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

    /// Whether a null was answered with physics that is not there.
    #[must_use]
    pub fn false_finding(&self) -> bool {
        self.truth.tier == Tier::Null
            && self.answer.as_ref().is_some_and(|answer| answer.verdict.claims())
    }

    /// Whether physics outside the library shows so much that no library effect explains it.
    #[must_use]
    pub fn is_unknown(&self) -> bool {
        self.truth.tier == Tier::Outside
            && self.truth.hidden.iter().any(|hidden| hidden.judged.unexplained_z >= LEAST_Z)
    }

    /// Whether it was called unknown.
    #[must_use]
    pub fn called_unknown(&self) -> bool {
        self.answer.as_ref().is_some_and(|answer| answer.verdict == Verdict::UnknownStructure)
    }

    /// Whether what it follows was told: every true word, and at most as many others.
    #[must_use]
    pub fn depends_on_right(&self) -> bool {
        let Some(answer) = &self.answer else { return false };
        let wanted = &self.truth.depends_on;
        wanted.iter().all(|word| answer.depends_on.contains(word))
            && answer.depends_on.len() <= 2 * wanted.len()
    }

    /// Whether the case cannot be decided though something shows.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        let alike =
            |hidden: &Hidden| hidden.judged.z >= LEAST_Z && !hidden.judged.rivals.is_empty();
        self.truth.tier != Tier::Multiple && self.truth.hidden.iter().any(alike)
    }

    /// Whether that was said: undetermined, or the truth and a rival of it in one set.
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

    /// For every counted number of what counts: whether its interval holds it; none where it was not found.
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

/// Whether a finding's interval of a number holds the truth; a phase may be told by any of its turns.
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
