//! Tables of numbers with arbitrary names: CSV, tabulators, blanks, with or without a header.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::columns::{self, Columns, Positions};
use super::names::{self, ColumnRole};
use super::preamble::{self, Shape};
use super::spacing::Spacing;
use super::{Options, Record, Wave, Waves, pick};
use crate::faults::{Fault, Faults, Setting};
use crate::files::binary_fault;
use crate::series::{self, Channel, Dialect, RawTable};

/// Information on a table from the header of its file.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct HeaderInfo {
    /// Unit by the column's name.
    pub(super) units: BTreeMap<String, String>,
    /// Samples per second.
    pub(super) rate_hz: Option<f64>,
}

pub(super) fn waves(name: &str, bytes: Vec<u8>, options: &Options) -> Result<Waves, Faults> {
    let mut notes = Vec::new();
    let mut faults = Faults::new(name);
    if let Some(fault) = binary_fault(&bytes) {
        faults.push(fault);
        return Err(faults);
    }
    let source = super::text(bytes, &mut notes);
    columns::check(options, &mut faults);
    let shape = preamble::find(&source, 0).unwrap_or_else(|| {
        let dialect = Dialect { units_row: Some(false), ..Dialect::default() };
        Shape { dialect, heads: None, unusable: None }
    });
    let records = records(&source, shape, &HeaderInfo::default(), options, &mut faults, &mut notes);
    let waves = Waves { file: PathBuf::new(), records, responses: Vec::new(), about: None, notes };
    faults.into_result((!waves.records.is_empty()).then_some(waves))
}

/// The records of one table of a text.
pub(super) fn records(
    source: &str,
    shape: Shape,
    header_info: &HeaderInfo,
    options: &Options,
    faults: &mut Faults,
    notes: &mut Vec<String>,
) -> Vec<Record> {
    if let Some(fault) = shape.unusable_names() {
        faults.push(fault);
        return Vec::new();
    }
    let mut table = RawTable::cut(source, &shape.dialect, faults);
    let named = shape.heads.is_some() || !shape.dialect.no_header;
    match shape.heads {
        Some(heads) => table.header = heads,
        None if named => name_units(&mut table),
        None => {}
    }
    notes.append(&mut table.notes);
    if table.len() == 0 {
        let fault = Fault::new("", "contains no rows of numbers");
        faults.push(fault.expected("a table of numbers, one row per sample"));
        return Vec::new();
    }
    TableReader { table: &table, header_info, named }.records(options, faults, notes)
}

/// Adds the units of a first row that contains nothing else to the names of the columns.
fn name_units(table: &mut RawTable<'_>) {
    let cell = |column| table.cell(0, column).unwrap_or_default().into_owned();
    let first: Vec<String> = (0..table.header.len()).map(cell).collect();
    if let Some(heads) = preamble::with_units(&table.header, &first) {
        table.header = heads;
        table.keep(|row, _| row > 0);
    }
}

struct TableReader<'t, 's> {
    table: &'t RawTable<'s>,
    header_info: &'t HeaderInfo,
    /// Whether the columns have names, not only numbers.
    named: bool,
}

impl TableReader<'_, '_> {
    fn records(
        &self,
        options: &Options,
        faults: &mut Faults,
        notes: &mut Vec<String>,
    ) -> Vec<Record> {
        let heads = &self.table.header;
        let requested = pick::columns(heads, &options.columns, faults);
        // A stated rate replaces a time that cannot be read.
        let has_grid = columns::requested_grid(options).is_some();
        let is_usable = |(column, role): &(usize, ColumnRole)| {
            !has_grid || (*role != ColumnRole::TimeInUnknownUnit && self.is_numeric(*column))
        };
        let counter = self.counter(&requested, notes).filter(is_usable);
        let beside: Vec<(usize, Channel)> = (0..heads.len())
            .filter(|column| !requested.contains(column))
            .filter_map(|column| Some((column, process(heads.get(column)?)?)))
            .collect();
        let chosen = if options.columns.is_empty() {
            self.waveforms(counter.as_ref().map(|(column, _)| *column), &beside, notes)
        } else {
            requested
        };
        if chosen.is_empty() && options.columns.is_empty() {
            let fault = Fault::new("", "no column contains a waveform");
            faults.push(
                fault.expected("at least one numeric column besides the time").help(self.listed()),
            );
        }
        let channels = chosen.iter().map(|column| self.wave(*column, faults)).collect();
        let beside = beside.into_iter().map(|(column, channel)| {
            let si = names::split(&heads[column]).1.and_then(crate::unit::Unit::from_name);
            let values = self.table.numbers(column, faults).into_iter();
            (channel, values.map(|v| si.map_or(v, |unit| unit.to_si(v))).collect())
        });
        let beside = beside.collect();
        let named = counter.as_ref().and_then(|(column, _)| heads.get(*column)).cloned();
        let positions = counter.as_ref().map_or_else(
            || self.header_info.rate_hz.map_or(Positions::Unknown, Positions::Rate),
            |(column, counts)| self.positions(*column, *counts, faults, notes),
        );
        let columns = Columns {
            stand: positions,
            named: named.unwrap_or_default(),
            segment: Vec::new(),
            channels,
            beside,
        };
        columns.records(options, faults, notes, |row, fault| {
            let column = counter.as_ref().map_or(0, |(column, _)| *column);
            self.table.cell_fault(row, column, fault)
        })
    }

    /// The column with time or length, and its meaning.
    fn counter(&self, requested: &[usize], notes: &mut Vec<String>) -> Option<(usize, ColumnRole)> {
        let heads = &self.table.header;
        let others = || (0..heads.len()).filter(|column| !requested.contains(column));
        let free = || others().filter(|column| self.is_numeric(*column));
        let role = |column: usize| (column, names::counts(&heads[column]));
        let by_name =
            |wanted: fn(ColumnRole) -> bool| free().map(role).find(|(_, counts)| wanted(*counts));
        // A time may also be a date and time of the day.
        let dates = || others().map(role).find(|(_, role)| matches!(role, ColumnRole::Time(_)));
        let found = by_name(|counts| matches!(counts, ColumnRole::Time(_)))
            .or_else(dates)
            .or_else(|| by_name(|counts| counts == ColumnRole::TimeInUnknownUnit))
            .or_else(|| by_name(|counts| matches!(counts, ColumnRole::Length(_))));
        if found.is_some() {
            return found;
        }
        // Without a name, the first column is the time if it increases evenly by steps other than
        // 1.
        let first = free().next().filter(|column| *column == 0 && heads.len() > 1)?;
        if self.named && names::counts(&heads[first]) == ColumnRole::Samples {
            return None;
        }
        let spacing =
            Spacing::of(&self.times(first, 1.0, &mut Faults::new(""), &mut Vec::new()), |_| false)
                .ok()?;
        let even = spacing.notes.is_empty() && spacing.runs.len() == 1;
        if !even || (spacing.step - 1.0).abs() < 1e-9 || self.table.len() < 3 {
            return None;
        }
        let name = &heads[first];
        notes.push(format!("column `{name}` increases evenly and is used as the time in s"));
        Some((first, ColumnRole::Time(1.0)))
    }

    /// A numeric column of `unit_s` seconds as times, s.
    fn times(
        &self,
        column: usize,
        unit_s: f64,
        faults: &mut Faults,
        notes: &mut Vec<String>,
    ) -> Vec<f64> {
        let times = self.table.numeric_times(&[column], unit_s, faults);
        if let Some(origin) = times.origin {
            let origin_s = origin.to_f64() * unit_s;
            if let Some(fault) = self.table.fault_of_epoch(column, origin_s) {
                faults.push(fault);
            }
            notes.push(series::epoch_note(&self.table.header[column], origin, ""));
        }
        times.values.into_iter().map(|time| time * unit_s).collect()
    }

    fn positions(
        &self,
        column: usize,
        counts: ColumnRole,
        faults: &mut Faults,
        notes: &mut Vec<String>,
    ) -> Positions {
        match counts {
            ColumnRole::Time(_) if !self.is_numeric(column) => {
                Positions::Time(self.table.times(&[column], None, 1.0, faults).values)
            }
            ColumnRole::TimeInUnknownUnit => {
                let head = &self.table.header[column];
                let fault = Fault::new(head, "is a time in an unknown unit");
                faults.push(fault.expected("s, ms, us, ns, min or h, as in `time (ms)`").help(
                    "give the sampling rate, or name the unit in a mapping (`t_s = { from = …, scale = … }`)",
                ).by(&[Setting::SamplingRate]));
                Positions::Time(self.times(column, 1.0, faults, notes))
            }
            ColumnRole::Time(si) => {
                let x = self.times(column, si, faults, notes);
                // LabVIEW leaves the column empty and states the step.
                match self.header_info.rate_hz {
                    Some(rate_hz) if x.iter().all(|x| x.is_nan()) => Positions::Rate(rate_hz),
                    _ => Positions::Time(x),
                }
            }
            ColumnRole::Length(si) => {
                let lengths = self.table.numbers(column, faults).into_iter();
                Positions::Length(lengths.map(|length| length * (1e3 * si)).collect())
            }
            ColumnRole::Samples | ColumnRole::Else => Positions::Unknown,
        }
    }

    /// All numeric columns that are neither the time nor known by name to be something else.
    fn waveforms(
        &self,
        counter: Option<usize>,
        beside: &[(usize, Channel)],
        notes: &mut Vec<String>,
    ) -> Vec<usize> {
        let heads = &self.table.header;
        let other = |column: usize| {
            Some(column) == counter
                || beside.iter().any(|(other, _)| *other == column)
                || (self.named && names::counts(&heads[column]) != ColumnRole::Else)
        };
        let (chosen, texts): (Vec<usize>, Vec<usize>) = (0..heads.len())
            .filter(|column| !other(*column))
            .partition(|column| self.is_numeric(*column));
        if !texts.is_empty() {
            let names: Vec<&str> = texts.iter().map(|column| heads[*column].as_str()).collect();
            notes.push(format!("skipped text columns: {}", names.join(", ")));
        }
        chosen
    }

    /// Whether most of the first rows have numbers or are empty: a single bad cell is a fault, not
    /// a column of text.
    fn is_numeric(&self, column: usize) -> bool {
        let rows = self.table.len().min(10);
        let cells = (0..rows).map(|row| self.table.cell(row, column).unwrap_or_default());
        2 * cells.filter(|cell| self.table.is_number(cell)).count() > rows
    }

    fn wave(&self, column: usize, faults: &mut Faults) -> Wave {
        let head = &self.table.header[column];
        let unit = self.header_info.units.get(head).map(String::as_str).or(names::split(head).1);
        Wave::new(head, unit.unwrap_or("1"), self.table.numbers(column, faults))
    }

    fn listed(&self) -> String {
        format!("the columns are: {}", self.table.header.join(", "))
    }
}

/// The channel of a process column, which is a waveform only on request.
fn process(head: &str) -> Option<Channel> {
    match series::Column::named(head) {
        Ok(series::Column::Channel(channel, _)) => {
            matches!(channel, Channel::Spindle | Channel::Feed | Channel::Tacho).then_some(channel)
        }
        _ => None,
    }
}
