//! The truth of all cases, sealed before the solver answers.

use challenge::commitment::{self, HashMismatch};
use challenge::truth::{self, Truth};
use recording::program;
use serde::Serialize;

use crate::{Case, case_name};

/// The published commitment: `trued.commitment/1`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Commitment<'a> {
    cases: usize,
    sealed_sha256: &'a str,
}

/// Truth of all cases, with its hash.
#[derive(Debug)]
pub struct SealedTruth {
    /// By case.
    pub truths: Vec<Truth>,
    /// SHA-256 of the text, hexadecimal.
    pub sha256: String,
    text: String,
}

impl SealedTruth {
    /// Seals the truth of these cases.
    #[must_use]
    pub fn of(cases: &[Case]) -> Self {
        let named = cases.iter().enumerate();
        let truths: Vec<Truth> = named.map(|(index, case)| case.truth(&case_name(index))).collect();
        let text = truth::to_json(&truths);
        Self { sha256: commitment::sha256(&text), text, truths }
    }

    /// The commitment as JSON, to be published before the answers.
    ///
    /// # Errors
    /// Serialisation failed (internal error).
    pub fn commitment(&self) -> Result<String, serde_json::Error> {
        let commitment = Commitment { cases: self.truths.len(), sealed_sha256: &self.sha256 };
        Ok(program::json("trued.commitment/1", &commitment)? + "\n")
    }

    /// The text, if it matches its hash.
    ///
    /// # Errors
    /// The text does not match the hash.
    pub fn open(&self) -> Result<&str, HashMismatch> {
        commitment::verify(&self.text, &self.sha256)
    }
}
