//! Reads a mapping: expands patterns, checks units, reports all errors at once.

use toml::de::DeValue;

use super::orientation::Orientation;
use super::{Columns, MappedColumn, Mapping, SCHEMA, Source};
use crate::faults::Faults;
use crate::series::{Column, Dialect, JOINTS_MAX, NumericColumns, RecordingMetadata, TimeFormat};
use crate::toml_reader::{Document, Table};
use crate::unit::Unit;

pub(super) fn parse(name: &str, text: &str) -> Result<Mapping, Faults> {
    let document = Document::parse(name, text)?;
    let mapping = read(&document.root());
    document.finish(mapping)
}

fn read(root: &Table<'_, '_>) -> Option<Mapping> {
    root.require("schema", "schema = \"trued.mapping/1\"");
    root.choice("schema", &[(SCHEMA, ())]);
    let joints = root.whole("joints", 1..JOINTS_MAX as i64 + 1);
    let joints = joints.and_then(|joints| usize::try_from(joints).ok());
    let mut dialect = dialect(root);
    let keep = root.table("keep").map(|table| keep(&table)).unwrap_or_default();
    let drop_repeated =
        root.choice("repeated_time", &[("fault", false), ("drop", true)]).unwrap_or_default();
    let about = root.table("recording").map(|table| RecordingMetadata::from_table(&table));
    let columns = root.table("columns").map(|table| columns(&table, joints));
    if let Some(columns) = &columns {
        dialect.reads = NumericColumns::Listed(columns.numbers().cloned().collect());
    }
    root.close();
    Some(Mapping { dialect, about, columns, keep, drop_repeated })
}

fn dialect(root: &Table<'_, '_>) -> Dialect {
    let separators = [(",", b','), (";", b';'), ("tab", b'\t'), ("space", b' '), ("|", b'|')];
    let thousands = [(".", '.'), (",", ','), ("space", ' '), ("'", '\'')];
    let skip = root.whole("skip_rows", 0..100_000).unwrap_or(0);
    let comment = root.text("comment");
    if let Some(text) = comment.filter(|text| text.len() != 1) {
        root.fault("comment", format!("is \"{text}\""), "one ASCII character");
    }
    let decimal_comma = root.choice("decimal", &[(".", false), (",", true)]);
    let thousands = root.choice("thousands", &thousands);
    if decimal_comma.is_some_and(|comma| thousands == Some(if comma { ',' } else { '.' })) {
        root.fault("thousands", "is the decimal mark", "a character different from `decimal`");
    }
    Dialect {
        separator: root.choice("separator", &separators),
        decimal_comma,
        thousands,
        units_row: root.flag("units_row"),
        comment: comment.and_then(|text| text.bytes().next()),
        skip_lines: usize::try_from(skip).unwrap_or(0),
        no_header: root.flag("header").is_some_and(|header| !header),
        width: None,
        reads: NumericColumns::Known,
    }
}

fn keep(table: &Table<'_, '_>) -> Vec<(String, Vec<String>)> {
    let mut keep = Vec::new();
    for name in table.keys() {
        if let Some(texts) = table.texts(name) {
            keep.push((name.to_owned(), texts.into_iter().map(str::to_owned).collect()));
        }
    }
    table.close();
    keep
}

fn columns(table: &Table<'_, '_>, joints: Option<usize>) -> Columns {
    let mut columns = Columns::default();
    for pattern in table.keys() {
        let Some(entry) = table.table(pattern) else { continue };
        if pattern == "orientation" {
            columns.orientation = Orientation::read(&entry);
        } else if let Some(found) = column(table, pattern, &entry, joints) {
            columns.named.extend(found);
        }
        entry.close();
    }
    table.close();
    columns
}

/// The columns of one entry: one, or for a name with `*` one per joint.
fn column(
    table: &Table<'_, '_>,
    pattern: &str,
    entry: &Table<'_, '_>,
    joints: Option<usize>,
) -> Option<Vec<MappedColumn>> {
    let order = entry.wholes("order", 1..1000);
    let unit = unit_of(entry);
    let names = sources(entry);
    let names =
        if pattern == "t_s" { names.and_then(|names| times(entry, names, unit)) } else { names };
    let starred = pattern.contains('*');
    let listed = names.as_ref().filter(|_| starred).and_then(SourceTemplate::count);
    let count = listed.or(order.as_ref().map(Vec::len)).or(joints).filter(|_| starred);
    if starred && count.is_none() {
        table.fault(
            pattern,
            "has one column per joint",
            "`joints = N` at the top, or `order` here",
        );
        return None;
    }
    let count = count.unwrap_or(1).min(JOINTS_MAX);
    let scale = factors(entry, "scale", count, 1.0)?;
    let sign = factors(entry, "sign", count, 1.0)?;
    let offset = factors(entry, "offset", count, 0.0)?;
    let names = names?;
    if let Some(several) = names.count().filter(|several| !starred && *several != 1) {
        let expected = "one column, or `sum = true`, or `labels = true`";
        entry.fault("from", format!("has {several} columns for one quantity"), expected);
        return None;
    }
    let mut found = Vec::new();
    for joint in 0..count {
        let name = pattern.replacen('*', &(joint + 1).to_string(), 1);
        let theirs = order.as_ref().and_then(|order| order.get(joint).copied());
        let theirs = theirs.unwrap_or(joint as i64 + 1);
        if !fits(table, pattern, &name, entry, unit) {
            return None;
        }
        let from = names.source(joint, theirs)?;
        found.push(MappedColumn {
            name,
            from,
            unit,
            scale: scale[joint] * sign[joint],
            offset: offset[joint],
        });
    }
    Some(found)
}

pub(super) fn unit_of(entry: &Table<'_, '_>) -> Option<Unit> {
    let name = entry.text("unit")?;
    let unit = Unit::from_name(name);
    if unit.is_none() {
        let known: Vec<&str> = crate::unit::UNITS.iter().map(|unit| unit.name).collect();
        entry.fault("unit", format!("is \"{name}\""), format!("one of {}", known.join(" ")));
    }
    unit
}

/// Whether the name is a column of a recording, and the source's unit is of the same quantity.
fn fits(
    table: &Table<'_, '_>,
    pattern: &str,
    name: &str,
    entry: &Table<'_, '_>,
    theirs: Option<Unit>,
) -> bool {
    let ours = match Column::named(name) {
        Ok(Column::Channel(_, unit)) => unit,
        Ok(Column::Time) => Unit::from_name("s"),
        Ok(Column::Segment) => None,
        Ok(Column::Unknown) => {
            table.fault(
                pattern,
                "is not a column of a recording",
                "a column name such as q1_deg, x_mm, t_s",
            );
            return false;
        }
        Err(expected) => {
            table.fault(pattern, "has a unit that does not fit", expected);
            return false;
        }
    };
    match (ours, theirs) {
        (_, None) => true,
        (Some(ours), Some(theirs)) if ours.quantity == theirs.quantity => true,
        (_, Some(theirs)) => {
            let expected = format!("a unit of the same quantity as `{name}`");
            entry.fault("unit", format!("is \"{}\"", theirs.name), expected);
            false
        }
    }
}

fn factors(entry: &Table<'_, '_>, key: &str, count: usize, default: f64) -> Option<Vec<f64>> {
    let is_list = entry.raw(key).is_some_and(|value| value.get_ref().is_array());
    let list = if is_list {
        entry.numbers(key, ..)?
    } else {
        vec![if entry.has(key) { entry.number(key, ..)? } else { default }; count]
    };
    if list.len() != count {
        entry.fault(key, format!("has {} numbers", list.len()), format!("{count}, one per joint"));
        return None;
    }
    if key == "sign" && list.iter().any(|sign| sign.abs() != 1.0) {
        entry.fault(key, "is not a sign", "1 or -1");
        return None;
    }
    Some(list)
}

/// Sources of an entry, before joints are expanded.
enum SourceTemplate {
    Pattern(String),
    List(Vec<String>),
    Labels(Vec<String>),
    Sum(Vec<String>),
    Times(Vec<String>, Option<TimeFormat>),
    Numbers(String, Vec<(String, f64)>),
    Constant(f64),
    Row(f64),
}

impl SourceTemplate {
    fn count(&self) -> Option<usize> {
        match self {
            Self::List(names) => Some(names.len()),
            _ => None,
        }
    }

    /// The source of a joint (from 0), which has the number `theirs` in the source table.
    fn source(&self, joint: usize, theirs: i64) -> Option<Source> {
        Some(match self {
            Self::Pattern(name) => Source::Column(name.replacen('*', &theirs.to_string(), 1)),
            Self::List(names) => Source::Column(names.get(joint)?.clone()),
            Self::Labels(names) => Source::Labels(names.clone()),
            Self::Sum(names) => Source::Sum(names.clone()),
            Self::Times(names, clock) => Source::Times(names.clone(), clock.clone()),
            Self::Numbers(name, numbers) => Source::Numbers(name.clone(), numbers.clone()),
            Self::Constant(value) => Source::Constant(*value),
            Self::Row(step) => Source::Row(*step),
        })
    }
}

fn sources(entry: &Table<'_, '_>) -> Option<SourceTemplate> {
    let labels = entry.flag("labels").unwrap_or_default();
    let sum = entry.flag("sum").unwrap_or_default();
    let numbers = entry.table("numbers").map(|table| numbers(&table));
    let constant = entry.number("constant", ..);
    let step = entry.number("per_row", ..);
    let from = match entry.raw("from").map(toml::Spanned::get_ref) {
        None => None,
        Some(DeValue::Array(_)) => {
            let names = names_of(entry);
            let origin = if labels {
                SourceTemplate::Labels
            } else if sum {
                SourceTemplate::Sum
            } else {
                SourceTemplate::List
            };
            names.map(origin)
        }
        Some(value) => name_of(value).map(|name| match numbers {
            Some(numbers) => SourceTemplate::Numbers(name, numbers),
            None if labels => SourceTemplate::Labels(vec![name]),
            None => SourceTemplate::Pattern(name),
        }),
    };
    if entry.has("from") && from.is_none() {
        entry.fault(
            "from",
            "does not identify a column",
            "a name, a number from 1, or a list of them",
        );
        return None;
    }
    let given: Vec<SourceTemplate> =
        [from, constant.map(SourceTemplate::Constant), step.map(SourceTemplate::Row)]
            .into_iter()
            .flatten()
            .collect();
    if given.len() != 1 {
        let message = format!("has {} sources", given.len());
        entry.fault_here(message, "give exactly one of `from`, `constant`, `per_row`");
    }
    given.into_iter().next()
}

/// A source of times, which may be numbers in a unit, dates or times of the day.
fn times(
    entry: &Table<'_, '_>,
    names: SourceTemplate,
    unit: Option<Unit>,
) -> Option<SourceTemplate> {
    let clock = match entry.text("format").map(|text| (text, TimeFormat::parse(text))) {
        Some((text, Err(expected))) => {
            entry.fault("format", format!("is \"{text}\""), expected);
            return None;
        }
        Some((_, Ok(clock))) => Some(clock),
        None => None,
    };
    if let Some(unit) = unit.filter(|_| clock.is_some()) {
        let expected = "no unit together with `format`, which implies it";
        entry.fault("unit", format!("is \"{}\"", unit.name), expected);
    }
    Some(match names {
        // A unit implies numbers.
        SourceTemplate::Pattern(name) if unit.is_none() => SourceTemplate::Times(vec![name], clock),
        SourceTemplate::List(names) if clock.is_some() => SourceTemplate::Times(names, clock),
        names => names,
    })
}

/// The columns that a list names.
pub(super) fn names_of(entry: &Table<'_, '_>) -> Option<Vec<String>> {
    let list = entry.raw("from")?.get_ref().as_array();
    let names = list.and_then(|list| list.iter().map(|v| name_of(v.get_ref())).collect());
    if names.is_none() {
        entry.fault("from", "is not a list of columns", "a list of names, or of numbers from 1");
    }
    names
}

/// The texts of a column and the numbers assigned to them.
fn numbers(table: &Table<'_, '_>) -> Vec<(String, f64)> {
    let number = |text: &str| Some((text.to_owned(), table.number(text, ..)?));
    let numbers = table.keys().filter_map(number).collect();
    table.close();
    numbers
}

fn name_of(value: &DeValue<'_>) -> Option<String> {
    match value {
        DeValue::String(name) => Some(name.to_string()),
        DeValue::Integer(number) => Some(number.as_str().to_owned()),
        _ => None,
    }
}
