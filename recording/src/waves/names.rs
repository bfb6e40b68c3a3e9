//! Interpretation of column names: unit, axis, time, length or sample count.
//!
//! Names are only a convention: what a name does not determine remains unknown.

use super::quantity;
use crate::unit::{Quantity, Unit};

/// What a column contains, by its name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ColumnRole {
    /// Time; the unit in s.
    Time(f64),
    /// Time in an unknown unit.
    TimeInUnknownUnit,
    /// A length along which the others were measured; the unit in m.
    Length(f64),
    /// Sample numbers, which do not determine the rate.
    Samples,
    /// Anything else.
    Else,
}

const TIME: &[&str] = &["t", "time", "x_value", "timestamp", "elapsed", "zeit", "tiempo", "temps"];
const LENGTH: &[&str] =
    &["x", "s", "pos", "position", "distance", "length", "place", "path", "weg"];
const SAMPLES: &[&str] = &["n", "no", "nr", "index", "sample", "samples", "row", "point", "i"];

/// Name and unit of a column head: `Fx_N`, `Force (N)`, `Force [N]`, `"Force"`.
pub(super) fn split(head: &str) -> (&str, Option<&str>) {
    let head = head.trim().trim_matches('"').trim_start_matches(['#', '%']).trim();
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some((name, unit)) = head.strip_suffix(close).and_then(|h| h.rsplit_once(open)) {
            let unit = unit.trim();
            return (name.trim(), (!unit.is_empty()).then_some(unit));
        }
    }
    match Unit::split(head) {
        (_, None) => (head, None),
        (base, Some(_)) => (base, head.get(base.len() + 1..)),
    }
}

/// The quantity of a unit, and its SI value. `x_mm` is the spelling of `trued.recording/1`, `x
/// (mm)` that of others.
pub(super) fn measured(unit: &str) -> Option<(Quantity, f64)> {
    let known = Unit::from_name(unit).map(|unit| (unit.quantity, unit.si));
    known.or_else(|| quantity::of(unit))
}

/// What a column contains, by its head.
pub(super) fn counts(head: &str) -> ColumnRole {
    let (name, unit) = split(head);
    let name = name.to_lowercase();
    let measured = unit.and_then(measured);
    let is = |list: &[&str]| list.contains(&name.as_str());
    match measured {
        Some((Quantity::Time, si)) if is(TIME) => ColumnRole::Time(si),
        None if is(TIME) && unit.is_none() => ColumnRole::Time(1.0),
        None if is(TIME) => ColumnRole::TimeInUnknownUnit,
        Some((Quantity::Length, si)) if is(LENGTH) => ColumnRole::Length(si),
        None if is(SAMPLES) => ColumnRole::Samples,
        // `seconds`, `ms`: only a unit.
        None => match quantity::of(&name) {
            // `min` may be a minimum.
            Some((Quantity::Time, si)) if !matches!(name.as_str(), "min" | "h") => {
                ColumnRole::Time(si)
            }
            _ => ColumnRole::Else,
        },
        _ => ColumnRole::Else,
    }
}

/// The axis in a name: 0 to 2 along x, y, z, 3 to 5 moments about them.
pub(super) fn axis(name: &str) -> Option<usize> {
    const ALONG: &[&str] =
        &["", "f", "a", "v", "d", "acc", "accel", "acceleration", "force", "vib", "+", "-"];
    const ABOUT: &[&str] = &["m", "mom", "moment", "torque"];
    let lower = name.to_lowercase();
    let words: Vec<&str> = lower
        .split(|c: char| !(c.is_alphabetic() || c == '+' || c == '-'))
        .filter(|word| !word.is_empty())
        .collect();
    let turning = words.iter().any(|word| ABOUT[1..].contains(word));
    words.iter().find_map(|word| {
        let letter = word.chars().next_back()?;
        let axis = ['x', 'y', 'z'].iter().position(|axis| *axis == letter)?;
        let before = word.get(..word.len() - 1)?;
        if ABOUT.contains(&before) {
            return Some(3 + axis);
        }
        ALONG.contains(&before).then_some(if turning { 3 + axis } else { axis })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_of_many_programs_give_name_and_unit() {
        for (head, name, unit) in [
            ("Fx_N", "Fx", Some("N")),
            ("Force (N)", "Force", Some("N")),
            (" Acceleration [m/s²] ", "Acceleration", Some("m/s²")),
            ("\"Voltage\"", "Voltage", None),
            ("acc_y_raw", "acc_y_raw", None),
            ("ax_m_s2", "ax", Some("m_s2")),
            ("# t", "t", None),
        ] {
            assert_eq!(split(head), (name, unit), "{head}");
        }
    }

    #[test]
    fn time_length_and_samples_are_distinguished() {
        for head in ["t_s", "Time", "time (s)", "X_Value", "Seconds", "t [sec]"] {
            assert_eq!(counts(head), ColumnRole::Time(1.0), "{head}");
        }
        assert_eq!(counts("t_ms"), ColumnRole::Time(1e-3));
        assert_eq!(counts("Time (min)"), ColumnRole::Time(60.0));
        assert_eq!(counts("Time (10 ms)"), ColumnRole::Time(0.01));
        assert_eq!(counts("Time (ticks)"), ColumnRole::TimeInUnknownUnit);
        assert_eq!(counts("x_um"), ColumnRole::Length(1e-6));
        assert_eq!(counts("Position (mm)"), ColumnRole::Length(1e-3));
        assert_eq!(counts("Sample"), ColumnRole::Samples);
        for head in ["Fx_N", "x", "temp_C", "tacho", "Force (N)", "min", "h"] {
            assert_eq!(counts(head), ColumnRole::Else, "{head}");
        }
    }

    #[test]
    fn an_axis_is_recognised_by_common_names_only() {
        for (name, expected) in [
            ("fx_N", Some(0)),
            ("acc_y_raw", Some(1)),
            ("AccelerationY", Some(1)),
            ("Fz", Some(2)),
            ("my_Nm", Some(4)),
            ("torque z", Some(5)),
            ("2+x", Some(0)),
            ("1-z", Some(2)),
            ("Voltage", None),
            ("matrix", None),
            ("7", None),
        ] {
            assert_eq!(axis(name), expected, "{name}");
        }
    }
}
