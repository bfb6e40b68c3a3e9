//! Location of a table cell in its file, for error messages.

use std::ops::Range;

use super::RawTable;
use crate::faults::{Fault, Location};

impl<'s> RawTable<'s> {
    /// A fault of a cell, with its place.
    pub(crate) fn cell_fault(&self, row: usize, column: usize, fault: Fault) -> Fault {
        if self.source.is_empty() {
            return fault.in_row(row + 1);
        }
        self.line_fault(self.line_of_row(row), column, fault)
    }

    /// A fault of a column's name, with its place.
    pub(crate) fn header_fault(&self, column: usize, fault: Fault) -> Fault {
        if self.header_line == 0 {
            return fault;
        }
        self.line_fault(self.header_line, column, fault)
    }

    /// A fault of a field of a line.
    pub(super) fn line_fault(&self, line: usize, column: usize, fault: Fault) -> Fault {
        let text = self.line_text(line);
        fault.at(Location::from_line(line, text, &self.field_span(text, column)))
    }

    pub(super) fn line_of_row(&self, row: usize) -> usize {
        self.line_of(self.rows.byte(row))
    }

    /// Line of a record, from 1. Counted here, because the reader's own count is one behind after
    /// CRLF, and its position of a record may be that of the preceding line ends and comments.
    pub(super) fn line_of(&self, byte: usize) -> usize {
        let start = byte.saturating_add(self.body_start);
        let mut rest = self.source.get(start..).unwrap_or_default();
        loop {
            let line = rest.trim_start_matches(['\n', '\r']);
            rest = line;
            if self.comment.is_none_or(|mark| line.as_bytes().first() != Some(&mark)) {
                break;
            }
            rest = line.find('\n').and_then(|end| line.get(end..)).unwrap_or_default();
        }
        let before = &self.source.as_bytes()[..self.source.len() - rest.len()];
        before.iter().filter(|byte| **byte == b'\n').count() + 1
    }

    pub(super) fn line_text(&self, line: usize) -> &'s str {
        self.source.lines().nth(line.saturating_sub(1)).unwrap_or_default()
    }

    fn field_span(&self, text: &str, column: usize) -> Range<usize> {
        let mut start = 0;
        if self.separator == b' ' {
            let mut fields = text.split_inclusive(char::is_whitespace).map(|field| {
                start += field.len();
                (start - field.len(), field.trim_end())
            });
            let field = fields.by_ref().filter(|(_, field)| !field.is_empty()).nth(column);
            return field.map_or(0..text.len(), |(from, field)| from..from + field.len());
        }
        let mut quoted = false;
        let separates = |c: char| {
            quoted ^= c == '"';
            !quoted && c == char::from(self.separator)
        };
        for (index, field) in text.split(separates).enumerate() {
            if index == column {
                return start..start + field.len();
            }
            start += field.len() + 1;
        }
        0..text.len()
    }
}
