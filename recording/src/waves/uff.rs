//! Universal files (UFF, UNV): their datasets one after the other; dataset 58 holds functions at nodes.
//!
//! Source: Structural Dynamics Research Laboratory, University of Cincinnati, description of datasets 58, 58b and 164.
//! Other datasets are left out with a note.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::uff_channels::{self, Channels, TimeResponse};
use super::uff_head::Units;
use super::uff58::{Content, Function};
use super::{Options, ResponseFunction, Waves, columns, pick, uff_names};
use crate::faults::{Fault, Faults};

/// Whether a file begins as a universal file: a line of -1, then a number.
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

/// A position in a file of lines and binary blocks.
pub(super) struct Cursor<'b> {
    bytes: &'b [u8],
    offset: usize,
    /// Lines so far, without binary data.
    pub(super) line: usize,
}

impl<'b> Cursor<'b> {
    /// The next line, without its end.
    pub(super) fn line(&mut self) -> Option<&'b [u8]> {
        let rest = self.bytes.get(self.offset..).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        self.offset += (end + 1).min(rest.len());
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
        let rest = self.bytes.get(self.offset..).unwrap_or_default();
        let run = rest.get(..count.min(rest.len())).unwrap_or_default();
        self.offset += run.len();
        run
    }

    /// Whether only zero bytes and blanks are left before the next line of -1, or the end.
    pub(super) fn is_before_mark(&self) -> bool {
        let rest = self.bytes.get(self.offset..).unwrap_or_default();
        let is_filling = |byte: &&u8| **byte == 0 || byte.is_ascii_whitespace();
        let filling = rest.iter().take_while(is_filling).count();
        rest.len() == filling || rest.get(filling..).unwrap_or_default().starts_with(b"-1")
    }

    /// Skips to the line of -1 that begins or ends a dataset, including zero bytes with which
    /// binary numbers may be padded; returns whether there was one.
    pub(super) fn skip_to_mark(&mut self) -> bool {
        while let Some(line) = self.line() {
            let filling = line.iter().take_while(|byte| **byte == 0).count();
            if line.get(filling..).unwrap_or_default().trim_ascii() == b"-1" {
                return true;
            }
        }
        false
    }
}

pub(super) fn waves(name: &str, bytes: &[u8], options: &Options) -> Result<Waves, Faults> {
    let mut faults = Faults::new(name);
    columns::check(options, &mut faults);
    let mut notes = Vec::new();
    let mut functions = Vec::new();
    let mut other = BTreeSet::new();
    let mut cursor = Cursor { bytes, offset: 0, line: 0 };
    let mut number = 0;
    let mut units: Vec<(usize, Units)> = Vec::new();
    while cursor.skip_to_mark() {
        // Two marks in a row: one that ended an unreadable dataset, and one that begins the next.
        let head = std::iter::from_fn(|| cursor.text()).find(|line| !is_mark(line));
        let Some(head) = head else { break };
        let kind = head.split_whitespace().next().unwrap_or("").to_owned();
        number += 1;
        let binary =
            kind.eq_ignore_ascii_case("58b") || (kind == "58" && head.contains(['b', 'B']));
        if kind == "164" {
            units.push((functions.len(), Units::read(&mut cursor)));
            cursor.skip_to_mark();
            continue;
        }
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
        // An ASCII function has read its own end; so has a binary one with the stated length.
    }
    if !other.is_empty() {
        let kinds: Vec<String> = other.into_iter().collect();
        notes.push(format!("skipped datasets of other kinds: {}", kinds.join(", ")));
    }
    if functions.is_empty() && faults.is_empty() {
        let fault =
            Fault::new("", "contains no dataset 58").expected("functions at nodes (dataset 58)");
        faults.push(fault.help("export time records or response functions as UFF 58"));
    }
    complete(&mut functions, &units, &mut notes);
    let waves = collect(functions, options, &mut faults, notes);
    faults.into_result((!(waves.records.is_empty() && waves.responses.is_empty())).then_some(waves))
}

/// Completes the units of functions by the systems of units, each with the number of functions
/// before it: the last one before a function, or otherwise the first one after it.
fn complete(functions: &mut [Function], systems: &[(usize, Units)], notes: &mut Vec<String>) {
    let (mut units, mut next) =
        (systems.first().map_or_else(Units::si, |(_, units)| units.clone()), 0);
    for (at, function) in functions.iter_mut().enumerate() {
        while let Some((_, system)) = systems.get(next).filter(|(before, _)| *before <= at) {
            (units, next) = (system.clone(), next + 1);
        }
        function.complete(&units);
    }
    if systems.iter().any(|(_, units)| systems.first().is_some_and(|(_, first)| first != units)) {
        let several = "contains several systems of units (dataset 164); each applies to the functions after it";
        notes.push(several.to_owned());
    }
}

/// Assigns functions to channels with their records, and to response functions; refuses a file with
/// other functions only.
fn collect(
    functions: Vec<Function>,
    options: &Options,
    faults: &mut Faults,
    mut notes: Vec<String>,
) -> Waves {
    let (mut channels, mut responses, mut others) =
        (Channels::default(), Vec::new(), BTreeMap::new());
    for function in functions {
        let Function { source, reference, denominator, content, note } = function;
        notes.extend(note.map(|note| format!("the function at `{}` {note}", source.dof)));
        match content {
            Content::Time { start_s, rate_hz, values } => {
                channels.add(source, TimeResponse { start_s, rate_hz, values });
            }
            Content::Response { frequency_hz, values } => {
                let function = ResponseFunction {
                    response: String::new(),
                    reference,
                    response_unit: source.ordinate.unit.clone(),
                    reference_unit: denominator.unit,
                    frequency_hz,
                    values,
                };
                responses.push((source, function));
            }
            Content::Other(kind) => *others.entry(kind).or_insert(0_usize) += 1,
        }
    }
    let others: Vec<String> =
        others.iter().map(|(kind, count)| format!("{kind} ({count})")).collect();
    let others = others.join(", ");
    if channels.all.is_empty() && responses.is_empty() && !others.is_empty() {
        let fault = Fault::new("", format!("contains only other functions: {others}"));
        let fault =
            fault.expected("time responses over time, or response functions over frequency");
        faults
            .push(fault.help("export the samples over time, or the response functions, as UFF 58"));
    } else if !others.is_empty() {
        notes.push(format!(
            "skipped: {others}; only time responses and response functions are supported"
        ));
    }
    notes.dedup();
    let responses = uff_names::name_responses(responses, &mut notes);
    let mut channels = channels.named(&mut notes);
    if !options.columns.is_empty() {
        let names: Vec<String> = channels.iter().map(|channel| channel.name.clone()).collect();
        let chosen = pick::columns(&names, &options.columns, faults);
        let mut indices = 0..;
        channels.retain(|_| indices.next().is_some_and(|indices| chosen.contains(&indices)));
    }
    uff_channels::note_renumbered(&channels, &mut notes);
    let records =
        uff_channels::records(channels, columns::requested_grid(options), faults, &mut notes);
    Waves { file: PathBuf::new(), records, responses, about: None, notes }
}
