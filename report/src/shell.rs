//! Words of a command, quoted for a POSIX shell: a page shows commands that can be copied.

/// The word as a shell reads it back: unchanged if it has no special characters, otherwise in single quotes.
///
/// ```
/// use report::shell_word;
///
/// assert_eq!(shell_word("out/poses.csv"), "out/poses.csv");
/// assert_eq!(shell_word("my robot.toml"), "'my robot.toml'");
/// assert_eq!(shell_word("it's"), r"'it'\''s'");
/// assert_eq!(shell_word(""), "''");
/// ```
#[must_use]
pub fn shell_word(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}
