//! Tables of text and numbers: the numbers of a column have equal decimals and are aligned.
//!
//! A table with numbers also contains them as CSV, with all digits, in a link in its caption: the
//! page needs no other file and no network for it.

use crate::escape::escape;
use crate::number::{beside, common_decimals, fixed, significant};
use percent_encoding::{NON_ALPHANUMERIC, utf8_percent_encode};

/// Up to this number of rows, a table is not split by a page break.
const SHORT: usize = 15;

/// A column's head, and the format of its numbers.
#[derive(Debug, Clone)]
pub struct Column {
    head: String,
    digits: usize,
}

impl Column {
    /// A column; the unit belongs in the head, e.g. `Mean (mm)`. Its largest number shows three
    /// digits.
    #[must_use]
    pub fn new(head: impl Into<String>) -> Self {
        Self { head: head.into(), digits: 3 }
    }

    /// The number of significant digits of the column's largest number.
    #[must_use]
    pub fn digits(mut self, digits: usize) -> Self {
        self.digits = digits;
        self
    }
}

impl<T: Into<String>> From<T> for Column {
    fn from(head: T) -> Self {
        Self::new(head)
    }
}

/// Content of a cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Text, left-aligned.
    Text(String),
    /// A number, right-aligned; `–` if it is not finite.
    Number(f64),
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

/// How the numbers of a column are written.
#[derive(Debug, Clone, Copy)]
struct NumberFormat {
    /// Common decimals; `None`: each number has its own.
    decimals: Option<usize>,
    /// The largest magnitude.
    largest: f64,
}

/// A table with a caption.
#[derive(Debug, Clone)]
pub struct Table {
    caption: String,
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table by its caption and its columns.
    #[must_use]
    pub fn new<T: Into<Column>>(
        caption: impl Into<String>,
        columns: impl IntoIterator<Item = T>,
    ) -> Self {
        let columns = columns.into_iter().map(Into::into).collect();
        Self { caption: caption.into(), columns, rows: Vec::new() }
    }

    /// Adds a row; missing cells are empty, cells without a column are ignored.
    #[must_use]
    pub fn row(mut self, cells: impl IntoIterator<Item = Cell>) -> Self {
        self.rows.push(cells.into_iter().collect());
        self
    }

    pub(crate) fn html(&self) -> String {
        let decimals: Vec<_> = (0..self.columns.len()).map(|i| self.format(i)).collect();
        let head: String = (0..self.columns.len()).map(|i| self.head(i)).collect();
        let body: String = self.rows.iter().map(|row| self.html_row(row, &decimals)).collect();
        let caption = escape(&self.caption);
        format!(
            "<div class=\"wide\" role=\"region\" tabindex=\"0\" aria-label=\"{caption}\"><table class=\"{}{}\"><caption>{caption}{}</caption>\
             <thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>\n",
            self.class(),
            if self.rows.len() <= SHORT { " short" } else { "" },
            self.link()
        )
    }

    /// A link that saves the table as CSV; empty if it contains no number.
    fn link(&self) -> String {
        let holds_numbers = (0..self.columns.len()).any(|i| !self.numbers(i).is_empty());
        let Some(csv) = self.csv().filter(|_| holds_numbers) else { return String::new() };
        let data = utf8_percent_encode(&csv, NON_ALPHANUMERIC);
        let name: String =
            self.caption.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        let name = match name.trim_matches('-') {
            "" => "table",
            name => name,
        };
        format!(
            " <a class=\"csv\" download=\"{name}.csv\" href=\"data:text/csv;charset=utf-8,{data}\" aria-label=\"{} as CSV\">CSV</a>",
            escape(&self.caption)
        )
    }

    /// The table as CSV (RFC 4180): heads, then rows; numbers with all their digits, empty if not
    /// finite. `None` if the writer fails.
    fn csv(&self) -> Option<String> {
        let mut writer = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
        writer.write_record(self.columns.iter().map(|column| &column.head)).ok()?;
        for row in &self.rows {
            let cells = row.iter().take(self.columns.len()).map(|cell| match cell {
                Cell::Text(text) => text.clone(),
                Cell::Number(value) if value.is_finite() => value.to_string(),
                Cell::Number(_) => String::new(),
            });
            writer.write_record(cells).ok()?;
        }
        String::from_utf8(writer.into_inner().ok()?).ok()
    }

    /// Wide tables have another layout on a phone and in print.
    fn class(&self) -> &'static str {
        match self.columns.len() {
            0..=3 => "few",
            4..=6 => "some",
            _ => "many",
        }
    }

    fn head(&self, i: usize) -> String {
        let class = if self.numbers(i).is_empty() { "" } else { " class=\"number\"" };
        format!("<th scope=\"col\"{class}>{}</th>", escape(&self.columns[i].head))
    }

    /// Each cell carries its column's head: on a phone a row becomes a list of them.
    fn html_row(&self, row: &[Cell], formats: &[NumberFormat]) -> String {
        let cells = self.columns.iter().zip(formats).enumerate().map(|(i, (column, format))| {
            let head = match (column.head.as_str(), self.class()) {
                ("", _) | (_, "few") => String::new(),
                (head, _) => format!(" data-head=\"{}\"", escape(head)),
            };
            match row.get(i) {
                None => "<td></td>".to_owned(),
                Some(Cell::Text(text)) if i == 0 => {
                    format!("<th scope=\"row\"{head}>{}</th>", escape(text))
                }
                Some(Cell::Text(text)) => format!("<td{head}>{}</td>", escape(text)),
                Some(Cell::Number(value)) => {
                    let value = beside(*value, format.largest);
                    let each = || significant(value, column.digits);
                    let text = format.decimals.map_or_else(each, |decimals| fixed(value, decimals));
                    format!("<td class=\"number\"{head}>{text}</td>")
                }
            }
        });
        format!("<tr>{}</tr>", cells.collect::<String>())
    }

    fn numbers(&self, column: usize) -> Vec<f64> {
        let number = |row: &Vec<Cell>| match row.get(column) {
            Some(Cell::Number(value)) => Some(*value),
            _ => None,
        };
        self.rows.iter().filter_map(number).collect()
    }

    /// How the numbers of a column are written: those that are rounding beside the largest as 0, the others with common decimals.
    fn format(&self, column: usize) -> NumberFormat {
        let mut numbers = self.numbers(column);
        let sizes = numbers.iter().map(|value| value.abs()).filter(|size| size.is_finite());
        let largest = sizes.fold(0.0, f64::max);
        numbers.iter_mut().for_each(|value| *value = beside(*value, largest));
        let is_count = numbers.iter().all(|value| value.fract() == 0.0 && value.abs() < 1e9);
        let common = || common_decimals(&numbers, self.columns[column].digits);
        NumberFormat { decimals: if is_count { Some(0) } else { common() }, largest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_a_column_share_their_decimals() {
        let table = Table::new("", ["Path", "Mean (mm)"])
            .row(["slot 1".into(), 0.8432.into()])
            .row(["slot 2".into(), 0.1.into()]);
        let html = table.html();
        assert!(html.contains(">0.843<") && html.contains(">0.100<"), "{html}");
    }

    #[test]
    fn a_table_of_numbers_carries_them_as_csv_with_all_digits() {
        let table = Table::new("Errors, mm", ["Path", "Mean (mm)"])
            .row(["slot \"1\", left".into(), 0.843_217_6.into()])
            .row(["slot 2".into(), f64::NAN.into()]);
        let csv = table.csv().expect("csv");
        assert_eq!(csv, "Path,Mean (mm)\n\"slot \"\"1\"\", left\",0.8432176\nslot 2,\n");
        let html = table.html();
        let link = html
            .split("href=\"data:text/csv;charset=utf-8,")
            .nth(1)
            .and_then(|rest| rest.split('"').next());
        let data = percent_encoding::percent_decode_str(link.expect("a link")).decode_utf8();
        assert_eq!(data.expect("UTF-8"), csv);
        assert!(html.contains("download=\"Errors--mm.csv\""), "{html}");
        let without_links = Table::new("Files", ["File"]).row(["a.csv".into()]).html();
        assert!(!without_links.contains("href"), "words alone stand in the page: {without_links}");
    }

    #[test]
    fn what_is_rounding_beside_its_column_is_zero_in_the_page_and_kept_in_the_csv() {
        let rows = [2.164e-128, 0.25, -0.5].map(Cell::from);
        let table = rows.into_iter().fold(Table::new("", ["rad"]), |table, cell| table.row([cell]));
        let html = table.html();
        assert!(html.contains(">0.000<") && html.contains(">−0.500<"), "{html}");
        assert!(!html.contains("10⁻¹²⁸"), "{html}");
        assert!(table.csv().expect("csv").contains("2164"));
    }

    #[test]
    fn counts_are_whole() {
        let html = Table::new("", ["n"]).row([12_345.0.into()]).row([3.0.into()]).html();
        assert!(html.contains(">12\u{202f}345<") && html.contains(">3<"), "{html}");
    }
}
