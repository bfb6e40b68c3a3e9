//! Applying a mapping to a foreign table.

use std::collections::{BTreeMap, BTreeSet};

use super::{MappedColumn, Mapping, Source};
use crate::faults::{Fault, Faults, nearest};
use crate::series::{About, Builder, Column, Need, RawTable, Recording};
use crate::unit::Unit;

impl Mapping {
    /// The recording that this mapping makes of a table.
    pub(crate) fn apply(
        &self,
        mut table: RawTable<'_>,
        mut faults: Faults,
        about: Option<About>,
        need: Need,
    ) -> Result<Recording, Faults> {
        self.keep_rows(&mut table, &mut faults);
        if self.drop_repeated {
            self.drop_repeated_times(&mut table);
        }
        let used: BTreeSet<&str> = self.columns.iter().filter_map(MappedColumn::theirs).collect();
        let unused = table.header.iter().map(String::as_str).filter(|name| !used.contains(name));
        let unused: Vec<&str> = unused.collect();
        if !unused.is_empty() {
            let note = format!("columns that the mapping does not name: {}", unused.join(", "));
            table.notes.push(note);
        }
        let mut builder = Builder::new(&table, faults);
        for column in &self.columns {
            column.apply(&table, &mut builder);
        }
        builder.finish(about.or_else(|| self.about.clone()).unwrap_or_default(), need)
    }

    fn keep_rows(&self, table: &mut RawTable<'_>, faults: &mut Faults) {
        for (name, wanted) in &self.keep {
            let Some(at) = table.position(name) else {
                faults.push(missing(table, name));
                continue;
            };
            let before = table.rows.len();
            table
                .rows
                .retain(|row| row.get(at).is_some_and(|cell| wanted.iter().any(|w| w == cell)));
            let kept = table.rows.len();
            table.notes.push(format!("kept {kept} of {before} rows by `{name}`"));
        }
    }

    fn drop_repeated_times(&self, table: &mut RawTable<'_>) {
        let theirs = |ours: &str| {
            let column = self.columns.iter().find(|column| column.name == ours)?;
            table.position(column.theirs()?)
        };
        let (Some(time), segment) = (theirs("t_s"), theirs("segment")) else { return };
        let mut last: BTreeMap<String, f64> = BTreeMap::new();
        let mut rows = std::mem::take(&mut table.rows);
        let before = rows.len();
        rows.retain(|row| {
            let key = segment.and_then(|at| row.get(at)).unwrap_or("").to_owned();
            let t = row.get(time).and_then(|cell| table.number(cell)).unwrap_or(f64::NAN);
            let repeated = last.get(&key).is_some_and(|last| t <= *last);
            if !repeated {
                last.insert(key, t);
            }
            !repeated
        });
        let dropped = before - rows.len();
        table.rows = rows;
        if dropped > 0 {
            table.notes.push(format!("left out {dropped} rows whose time does not increase"));
        }
    }
}

impl MappedColumn {
    fn theirs(&self) -> Option<&str> {
        match &self.from {
            Source::Column(name) | Source::Labels(name) => Some(name),
            Source::Constant(_) | Source::Row(_) => None,
        }
    }

    fn apply(&self, table: &RawTable<'_>, builder: &mut Builder<'_, '_>) {
        let rows = table.rows.len();
        let from = self.theirs().map(|name| (name, table.position(name)));
        let values = match (&self.from, from) {
            (_, Some((name, None))) => {
                builder.fault(missing(table, name));
                return;
            }
            (Source::Labels(_), Some((_, Some(at)))) => labels(table, at),
            (_, Some((_, Some(at)))) => builder.numbers(at),
            (Source::Row(step), None) => (0..rows).map(|row| row as f64 * step).collect(),
            (Source::Constant(value), None) => vec![*value; rows],
            (Source::Column(_) | Source::Labels(_), None) => return,
        };
        let values = values.into_iter().map(|value| self.ours(value)).collect();
        builder.take(&self.name, from.and_then(|(_, at)| at), values);
    }

    /// A value of theirs in the unit of our name.
    fn ours(&self, theirs: f64) -> f64 {
        let ours = match Column::named(&self.name) {
            Ok(Column::Channel(_, unit)) => unit,
            _ => Unit::named("s"),
        };
        let value = match (self.unit, ours) {
            (Some(theirs_unit), Some(ours)) if theirs_unit != ours => {
                ours.from_si(theirs_unit.to_si(theirs))
            }
            _ => theirs,
        };
        // Plain columns keep their bits: -0.0 + 0.0 would lose a sign.
        if self.scale == 1.0 && self.offset == 0.0 {
            value
        } else {
            self.scale * value + self.offset
        }
    }
}

fn labels(table: &RawTable<'_>, at: usize) -> Vec<f64> {
    let mut known: Vec<&str> = Vec::new();
    let mut number = |cell| {
        known.iter().position(|name| *name == cell).unwrap_or_else(|| {
            known.push(cell);
            known.len() - 1
        }) as f64
    };
    table.rows.iter().map(|row| number(row.get(at).unwrap_or(""))).collect()
}

fn missing(table: &RawTable<'_>, name: &str) -> Fault {
    let near = nearest(name, table.header.iter().map(String::as_str));
    let help = near.map(|name| format!("did you mean `{name}`?"));
    Fault::new(name, "is not a column of this file")
        .expected(format!("one of: {}", table.header.join(", ")))
        .help(help.unwrap_or_default())
}
