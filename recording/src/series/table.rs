//! A foreign table, of text or of cells: separators, comments and the last line's end found out and said.
//!
//! Contract: no number is interpreted but when asked for ([`RawTable::numbers`]), and to judge a last line that was cut
//! off. Every row of text keeps the line it came from.

use std::borrow::Cow;
use std::ops::Range;

use csv::{ReaderBuilder, StringRecord};

#[cfg(feature = "parquet")]
use super::parquet::Cells;
use crate::faults::{Fault, Faults, Place};

/// How a table is written down; `None` means: find out.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Dialect {
    pub(crate) separator: Option<u8>,
    pub(crate) decimal_comma: Option<bool>,
    pub(crate) comment: Option<u8>,
    /// Lines before the header (or the first row), whatever stands in them.
    pub(crate) skip_lines: usize,
    /// Without a header columns are named by their numbers, from 1.
    pub(crate) no_header: bool,
    /// Rows have so many cells, and what stands beyond is not looked at; `None`: as many as the header, exactly.
    pub(crate) width: Option<usize>,
}

/// A table as it was found.
pub(crate) struct RawTable<'s> {
    source: &'s str,
    pub(crate) header: Vec<String>,
    /// Of a table of text.
    rows: Vec<StringRecord>,
    /// Column by column, of one that was no text.
    #[cfg(feature = "parquet")]
    cells: Vec<Cells>,
    pub(crate) notes: Vec<String>,
    separator: u8,
    decimal_comma: bool,
    header_line: usize,
    body_start: usize,
}

impl<'s> RawTable<'s> {
    /// Cuts a text into fields. Faults of shape are noted; what is readable stays.
    pub(crate) fn cut(source: &'s str, dialect: &Dialect, faults: &mut Faults) -> Self {
        let body_start = source.split_inclusive('\n').take(dialect.skip_lines).map(str::len).sum();
        let body = source.get(body_start..).unwrap_or_default();
        let is_comment = |line: &&str| {
            dialect.comment.is_some_and(|mark| line.as_bytes().first() == Some(&mark))
        };
        let first = body.lines().find(|line| !line.trim().is_empty() && !is_comment(line));
        let separator = dialect.separator.unwrap_or_else(|| guess_separator(first.unwrap_or("")));
        let mut table = Self {
            source,
            header: Vec::new(),
            rows: Vec::new(),
            #[cfg(feature = "parquet")]
            cells: Vec::new(),
            notes: Vec::new(),
            separator,
            decimal_comma: dialect.decimal_comma.unwrap_or(separator == b';'),
            header_line: 0,
            body_start,
        };
        if dialect.separator.is_none() && separator != b',' {
            let name = if separator == b';' { "semicolons" } else { "tabulators" };
            table.notes.push(format!("fields are separated by {name}"));
        }
        table.read_rows(body, dialect, faults);
        table.judge_last_line(body);
        table.judge_lengths(dialect.width.is_some(), faults);
        table
    }

    /// A table that was no text; faults then name rows instead of lines.
    #[cfg(feature = "parquet")]
    pub(crate) fn made(header: Vec<String>, cells: Vec<Cells>) -> RawTable<'static> {
        RawTable {
            source: "",
            header,
            rows: Vec::new(),
            cells,
            notes: Vec::new(),
            separator: b',',
            decimal_comma: false,
            header_line: 0,
            body_start: 0,
        }
    }

    /// How many rows there are.
    pub(crate) fn len(&self) -> usize {
        #[cfg(feature = "parquet")]
        if let Some(first) = self.cells.first() {
            return first.len();
        }
        self.rows.len()
    }

    /// What stands in a cell; none where its row is too short.
    pub(crate) fn cell(&self, row: usize, column: usize) -> Option<Cow<'_, str>> {
        #[cfg(feature = "parquet")]
        if let Some(cells) = self.cells.get(column) {
            return Some(cells.text(row));
        }
        self.rows.get(row)?.get(column).map(Cow::Borrowed)
    }

    /// The number in a cell: NaN where it is empty, `None` where it is no number.
    fn number_in(&self, row: usize, column: usize) -> Option<f64> {
        #[cfg(feature = "parquet")]
        if let Some(number) = self.cells.get(column).and_then(|cells| cells.number(row)) {
            return Some(number);
        }
        self.cell(row, column).map_or(Some(f64::NAN), |cell| self.number(&cell))
    }

    /// Leaves out the rows that are not `wanted`.
    pub(crate) fn keep(&mut self, mut wanted: impl FnMut(usize, &Self) -> bool) {
        let wanted: Vec<bool> = (0..self.len()).map(|row| wanted(row, self)).collect();
        #[cfg(feature = "parquet")]
        self.cells.iter_mut().for_each(|cells| cells.keep(&wanted));
        let mut wanted = wanted.iter();
        self.rows.retain(|_| wanted.next() == Some(&true));
    }

    fn read_rows(&mut self, body: &str, dialect: &Dialect, faults: &mut Faults) {
        if self.separator == b' ' {
            return self.read_blanks(body, dialect);
        }
        let mut reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(self.separator)
            .comment(dialect.comment)
            .trim(csv::Trim::All)
            .from_reader(body.as_bytes());
        for record in reader.records() {
            match record {
                Ok(record) if record.len() == 1 && record.get(0) == Some("") => {}
                Ok(record) if self.header.is_empty() => self.take_header(record, dialect),
                Ok(record) => self.rows.push(record),
                Err(error) => {
                    faults.push(Fault::new("", format!("not a table of text: {error}")));
                    return;
                }
            }
        }
    }

    /// Fields set apart by blanks, however many.
    fn read_blanks(&mut self, body: &str, dialect: &Dialect) {
        let mut byte = 0;
        for line in body.split_inclusive('\n') {
            let comment =
                dialect.comment.is_some_and(|mark| line.as_bytes().first() == Some(&mark));
            let mut record: StringRecord = line.split_whitespace().collect();
            let mut position = csv::Position::new();
            position.set_byte(byte);
            record.set_position(Some(position));
            byte += line.len() as u64;
            match record.is_empty() || comment {
                true => {}
                false if self.header.is_empty() => self.take_header(record, dialect),
                false => self.rows.push(record),
            }
        }
    }

    fn take_header(&mut self, record: StringRecord, dialect: &Dialect) {
        if dialect.no_header {
            let width = dialect.width.unwrap_or(record.len());
            self.header = (1..=width).map(|number| number.to_string()).collect();
            self.rows.push(record);
        } else {
            self.header_line = self.line_of(&record);
            self.header = record.iter().map(str::to_owned).collect();
        }
    }

    fn judge_last_line(&mut self, body: &str) {
        let Some(last) = self.rows.last() else { return };
        if body.ends_with('\n') {
            return;
        }
        let cell = last.iter().next_back().unwrap_or("");
        let above = self.rows.len().checked_sub(2).and_then(|at| self.rows.get(at));
        let above = above.and_then(|row| row.get(last.len() - 1)).unwrap_or("");
        let broken = self.number(cell).is_none() && self.number(above).is_some();
        let line = self.line_of(last);
        if last.len() < self.header.len() || broken {
            self.rows.pop();
            self.notes.push(format!("line {line} is cut off: it was left out"));
        } else {
            self.notes.push(format!("the last line ({line}) has no end: kept, as it is complete"));
        }
    }

    fn judge_lengths(&self, more_may_follow: bool, faults: &mut Faults) {
        let width = self.header.len();
        let fits =
            |row: &StringRecord| row.len() == width || (more_may_follow && row.len() > width);
        for row in self.rows.iter().filter(|row| !fits(row)) {
            faults.push_with(|| {
                let line = self.line_of(row);
                let text = self.line_text(line);
                Fault::new("", format!("this row has {} fields", row.len()))
                    .expected(format!("{width}, as the header"))
                    .at(Place::in_line(line, text, &(0..text.len())))
            });
        }
    }

    /// A cell as a number: NaN where it is empty, `None` where it is no number.
    pub(crate) fn number(&self, cell: &str) -> Option<f64> {
        if cell.is_empty() {
            return Some(f64::NAN);
        }
        if self.decimal_comma && cell.contains(',') {
            return cell.replace(',', ".").parse().ok();
        }
        cell.parse().ok()
    }

    /// The numbers of a column; what is none, or infinite, is a fault and stays in place as NaN or itself.
    pub(crate) fn numbers(&self, column: usize, faults: &mut Faults) -> Vec<f64> {
        let name = self.header.get(column).cloned().unwrap_or_default();
        let mut numbers = Vec::with_capacity(self.len());
        for row in 0..self.len() {
            let number = self.number_in(row, column);
            let fault = match number {
                None => {
                    let cell = self.cell(row, column).unwrap_or_default();
                    Some(Fault::new(&name, format!("`{cell}` is no number")).expected("a number"))
                }
                Some(number) if number.is_infinite() => {
                    Some(Fault::new(&name, "is infinite").expected("a finite number, or nothing"))
                }
                Some(_) => None,
            };
            if let Some(fault) = fault {
                faults.push_with(|| self.cell_fault(row, column, fault));
            }
            numbers.push(number.unwrap_or(f64::NAN));
        }
        numbers
    }

    /// The column with this name.
    pub(crate) fn position(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|header| header == name)
    }

    /// A fault of a cell, with its place.
    pub(crate) fn cell_fault(&self, row: usize, column: usize, fault: Fault) -> Fault {
        let Some(record) = self.rows.get(row) else { return fault };
        if self.source.is_empty() {
            return fault.help(format!("in row {} of the data", row + 1));
        }
        let line = self.line_of(record);
        let text = self.line_text(line);
        fault.at(Place::in_line(line, text, &self.field_span(text, column)))
    }

    /// A fault of a column's name, with its place.
    pub(crate) fn header_fault(&self, column: usize, fault: Fault) -> Fault {
        if self.header_line == 0 {
            return fault;
        }
        let text = self.line_text(self.header_line);
        fault.at(Place::in_line(self.header_line, text, &self.field_span(text, column)))
    }

    /// Line of a record, from 1. Counted here: the reader's own count is one behind after CRLF.
    fn line_of(&self, record: &StringRecord) -> usize {
        let byte = record.position().map_or(0, csv::Position::byte);
        let start = usize::try_from(byte).unwrap_or(usize::MAX).saturating_add(self.body_start);
        let bytes = self.source.as_bytes();
        let ends = |byte: &u8| matches!(byte, b'\n' | b'\r');
        let at = (start..bytes.len()).find(|at| !ends(&bytes[*at])).unwrap_or(bytes.len());
        bytes[..at].iter().filter(|byte| **byte == b'\n').count() + 1
    }

    fn line_text(&self, line: usize) -> &'s str {
        self.source.lines().nth(line.saturating_sub(1)).unwrap_or_default()
    }

    fn field_span(&self, text: &str, column: usize) -> Range<usize> {
        let mut start = 0;
        if self.separator == b' ' {
            let mut words = text.split_inclusive(char::is_whitespace).map(|word| {
                start += word.len();
                (start - word.len(), word.trim_end())
            });
            let field = words.by_ref().filter(|(_, word)| !word.is_empty()).nth(column);
            return field.map_or(0..text.len(), |(from, word)| from..from + word.len());
        }
        for (at, field) in text.split(char::from(self.separator)).enumerate() {
            if at == column {
                return start..start + field.len();
            }
            start += field.len() + 1;
        }
        0..text.len()
    }
}

fn guess_separator(line: &str) -> u8 {
    let count = |mark: u8| line.bytes().filter(|byte| *byte == mark).count();
    let mut best = b',';
    for mark in [b';', b'\t'] {
        if count(mark) > count(best) {
            best = mark;
        }
    }
    best
}
