//! Values as TOML text: numbers that read back to the same bits, strings with everything escaped.

use std::fmt::Write;

/// A line `key = value`.
pub(crate) fn line(out: &mut String, key: &str, value: &str) {
    // Writing into a string cannot fail.
    let _ = writeln!(out, "{key} = {value}");
}

/// A list of numbers.
pub(crate) fn list(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|value| number(*value)).collect();
    format!("[{}]", values.join(", "))
}

/// The shortest text that reads back to the same bits, as TOML spells it.
pub(crate) fn number(value: f64) -> String {
    if value.is_nan() {
        "nan".to_owned()
    } else if value.is_infinite() {
        if value > 0.0 { "inf".to_owned() } else { "-inf".to_owned() }
    } else {
        format!("{value:?}")
    }
}

/// A basic string: everything that is not plain is escaped.
pub(crate) fn string(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\t' => out.push_str("\\t"),
            c if c.is_control() => {
                let _ = write!(out, "\\U{:08X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
