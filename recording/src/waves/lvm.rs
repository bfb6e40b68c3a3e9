//! `LabVIEW` measurement files (.lvm): a header, then sections with their own units, rate and table.
//!
//! Source: the public description of the format's text header (keys `Separator`, `Multi_Headings`,
//! `X_Columns`, `Y_Unit_Label`, `Delta_X`). A non-empty column `X_Value` takes precedence over
//! `Delta_X`, as a file may have been decimated.

use std::path::PathBuf;

use super::names::ColumnRole;
use super::preamble::Shape;
use super::table::{self, HeaderInfo};
use super::{Grid, Options, Record, Waves, columns, names};
use crate::faults::{Fault, Faults};
use crate::series::Dialect;

const END_OF_HEADER: &str = "***End_of_Header***";
/// Limit on sections: each is a record.
const SECTIONS_MAX: usize = 10_000;

pub(super) fn waves(name: &str, bytes: Vec<u8>, options: &Options) -> Result<Waves, Faults> {
    let mut notes = Vec::new();
    let source = super::text(bytes, &mut notes);
    let mut faults = Faults::new(name);
    columns::check(options, &mut faults);
    let lines: Vec<&str> = source.lines().collect();
    let separator = separator(&lines);
    let mut records: Vec<Record> = Vec::new();
    let sections = sections(&lines, separator);
    if sections.is_empty() {
        let fault =
            Fault::new("", "has no section").expected("a line ***End_of_Header***, then a table");
        faults.push(fault.help("the file seems to be truncated"));
    }
    if sections.len() > SECTIONS_MAX {
        faults.push(
            Fault::new("", format!("has {} sections", sections.len())).expected("at most 10000"),
        );
        return faults.into_result(None);
    }
    for section in &sections {
        records.extend(section.records(
            &source,
            &lines,
            separator,
            options,
            &mut faults,
            &mut notes,
        ));
    }
    notes.dedup();
    let waves = Waves { file: PathBuf::new(), records, responses: Vec::new(), about: None, notes };
    faults.into_result((!waves.records.is_empty()).then_some(waves))
}

/// The value of a key in a line of a header.
fn value<'l>(line: &'l str, key: &str, separator: char) -> Option<&'l str> {
    let rest = line.strip_prefix(key)?;
    rest.strip_prefix(separator)
}

fn separator(lines: &[&str]) -> char {
    let separator = lines.iter().take(64).find_map(|line| line.strip_prefix("Separator"));
    match separator {
        Some(rest) if rest.contains("Comma") => ',',
        _ => '\t',
    }
}

/// Lines of one section: its header, and the line of names with the table below it.
struct Section {
    header: std::ops::Range<usize>,
    body: std::ops::Range<usize>,
}

/// The second and every further end of a header is that of a section.
fn sections(lines: &[&str], separator: char) -> Vec<Section> {
    let is_end = |line: &&str| line.trim_end_matches([separator, ' ']) == END_OF_HEADER;
    let ends: Vec<usize> = (0..lines.len()).filter(|line| is_end(&lines[*line])).collect();
    let begins = |line: &str| value(line, "Channels", separator).is_some();
    let mut sections: Vec<Section> = Vec::new();
    for pair in ends.windows(2) {
        let from = (pair[0] + 1..pair[1]).find(|line| begins(lines[*line])).unwrap_or(pair[0] + 1);
        if let Some(before) = sections.last_mut() {
            before.body.end = from;
        }
        sections.push(Section { header: from..pair[1], body: pair[1] + 1..lines.len() });
    }
    sections
}

impl Section {
    fn records(
        &self,
        source: &str,
        lines: &[&str],
        separator: char,
        options: &Options,
        faults: &mut Faults,
        notes: &mut Vec<String>,
    ) -> Vec<Record> {
        let Some(head) = lines.get(self.body.start) else { return Vec::new() };
        let mut heads: Vec<String> =
            head.split(separator).map(|name| name.trim().to_owned()).collect();
        while heads.last().is_some_and(|name| name.is_empty() || name == "Comment") {
            heads.pop();
        }
        if heads.is_empty() {
            let fault = Fault::new("", format!("line {} has no column names", self.body.start + 1));
            faults.push(fault.expected("X_Value and the channels' names"));
            return Vec::new();
        }
        if let Some(fault) = self.unsupported(lines, separator) {
            faults.push(fault);
            return Vec::new();
        }
        let header_info = self.header_info(lines, separator, &heads);
        let body_end = byte_of(source, self.body.end);
        let body = source.get(..body_end).unwrap_or(source);
        let dialect = Dialect {
            separator: u8::try_from(separator).ok(),
            skip_lines: self.body.start + 1,
            no_header: true,
            width: Some(heads.len()),
            ..Dialect::default()
        };
        let shape = Shape { dialect, heads: Some(heads), unusable: None };
        let records = table::records(body, shape, &header_info, options, faults, notes);
        let stated = header_info.rate_hz.zip(records.first());
        if let Some((stated_hz, Record { grid: Grid::Time { rate_hz, .. }, .. })) = stated
            && options.rate_hz.is_none()
            && (stated_hz / rate_hz - 1.0).abs() > 0.01
        {
            notes.push(format!(
                "the header says {stated_hz:.6} Hz, the column X_Value {rate_hz:.6} Hz: the column takes precedence"
            ));
        }
        records
    }

    /// The values of a key of the section's header, one for each channel.
    fn values<'l>(&self, lines: &[&'l str], key: &str, separator: char) -> Vec<&'l str> {
        let header = lines.get(self.header.clone()).unwrap_or_default();
        let list = header.iter().find_map(|line| value(line, key, separator)).unwrap_or_default();
        list.split(separator).map(str::trim).filter(|value| !value.is_empty()).collect()
    }

    /// Why the section is not read: samples that are not over time, or not of one rate.
    fn unsupported(&self, lines: &[&str], separator: char) -> Option<Fault> {
        let dimensions = self.values(lines, "X_Dimension", separator);
        if let Some(other) = dimensions.iter().find(|name| !name.eq_ignore_ascii_case("time")) {
            let fault = Fault::new("X_Dimension", format!("is `{other}`"));
            return Some(fault.expected("samples over time").help("export the time signals"));
        }
        let steps = self.values(lines, "Delta_X", separator);
        let size = |step: &str| step.replace(',', ".").parse::<f64>().ok();
        let first = steps.first()?;
        let other = steps.iter().find(|step| size(step) != size(first))?;
        let message = format!("differs between the channels: {first}, {other}");
        let fault = Fault::new("Delta_X", message).expected("one rate for all channels");
        Some(fault.help("export channels of different rates to different files"))
    }

    /// Units and rate of the section's header. Its lists count channels; the table may have an X column each.
    fn header_info(&self, lines: &[&str], separator: char, heads: &[String]) -> HeaderInfo {
        let header = lines.get(self.header.clone()).unwrap_or_default();
        let list = |key: &str| {
            header
                .iter()
                .find_map(|line| value(line, key, separator))
                .map(|rest| rest.split(separator))
        };
        let channels =
            heads.iter().filter(|head| !matches!(names::counts(head), ColumnRole::Time(_)));
        let units = list("Y_Unit_Label").into_iter().flatten().map(|unit| unit.trim().to_owned());
        let units = channels.cloned().zip(units).filter(|(_, unit)| !unit.is_empty()).collect();
        let step_s = list("Delta_X").and_then(|mut steps| steps.next());
        let step_s = step_s.and_then(|step| step.trim().replace(',', ".").parse::<f64>().ok());
        let rate_hz = step_s.filter(|step| *step > 0.0 && step.is_finite());
        HeaderInfo { units, rate_hz: rate_hz.map(|step| super::spacing::tidy(1.0 / step, 1e-6)) }
    }
}

/// The byte offset of a line.
fn byte_of(source: &str, line: usize) -> usize {
    source.split_inclusive('\n').take(line).map(str::len).sum()
}
