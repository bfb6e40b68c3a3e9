//! The end of a table of text: a truncated last line, empty rows.

use super::table::{Dialect, RawTable};

impl RawTable<'_> {
    /// Drops a truncated last row, if it can be recognised.
    pub(super) fn judge_last_line(&mut self, body: &str, dialect: &Dialect) {
        let end = body.rsplit('\n').next().unwrap_or_default();
        let Some(last) = self.rows.len().checked_sub(1) else { return };
        if end.trim().is_empty() || dialect.is_comment(end) || self.is_empty_row(last) {
            return;
        }
        let (width, expected) = (self.rows.width(last), self.header.len());
        let line = self.line_of_row(last);
        let column = width.saturating_sub(1);
        let cell = self.rows.cell(last, column).unwrap_or_default();
        let left_out = if width < expected {
            Some(format!("it has {width} of {expected} fields"))
        } else if !self.is_number(cell) && self.holds_numbers(column, last) {
            Some(format!("`{cell}` is not a number"))
        } else {
            None
        };
        self.notes.push(match &left_out {
            Some(why) => format!("line {line} is truncated and was skipped: {why}"),
            None => format!(
                "the last line ({line}) has no line break: it was kept because it has all {expected} fields, but its last field may be truncated"
            ),
        });
        if left_out.is_some() {
            self.rows.keep_first(last);
        }
    }

    fn is_empty_row(&self, row: usize) -> bool {
        (0..self.rows.width(row)).all(|column| self.rows.cell(row, column) == Some(""))
    }

    /// Whether all non-empty cells of a column in the rows before this one are numbers, and there
    /// are any.
    fn holds_numbers(&self, column: usize, before: usize) -> bool {
        let mut cells = (0..before)
            .filter_map(|row| self.rows.cell(row, column))
            .filter(|cell| !cell.is_empty())
            .peekable();
        cells.peek().is_some() && cells.all(|cell| self.is_number(cell))
    }

    /// Drops the empty rows that spreadsheets write below a table.
    pub(super) fn drop_empty_end(&mut self) {
        let before = self.rows.len();
        while let Some(last) = self.rows.len().checked_sub(1).filter(|row| self.is_empty_row(*row))
        {
            self.rows.keep_first(last);
        }
        let dropped = before - self.rows.len();
        if dropped > 0 {
            self.notes.push(format!("skipped {dropped} empty rows at the end"));
        }
    }
}
