//! The score of a challenge.

use challenge::answer::Answer;
use challenge::score::{Errors, Figures, Line, Outcome, figures};
use challenge::seal;

use crate::{Domain, SealedTruth, case_name};

/// What a solver gave for a case.
#[derive(Debug, Default)]
pub struct SolverAnswer {
    /// Text of `diagnosis.json`; none where it gave none.
    pub diagnosis: Option<String>,
    /// Text of the written model; none where it wrote none.
    pub model: Option<String>,
    /// How long it took, s; none where it did not end by itself.
    pub seconds: Option<f64>,
}

/// SHA-256 of all answers, hexadecimal: what was reported and what was written, case by case.
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
    seal::sha256(&text)
}

/// A scored challenge: `trued.challenge/1` are its [`figures`](Self::figures).
#[derive(Debug)]
pub struct Scored {
    /// All figures.
    pub figures: Figures,
    /// Truth and answer, case by case.
    pub outcomes: Vec<Outcome>,
}

impl Scored {
    /// The score of the answers to the cases of a seed; `errors` of the written models ([`Case::errors`](crate::Case::errors)).
    #[must_use]
    pub fn of(
        seed: u64,
        domain: Domain,
        truth: SealedTruth,
        answers: &[SolverAnswer],
        errors: Vec<Option<Errors>>,
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
        let figures = figures(seed, &sha256, &answers_sha256, &outcomes);
        Self { figures, outcomes }
    }

    /// Truth and answer of each case as JSON.
    ///
    /// # Errors
    /// They cannot be written as JSON: a fault of this program.
    pub fn outcomes_json(&self) -> Result<String, serde_json::Error> {
        let lines: Vec<Line> = self.outcomes.iter().map(Outcome::line).collect();
        Ok(serde_json::to_string_pretty(&lines)? + "\n")
    }
}

/// The answer as far as it is valid.
fn parsed(answer: &SolverAnswer, domain: Domain) -> Option<Answer> {
    let text = answer.diagnosis.as_deref()?;
    Answer::parse(text, domain.name()).ok()
}
