//! Statements of a result as text: an emphasised head, and what follows it.

use std::fmt;

use crate::page::Tone;

/// A statement in one or several lines. A terminal may colour the head by its tone ([`Tone::Plain`]: bold); as text it is head and rest.
///
/// ```
/// use report::{TextLine, Tone};
///
/// let line = TextLine::with_head(Tone::Good, "the model still holds", "; 10 poses");
/// assert_eq!(line.to_string(), "the model still holds; 10 poses");
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TextLine {
    /// How the head is meant.
    pub tone: Tone,
    /// What is emphasised; may be empty.
    pub head: String,
    /// What follows, with its own space or punctuation.
    pub rest: String,
}

impl TextLine {
    /// A statement that begins with an emphasised head.
    #[must_use]
    pub fn with_head(tone: Tone, head: impl Into<String>, rest: impl Into<String>) -> Self {
        Self { tone, head: head.into(), rest: rest.into() }
    }
}

impl From<String> for TextLine {
    fn from(rest: String) -> Self {
        Self::with_head(Tone::Plain, "", rest)
    }
}

impl From<&str> for TextLine {
    fn from(rest: &str) -> Self {
        rest.to_owned().into()
    }
}

impl fmt::Display for TextLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.head, self.rest)
    }
}
