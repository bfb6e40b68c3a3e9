//! The blind challenge for people and programs: random cases, effects added to real recordings, and the score as JSON, text and page.
//!
//! A challenge is drawn ([`Case::draw`]), its truth is sealed ([`SealedTruth::of`]), a solver answers, the answers are hashed ([`answers_sha256`]), the truth is
//! opened and the answers are scored ([`Scored::of`]). No case is dropped because of its answer. Modules in the order in which to read them: `case` (a
//! case of any domain), `prediction` (what a written model says of a motion that nobody saw), `truth`, `scored`, `text`, `page`; [`injection`]: effects added to
//! real recordings.
//!
//! Runs no solver, writes no file; the same seed and answers give the same bytes.
//!
//! ```
//! use challenge::case::Tier;
//! use challenge_report::{Case, Domain, Scored, SealedTruth, SolverAnswer, answers_sha256};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let cases = vec![Case::draw(Domain::Position, 7, 0, (Tier::Null, 0))];
//! let truth = SealedTruth::of(&cases);
//! let answers = vec![SolverAnswer::default()];
//! let hash = answers_sha256(&answers);
//! truth.open()?;
//! let errors = cases.iter().zip(&answers).map(|(case, a)| case.errors(a.model.as_deref()));
//! let scored = Scored::of(7, Domain::Position, truth, &answers, errors.collect());
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
pub use scored::{Scored, SolverAnswer, answers_sha256};
pub use truth::{Commitment, SealedTruth};

/// Name of a case's folder, by its place from 0.
#[must_use]
pub fn case_name(index: usize) -> String {
    format!("{index:05}")
}
