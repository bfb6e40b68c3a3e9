//! Number format of a table: decimal mark, thousands separators, minus signs.
//!
//! A wrong decimal mark changes a value by a factor of 1000 without any other sign of it, so an
//! ambiguous number is refused:
//! - one decimal mark per file, stated or detected ([`Notation::detect`]) in the numeric columns;
//! - if there are only commas, each followed by three digits, they are decimal commas between semicolons, as written by spreadsheets: the only exception, and noted;
//! - the other mark is a thousands separator only if stated (`thousands`), or if it appears in one number with the decimal mark: `1.042,5`;
//! - a group has three digits, the first one to three and no leading zero.
//!
//! Apostrophes and no-break or thin spaces are never decimal marks: between groups of three digits they are thousands separators.

use super::epoch_time::Decimal;
use crate::faults::Fault;

/// Decimal mark and thousands separator of a file's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Notation {
    /// `.` or `,`.
    pub(super) decimal: char,
    /// A thousands separator stated by the user.
    pub(super) thousands: Option<char>,
    /// All numbers of the file have one mark and three digits after it: `1.042` is ambiguous.
    pub(super) undecided: bool,
}

/// Why a cell is not read as a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NumberError {
    /// It is not a number in any notation.
    NotANumber,
    /// It is ambiguous: decimals, or groups of thousands.
    Ambiguous,
    /// Its decimal mark is not the one of the file.
    OtherDecimal,
}

/// Thousands separators that cannot have another meaning: apostrophes, no-break space, narrow
/// no-break space, thin space.
const GROUPING: [char; 5] = ['\'', '\u{2019}', '\u{a0}', '\u{202f}', '\u{2009}'];
/// U+2212, which typesetting programs write for `-`.
const MINUS: char = '\u{2212}';
/// Digits of a group of thousands.
const GROUP: usize = 3;

impl Notation {
    pub(super) fn of(decimal: char, thousands: Option<char>) -> Self {
        Self { decimal, thousands, undecided: false }
    }

    /// The notation of a file by its cells: determined by the first unambiguous number.
    ///
    /// If there is none, semicolons between fields imply decimal commas, as written by
    /// spreadsheets; otherwise the decimal mark is a point. Points only, each followed by three
    /// digits, leave it undecided for formats of spreadsheets (semicolons, tabulators).
    pub(super) fn detect<'c>(separator: u8, cells: impl Iterator<Item = &'c str>) -> Self {
        if separator == b',' {
            return Self::of('.', None);
        }
        let (mut points, mut commas) = (false, false);
        for (mark, proves) in cells.filter_map(evidence) {
            if proves {
                return Self::of(mark, None);
            }
            points |= mark == '.';
            commas |= mark == ',';
        }
        let decimal = if separator == b';' && commas && !points { ',' } else { '.' };
        let undecided = points && (commas || separator != b' ');
        Self { decimal, thousands: None, undecided }
    }

    /// As [`Notation::detect`], from a part of the cells; `None` if these leave it open.
    pub(super) fn proven<'c>(
        separator: u8,
        mut cells: impl Iterator<Item = &'c str>,
    ) -> Option<Self> {
        if separator == b',' {
            return Some(Self::of('.', None));
        }
        let proof = |cell| evidence(cell).filter(|(_, proves)| *proves);
        cells.find_map(proof).map(|(mark, _)| Self::of(mark, None))
    }

    /// The number in a cell: NaN if it is empty.
    pub(super) fn read(self, cell: &str) -> Result<f64, NumberError> {
        if cell.is_empty() {
            return Ok(f64::NAN);
        }
        let plain = |byte: &u8| byte.is_ascii() && !matches!(byte, b'.' | b',' | b'\'');
        let has_marks = !cell.as_bytes().iter().all(plain);
        if !has_marks && self.thousands != Some(' ') {
            return cell.parse().map_err(|_| NumberError::NotANumber);
        }
        if self.decimal == '.' && !self.undecided && self.thousands != Some('.') {
            // The usual case: Rust's own notation.
            if let Ok(number) = cell.parse() {
                return Ok(number);
            }
        }
        self.read_marked(cell)
    }

    /// The number in a cell with all its digits, if [`Notation::read`] accepts it; `None` also for an empty cell.
    pub(super) fn decimal(self, cell: &str) -> Option<Decimal> {
        self.read(cell).ok()?;
        let text = Parts::of(cell, self.decimal)?.text(other_of(self.decimal), self.thousands)?;
        Decimal::parse(&text)
    }

    /// How a cell that could not be read is quoted in an error.
    pub(super) fn fault(self, unread: NumberError, cell: &str) -> Fault {
        let mark = if cell.contains('.') { '.' } else { ',' };
        let other = other_of(mark);
        let named = |mark: char| if mark == '.' { "point" } else { "comma" };
        let grouped = groups(cell.trim_start_matches(['-', '+', MINUS]), mark);
        match unread {
            NumberError::NotANumber | NumberError::Ambiguous
                if grouped.is_some() && cell.matches(mark).count() > 1 =>
            {
                let message =
                    format!("`{cell}` is a number only if its {} separates thousands", named(mark));
                Fault::new("", message)
                    .expected("a number without thousands separators")
                    .help(format!("if so, state `thousands = \"{mark}\"` in a mapping"))
            }
            NumberError::NotANumber => {
                Fault::new("", format!("`{cell}` is not a number")).expected("a number")
            }
            NumberError::Ambiguous => {
                let grouped = cell.replace(mark, "");
                let decimals = cell.replacen(mark, ".", 1);
                Fault::new("", format!("`{cell}` is ambiguous: {grouped} or {decimals}"))
                    .expected(format!("a number without thousands separators, with a {} as decimal mark", named(self.decimal)))
                    .help(format!(
                        "state it in a mapping: `decimal = \"{other}\"` and `thousands = \"{mark}\"` \
                         for {grouped}, `decimal = \"{mark}\"` for {decimals}"
                    ))
            }
            NumberError::OtherDecimal => Fault::new(
                "",
                format!(
                    "`{cell}` has a decimal {}, the file a decimal {}",
                    named(other_of(self.decimal)),
                    named(self.decimal)
                ),
            )
            .expected("one decimal mark in the whole file")
            .help("use one decimal mark, and state it in a mapping (`decimal`)"),
        }
    }

    fn read_marked(self, cell: &str) -> Result<f64, NumberError> {
        let other = other_of(self.decimal);
        let parts = Parts::of(cell, self.decimal).ok_or(NumberError::NotANumber)?;
        if self.undecided && parts.groups_by_three() {
            return Err(NumberError::Ambiguous);
        }
        if let Some(number) = parts.value(other, self.thousands) {
            return Ok(number);
        }
        let elsewhere = Parts::of(cell, other).and_then(|parts| parts.value(self.decimal, None));
        Err(match elsewhere {
            _ if groups(parts.whole, other).is_some() => NumberError::Ambiguous,
            Some(_) => NumberError::OtherDecimal,
            None => NumberError::NotANumber,
        })
    }
}

/// A number split at its decimal mark.
#[derive(Debug, Clone, Copy)]
struct Parts<'c> {
    sign: &'static str,
    whole: &'c str,
    /// The digits after the decimal mark, if there is one.
    decimals: Option<&'c str>,
    /// Including its letter.
    exponent: &'c str,
}

impl<'c> Parts<'c> {
    fn of(cell: &'c str, decimal: char) -> Option<Self> {
        let negative = cell.strip_prefix(['-', MINUS]);
        let rest = negative.or_else(|| cell.strip_prefix('+')).unwrap_or(cell);
        let (mantissa, exponent) =
            rest.find(['e', 'E']).map_or((rest, ""), |exponent_at| rest.split_at(exponent_at));
        let (whole, decimals) = match mantissa.rsplit_once(decimal) {
            Some((whole, decimals)) => (whole, Some(decimals)),
            None => (mantissa, None),
        };
        let has_digits = mantissa.bytes().any(|byte| byte.is_ascii_digit());
        let sign = if negative.is_some() { "-" } else { "" };
        has_digits.then_some(Self { sign, whole, decimals, exponent })
    }

    /// The number in Rust's notation; thousands may be grouped by `thousands`, by the `other` mark if there are
    /// decimals, or by an unambiguous separator.
    fn text(&self, other: char, thousands: Option<char>) -> Option<String> {
        let may_group = |c: &char| {
            (*c == other && self.decimals.is_some())
                || Some(*c) == thousands
                || GROUPING.contains(c)
        };
        let whole = match self.whole.chars().find(may_group) {
            Some(mark) => groups(self.whole, mark)?,
            None => self.whole.to_owned(),
        };
        let decimals = self.decimals.unwrap_or("");
        let is_number = whole.bytes().chain(decimals.bytes()).all(|byte| byte.is_ascii_digit());
        is_number.then(|| format!("{}{whole}.{decimals}{}", self.sign, self.exponent))
    }

    fn value(&self, other: char, thousands: Option<char>) -> Option<f64> {
        self.text(other, thousands)?.parse().ok()
    }

    /// Whether it consists of digits and one decimal mark only.
    fn is_plain(&self) -> bool {
        let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
        digits(self.whole) && self.decimals.is_some_and(digits)
    }

    /// Whether its decimals could be a group of thousands.
    fn groups_by_three(&self) -> bool {
        let starts = (1..=GROUP).contains(&self.whole.len()) && !self.whole.starts_with('0');
        let group = self.decimals.is_some_and(|decimals| decimals.len() == GROUP);
        self.is_plain() && starts && group && self.exponent.is_empty()
    }
}

/// Whether a cell is a number in some notation, even an ambiguous one.
pub(crate) fn is_number(cell: &str) -> bool {
    let reads = |decimal| Notation::of(decimal, None).read(cell) != Err(NumberError::NotANumber);
    !cell.is_empty() && (reads('.') || reads(','))
}

fn other_of(mark: char) -> char {
    if mark == '.' { ',' } else { '.' }
}

/// The digits of an integer whose thousands are grouped by this mark; `None` if they are not.
fn groups(whole: &str, mark: char) -> Option<String> {
    let mut parts = whole.split(mark);
    let first = parts.next()?;
    let starts = (1..=GROUP).contains(&first.len()) && !first.starts_with('0');
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let mut text = first.to_owned();
    let mut more = 0;
    for part in parts {
        if part.len() != GROUP || !digits(part) {
            return None;
        }
        text.push_str(part);
        more += 1;
    }
    (starts && digits(first) && more > 0).then_some(text)
}

/// The decimal mark that a cell implies, and whether any other reading of it is not a number.
fn evidence(cell: &str) -> Option<(char, bool)> {
    let cell = cell.trim_start_matches(['-', '+', MINUS]);
    let is_numeric = |c: char| c.is_ascii_digit() || matches!(c, '.' | ',' | 'e' | 'E' | '-' | '+');
    if !cell.contains(['.', ',']) || !cell.chars().all(is_numeric) {
        return None;
    }
    let reads_as = |mark| {
        let parts = Parts::of(cell, mark).filter(|parts| parts.decimals.is_some())?;
        (parts.is_plain()).then_some((mark, !parts.groups_by_three()))
    };
    let grouped = |decimal: &char| Notation::of(*decimal, None).read_marked(cell).is_ok();
    match (cell.contains('.'), cell.contains(',')) {
        (true, true) => ['.', ','].into_iter().find(grouped).map(|mark| (mark, true)),
        (true, false) if cell.matches('.').count() == 1 => reads_as('.'),
        (false, true) if cell.matches(',').count() == 1 => reads_as(','),
        // Versions and addresses have the same form.
        (true, false) => groups(cell, '.').map(|_| (',', false)),
        (false, true) => groups(cell, ',').map(|_| ('.', false)),
        (false, false) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_number_is_read_in_the_notation_of_its_file_or_refused() {
        let point = Notation::of('.', None);
        let comma = Notation::of(',', None);
        let (two, other, none) = (
            Err(NumberError::Ambiguous),
            Err(NumberError::OtherDecimal),
            Err(NumberError::NotANumber),
        );
        for (cell, in_points, in_commas) in [
            ("12", Ok(12.0), Ok(12.0)),
            ("-1.5", Ok(-1.5), other),
            ("-1,5", other, Ok(-1.5)),
            ("\u{2212}1.5e3", Ok(-1500.0), other),
            ("+1,5E-3", other, Ok(0.0015)),
            ("\u{2212}7", Ok(-7.0), Ok(-7.0)),
            (".5", Ok(0.5), other),
            ("5,", other, Ok(5.0)),
            ("1.042", Ok(1.042), two),
            ("1,042", two, Ok(1.042)),
            ("0,042", other, Ok(0.042)),
            ("1.042,5", other, Ok(1042.5)),
            ("1,042.5", Ok(1042.5), other),
            ("-1.234.567,5", other, Ok(-1_234_567.5)),
            ("1.23.456,5", none, none),
            ("1'042.5", Ok(1042.5), other),
            ("1\u{2019}042", Ok(1042.0), Ok(1042.0)),
            ("1\u{202f}042,5", other, Ok(1042.5)),
            ("1\u{a0}042", Ok(1042.0), Ok(1042.0)),
            ("10\u{a0}42", none, none),
            ("1 042", none, none),
            ("26.11.2026", none, none),
            ("1,2,3", none, none),
            ("mm", none, none),
            (".", none, none),
            ("e5", none, none),
            ("1.5 mm", none, none),
        ] {
            assert_eq!(point.read(cell), in_points, "{cell} in decimal points");
            assert_eq!(comma.read(cell), in_commas, "{cell} in decimal commas");
        }
        assert!(point.read("").unwrap().is_nan() && comma.read("nan").unwrap().is_nan());
    }

    #[test]
    fn a_stated_mark_groups_thousands_and_only_by_three() {
        let german = Notation::of(',', Some('.'));
        assert_eq!(german.read("1.042"), Ok(1042.0));
        assert_eq!(german.read("1.042.075"), Ok(1_042_075.0));
        assert_eq!(german.read("5,5"), Ok(5.5));
        assert_eq!(german.read("88.5"), Err(NumberError::OtherDecimal));
        assert_eq!(german.read("0.042"), Err(NumberError::OtherDecimal));
        assert_eq!(Notation::of('.', Some(',')).read("1,042"), Ok(1042.0));
        assert_eq!(Notation::of(',', Some(' ')).read("1 042,5"), Ok(1042.5));
        assert_eq!(Notation::of(',', Some(' ')).read("1 042"), Ok(1042.0));
        assert_eq!(Notation::of('.', Some(' ')).read("1 42"), Err(NumberError::NotANumber));
    }

    #[test]
    fn the_notation_is_found_from_what_can_be_read_in_one_way_only() {
        let found = |separator, cells: &[&str]| Notation::detect(separator, cells.iter().copied());
        let (point, comma) = (Notation::of('.', None), Notation::of(',', None));
        let undecided = Notation { undecided: true, ..point };
        assert_eq!(found(b';', &["1", "1.042", "0,5"]), comma);
        assert_eq!(found(b';', &["1", "1,042", "0.5"]), point);
        assert_eq!(found(b';', &["a", "1,042", "26.11.2026"]), comma);
        assert_eq!(found(b'\t', &["1.042,50"]), comma);
        assert_eq!(found(b'\t', &["1.042.000"]), point);
        assert_eq!(found(b';', &["1.042.000", "1.5"]), point);
        assert_eq!(found(b';', &["1.042.000", "1.042"]), undecided);
        assert_eq!(found(b';', &["1,042", "2,500", "88"]), comma);
        assert_eq!(found(b';', &["1", "1.042", "88"]), undecided);
        assert_eq!(found(b';', &["1,042", "1.042"]), undecided);
        assert_eq!(found(b' ', &["1.042", "88"]), point);
        assert_eq!(found(b',', &["5,5"]), point);
        assert_eq!(undecided.read("1.042"), Err(NumberError::Ambiguous));
        assert_eq!(undecided.read("1,042"), Err(NumberError::Ambiguous));
        assert_eq!(undecided.read("88"), Ok(88.0));
    }

    proptest! {
        #[test]
        fn a_number_written_in_any_notation_reads_back_to_the_same_bits(value in -1e9..1e9_f64) {
            let text = format!("{value}");
            prop_assert_eq!(Notation::of('.', None).read(&text), Ok(value));
            prop_assert_eq!(Notation::of(',', None).read(&text.replace('.', ",")), Ok(value));
        }

        #[test]
        fn thousands_read_back_whatever_groups_them(value in -1_000_000_000..1_000_000_000_i64) {
            let digits = value.unsigned_abs().to_string();
            for mark in ['.', '\'', '\u{202f}'] {
                let mut text = String::new();
                for (index, digit) in digits.chars().enumerate() {
                    if index > 0 && (digits.len() - index) % 3 == 0 { text.push(mark); }
                    text.push(digit);
                }
                let text = format!("{}{text},25", if value < 0 { "\u{2212}" } else { "" });
                let expected = value.unsigned_abs() as f64 + 0.25;
                let expected = if value < 0 { -expected } else { expected };
                prop_assert_eq!(Notation::of(',', None).read(&text), Ok(expected));
            }
        }

        #[test]
        fn no_cell_makes_it_panic(cell in "[0-9.,'eE+\\-\u{2212}\u{a0} ]{0,12}") {
            for decimal in ['.', ','] {
                for thousands in [None, Some('.'), Some(','), Some(' ')] {
                    let _ = Notation::of(decimal, thousands).read(&cell);
                }
            }
            let _ = Notation::detect(b';', std::iter::once(cell.as_str()));
        }
    }
}
