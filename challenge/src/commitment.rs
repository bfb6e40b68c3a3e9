//! Commitment: the hash of a text is published first, the text later.
//!
//! Invariant: a text changed by one byte does not match its hash. This provides no secrecy; the text must be stored elsewhere until it is opened.

use sha2::{Digest, Sha256};

/// SHA-256 of a text, in hexadecimal.
#[must_use]
pub fn sha256(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A text that does not match its seal.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the text does not fit its seal: its SHA-256 is {found}, sealed was {sealed}")]
pub struct HashMismatch {
    /// The published hash.
    pub sealed: String,
    /// The hash of the opened text.
    pub found: String,
}

/// Verifies a sealed text against its published hash.
///
/// # Errors
/// The text does not match the hash.
pub fn verify<'t>(text: &'t str, sealed: &str) -> Result<&'t str, HashMismatch> {
    let found = sha256(text);
    if found == sealed { Ok(text) } else { Err(HashMismatch { sealed: sealed.to_owned(), found }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_the_standards() {
        // FIPS 180-2, appendix B.1.
        let known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256("abc"), known);
    }

    #[test]
    fn a_truth_that_was_changed_does_not_open() {
        let truth = "{\"effect\": \"backlash\", \"joint\": 3}";
        let sealed = sha256(truth);
        assert_eq!(verify(truth, &sealed), Ok(truth));
        assert!(verify(&truth.replace('3', "4"), &sealed).is_err());
    }
}
