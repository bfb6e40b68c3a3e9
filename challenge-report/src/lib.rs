//! The blind challenge for people and programs: random cases, effects added to real recordings, and the score as JSON, text and page.
//!
//! Cases are generated ([`Case::generate`]), their truth is sealed ([`SealedTruth::of`]), a solver answers, the answers are hashed ([`answers_sha256`]), the truth
//! is opened and the answers are scored ([`ScoredChallenge::of`]). No case is dropped because of its answer. Reading order of the modules: `case` (a case of
//! any domain), `prediction` (predictions of a written model for an unseen motion), `truth`, `scored`, `text`, `page`; [`injection`]: effects added to
//! real recordings.
//!
//! Runs no solver, writes no file; the same seed and answers give the same bytes.
//!
//! ```
//! use challenge::case::Tier;
//! use challenge_report::{Case, Domain, ScoredChallenge, SealedTruth, SolverAnswer, answers_sha256};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let cases = vec![Case::generate(Domain::Position, 7, 0, (Tier::Null, 0))];
//! let truth = SealedTruth::of(&cases);
//! let answers = vec![SolverAnswer::default()];
//! let hash = answers_sha256(&answers);
//! truth.open()?;
//! let errors = cases.iter().zip(&answers).map(|(case, a)| case.errors(a.model.as_deref()));
//! let scored = ScoredChallenge::of(7, Domain::Position, truth, &answers, errors.collect());
//! assert_eq!(scored.figures.answers_sha256, hash);
//! assert_eq!(scored.figures.unanswered, 1);
//! # Ok(())
//! # }
//! ```

mod case;
pub mod injection;
mod page;
mod prediction;
mod scored;
mod text;
mod truth;

pub use case::{Case, Domain};
pub use scored::{ScoredChallenge, SolverAnswer, answers_sha256};
pub use truth::{Commitment, SealedTruth};

/// Folder name of case `index` (0-based).
#[must_use]
pub fn case_name(index: usize) -> String {
    format!("{index:05}")
}
