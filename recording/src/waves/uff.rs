//! Universal files (UFF, UNV): their datasets one after the other; dataset 58 holds functions at nodes.
//!
//! Source: Structural Dynamics Research Laboratory, University of Cincinnati, description of dataset 58 and 58b. Other
//! datasets are passed over and said.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::uff58::{Content, Function};
use super::{Grid, Options, Record, ResponseFunction, Wave, Waves, columns, pick};
use crate::faults::{Fault, Faults};

/// Whether a file begins as a universal file does: a line of -1, then a number.
pub(super) fn is_uff(bytes: &[u8]) -> bool {
    let head = bytes.get(..bytes.len().min(400)).unwrap_or_default();
    let text = String::from_utf8_lossy(head);
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let begins = lines.next().is_some_and(is_mark);
    let number = |line: &str| {
        line.split_whitespace().next()?.trim_end_matches(['b', 'B']).parse::<u32>().ok()
    };
    begins && lines.next().and_then(number).is_some()
}

fn is_mark(line: &str) -> bool {
    line.trim() == "-1"
}

/// A place in a file of lines and runs of bytes.
pub(super) struct Cursor<'b> {
    bytes: &'b [u8],
    at: usize,
    /// Lines so far, binary runs not counted.
    pub(super) line: usize,
}

impl<'b> Cursor<'b> {
    /// The next line, without its end.
    pub(super) fn line(&mut self) -> Option<&'b [u8]> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        self.at += (end + 1).min(rest.len());
        self.line += 1;
        let line = rest.get(..end)?;
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }

    /// The next line as text; what is not ASCII is replaced.
    pub(super) fn text(&mut self) -> Option<String> {
        self.line().map(|line| String::from_utf8_lossy(line).into_owned())
    }

    /// The next bytes, as many as there are.
    pub(super) fn bytes(&mut self, count: usize) -> &'b [u8] {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let run = rest.get(..count.min(rest.len())).unwrap_or_default();
        self.at += run.len();
        run
    }

    /// Reads on to the line of -1 that ends a dataset; says whether there was one.
    pub(super) fn skip_to_mark(&mut self) -> bool {
        while let Some(line) = self.line() {
            if line.trim_ascii() == b"-1" {
                return true;
            }
        }
        false
    }
}

pub(super) fn waves(name: &str, bytes: &[u8], options: &Options) -> Result<Waves, Faults> {
    let mut faults = Faults::of(name);
    columns::check(options, &mut faults);
    let mut notes = Vec::new();
    let mut functions = Vec::new();
    let mut other = BTreeSet::new();
    let mut cursor = Cursor { bytes, at: 0, line: 0 };
    let mut number = 0;
    while cursor.skip_to_mark() {
        // Two marks in a row: one that ended what could not be read, and one that begins.
        let head = std::iter::from_fn(|| cursor.text()).find(|line| !is_mark(line));
        let Some(head) = head else { break };
        let kind = head.split_whitespace().next().unwrap_or("").to_owned();
        number += 1;
        let binary =
            kind.eq_ignore_ascii_case("58b") || (kind == "58" && head.contains(['b', 'B']));
        if kind != "58" && !binary {
            other.insert(kind);
            cursor.skip_to_mark();
            continue;
        }
        match Function::read(&mut cursor, binary.then_some(head.as_str())) {
            Ok(function) => functions.push(function),
            Err(fault) => {
                let key = format!("dataset {number}");
                faults.push(Fault { key, ..*fault });
            }
        }
        // An ASCII function has read its own end; so has a binary one that is as long as it says.
    }
    if !other.is_empty() {
        let kinds: Vec<String> = other.into_iter().collect();
        notes.push(format!("datasets of other kinds, left out: {}", kinds.join(", ")));
    }
    if functions.is_empty() && faults.is_empty() {
        let fault =
            Fault::new("", "holds no dataset 58").expected("functions at nodes (dataset 58)");
        faults.push(fault.help("export time records or response functions as UFF 58"));
    }
    let waves = collect(functions, options, &mut faults, notes);
    faults.or((!(waves.records.is_empty() && waves.responses.is_empty())).then_some(waves))
}

/// Sorts functions into records: the k-th function of each channel belongs to the k-th record.
fn collect(
    functions: Vec<Function>,
    options: &Options,
    faults: &mut Faults,
    mut notes: Vec<String>,
) -> Waves {
    let mut names: Vec<String> = Vec::new();
    let mut records: Vec<Record> = Vec::new();
    let mut responses = Vec::new();
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    for function in functions {
        match function.content {
            Content::Time { start_s, rate_hz, values } => {
                let grid = columns::asked(options).unwrap_or(Grid::Time { start_s, rate_hz });
                let wave = Wave::new(&function.response, &function.unit, values);
                let turn = seen.entry(function.response.clone()).or_default();
                if !names.contains(&function.response) {
                    names.push(function.response);
                }
                put(&mut records, *turn, grid, wave);
                *turn += 1;
            }
            Content::Response { frequency_hz, values } => responses.push(ResponseFunction {
                response: function.response,
                reference: function.reference,
                response_unit: function.unit,
                reference_unit: function.reference_unit,
                frequency_hz,
                values,
            }),
            Content::Other(kind) => notes.push(format!(
                "{} at {}: left out, only time responses and response functions are read",
                kind, function.response
            )),
        }
    }
    notes.dedup();
    if !options.columns.is_empty() {
        let chosen = pick::columns(&names, &options.columns, faults);
        let wanted: Vec<&String> = chosen.iter().filter_map(|at| names.get(*at)).collect();
        for record in &mut records {
            record.channels.retain(|wave| wanted.contains(&&wave.name));
        }
        records.retain(|record| !record.channels.is_empty());
    }
    Waves { file: PathBuf::new(), records, responses, about: None, notes }
}

/// Puts a channel into the record of its turn, or into a new one where it does not fit beside the others.
fn put(records: &mut Vec<Record>, turn: usize, grid: Grid, wave: Wave) {
    let fits = |record: &&mut Record| {
        record.grid == grid
            && record.len() == wave.values.len()
            && record.channels.iter().all(|there| there.name != wave.name)
    };
    match records.get_mut(turn).filter(fits) {
        Some(record) => record.channels.push(wave),
        None => {
            records.push(Record { grid, channels: vec![wave], beside: BTreeMap::new() });
        }
    }
}
