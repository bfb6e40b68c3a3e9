//! Keys on the bus: `trued/GROUP/CELL/…`.

use crate::message::Kind;

/// What all keys begin with.
pub const ROOT: &str = "trued";

/// Why a name cannot be part of a key.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what} `{name}`: expected 1 to 64 letters, digits, `-`, `_` or `.`")]
pub struct NotAName {
    what: &'static str,
    name: String,
}

/// Keys of one cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keys {
    /// Group of cells.
    pub group: String,
    /// The cell.
    pub cell: String,
}

impl Keys {
    /// The keys of `cell` in `group`.
    ///
    /// # Errors
    /// [`NotAName`] where a name holds what separates or matches keys.
    pub fn new(group: &str, cell: &str) -> Result<Self, NotAName> {
        check("group", group)?;
        check("cell", cell)?;
        Ok(Self { group: group.to_owned(), cell: cell.to_owned() })
    }

    fn key(&self, last: &str) -> String {
        format!("{ROOT}/{}/{}/{last}", self.group, self.cell)
    }

    /// Where messages of a kind are sent, and the last one is answered.
    #[must_use]
    pub fn of(&self, kind: Kind) -> String {
        self.key(kind.word())
    }

    /// Where kept messages are requested.
    #[must_use]
    pub fn history(&self) -> String {
        self.key("history")
    }

    /// Where models are offered.
    #[must_use]
    pub fn offer(&self) -> String {
        self.key("offer")
    }

    /// The token that is there while the bridge is.
    #[must_use]
    pub fn alive(&self) -> String {
        self.key("alive")
    }
}

/// Checks a name that becomes part of a key.
///
/// # Errors
/// [`NotAName`].
pub fn check(what: &'static str, name: &str) -> Result<(), NotAName> {
    let may = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let is_name = (1..=64).contains(&name.len()) && name.chars().all(may);
    if is_name { Ok(()) } else { Err(NotAName { what, name: name.to_owned() }) }
}

#[cfg(test)]
mod tests {
    use super::Keys;
    use crate::message::Kind;

    #[test]
    fn a_name_that_would_match_or_separate_keys_is_refused() {
        assert_eq!(
            Keys::new("line-1", "cell_4").unwrap().of(Kind::Event),
            "trued/line-1/cell_4/event"
        );
        for name in ["", "a/b", "*", "a$*", "a?b", "a#b", "ü", &"a".repeat(65)] {
            assert!(Keys::new("line", name).is_err() && Keys::new(name, "cell").is_err(), "{name}");
        }
    }
}
