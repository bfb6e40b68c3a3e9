//! A table from a file, as text or as values: separators, decimal mark, comments, a line of units and a truncated last line are detected and noted.
//!
//! Cells are converted to numbers only on request ([`RawTable::numbers`], [`RawTable::times`]), and
//! to check for a truncated last line. Every row of text keeps its line number.

use std::borrow::Cow;
use std::collections::BTreeSet;

use csv::{ReaderBuilder, StringRecord};

use super::cells::Cells;
use super::channel::Column;
use super::epoch_time::Decimal;
use super::number::{Notation, NumberError, is_number};
use super::rows::{Rows, TooLarge, too_large};
use super::separator::{guess_separator, separator_line};
use super::units_line::UnitsLine;
use crate::faults::{Fault, Faults, Location, nearest};

/// Format of a text table; `None` means that it is detected.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Dialect {
    pub(crate) separator: Option<u8>,
    pub(crate) decimal_comma: Option<bool>,
    /// Thousands separator.
    pub(crate) thousands: Option<char>,
    /// Whether the row below the header contains units.
    pub(crate) units_row: Option<bool>,
    pub(crate) comment: Option<u8>,
    /// Number of lines before the header (or the first row), with any content.
    pub(crate) skip_lines: usize,
    /// Without a header columns are named by their numbers, from 1.
    pub(crate) no_header: bool,
    /// Number of cells per row, further ones are ignored; `None`: exactly as many as the header.
    pub(crate) width: Option<usize>,
    pub(crate) reads: NumericColumns,
}

/// Which columns are read as numbers: only they determine the decimal mark.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) enum NumericColumns {
    #[default]
    All,
    /// Columns with names of the format.
    Known,
    /// Columns with these names.
    Listed(BTreeSet<String>),
}

impl NumericColumns {
    pub(super) fn has(&self, name: &str) -> bool {
        match self {
            Self::All => true,
            Self::Known => !matches!(Column::named(name), Ok(Column::Unknown)),
            Self::Listed(names) => names.contains(name),
        }
    }
}

impl Dialect {
    pub(super) fn is_comment(&self, line: &str) -> bool {
        self.comment.is_some_and(|mark| line.as_bytes().first() == Some(&mark))
    }

    /// The decimal mark if it is stated, possibly through the thousands separator.
    pub(super) fn stated_decimal(&self) -> Option<char> {
        match (self.decimal_comma, self.thousands) {
            (Some(comma), _) => Some(if comma { ',' } else { '.' }),
            (None, Some('.')) => Some(','),
            (None, Some(',')) => Some('.'),
            (None, _) => None,
        }
    }
}

/// The names in the first row; the numbers of the columns if there are no names.
pub(super) fn header_of<'f>(
    fields: impl Iterator<Item = &'f str>,
    dialect: &Dialect,
) -> Vec<String> {
    if dialect.no_header {
        let width = dialect.width.unwrap_or_else(|| fields.count());
        return (1..=width).map(|number| number.to_string()).collect();
    }
    // Word processors put no-break spaces into names, which cannot be typed into a mapping.
    fields.map(|name| name.trim().replace('\u{a0}', " ")).collect()
}

fn report_fields(count: usize) -> String {
    format!("{count} field{}", if count == 1 { "" } else { "s" })
}

/// A table as read.
pub(crate) struct RawTable<'s> {
    pub(super) source: &'s str,
    pub(crate) header: Vec<String>,
    pub(super) units: Option<UnitsLine>,
    /// Rows of a text table.
    pub(super) rows: Rows,
    /// Column by column, for a table stored as values.
    cells: Vec<Cells>,
    pub(crate) notes: Vec<String>,
    pub(super) separator: u8,
    pub(super) comment: Option<u8>,
    notation: Notation,
    pub(super) header_line: usize,
    pub(super) body_start: usize,
}

impl<'s> RawTable<'s> {
    /// Splits a text into fields. Faults of the structure are added; readable parts are kept.
    pub(crate) fn cut(source: &'s str, dialect: &Dialect, faults: &mut Faults) -> Self {
        let skipped: usize =
            source.split_inclusive('\n').take(dialect.skip_lines).map(str::len).sum();
        let (stated, body_start) = separator_line(source, skipped);
        let body = source.get(body_start..).unwrap_or_default();
        let first = body.lines().find(|line| !line.trim().is_empty() && !dialect.is_comment(line));
        let known = dialect.separator.or(stated);
        let separator =
            known.unwrap_or_else(|| guess_separator(first.unwrap_or(""), dialect.no_header));
        let mut table = Self {
            source,
            header: Vec::new(),
            units: None,
            rows: Rows::default(),
            cells: Vec::new(),
            notes: Vec::new(),
            separator,
            comment: dialect.comment,
            notation: Notation::of('.', None),
            header_line: 0,
            body_start,
        };
        table.note_separator(dialect);
        if table.read_rows(body, dialect, faults).is_err() {
            faults.push(too_large());
        }
        table.find_notation(dialect);
        table.take_units(dialect);
        table.judge_last_line(body, dialect);
        table.drop_empty_end();
        table.judge_lengths(dialect.width.is_some(), faults);
        table
    }

    fn note_separator(&mut self, dialect: &Dialect) {
        if dialect.separator.is_none() && self.separator != b',' {
            let name = match self.separator {
                b';' => "semicolons".to_owned(),
                b'\t' => "tabulators".to_owned(),
                other => format!("`{}`", char::from(other)),
            };
            self.notes.push(format!("the field separator is {name}"));
        }
    }

    fn find_notation(&mut self, dialect: &Dialect) {
        let rows = &self.rows;
        let columns =
            (0..self.header.len()).filter(|column| dialect.reads.has(&self.header[*column]));
        let columns: Vec<usize> = columns.collect();
        let cells = (0..rows.len())
            .flat_map(|row| columns.iter().filter_map(move |column| rows.cell(row, *column)));
        self.notation = match dialect.stated_decimal() {
            Some(decimal) => Notation::of(decimal, dialect.thousands),
            None => {
                Notation { thousands: dialect.thousands, ..Notation::detect(self.separator, cells) }
            }
        };
        self.note_decimal(dialect);
    }

    fn note_decimal(&mut self, dialect: &Dialect) {
        if dialect.stated_decimal().is_none() && self.notation.decimal == ',' {
            self.notes.push("the decimal mark is a comma".to_owned());
        }
    }

    /// Sets how the cells of a table were read, and notes it.
    pub(super) fn is_read_by(&mut self, separator: u8, notation: Notation, dialect: &Dialect) {
        (self.separator, self.notation) = (separator, notation);
        self.note_separator(dialect);
        self.note_decimal(dialect);
    }

    /// Takes the first row as a line of units, if the header names the columns and the row contains
    /// units.
    fn take_units(&mut self, dialect: &Dialect) {
        let has_units_row = dialect.units_row;
        if self.rows.len() == 0
            || has_units_row == Some(false)
            || (dialect.no_header && has_units_row.is_none())
        {
            return;
        }
        let cells = (0..self.rows.width(0)).filter_map(|column| self.rows.cell(0, column));
        let line = self.line_of_row(0);
        if let Some(units) = UnitsLine::of(line, cells, has_units_row == Some(true)) {
            let mut wanted = vec![true; self.rows.len()];
            wanted[0] = false;
            self.rows.keep(&wanted);
            self.notes.push(format!("line {line} contains the units"));
            self.units = Some(units);
        }
    }

    /// A table that is kept as values; faults then name rows instead of lines.
    pub(crate) fn made(header: Vec<String>, cells: Vec<Cells>) -> RawTable<'static> {
        RawTable {
            source: "",
            header,
            units: None,
            rows: Rows::default(),
            cells,
            notes: Vec::new(),
            separator: b',',
            comment: None,
            notation: Notation::of('.', None),
            header_line: 0,
            body_start: 0,
        }
    }

    /// How many rows there are.
    pub(crate) fn len(&self) -> usize {
        if let Some(first) = self.cells.first() {
            return first.len();
        }
        self.rows.len()
    }

    /// The content of a cell; `None` if its row is too short.
    pub(crate) fn cell(&self, row: usize, column: usize) -> Option<Cow<'_, str>> {
        if let Some(cells) = self.cells.get(column) {
            return Some(cells.text(row));
        }
        self.rows.cell(row, column).map(Cow::Borrowed)
    }

    /// The number in a cell: NaN if it is empty.
    pub(super) fn number_in(&self, row: usize, column: usize) -> Result<f64, NumberError> {
        if let Some(number) = self.cells.get(column).and_then(|cells| cells.number(row)) {
            return Ok(number);
        }
        self.cell(row, column).map_or(Ok(f64::NAN), |cell| self.notation.read(&cell))
    }

    /// The number in a cell with all its digits.
    pub(super) fn decimal_in(&self, row: usize, column: usize) -> Option<Decimal> {
        let cell = self.cell(row, column)?;
        match self.cells.get(column).and_then(|cells| cells.number(row)) {
            // The shortest text of a float is the decimal that it was made of.
            Some(_) => Decimal::parse(&cell),
            None => self.notation.decimal(&cell),
        }
    }

    /// Keeps only the rows that are `wanted`.
    pub(crate) fn keep(&mut self, mut wanted: impl FnMut(usize, &Self) -> bool) {
        let wanted: Vec<bool> = (0..self.len()).map(|row| wanted(row, self)).collect();
        self.cells.iter_mut().for_each(|cells| cells.keep(&wanted));
        self.rows.keep(&wanted);
    }

    fn read_rows(
        &mut self,
        body: &str,
        dialect: &Dialect,
        faults: &mut Faults,
    ) -> Result<(), TooLarge> {
        if self.separator == b' ' {
            return self.read_blanks(body, dialect);
        }
        let mut reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(self.separator)
            .comment(dialect.comment)
            .from_reader(body.as_bytes());
        let mut record = StringRecord::new();
        loop {
            match reader.read_record(&mut record) {
                Ok(false) => return Ok(()),
                Ok(true)
                    if record.len() == 1 && record.iter().all(|field| field.trim().is_empty()) => {}
                Ok(true) => {
                    let byte = record.position().map_or(0, csv::Position::byte);
                    let byte = usize::try_from(byte).unwrap_or(usize::MAX);
                    self.take(byte, record.iter(), dialect)?;
                }
                Err(error) => {
                    faults.push(Fault::new("", format!("is not a text table: {error}")));
                    return Ok(());
                }
            }
        }
    }

    /// Reads fields separated by any number of blanks.
    fn read_blanks(&mut self, body: &str, dialect: &Dialect) -> Result<(), TooLarge> {
        let mut byte = 0;
        for line in body.split_inclusive('\n') {
            if !dialect.is_comment(line) && !line.trim().is_empty() {
                self.take(byte, line.split_whitespace(), dialect)?;
            }
            byte += line.len();
        }
        Ok(())
    }

    /// Adds a record: the header first, then rows.
    fn take<'f>(
        &mut self,
        byte: usize,
        fields: impl Iterator<Item = &'f str> + Clone,
        dialect: &Dialect,
    ) -> Result<(), TooLarge> {
        if !self.header.is_empty() {
            return self.rows.push(byte, fields);
        }
        self.header = header_of(fields.clone(), dialect);
        if dialect.no_header {
            return self.rows.push(byte, fields);
        }
        self.header_line = self.line_of(byte);
        Ok(())
    }

    fn judge_lengths(&self, more_may_follow: bool, faults: &mut Faults) {
        let width = self.header.len();
        let cell = |row, at| self.rows.cell(row, at).unwrap_or_default();
        // A comment may follow, but no further number.
        let is_comment = |row: &usize| {
            let mut more = (width..self.rows.width(*row)).map(|at| cell(*row, at));
            more.all(|cell| cell.trim().is_empty() || !is_number(cell))
        };
        let ends_empty =
            |row: &usize| (width..self.rows.width(*row)).all(|at| cell(*row, at).trim().is_empty());
        let fits = |row: &usize| {
            let found = self.rows.width(*row);
            let may_have_more = ends_empty(row) || (more_may_follow && is_comment(row));
            found == width || (found > width && may_have_more)
        };
        for row in (0..self.rows.len()).filter(|row| !fits(row)) {
            faults.push_with(|| {
                let line = self.line_of_row(row);
                let text = self.line_text(line);
                let found = report_fields(self.rows.width(row));
                Fault::new("", format!("this row has {found}"))
                    .expected(format!("{width}, like the header"))
                    .help(self.other_separator(text))
                    .at(Location::from_line(line, text, &(0..text.len())))
            });
        }
    }

    /// What to do about a row whose fields are separated by another mark than those of the header; empty if they are not.
    fn other_separator(&self, text: &str) -> String {
        let others = [';', '\t', ',', '|'].into_iter().filter(|c| *c != char::from(self.separator));
        let splits =
            |c: &char| text.split(*c).count() == self.header.len() && self.header.len() > 1;
        let named = |c: char| if c == '\t' { "a tabulator".to_owned() } else { format!("`{c}`") };
        let found = others.filter(|_| !text.contains(char::from(self.separator))).find(splits);
        found.map_or(String::new(), |found| {
            let (found, ours) = (named(found), named(char::from(self.separator)));
            format!("its fields are separated by {found}, those of the header by {ours}: use one mark in the whole file")
        })
    }

    /// Whether a cell is empty or a number, even an ambiguous one.
    pub(crate) fn is_number(&self, cell: &str) -> bool {
        self.notation.read(cell) != Err(NumberError::NotANumber)
    }

    /// The numbers of a column; invalid or infinite ones are faults and stay in place as NaN or
    /// themselves.
    pub(crate) fn numbers(&self, column: usize, faults: &mut Faults) -> Vec<f64> {
        let name = self.header.get(column).map_or("", String::as_str);
        let mut numbers = Vec::with_capacity(self.len());
        for row in 0..self.len() {
            let number = self.number_in(row, column);
            let is_sound = number.is_ok_and(|number| !number.is_infinite());
            if !is_sound {
                faults.push_with(|| {
                    let cell = self.cell(row, column).unwrap_or_default();
                    let fault = match number {
                        Err(unread) => self.notation.fault(unread, &cell),
                        Ok(_) => {
                            Fault::new("", "is infinite").expected("a finite number, or nothing")
                        }
                    };
                    self.cell_fault(row, column, Fault { key: name.to_owned(), ..fault })
                });
            }
            numbers.push(number.unwrap_or(f64::NAN));
        }
        numbers
    }

    /// The column with this name; a missing or duplicate name is a fault.
    pub(crate) fn column(&self, name: &str, faults: &mut Faults) -> Option<usize> {
        let mut places = (0..self.header.len()).filter(|column| self.header[*column] == name);
        match (places.next(), places.next()) {
            (Some(column), None) => return Some(column),
            (Some(_), Some(again)) => faults.push(self.duplicate_name_fault(again)),
            (None, _) => {
                let nearest_name = nearest(name, self.header.iter().map(String::as_str));
                let help = nearest_name.map(|name| format!("did you mean `{name}`?"));
                let fault = Fault::new(name, "is not a column of this file")
                    .expected(format!("one of: {}", self.header.join(", ")))
                    .help(help.unwrap_or_default());
                faults.push(fault);
            }
        }
        None
    }

    /// The fault of a column whose name is not unique.
    pub(super) fn duplicate_name_fault(&self, column: usize) -> Fault {
        let name = self.header.get(column).map_or("", String::as_str);
        let fault = Fault::new(name, "appears twice in the header")
            .expected("a unique name for each column")
            .help("rename one of them, or read the columns by their numbers: `header = false` and `skip_rows` in a mapping");
        self.header_fault(column, fault)
    }
}
