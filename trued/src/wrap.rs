//! Line wrapping for a terminal: long lines are broken between words, with a hanging indent.
//!
//! Only for terminals: output to a pipe or a file keeps its lines, so that programs can read them.

use std::io;

use terminal_size::{Width, terminal_size_of};

/// Lines are no longer than this, however wide the terminal is, for readability.
const COLUMNS_MAX: usize = 100;
/// Below this width nothing is wrapped.
const COLUMNS_MIN: usize = 30;
/// How far a broken line hangs under its beginning.
const HANGING_INDENT: usize = 2;

/// Width of standard output in columns; `None` if it is no terminal.
pub(crate) fn columns_of_stdout() -> Option<usize> {
    terminal_size_of(io::stdout()).map(|(Width(columns), _)| usize::from(columns))
}

/// The same of standard error.
pub(crate) fn columns_of_stderr() -> Option<usize> {
    terminal_size_of(io::stderr()).map(|(Width(columns), _)| usize::from(columns))
}

/// The text with lines of at most `columns`; longer words are kept whole.
pub(crate) fn wrapped(text: &str, columns: usize) -> String {
    if columns < COLUMNS_MIN {
        return text.to_owned();
    }
    let columns = columns.min(COLUMNS_MAX);
    let lines: Vec<String> = text.split('\n').map(|line| break_line(line, columns)).collect();
    lines.join("\n")
}

fn break_line(line: &str, columns: usize) -> String {
    if width(line) <= columns {
        return line.to_owned();
    }
    let hang = hang(line, columns);
    let mut text = String::new();
    let mut column = 0;
    let mut is_first = true;
    for word in line.split(' ') {
        let gap = usize::from(!is_first);
        if !is_first && column > hang && !word.is_empty() && column + gap + width(word) > columns {
            text = text.trim_end_matches(' ').to_owned();
            text.push('\n');
            text += &" ".repeat(hang);
            column = hang + width(word);
        } else {
            text += &" ".repeat(gap);
            column += gap + width(word);
        }
        text += word;
        is_first = false;
    }
    text
}

/// Indentation of the following lines: below the text after a label and two spaces, otherwise a few
/// columns to the right.
fn hang(line: &str, columns: usize) -> usize {
    let indent = line.chars().take_while(|c| *c == ' ').count();
    let rest: Vec<char> = plain(line).chars().skip(indent).collect();
    let label = rest.windows(2).position(|pair| pair == [' ', ' ']);
    let column = label.map(|label| {
        let spaces = rest.iter().skip(label).take_while(|c| **c == ' ').count();
        indent + label + spaces
    });
    column.filter(|column| *column <= columns / 3).unwrap_or(indent + HANGING_INDENT)
}

/// Characters that take a place; colours take none.
fn width(text: &str) -> usize {
    plain(text).chars().count()
}

/// Without the escape sequences of colours.
fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut is_escape = false;
    for character in text.chars() {
        match character {
            '\u{1b}' => is_escape = true,
            'm' if is_escape => is_escape = false,
            _ if is_escape => {}
            _ => plain.push(character),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_line_is_longer_than_the_terminal_and_no_word_is_lost() {
        let text = "  A sentence that is much longer than forty columns, with a number of 12.5\u{a0}mm in it.\nshort";
        let wrapped = wrapped(text, 40);
        assert!(wrapped.lines().all(|line| line.chars().count() <= 40), "{wrapped}");
        assert!(wrapped.lines().skip(1).take(2).all(|line| line.starts_with("    ")), "{wrapped}");
        let words = |text: &str| {
            text.split([' ', '\n']).filter(|w| !w.is_empty()).map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(words(&wrapped), words(text));
    }

    #[test]
    fn what_follows_a_label_hangs_under_itself() {
        let line = "sensor    a fault that is told in a sentence of more than fifty characters";
        let wrapped = wrapped(line, 50);
        assert!(wrapped.lines().skip(1).all(|line| line.starts_with("          ")), "{wrapped}");
    }

    #[test]
    fn a_long_log_line_is_broken_between_its_words() {
        let line = " WARN traj_A.csv: columns not in the mapping: act_vel_mot_deg_per_s_1, act_vel_mot_deg_per_s_2\n";
        let wrapped = wrapped(line, 80);
        let expected = " WARN traj_A.csv: columns not in the mapping: act_vel_mot_deg_per_s_1,\n   act_vel_mot_deg_per_s_2\n";
        assert_eq!(wrapped, expected);
    }

    #[test]
    fn colours_take_no_room() {
        let line = format!("\u{1b}[1mhead\u{1b}[0m: {}", "word ".repeat(8).trim_end());
        assert_eq!(wrapped(&line, 48), line);
    }
}
