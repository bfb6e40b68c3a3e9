//! Builds a consistent [`Recording`] from named columns, with all checks of the format.
//!
//! Format: docs/reference/recording.md, "Errors". Every error is reported with row and column.

use std::collections::{BTreeMap, BTreeSet};

use super::metadata::{DirectionSource, HeldOut, RecordingMetadata};
use physics::JointKind;

use super::channel::{Channel, Column, FileUnits, joint_kind_of};
use super::epoch_time::{Decimal, Epoch, Times, epoch_note};
use super::required_data::lacking;
use super::table::RawTable;
use super::time_format::TimeFormat;
use super::{Recording, RequiredData, suffix};
use crate::faults::{Fault, Faults, nearest};
use crate::unit::Unit;

/// A column during conversion: meaning, origin, values in the unit of its name.
struct ColumnOrigin {
    name: String,
    /// Index of the column in the source table, if it has one.
    from: Option<usize>,
}

/// Collects columns and faults, then checks them together.
pub(crate) struct Builder<'t, 's> {
    table: &'t RawTable<'s>,
    pub(super) faults: Faults,
    time: Option<Vec<f64>>,
    /// The source column of the time.
    time_from: Option<usize>,
    segment: Option<Vec<i64>>,
    pub(super) columns: BTreeMap<Channel, Vec<f64>>,
    sources: BTreeMap<Channel, ColumnOrigin>,
    kinds: BTreeMap<usize, JointKind>,
    other: Vec<(String, Vec<String>)>,
    degrees: bool,
    millimetres: bool,
    notes: Vec<String>,
    epoch: Option<Epoch>,
}

impl<'t, 's> Builder<'t, 's> {
    pub(crate) fn new(table: &'t RawTable<'s>, faults: Faults) -> Self {
        Self {
            table,
            faults,
            time: None,
            time_from: None,
            segment: None,
            columns: BTreeMap::new(),
            sources: BTreeMap::new(),
            kinds: BTreeMap::new(),
            other: Vec::new(),
            degrees: false,
            millimetres: false,
            notes: Vec::new(),
            epoch: None,
        }
    }

    pub(crate) fn fault(&mut self, fault: Fault) {
        self.faults.push(fault);
    }

    /// Indices of the source columns with these names; `None` if a fault was added.
    pub(crate) fn places(&mut self, names: &[String]) -> Option<Vec<usize>> {
        let column = |name: &String| self.table.column(name, &mut self.faults);
        let places: Vec<usize> = names.iter().filter_map(column).collect();
        (places.len() == names.len()).then_some(places)
    }

    /// The numbers of a source column; faults are added, the values stay in place.
    pub(crate) fn numbers(&mut self, from: usize) -> Vec<f64> {
        self.table.numbers(from, &mut self.faults)
    }

    /// Times from columns of the foreign table; see [`RawTable::times`].
    pub(crate) fn times(
        &mut self,
        from: &[usize],
        clock: Option<&TimeFormat>,
        unit_s: f64,
    ) -> Times {
        self.table.times(from, clock, unit_s, &mut self.faults)
    }

    /// Times from numeric columns; see [`RawTable::numeric_times`].
    pub(crate) fn numeric_times(&mut self, from: &[usize], unit_s: f64) -> Times {
        self.table.numeric_times(from, unit_s, &mut self.faults)
    }

    /// Notes that the time counts from the first row's, which is `epoch`, s.
    pub(crate) fn note_epoch(&mut self, from: &[usize], epoch: Decimal) {
        self.epoch = Some(Epoch(epoch));
        let first = from.first().copied().unwrap_or_default();
        if let Some(fault) = self.table.fault_of_epoch(first, epoch.to_f64()) {
            self.fault(fault);
        }
        let names: Vec<String> =
            from.iter().filter_map(|column| self.table.header.get(*column)).cloned().collect();
        self.notes.push(epoch_note(&names.join(" + "), epoch, " s"));
    }

    /// See [`RawTable::check_unit`].
    pub(crate) fn check_unit(&mut self, from: usize, read_in: Option<Unit>, stated: bool) {
        self.table.check_unit(from, read_in, stated, &mut self.faults);
    }

    /// Takes the columns with names of the format, and keeps the others.
    pub(crate) fn take_own_columns(&mut self) {
        let mut names = BTreeSet::new();
        for (column, name) in self.table.header.iter().enumerate() {
            if !names.insert(name) {
                self.fault(self.table.duplicate_name_fault(column));
                continue;
            }
            match Column::named(name) {
                Ok(Column::Unknown) => self.keep(column),
                Ok(Column::Time) => {
                    let Times { values: times, origin } = self.times(&[column], None, 1.0);
                    if let Some(origin) = origin {
                        self.note_epoch(&[column], origin);
                    }
                    self.check_unit(column, Unit::from_name("s"), false);
                    self.take(name, Some(column), times);
                }
                Ok(known) => {
                    let numbers = self.numbers(column);
                    if let Column::Channel(_, unit) = known {
                        self.check_unit(column, unit, false);
                    }
                    self.take(name, Some(column), numbers);
                }
                Err(expected) => {
                    let fault = Fault::new(name, "has a unit that does not fit").expected(expected);
                    self.fault(self.table.header_fault(column, fault));
                }
            }
        }
    }

    /// Adds a column of the format. `values` are in the unit of its name.
    pub(crate) fn take(&mut self, name: &str, from: Option<usize>, values: Vec<f64>) {
        match Column::named(name) {
            Ok(Column::Time) => {
                self.judge_finite(name, from, &values);
                self.time = Some(values);
                self.time_from = from;
            }
            Ok(Column::Segment) => self.take_segment(from, &values),
            Ok(Column::Channel(channel, unit)) => {
                self.take_channel(
                    channel,
                    unit,
                    ColumnOrigin { name: name.to_owned(), from },
                    values,
                );
            }
            Ok(Column::Unknown) | Err(_) => {}
        }
    }

    /// Keeps an unknown column as text.
    pub(crate) fn keep(&mut self, from: usize) {
        let name = self.table.header.get(from).cloned().unwrap_or_default();
        let cell = |row| self.table.cell(row, from).unwrap_or_default().into_owned();
        let cells = (0..self.table.len()).map(cell).collect();
        self.other.push((name, cells));
    }

    /// The names of the unknown columns.
    pub(super) fn kept(&self) -> impl Iterator<Item = &str> {
        self.other.iter().map(|(name, _)| name.as_str())
    }

    /// Adds a fault of the name of an unknown column.
    pub(super) fn kept_fault(&mut self, name: &str, fault: Fault) {
        let from = self.table.header.iter().position(|known| known == name);
        self.header_fault(from, fault);
    }

    fn take_segment(&mut self, from: Option<usize>, values: &[f64]) {
        if let Some(row) = values.iter().position(|value| !is_whole(*value)) {
            let fault = Fault::new("segment", "is not a whole number").expected("a whole number");
            self.cell_fault(row, from, fault);
        }
        self.segment = Some(values.iter().map(|value| *value as i64).collect());
    }

    fn take_channel(
        &mut self,
        channel: Channel,
        unit: Option<Unit>,
        source: ColumnOrigin,
        values: Vec<f64>,
    ) {
        if let Some(before) = self.sources.get(&channel) {
            let message = format!("is the same quantity as `{}`", before.name);
            let fault = Fault::new(&source.name, message).help("keep one of the two columns");
            self.header_fault(source.from, fault);
            return;
        }
        if let (Some(joint), Some(kind)) = (channel.joint(), joint_kind_of(channel, unit)) {
            let known = *self.kinds.entry(joint).or_insert(kind);
            if known != kind {
                let message = format!("contradicts the kind of joint {}", joint + 1);
                let fault = Fault::new(&source.name, message).expected(
                    "consistent units for all columns of a joint: angle and Nm, or length and N",
                );
                self.header_fault(source.from, fault);
            }
        }
        self.degrees |= unit.is_some_and(|unit| unit.name == "deg");
        self.millimetres |= unit.is_some_and(|unit| unit.name == "mm");
        let si = values.into_iter().map(|v| unit.map_or(v, |unit| unit.to_si(v)));
        let si: Vec<f64> = si.collect();
        self.judge_finite(&source.name, source.from, &si);
        self.columns.insert(channel, si);
        self.sources.insert(channel, source);
    }

    /// Adds a fault at the first value that is infinite though its cell is not: infinite cells were
    /// already reported.
    fn judge_finite(&mut self, name: &str, from: Option<usize>, values: &[f64]) {
        let is_infinite_in_file = |row: usize| {
            from.is_some_and(|column| self.table.number_in(row, column).is_ok_and(f64::is_infinite))
        };
        let overflows = |row: &usize| values[*row].is_infinite() && !is_infinite_in_file(*row);
        if let Some(row) = (0..values.len()).find(overflows) {
            let fault = Fault::new(name, "is too large: infinite after unit conversion")
                .expected("a finite number")
                .help("check the unit, `scale` and `offset`");
            self.cell_fault(row, from, fault);
        }
    }

    /// Adds a fault of a cell of a known column.
    pub(super) fn channel_fault(&mut self, row: usize, channel: Channel, fault: Fault) {
        let from = self.sources.get(&channel).and_then(|source| source.from);
        self.cell_fault(row, from, fault);
    }

    fn cell_fault(&mut self, row: usize, from: Option<usize>, fault: Fault) {
        self.faults.push_with(|| match from {
            Some(from) => self.table.cell_fault(row, from, fault),
            None => fault.in_row(row + 1),
        });
    }

    fn header_fault(&mut self, from: Option<usize>, fault: Fault) {
        let fault = match from {
            Some(from) => self.table.header_fault(from, fault),
            None => fault,
        };
        self.faults.push(fault);
    }

    /// The recording, or every fault.
    pub(crate) fn finish(
        mut self,
        metadata: RecordingMetadata,
        need: RequiredData,
    ) -> Result<Recording, Faults> {
        let rows = self.table.len();
        if rows == 0 && self.table.header.iter().all(String::is_empty) {
            let fault = Fault::new("", "is empty");
            self.faults.push(fault.expected("a header row, then one row per sample"));
            return self.faults.into_result(None);
        }
        if rows == 0 {
            self.faults.push(Fault::new("", "the table has no rows"));
        }
        self.judge_time(rows);
        self.judge_values();
        self.judge_groups(&metadata, need);
        self.judge_about(&metadata);
        self.judge_gauges(&metadata.gauges);
        let mut notes = self.table.notes.clone();
        notes.append(&mut self.notes);
        notes.extend(suffix::note(self.kept()));
        notes.extend(unknown_columns(self.kept()));
        let name = |source: &ColumnOrigin| self.table.header.get(source.from?).cloned();
        let names = self.sources.iter().filter_map(|(c, source)| Some((*c, name(source)?)));
        let names = names.collect();
        let mut recording = Recording {
            file: self.faults.file().into(),
            t_s: self.time.unwrap_or_default(),
            segment: self.segment.unwrap_or_else(|| vec![0; rows]),
            metadata,
            units: FileUnits { degrees: self.degrees, millimetres: self.millimetres },
            other: self.other,
            notes,
            columns: self.columns,
            kinds: self.kinds,
            epoch: self.epoch,
            names,
        };
        for twins in recording.twins() {
            if need == RequiredData::Measurement {
                self.faults.push(twins.fault());
            } else {
                recording.notes.push(twins.note());
            }
        }
        self.faults.into_result(Some(recording))
    }

    fn judge_time(&mut self, rows: usize) {
        let Some(time) = self.time.clone() else {
            let nearest_name = nearest("t_s", self.table.header.iter().map(String::as_str));
            let help =
                nearest_name.map(|name| format!("did you mean `{name}`? ")).unwrap_or_default();
            let help = format!("{help}rename the column, or use a mapping");
            self.faults.push(Fault::new("t_s", "is missing").expected("time in s").help(help));
            return;
        };
        let from = self.time_from;
        let mut last: BTreeMap<i64, f64> = BTreeMap::new();
        for (row, t) in time.iter().enumerate().take(rows) {
            let segment = self.segment.as_ref().and_then(|s| s.get(row)).copied().unwrap_or(0);
            let before = last.get(&segment).copied();
            if !t.is_finite() {
                // Unreadable and infinite times were already reported.
                let unread = from.is_some_and(|column| self.table.number_in(row, column).is_err());
                if unread || t.is_infinite() {
                    continue;
                }
                let cell = from.and_then(|column| self.table.cell(row, column));
                let message = match cell.filter(|cell| !cell.is_empty()) {
                    Some(cell) => format!("is `{cell}`"),
                    None => "is empty".to_owned(),
                };
                let fault = Fault::new("t_s", message).expected("a time in every row");
                self.cell_fault(row, from, fault);
            } else if before.is_some_and(|before| before >= *t) {
                let before = before.unwrap_or_default();
                let verb = if before == *t { "repeats" } else { "decreases" };
                let message = format!("{verb}: {t} after {before}");
                let fault = Fault::new("t_s", message)
                    .expected("strictly increasing times within a segment");
                self.cell_fault(row, from, fault);
                // One jump is one fault: continue from the present time.
                last.insert(segment, *t);
            } else {
                last.insert(segment, *t);
            }
        }
    }

    fn judge_values(&mut self) {
        let mut found = Vec::new();
        for (channel, values) in &self.columns {
            let (good, expected): (fn(f64) -> bool, _) = match channel {
                Channel::Direction(_) => {
                    (|v| v.is_nan() || [-1.0, 0.0, 1.0].contains(&v), "-1, 0 or 1")
                }
                Channel::Station => (is_whole, "a whole number"),
                _ => continue,
            };
            if let Some(row) = values.iter().position(|value| !good(*value)) {
                let message = format!("is {}", values[row]);
                let fault = Fault::new(channel.base(), message).expected(expected);
                found.push((row, *channel, fault));
            }
        }
        if let Some((row, norm)) = self.bad_quaternion() {
            let fault = Fault::new("ow", format!("the quaternion's length is {norm}"))
                .expected("unit length within 1e-3");
            found.push((row, Channel::Orientation(0), fault));
        }
        for (row, channel, fault) in found {
            self.channel_fault(row, channel, fault);
        }
    }

    fn bad_quaternion(&self) -> Option<(usize, f64)> {
        let part = |part| self.columns.get(&Channel::Orientation(part));
        let (w, x, y, z) = (part(0)?, part(1)?, part(2)?, part(3)?);
        let norm = |row: usize| {
            let squares = [w, x, y, z].map(|part| part.get(row).map_or(f64::NAN, |v| v * v));
            squares.iter().sum::<f64>().sqrt()
        };
        (0..w.len()).map(|row| (row, norm(row))).find(|(_, norm)| (norm - 1.0).abs() > 1e-3)
    }

    fn judge_groups(&mut self, about: &RecordingMetadata, need: RequiredData) {
        let quaternion = (0..4).filter(|p| self.columns.contains_key(&Channel::Orientation(*p)));
        if !matches!(quaternion.count(), 0 | 4) {
            let fault = Fault::new("ow, ox, oy, oz", "incomplete quaternion");
            self.faults.push(fault.expected("all four parts of a quaternion"));
        }
        self.judge_suffixes(need);
        if let Some(fault) = lacking(&self.columns, need) {
            self.faults.push(fault);
        }
        let has = |wanted: fn(&Channel) -> bool| self.columns.keys().any(wanted);
        if about.approach == DirectionSource::Columns
            && !has(|c| matches!(c, Channel::Direction(_)))
        {
            let fault = Fault::new("approach", "is \"columns\", but there is no column `d1`");
            self.faults.push(fault.expected("columns `d1` …, or approach = \"sequence\""));
        }
    }

    fn judge_about(&mut self, about: &RecordingMetadata) {
        let highest = |c: &Channel| match c {
            Channel::Current(joint) => Some(joint + 1),
            _ => None,
        };
        let currents = self.columns.keys().filter_map(highest).max().unwrap_or(0);
        if currents > about.torque_per_ampere.len() {
            let found = about.torque_per_ampere.len();
            self.faults.push(
                Fault::new("torque_per_ampere", format!("has {found} numbers"))
                    .expected(format!("{currents}, one per joint up to `i{currents}_A`"))
                    .help("state them in the recording's TOML"),
            );
        }
        if let (HeldOut::Segments(wanted), segments) = (&about.heldout, &self.segment) {
            let existing: BTreeSet<i64> = segments.iter().flatten().copied().collect();
            for segment in wanted.iter().filter(|s| !existing.contains(s)) {
                let fault = Fault::new("heldout", format!("segment {segment} does not exist"));
                self.faults.push(fault.expected("segments of this recording"));
            }
        }
    }
}

/// Whether a count is an exactly represented integer.
fn is_whole(value: f64) -> bool {
    value.fract() == 0.0 && value.abs() < 9e15
}

/// One note on all unknown columns whose names do not resemble a known one.
fn unknown_columns<'n>(other: impl Iterator<Item = &'n str>) -> Option<String> {
    let names: Vec<&str> = other.filter(|name| Channel::misnamed(name).is_none()).collect();
    let named = |name: &'n str| if name.is_empty() { "one without a name" } else { name };
    let names: Vec<&str> = names.into_iter().map(named).collect();
    (!names.is_empty()).then(|| format!("unused columns: {}", names.join(", ")))
}
