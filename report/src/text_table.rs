//! Text tables: aligned columns, two spaces apart, no frame.

/// A text table; columns are aligned by the kind of most of their cells.
#[derive(Debug, Clone)]
pub struct TextTable {
    rows: Vec<Vec<String>>,
}

impl TextTable {
    /// A table by the heads of its columns.
    #[must_use]
    pub fn new<T: Into<String>>(heads: impl IntoIterator<Item = T>) -> Self {
        Self { rows: vec![heads.into_iter().map(Into::into).collect()] }
    }

    /// Adds a row.
    #[must_use]
    pub fn row<T: Into<String>>(mut self, cells: impl IntoIterator<Item = T>) -> Self {
        self.rows.push(cells.into_iter().map(Into::into).collect());
        self
    }

    /// The text, with a newline at the end; columns of numbers are right-aligned. If it is wider
    /// than `width_max` characters, each row becomes a list of its cells.
    #[must_use]
    pub fn render(&self, width_max: Option<usize>) -> String {
        match width_max {
            Some(columns) if self.total() > columns => self.turned(),
            _ => self.aligned(),
        }
    }

    /// Width of the widest row.
    fn total(&self) -> usize {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        (0..columns).map(|i| self.width(i)).sum::<usize>() + 2 * columns.saturating_sub(1)
    }

    /// Row by row: its first cell, then each other one in a line with its head.
    fn turned(&self) -> String {
        let Some((heads, rows)) = self.rows.split_first() else { return String::new() };
        let widest = heads.iter().skip(1).map(|head| head.chars().count()).max().unwrap_or(0);
        let mut text = String::new();
        for row in rows {
            text += row.first().map_or("", String::as_str);
            text.push('\n');
            for (head, cell) in heads.iter().zip(row).skip(1).filter(|(_, cell)| !cell.is_empty()) {
                let gap = " ".repeat(widest - head.chars().count());
                text += &format!("  {head}{gap}  {cell}\n");
            }
        }
        text
    }

    fn aligned(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns).map(|i| self.width(i)).collect();
        let right: Vec<bool> = (0..columns).map(|i| i > 0 && self.is_numeric(i)).collect();
        let mut text = String::new();
        for row in &self.rows {
            let cells = row.iter().enumerate().map(|(i, cell)| {
                let gap = " ".repeat(widths[i] - cell.chars().count());
                if right[i] { gap + cell } else { format!("{cell}{gap}") }
            });
            let line = cells.collect::<Vec<_>>().join("  ");
            text += line.trim_end();
            text.push('\n');
        }
        text
    }

    fn width(&self, column: usize) -> usize {
        self.rows
            .iter()
            .filter_map(|row| row.get(column))
            .map(|cell| cell.chars().count())
            .max()
            .unwrap_or(0)
    }

    fn is_numeric(&self, column: usize) -> bool {
        let like_number = |cell: &String| {
            cell.is_empty() || cell.starts_with(|c: char| c.is_ascii_digit() || "-−–+.".contains(c))
        };
        self.rows.iter().skip(1).filter_map(|row| row.get(column)).all(like_number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_to_the_right_and_words_to_the_left() {
        let table = TextTable::new(["", "mean", "state"])
            .row(["without correction", "0.843", "ok"])
            .row(["with", "–", "µ-held"]);
        assert_eq!(
            table.render(None),
            "                     mean  state\nwithout correction  0.843  ok\nwith                    –  µ-held\n"
        );
    }

    #[test]
    fn a_table_that_is_too_wide_is_written_cell_by_cell() {
        let table = TextTable::new(["", "p50", "worst"])
            .row(["trued", "7.6", "103"])
            .row(["pipe", "", "9"]);
        assert_eq!(table.total(), 17);
        assert_eq!(table.render(Some(16)), "trued\n  p50    7.6\n  worst  103\npipe\n  worst  9\n");
    }

    #[test]
    fn rows_of_unequal_length_are_no_fault() {
        assert_eq!(
            TextTable::new(["a"]).row(["1", "2", "3"]).row(Vec::<String>::new()).render(None),
            "a\n1  2  3\n\n"
        );
    }
}
