//! Applying a mapping to a foreign table.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use super::{Columns, MappedColumn, Mapping, Orientation, Source};
use crate::faults::{Fault, Faults};
use crate::series::{
    Builder, Column, Decimal, EPOCH_S, RawTable, Recording, RecordingMetadata, RequiredData,
    TimeFormat, Times,
};
use crate::unit::Unit;

impl Mapping {
    /// Converts a table to a recording by this mapping.
    pub(crate) fn apply(
        &self,
        mut table: RawTable<'_>,
        mut faults: Faults,
        about: Option<RecordingMetadata>,
        need: RequiredData,
    ) -> Result<Recording, Faults> {
        self.keep_rows(&mut table, &mut faults);
        if self.drop_repeated {
            self.drop_repeated_times(&mut table);
        }
        if let Some(columns) = &self.columns {
            let used: BTreeSet<&str> = columns.theirs().map(String::as_str).collect();
            let unused =
                table.header.iter().map(String::as_str).filter(|name| !used.contains(name));
            let unused: Vec<&str> = unused.collect();
            if !unused.is_empty() {
                let note = format!("columns not in the mapping: {}", unused.join(", "));
                table.notes.push(note);
            }
        }
        let mut builder = Builder::new(&table, faults);
        match &self.columns {
            Some(columns) => columns.apply(&table, &mut builder),
            None => builder.take_own_columns(),
        }
        builder.finish(about.or_else(|| self.about.clone()).unwrap_or_default(), need)
    }

    fn keep_rows(&self, table: &mut RawTable<'_>, faults: &mut Faults) {
        for (name, wanted) in &self.keep {
            let Some(column) = table.column(name, faults) else { continue };
            let before = table.len();
            table.keep(|row, table| {
                table.cell(row, column).is_some_and(|cell| wanted.iter().any(|w| *w == cell))
            });
            let kept = table.len();
            table.notes.push(format!("kept {kept} of {before} rows by `{name}`"));
        }
    }

    fn drop_repeated_times(&self, table: &mut RawTable<'_>) {
        let named = self.columns.iter().flat_map(|columns| &columns.named);
        let column = |ours: &str| named.clone().find(|column| column.name == ours);
        let places = |ours: &str| {
            let theirs = match (&self.columns, column(ours)) {
                (Some(_), column) => column.map(MappedColumn::theirs).unwrap_or_default().to_vec(),
                (None, _) => vec![ours.to_owned()],
            };
            // One that is not there is reported when it is read.
            theirs
                .iter()
                .filter_map(|name| table.column(name, &mut Faults::new("")))
                .collect::<Vec<usize>>()
        };
        let (time, segment) = (places("t_s"), places("segment"));
        if time.is_empty() {
            return;
        }
        let clock = match column("t_s").map(|column| &column.from) {
            Some(Source::Times(_, clock)) => clock.as_ref(),
            _ => None,
        };
        // A text that is no time is reported when the column is read.
        let unit_s = column("t_s").map_or(1.0, MappedColumn::unit_s);
        let times = table.times(&time, clock, unit_s, &mut Faults::new("")).values;
        let mut last: BTreeMap<Vec<String>, f64> = BTreeMap::new();
        let before = table.len();
        table.keep(|row, table| {
            let cell = |column: &usize| table.cell(row, *column).unwrap_or_default().into_owned();
            let key = segment.iter().map(cell).collect();
            let t = times.get(row).copied().unwrap_or(f64::NAN);
            let repeated = last.get(&key).is_some_and(|last| t <= *last);
            if !repeated {
                last.insert(key, t);
            }
            !repeated
        });
        let dropped = before - table.len();
        if dropped > 0 {
            table.notes.push(format!("skipped {dropped} rows whose time does not increase"));
        }
    }
}

impl Columns {
    /// All source columns in use.
    fn theirs(&self) -> impl Iterator<Item = &String> {
        let turned = self.orientation.iter().flat_map(Orientation::theirs);
        self.named.iter().flat_map(MappedColumn::theirs).chain(turned)
    }

    /// The source columns that are read as numbers.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &String> {
        let turned = self.orientation.iter().flat_map(Orientation::theirs);
        let numeric = self.named.iter().filter(|column| column.is_of_numbers());
        numeric.flat_map(MappedColumn::theirs).chain(turned)
    }

    fn apply(&self, table: &RawTable<'_>, builder: &mut Builder<'_, '_>) {
        for column in &self.named {
            column.apply(table, builder);
        }
        if let Some(orientation) = &self.orientation {
            orientation.apply(table, builder);
        }
    }
}

impl MappedColumn {
    /// The source columns that it needs.
    fn theirs(&self) -> &[String] {
        match &self.from {
            Source::Column(name) | Source::Numbers(name, _) => std::slice::from_ref(name),
            Source::Labels(names) | Source::Sum(names) | Source::Times(names, _) => names,
            Source::Constant(_) | Source::Row(_) => &[],
        }
    }

    /// Whether its source columns hold numbers, not texts.
    fn is_of_numbers(&self) -> bool {
        match &self.from {
            Source::Column(_) | Source::Sum(_) => true,
            Source::Times(_, clock) => matches!(clock, None | Some(TimeFormat::Days)),
            Source::Labels(_) | Source::Numbers(..) | Source::Constant(_) | Source::Row(_) => false,
        }
    }

    fn apply(&self, table: &RawTable<'_>, builder: &mut Builder<'_, '_>) {
        let rows = table.len();
        let Some(places) = builder.places(self.theirs()) else { return };
        let first = places.first().copied();
        if matches!(self.from, Source::Column(_) | Source::Sum(_) | Source::Times(..)) {
            let stated = self.unit.is_some() || matches!(self.from, Source::Times(_, Some(_)));
            places.iter().for_each(|column| builder.check_unit(*column, self.read_in(), stated));
        }
        let values = match (&self.from, first) {
            (Source::Column(_) | Source::Sum(_), _) if self.name == "t_s" => {
                let times = builder.numeric_times(&places, self.unit_s());
                return self.take_times(&places, times, builder);
            }
            (Source::Times(_, clock), _) => {
                let times = builder.times(&places, clock.as_ref(), self.unit_s());
                return self.take_times(&places, times, builder);
            }
            (Source::Labels(_), _) => labels(table, &places),
            (Source::Sum(_), _) => {
                let mut sum = vec![0.0; rows];
                for column in &places {
                    sum.iter_mut().zip(builder.numbers(*column)).for_each(|(sum, x)| *sum += x);
                }
                sum
            }
            (Source::Numbers(_, numbers), Some(column)) => {
                numbers_of_labels(table, column, numbers, builder)
            }
            (Source::Column(_), Some(column)) => builder.numbers(column),
            (Source::Row(step), _) => (0..rows).map(|row| row as f64 * step).collect(),
            (Source::Constant(value), _) => vec![*value; rows],
            (Source::Column(_) | Source::Numbers(..), None) => return,
        };
        let values = values.into_iter().map(|value| self.ours(value)).collect();
        builder.take(&self.name, first, values);
    }

    /// Takes times that may count from an epoch. A stated `offset` that leads back from the epoch counts from the origin that it means.
    fn take_times(&self, places: &[usize], times: Times, builder: &mut Builder<'_, '_>) {
        let first = places.first().copied();
        let Some(origin) = times.origin else {
            let values = times.values.into_iter().map(|time| self.ours(time)).collect();
            return builder.take(&self.name, first, values);
        };
        let exact = Decimal::of(self.unit_s()).and_then(|unit_s| origin.times(unit_s));
        let exact = exact.zip(Decimal::of(self.offset)).and_then(|(start, by)| start.plus(by));
        let start_s = exact.map_or_else(|| self.ours(origin.to_f64()), Decimal::to_f64);
        let is_epoch = start_s.abs() >= EPOCH_S;
        if let Some(epoch) = exact.or_else(|| Decimal::of(start_s)).filter(|_| is_epoch) {
            builder.note_epoch(places, epoch);
        }
        let begin_s = if is_epoch { 0.0 } else { start_s };
        let scaled = Self { offset: 0.0, ..self.clone() };
        let values = times.values.into_iter().map(|time| scaled.ours(time) + begin_s).collect();
        builder.take(&self.name, first, values);
    }

    /// The size of a time's unit in the file, s.
    fn unit_s(&self) -> f64 {
        self.unit.map_or(1.0, |unit| unit.si) * self.scale
    }

    /// The unit in the recording's column name.
    fn unit_of_name(&self) -> Option<Unit> {
        match Column::named(&self.name) {
            Ok(Column::Channel(_, unit)) => unit,
            Ok(Column::Time) => Unit::from_name("s"),
            _ => None,
        }
    }

    /// The unit in which the numbers are read; `None` if a scale alone may account for it.
    fn read_in(&self) -> Option<Unit> {
        let unscaled = self.scale.abs() == 1.0;
        self.unit.or(self.unit_of_name().filter(|_| unscaled))
    }

    /// A source value in the unit of the recording's column.
    fn ours(&self, theirs: f64) -> f64 {
        let value = match (self.unit, self.unit_of_name()) {
            (Some(theirs_unit), Some(ours)) if theirs_unit != ours => {
                ours.from_si(theirs_unit.to_si(theirs))
            }
            _ => theirs,
        };
        // Unscaled columns keep their bits: -0.0 + 0.0 would lose a sign.
        if self.scale == 1.0 && self.offset == 0.0 {
            value
        } else {
            self.scale * value + self.offset
        }
    }
}

fn labels(table: &RawTable<'_>, places: &[usize]) -> Vec<f64> {
    let mut known: BTreeMap<Vec<Cow<'_, str>>, usize> = BTreeMap::new();
    let mut numbers = Vec::with_capacity(table.len());
    for row in 0..table.len() {
        let texts =
            places.iter().map(|column| table.cell(row, *column).unwrap_or_default()).collect();
        let next = known.len();
        numbers.push(*known.entry(texts).or_insert(next) as f64);
    }
    numbers
}

/// The numbers assigned to texts; the first text without a number is a fault.
fn numbers_of_labels(
    table: &RawTable<'_>,
    column: usize,
    numbers: &[(String, f64)],
    builder: &mut Builder<'_, '_>,
) -> Vec<f64> {
    let known: BTreeMap<&str, f64> = numbers.iter().map(|(text, x)| (text.as_str(), *x)).collect();
    let number = |row: usize| known.get(table.cell(row, column)?.as_ref()).copied();
    let rows = 0..table.len();
    if let Some(row) = rows.clone().find(|row| number(*row).is_none()) {
        let name = table.header.get(column).cloned().unwrap_or_default();
        let cell = table.cell(row, column).unwrap_or_default();
        let texts: Vec<&str> = known.keys().copied().collect();
        let fault = Fault::new(name, format!("no number is defined for \"{cell}\""))
            .expected(format!("one of: {}", texts.join(", ")))
            .help("add it to `numbers`, or exclude its rows with `keep`");
        builder.fault(table.cell_fault(row, column, fault));
    }
    rows.map(|row| number(row).unwrap_or(0.0)).collect()
}
