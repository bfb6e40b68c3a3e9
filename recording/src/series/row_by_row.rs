//! Reads a text table row by row: only the values are kept in memory, for files of any length.
//!
//! Gives the same bits and notes as reading the whole text ([`RawTable::cut`]). Cases that require
//! the whole
//! text (errors with lines, a truncated end, ambiguous marks, a line of units) are left to that:
//! then no table is returned here.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use csv::{ReaderBuilder, StringRecord};

use super::cells::{Cells, Texts};
use super::epoch_time::EPOCH_S;
use super::number::Notation;
use super::separator::{guess_separator, separator_line};
use super::table::{Dialect, RawTable, header_of};
use super::time_format::TimeFormat;
use super::units_line::UnitsLine;

/// Part of a file that is in memory at once.
const PIECE_BYTES: usize = 1 << 18;
/// Number of rows from which the decimal mark is determined if the separator does not imply it.
const ROWS_TOLD: usize = 1000;
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// The table in a file; `None` if it must be read as a whole.
pub(super) fn table(path: &Path, dialect: &Dialect) -> Option<RawTable<'static>> {
    // A pipe can be opened and read only once, as a whole.
    let mut file = File::open(path.is_file().then_some(path)?).ok()?;
    let mut last = [0];
    file.seek(SeekFrom::End(-1)).ok()?;
    file.read_exact(&mut last).ok()?;
    file.rewind().ok()?;
    if last != *b"\n" {
        return None;
    }
    let mut source = BufReader::with_capacity(PIECE_BYTES, file);
    if source.fill_buf().ok()?.starts_with(BYTE_ORDER_MARK) {
        source.consume(BYTE_ORDER_MARK.len());
    }
    of_text(source, dialect)
}

/// The table in a text that ends with a line's end.
fn of_text(mut source: impl BufRead, dialect: &Dialect) -> Option<RawTable<'static>> {
    let mut line = Vec::new();
    for _ in 0..dialect.skip_lines {
        line.clear();
        source.read_until(b'\n', &mut line).ok()?;
        if line.trim_ascii_end().contains(&b'\r') {
            return None;
        }
    }
    let separator = separator(source.fill_buf().ok()?, dialect)?;
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(separator)
        .comment(dialect.comment)
        .buffer_capacity(PIECE_BYTES)
        .from_reader(source);
    let mut next = move || -> Option<Option<StringRecord>> {
        loop {
            let mut record = StringRecord::new();
            if !reader.read_record(&mut record).ok()? {
                return Some(None);
            }
            if record.len() != 1 || record.iter().any(|field| !field.trim().is_empty()) {
                return Some(Some(record));
            }
        }
    };
    let first = next()??;
    let header = header_of(first.iter(), dialect);
    let mut sample = Vec::new();
    if dialect.no_header {
        sample.push(first);
    }
    while sample.len() < ROWS_TOLD
        && let Some(record) = next()?
    {
        sample.push(record);
    }
    let notation = notation(separator, &header, &sample, dialect)?;
    let mut columns = Columns::of(header, notation, dialect, sample.first()?)?;
    for record in &sample {
        columns.take(record)?;
    }
    drop(sample);
    while let Some(record) = next()? {
        columns.take(&record)?;
    }
    columns.finish(separator, dialect)
}

/// The field separator, from the first complete line in the `head` of a text.
fn separator(head: &[u8], dialect: &Dialect) -> Option<u8> {
    let whole = head.iter().rposition(|byte| *byte == b'\n')?;
    let head = str::from_utf8(head.get(..=whole)?).ok()?;
    let first = head.lines().find(|line| !line.trim().is_empty() && !dialect.is_comment(line))?;
    if first.contains('\r') || separator_line(head, 0).0.is_some() {
        return None;
    }
    let separator = dialect.separator.unwrap_or_else(|| guess_separator(first, dialect.no_header));
    (separator != b' ').then_some(separator)
}

/// Number format: as stated, by the separator, or by the first rows; `None` if these are ambiguous.
fn notation(
    separator: u8,
    header: &[String],
    rows: &[StringRecord],
    dialect: &Dialect,
) -> Option<Notation> {
    let columns: Vec<usize> =
        (0..header.len()).filter(|column| dialect.reads.has(&header[*column])).collect();
    let cells = rows
        .iter()
        .flat_map(|row| columns.iter().filter_map(|column| row.get(*column)).map(str::trim));
    let found = match dialect.stated_decimal() {
        Some(decimal) => Notation::of(decimal, None),
        None => Notation::proven(separator, cells)?,
    };
    Some(Notation { thousands: dialect.thousands, ..found })
}

/// Columns while rows are read.
struct Columns {
    header: Vec<String>,
    cells: Vec<Cells>,
    /// Whether a column has numbers only, even if they are kept as texts.
    is_numeric: Vec<bool>,
    /// Whether a column has had content so far.
    begun: Vec<bool>,
    notation: Notation,
    /// Rows may have more fields than there are columns.
    more_may_follow: bool,
    /// Whether all fields of the last row were empty.
    is_empty: bool,
}

impl Columns {
    /// Columns without rows; the cells of the first row determine their types.
    fn of(
        header: Vec<String>,
        notation: Notation,
        dialect: &Dialect,
        first: &StringRecord,
    ) -> Option<Self> {
        let may_hold_units = match dialect.units_row {
            None => !dialect.no_header,
            Some(stated) => stated,
        };
        let stated = dialect.units_row == Some(true);
        let fields = || first.iter().map(str::trim);
        if may_hold_units && (stated || UnitsLine::of(0, fields(), false).is_some()) {
            return None;
        }
        let holds = |(name, cell): (&String, &str)| {
            // A number is not a time of ISO 8601 unless it is read as text, as the digits of a date
            // are.
            let is_number = notation.read(cell).is_ok() && !TimeFormat::Iso.reads(cell);
            is_number && dialect.reads.has(name)
        };
        // A time since an epoch has more digits than a float, and is subtracted from as a decimal.
        let is_large = |cell: &str| notation.read(cell).is_ok_and(|value| value.abs() >= EPOCH_S);
        let cells_of = |(is_numeric, cell): (bool, &str)| match is_numeric && !is_large(cell) {
            true => Cells::Numbers(Vec::new()),
            false => Cells::Texts(Texts::default()),
        };
        let fields = fields().chain(std::iter::repeat(""));
        let is_numeric: Vec<bool> = header.iter().zip(fields.clone()).map(holds).collect();
        let cells = is_numeric.iter().copied().zip(fields).map(cells_of).collect();
        let (begun, more_may_follow) = (vec![false; header.len()], dialect.width.is_some());
        Some(Self { header, cells, is_numeric, begun, notation, more_may_follow, is_empty: false })
    }

    /// Adds a row; `None` if it cannot be read here.
    fn take(&mut self, row: &StringRecord) -> Option<()> {
        let (found, width) = (row.len(), self.header.len());
        if found != width && !(self.more_may_follow && found > width) {
            return None;
        }
        self.is_empty = true;
        let columns = self.cells.iter_mut().zip(&mut self.begun).zip(&self.is_numeric);
        for (((cells, begun), is_numeric), field) in columns.zip(row) {
            let field = field.trim();
            self.is_empty &= field.is_empty();
            let mut number = f64::NAN;
            if *is_numeric {
                number = self.notation.read(field).ok()?;
                let is_date = !*begun && TimeFormat::Iso.reads(field);
                if number.is_infinite() || is_date {
                    return None;
                }
                *begun |= !field.is_empty();
            }
            match cells {
                Cells::Numbers(all) => all.push(number),
                Cells::Texts(all) if !field.contains('\r') => all.push(field),
                _ => return None,
            }
        }
        Some(())
    }

    fn finish(self, separator: u8, dialect: &Dialect) -> Option<RawTable<'static>> {
        let mut table = RawTable::made(self.header, self.cells);
        table.is_read_by(separator, self.notation, dialect);
        (!self.is_empty).then_some(table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::Faults;
    use crate::mapping::Mapping;
    use crate::series::text::{dialect, of_table};
    use crate::series::{Recording, RequiredData, read_text};
    use proptest::prelude::*;

    const TEMPLATE: &str = "schema = \"trued.mapping/1\"\n";

    /// The recording read row by row, where it can be, and as a whole.
    fn both(text: &str, mapping: Option<&Mapping>) -> (Option<Recording>, Option<Recording>) {
        let whole = read_text("x.csv", text, mapping, None, RequiredData::Path).ok();
        let table = of_text(text.as_bytes(), &dialect(mapping));
        let faults = Faults::new("x.csv");
        let rowwise =
            table.and_then(|table| of_table(table, faults, mapping, None, RequiredData::Path).ok());
        (rowwise, whole)
    }

    /// All of a recording, including NaN.
    fn shown(recording: &Recording) -> String {
        format!("{recording:?}")
    }

    #[test]
    fn a_plain_table_is_read_row_by_row_to_the_same_bits_and_notes() {
        let fixed = format!("{TEMPLATE}skip_rows = 2\n");
        for (text, mapping) in [
            ("t_s,q1_deg,note\n0,1.5,a\n1,-0.0,\n2,,\"b, c\"\n", None),
            ("t_s,q1_deg\r\n0, 1e-3 \r\n\r\n1,nan\r\n", None),
            ("t_s;q1_deg;remark\n0;1.25;1\n1;1.042;\n", None),
            ("t_s;q1_deg\n0;1,25\n1;2,5\n", None),
            ("t_s\tq1_deg\n0\t0.5\n1\t7\n", None),
            ("t_s,q1_deg\n2026-11-26T10:00:00,1\n2026-11-26T10:00:01.5,2\n", None),
            ("t_s,q1_deg\n1732880000.123456789,1\n1732880000.123457039,-3e9\n", None),
            ("t_s;q1_deg\n1.732.880.000,125;1\n1732880001,25;2\n", None),
            ("made by x\n\nt_s,q1_deg\n0,1\n1,2\n", Some(fixed.as_str())),
        ] {
            let mapping = mapping.map(|text| Mapping::parse("m", text).unwrap());
            let (rowwise, whole) = both(text, mapping.as_ref());
            let (rowwise, whole) = (rowwise.expect(text), whole.expect(text));
            assert_eq!(shown(&rowwise), shown(&whole), "{text}");
        }
    }

    #[test]
    fn what_only_the_whole_text_tells_is_not_read_row_by_row() {
        for text in [
            "t_s,q1_deg\n0,1\n1\n",
            "t_s,q1_deg\n0,1\n1,x\n",
            "t_s,q1_deg\n0,1\n1,inf\n",
            "t_s,q1_deg\n0,1\n,\n",
            "t_s,q1_deg\n1732880000,1\nx,2\n",
            "t_s,q1_deg\ns,deg\n0,1\n",
            "t_s;q1_deg\n0;1.042\n1;2.500\n",
            "t_s;q1_deg\n0;1.25\n1;2,5\n",
            "sep=;\nt_s;q1_deg\n0;1.25\n",
            "t_s,q1_deg\n,1\n2026-11-26,2\n",
            "t_s,q1_deg\n",
            "",
        ] {
            let table = of_text(text.as_bytes(), &dialect(None));
            assert!(table.is_none(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn whatever_is_read_row_by_row_is_what_the_whole_text_says(
            separator in "[,;\t]",
            cells in prop::collection::vec("-?[0-9]{0,4}([.,][0-9]{1,4})?( |e2|x|-0)?", 3..40),
            width in 1..4_usize,
        ) {
            let names = ["t_s", "q1_deg", "q2_mm", "remark"];
            let mut text = names[..=width].join(&separator) + "\n";
            for (row, cells) in cells.chunks(width).enumerate() {
                text += &format!("{row}{separator}{}\n", cells.join(&separator));
            }
            let (rowwise, whole) = both(&text, None);
            if let Some(rowwise) = rowwise {
                let whole = whole.expect("read row by row, so there is no fault");
                prop_assert_eq!(shown(&rowwise), shown(&whole), "{}", text);
            }
        }
    }
}
