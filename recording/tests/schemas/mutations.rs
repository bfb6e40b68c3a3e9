//! Changes of a value in a file: an unknown key, a missing key, a value of another type, a number
//! at and beyond each bound.

use serde_json::{Map, Number, Value, json};

/// Unlike any key of our formats, so that no reader takes it for a misspelling.
const UNKNOWN_KEY: &str = "qqqqqqqqqqqq";
const UNKNOWN: &str = "with an unknown key";

/// A changed file, and the change.
pub(super) struct Mutant {
    pub(super) change: String,
    /// The key that was changed, added or removed.
    pub(super) key: String,
    pub(super) value: Value,
}

/// Every single change of a value; `numbers` replace each number, so that every bound of a schema
/// is tested on both sides.
pub(super) fn of(good: &Value, numbers: &[f64]) -> Vec<Mutant> {
    let mut found = Vec::new();
    for pointer in pointers(good) {
        let value = good.pointer(&pointer).unwrap();
        for (change, new) in changes(value, numbers) {
            let mut value = good.clone();
            *value.pointer_mut(&pointer).unwrap() = new;
            let key = if change == UNKNOWN { UNKNOWN_KEY } else { key_of(&pointer) }.to_owned();
            found.push(Mutant { change: format!("{pointer} {change}"), key, value });
        }
        if let Some((table, key)) = pointer.rsplit_once('/') {
            let mut value = good.clone();
            if let Some(table) = value.pointer_mut(table).and_then(Value::as_object_mut) {
                table.remove(key);
                let key = key.to_owned();
                found.push(Mutant { change: format!("{pointer} removed"), key, value });
            }
        }
    }
    found
}

/// The last key of the path that is not a list index.
fn key_of(pointer: &str) -> &str {
    pointer.rsplit('/').find(|part| part.parse::<usize>().is_err()).unwrap_or_default()
}

fn changes(value: &Value, numbers: &[f64]) -> Vec<(String, Value)> {
    let wrong_type = |new: Value| (format!("of another type: {new}"), new);
    match value {
        Value::Object(table) => {
            let mut more = table.clone();
            more.insert(UNKNOWN_KEY.to_owned(), json!(true));
            vec![(UNKNOWN.to_owned(), Value::Object(more)), wrong_type(json!(1))]
        }
        Value::Array(_) => vec![wrong_type(json!(true))],
        Value::String(_) => vec![wrong_type(json!(true)), wrong_type(json!({}))],
        Value::Bool(_) => vec![wrong_type(json!(7)), wrong_type(json!("yes"))],
        Value::Number(number) => {
            let other = numbers.iter().filter_map(|new| same_kind(number, *new));
            let other = other.map(|new| (format!("is {new}"), Value::Number(new)));
            other.chain([wrong_type(json!(true)), wrong_type(json!("1"))]).collect()
        }
        Value::Null => Vec::new(),
    }
}

/// An integer in place of an integer.
fn same_kind(old: &Number, new: f64) -> Option<Number> {
    if old.is_f64() {
        return Number::from_f64(new);
    }
    (new.fract() == 0.0 && new.abs() < 1e15).then(|| Number::from(new as i64))
}

/// Paths to every value, the whole first.
fn pointers(value: &Value) -> Vec<String> {
    let mut found = vec![String::new()];
    let mut below = |key: &str, value: &Value| {
        found.extend(pointers(value).into_iter().map(|rest| format!("/{key}{rest}")));
    };
    match value {
        // Keys of our files contain neither `/` nor `~`.
        Value::Object(table) => table.iter().for_each(|(key, value)| below(key, value)),
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(index, v)| below(&index.to_string(), v));
        }
        _ => {}
    }
    found
}

/// Every bound of a schema, with a number just below and just above it.
pub(super) fn bounds(schema: &Value) -> Vec<f64> {
    let mut found = vec![-1e13, 0.0, 1e13];
    gather(schema, &mut found);
    found.sort_by(f64::total_cmp);
    found.dedup();
    found
}

fn gather(schema: &Value, found: &mut Vec<f64>) {
    match schema {
        Value::Object(table) => {
            for key in ["minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"] {
                if let Some(bound) = table.get(key).and_then(Value::as_f64) {
                    let step = 1e-6 * bound.abs().max(1e-3);
                    found.extend([bound - 1.0, bound - step, bound, bound + step, bound + 1.0]);
                }
            }
            table.values().for_each(|value| gather(value, found));
        }
        Value::Array(list) => list.iter().for_each(|value| gather(value, found)),
        _ => {}
    }
}

/// The value as TOML, tables inline.
pub(super) fn toml(value: &Value) -> String {
    let empty = Map::new();
    let table = value.as_object().unwrap_or(&empty);
    table.iter().map(|(key, value)| format!("{key:?} = {}\n", inline(value))).collect()
}

fn inline(value: &Value) -> String {
    match value {
        Value::Object(table) => {
            let pairs = table.iter().map(|(key, value)| format!("{key:?} = {}", inline(value)));
            format!("{{ {} }}", pairs.collect::<Vec<_>>().join(", "))
        }
        Value::Array(list) => {
            format!("[{}]", list.iter().map(inline).collect::<Vec<_>>().join(", "))
        }
        other => other.to_string(),
    }
}
