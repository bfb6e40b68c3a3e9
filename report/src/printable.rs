//! Text of files and of other programs, made harmless for a terminal.

use std::borrow::Cow;

/// The text with each control character but line break and tab in its escaped form: a name in a file must not move the cursor, change a title, or hide other text. The
/// escape sequences of colour in `allowed` stay.
#[must_use]
pub fn printable<'a>(text: &'a str, allowed: &[&str]) -> Cow<'a, str> {
    let is_harmless = |one: char| !one.is_control() || one == '\n' || one == '\t';
    if text.chars().all(is_harmless) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(one) = rest.chars().next() {
        if let Some(sequence) = allowed.iter().find(|sequence| rest.starts_with(**sequence)) {
            safe += sequence;
            rest = rest.get(sequence.len()..).unwrap_or_default();
            continue;
        }
        if is_harmless(one) {
            safe.push(one);
        } else {
            safe.extend(one.escape_default());
        }
        rest = rest.get(one.len_utf8()..).unwrap_or_default();
    }
    Cow::Owned(safe)
}

#[cfg(test)]
mod tests {
    use super::printable;

    #[test]
    fn no_control_character_of_a_name_reaches_the_terminal() {
        let name = "arm\u{1b}]0;owned\u{7}\u{9b}2J\r\u{8}\u{7f} näme\t1\n";
        let shown = printable(name, &[]);
        assert_eq!(shown, "arm\\u{1b}]0;owned\\u{7}\\u{9b}2J\\r\\u{8}\\u{7f} näme\t1\n");
        assert_eq!(
            printable("\u{1b}[1mbold\u{1b}[0m\u{1b}[2J", &["\u{1b}[1m", "\u{1b}[0m"]),
            "\u{1b}[1mbold\u{1b}[0m\\u{1b}[2J"
        );
    }
}
