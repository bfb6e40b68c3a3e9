//! Detection of the start of a table in a text of numbers, its separator and column names.
//!
//! Instruments write their own lines before the table, with or without a line of names, with any
//! separator. The table begins at the first of six lines (or of all that follow) most of which have
//! the same number of numeric cells.

use super::names::{self, ColumnRole};
use super::quantity;
use crate::faults::{Fault, Location};
use crate::series::{Dialect, is_number, is_unit};

/// Lines that are searched for the beginning.
const SEARCHED: usize = 2000;
/// Number of similar lines that make a table.
const ALIKE: usize = 6;
/// Separators in the order in which they are tried.
const SEPARATORS: &[u8] = b"\t;,| ";

/// Format of a table, and the names above its columns.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shape {
    pub(super) dialect: Dialect,
    /// One per column of the table; `None` if no line of names was found.
    pub(super) heads: Option<Vec<String>>,
    /// A line of names just above the table, but of another number than its columns.
    pub(super) unusable: Option<UnusableNames>,
}

/// Names that do not belong to the columns of the table below.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct UnusableNames {
    /// Line in the file, from 1.
    line: usize,
    text: String,
    names: usize,
    columns: usize,
}

impl Shape {
    /// The fault of names that do not belong to the columns.
    pub(super) fn unusable_names(&self) -> Option<Fault> {
        let UnusableNames { line, text, names, columns } = self.unusable.as_ref()?;
        let fault = Fault::new("", format!("has {names} names above rows of {columns} cells"));
        Some(
            fault
                .at(Location::from_line(*line, text, &(0..text.len())))
                .expected("one name for each column")
                .help("if the numbers have decimal commas, use another separator, such as `;`; if the line holds no names, remove it, or skip it by a mapping (`header = false`, `skip_rows`)"),
        )
    }
}

/// The structure of the first table of a text, searched after `skipped` lines.
pub(super) fn find(source: &str, skipped: usize) -> Option<Shape> {
    let lines: Vec<(usize, &str)> = source
        .lines()
        .enumerate()
        .skip(skipped)
        .filter(|(_, line)| !line.trim().is_empty())
        .take(SEARCHED)
        .collect();
    (0..lines.len()).find_map(|index| {
        let following = lines.get(index..(index + ALIKE).min(lines.len()))?;
        // A table of few rows must make up most of the text: otherwise its end would be taken for
        // the whole.
        if following.len() < ALIKE && 2 * index > lines.len() {
            return None;
        }
        let separator = *SEPARATORS.iter().find(|separator| {
            let widths = || following.iter().map(|(_, line)| width(line, **separator));
            let first = widths().next().flatten();
            // An invalid cell is reported by the reader; it does not change the start of the table.
            let equal_widths = widths().filter(|width| *width == first).count();
            first.is_some() && 3 * equal_widths >= 2 * following.len()
        })?;
        let (number, line) = *lines.get(index)?;
        let width = width(line, separator)?;
        let above =
            |up: usize| index.checked_sub(up).and_then(|index| lines.get(index)).map(|(_, l)| *l);
        let heads = heads(above(1), above(2), separator, width);
        let is_next = index
            .checked_sub(1)
            .and_then(|index| lines.get(index))
            .is_some_and(|l| l.0 + 1 == number);
        let unusable = above(1).filter(|_| heads.is_none() && is_next);
        let unusable = unusable.and_then(|text| unusable_names(text, separator, width, number));
        let dialect = Dialect {
            separator: Some(separator),
            skip_lines: number,
            no_header: true,
            width: Some(width),
            ..Dialect::default()
        };
        Some(Shape { dialect, heads, unusable })
    })
}

/// Number of cells of a row of numbers in any notation, without empty ones at its end; `None` if it
/// is not such a row.
fn width(line: &str, separator: u8) -> Option<usize> {
    if separator != b' ' && !line.contains(char::from(separator)) {
        return None;
    }
    let cells = cells(line, separator);
    let numbers = cells.iter().filter(|cell| is_number(cell)).count();
    let empty = cells.iter().filter(|cell| cell.is_empty()).count();
    (numbers > 0 && numbers + empty == cells.len()).then_some(cells.len())
}

/// The cells of a line, trimmed, without empty ones at its end.
fn cells(line: &str, separator: u8) -> Vec<&str> {
    let mut cells: Vec<&str> = if separator == b' ' {
        line.split_whitespace().collect()
    } else {
        line.split(char::from(separator)).map(str::trim).collect()
    };
    while cells.last().is_some_and(|cell| cell.is_empty()) {
        cells.pop();
    }
    cells
}

/// A line of names directly above a table with another number of columns. A line counts as names if one of them is a time or has a unit, or if commas or
/// semicolons separate single words; any other may be text about the measurement.
fn unusable_names(text: &str, separator: u8, width: usize, line: usize) -> Option<UnusableNames> {
    let cells = cells(text.trim_start().trim_start_matches(['#', '%']), separator);
    let is_text = |cell: &&str| cell.contains(char::is_alphabetic);
    let is_word = |cell: &&str| !cell.contains(' ');
    let is_quantity = |cell: &&str| {
        let unit = names::split(cell).1.and_then(names::measured);
        unit.is_some() || matches!(names::counts(cell), ColumnRole::Time(_))
    };
    let has_words = matches!(separator, b',' | b';') && cells.iter().all(is_word);
    let are_names = cells.iter().all(is_text) && (has_words || cells.iter().any(is_quantity));
    (separator != b' ' && are_names && cells.len() > 1 && cells.len() != width)
        .then(|| UnusableNames { line, text: text.to_owned(), names: cells.len(), columns: width })
}

fn heads(
    above: Option<&str>,
    two_above: Option<&str>,
    separator: u8,
    wanted: usize,
) -> Option<Vec<String>> {
    let line = above?;
    let names = names(line, separator, wanted)?;
    let two_above = two_above.and_then(|line| self::names(line, separator, wanted));
    Some(two_above.and_then(|real| with_units(&real, &names)).unwrap_or(names))
}

/// Names with the units of the row below them; `None` if that row contains anything else.
pub(super) fn with_units(names: &[String], below: &[String]) -> Option<Vec<String>> {
    let units: Vec<&str> =
        below.iter().map(|cell| cell.trim_matches(['(', ')', '[', ']', '<', '>'])).collect();
    let is_unit = |unit: &&str| quantity::of(unit).is_some() || *unit == "1" || is_unit(unit);
    let says_any = units.iter().any(|unit| !unit.is_empty() && !is_number(unit));
    if !says_any || names.len() != units.len() || !units.iter().all(is_unit) {
        return None;
    }
    Some(names.iter().zip(units).map(|(name, unit)| with_unit(name, unit)).collect())
}

/// A name with its unit; one with another unit keeps that too.
fn with_unit(name: &str, unit: &str) -> String {
    let (own_unit, measured) = (names::split(name).1, names::measured(unit));
    let is_same = |own_unit: &str| {
        own_unit == unit || (measured.is_some() && names::measured(own_unit) == measured)
    };
    if matches!(unit, "" | "-") || own_unit.is_some_and(is_same) {
        return name.to_owned();
    }
    format!("{name} [{unit}]")
}

/// The names in a line above the table; `None` if it contains numbers, or another number of cells.
fn names(line: &str, separator: u8, wanted: usize) -> Option<Vec<String>> {
    let line = line.trim_start().trim_start_matches(['#', '%']);
    let mut names = cells(line, separator);
    if names.len() != wanted && separator == b' ' {
        // Names that contain blanks and are separated by more than one.
        names = line.split("  ").map(str::trim).filter(|name| !name.is_empty()).collect();
    }
    // A last column without a value in the first rows: a comment.
    names.truncate(wanted.max(1));
    let texts = names.iter().any(|name| !is_number(name));
    let plain = |name: &&str| name.trim_matches('"').trim().to_owned();
    (names.len() == wanted && texts).then(|| names.iter().map(plain).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> (u8, usize, Option<Vec<String>>) {
        let Shape { dialect, heads, .. } = find(text, 0).unwrap();
        (dialect.separator.unwrap(), dialect.skip_lines, heads)
    }

    fn names(list: &[&str]) -> Option<Vec<String>> {
        Some(list.iter().map(|name| (*name).to_owned()).collect())
    }

    #[test]
    fn a_table_is_found_whatever_stands_above_it() {
        assert_eq!(found("1 2\n3 4\n"), (b' ', 0, None));
        assert_eq!(found("t,a\n1,2\n3,4\n"), (b',', 1, names(&["t", "a"])));
        let text = "Device 7\nRate: 1000\n\nTime (s)\tForce (N)\n0\t1\n0.1\t2\n0.2\t3\n";
        assert_eq!(found(text), (b'\t', 4, names(&["Time (s)", "Force (N)"])));
        let text = "1000\n0.001\n# t  Fx\n0 1\n1 2\n2 3\n3 4\n4 5\n5 6\n";
        assert_eq!(found(text), (b' ', 3, names(&["t", "Fx"])));
    }

    #[test]
    fn numbers_of_any_notation_and_a_line_of_units_are_found() {
        assert_eq!(found("a;b\n1,5;2,5\n3,5;4\n"), (b';', 1, names(&["a", "b"])));
        assert_eq!(found("0,001 1,5\n0,002 1,7\n0,003 2\n"), (b' ', 0, None));
        let grouped = "t;F\n0,0;1.588,66\n0,1;\u{2212}1.672,88\n0,2;1.740.000\n";
        assert_eq!(found(grouped), (b';', 1, names(&["t", "F"])));
        let text = "t,F,note\ns,N,-\n0,1,2\n1,2,3\n2,3,4\n";
        assert_eq!(found(text).2, names(&["t [s]", "F [N]", "note"]));
    }

    #[test]
    fn names_that_are_not_one_for_each_column_are_reported_and_other_texts_are_not() {
        let unusable = |text: &str| find(text, 0).unwrap().unusable.is_some();
        assert!(unusable("t_s,a\n0,000,1,5\n0,001,1,7\n0,002,2,0\n"));
        assert!(unusable("Time (s),Force (N)\n0,000,1,5\n0,001,1,7\n0,002,2,0\n"));
        assert!(unusable("time\tforce\n0\t1\t5\n1\t1\t7\n2\t2\t0\n"));
        assert!(!unusable("Operator\tMiller\n0\t1\t5\n1\t1\t7\n2\t2\t0\n"));
        assert!(!unusable("t_s,a\n0,1\n1,2\n2,3\n"));
        assert!(!unusable("Recorded by, the third shift\n0,1,2\n1,2,3\n2,3,4\n"));
        assert!(!unusable("Device;7\n0;1;2\n1;2;3\n2;3;4\n"));
        assert!(!unusable("t a\n0 1 2\n1 2 3\n2 3 4\n"));
    }

    #[test]
    fn a_text_without_rows_of_numbers_is_no_table() {
        assert_eq!(find("", 0), None);
        assert_eq!(find("a b c\nd e f\n", 0), None);
    }
}
