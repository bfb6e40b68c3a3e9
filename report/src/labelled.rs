//! Text next to a label, wrapped to the width of a terminal.

/// Width of a terminal, characters.
const COLUMNS: usize = 80;

/// The lines of a text next to its label, at most 80 characters wide: the label takes `indent` of
/// them, the
/// text is wrapped at spaces, and words longer than a line are broken.
#[must_use]
pub fn labelled(label: &str, indent: usize, text: &str) -> Vec<String> {
    let width = COLUMNS.saturating_sub(indent).max(1);
    let (mut rows, mut row) = (Vec::new(), String::new());
    for word in text.split_whitespace() {
        let letters: Vec<char> = word.chars().collect();
        for piece in letters.chunks(width) {
            let used = row.chars().count();
            if used > 0 && used + 1 + piece.len() > width {
                rows.push(std::mem::take(&mut row));
            } else if used > 0 {
                row.push(' ');
            }
            row.extend(piece);
        }
    }
    rows.push(row);
    let head = |row_index: usize| if row_index == 0 { label } else { "" };
    rows.iter()
        .enumerate()
        .map(|(row_index, row)| format!("{:<indent$}{row}", head(row_index)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_line_is_wider_than_a_terminal_and_no_word_is_lost() {
        let text = format!("short {} end", "x".repeat(200));
        let lines = labelled("health", 10, &text);
        assert!(lines.iter().all(|line| line.chars().count() <= COLUMNS), "{lines:#?}");
        let back: String = lines.iter().map(|line| line[10..].replace(' ', "")).collect();
        assert_eq!(back, text.replace(' ', ""));
    }
}
