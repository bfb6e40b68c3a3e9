//! The score of a challenge.

use challenge::answer::Answer;
use challenge::commitment;
use challenge::score::{
    CaseSummary, ChallengeStatistics, Outcome, PredictionErrors, compute_statistics,
};

use crate::{Domain, SealedTruth, case_name};

/// Output of a solver for a case.
#[derive(Debug, Default)]
pub struct SolverAnswer {
    /// Text of `diagnosis.json`, if any.
    pub diagnosis: Option<String>,
    /// Text of the written model, if any.
    pub model: Option<String>,
    /// Computing time, s; `None` if the solver was stopped.
    pub seconds: Option<f64>,
}

/// SHA-256 of all answers, hexadecimal: reports and written models, case by case.
///
/// ```
/// use challenge_report::{SolverAnswer, answers_sha256};
///
/// let answered = SolverAnswer { diagnosis: Some("{}".to_owned()), ..SolverAnswer::default() };
/// assert_ne!(answers_sha256(&[answered]), answers_sha256(&[SolverAnswer::default()]));
/// ```
#[must_use]
pub fn answers_sha256(answers: &[SolverAnswer]) -> String {
    let mut text = String::new();
    for (index, answer) in answers.iter().enumerate() {
        for part in [Some(&case_name(index)), answer.diagnosis.as_ref(), answer.model.as_ref()] {
            text += part.map_or("", String::as_str);
            text.push('\n');
        }
    }
    commitment::sha256(&text)
}

/// A scored challenge: `trued.challenge/1` are its [`figures`](Self::figures).
#[derive(Debug)]
pub struct ScoredChallenge {
    /// All figures.
    pub figures: ChallengeStatistics,
    /// Truth and answer, case by case.
    pub outcomes: Vec<Outcome>,
}

impl ScoredChallenge {
    /// The score of the answers to the cases of a seed; `errors` of the written models ([`Case::errors`](crate::Case::errors)).
    #[must_use]
    pub fn of(
        seed: u64,
        domain: Domain,
        truth: SealedTruth,
        answers: &[SolverAnswer],
        errors: Vec<Option<PredictionErrors>>,
    ) -> Self {
        let answers_sha256 = answers_sha256(answers);
        let SealedTruth { truths, sha256, .. } = truth;
        let outcomes: Vec<Outcome> = truths
            .into_iter()
            .zip(answers.iter().zip(errors))
            .map(|(truth, (answer, errors))| Outcome {
                truth,
                answer: parsed(answer, domain),
                errors,
                seconds: answer.seconds,
            })
            .collect();
        let figures = compute_statistics(seed, &sha256, &answers_sha256, &outcomes);
        Self { figures, outcomes }
    }

    /// Truth and answer of each case as JSON.
    ///
    /// # Errors
    /// Serialisation failed (internal error).
    pub fn outcomes_json(&self) -> Result<String, serde_json::Error> {
        let lines: Vec<CaseSummary> = self.outcomes.iter().map(Outcome::summary).collect();
        Ok(serde_json::to_string_pretty(&lines)? + "\n")
    }
}

/// The parsed answer, if valid.
fn parsed(answer: &SolverAnswer, domain: Domain) -> Option<Answer> {
    let text = answer.diagnosis.as_deref()?;
    Answer::parse(text, domain.name()).ok()
}
