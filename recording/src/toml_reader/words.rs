//! Error messages for TOML: suggestions for unknown keys, descriptions of ranges.

use std::ops::{Bound, RangeBounds};

use crate::faults::{Fault, nearest};
use crate::unit::{Quantity, Unit};

/// The fault of an unknown key, and the known key that is probably meant.
pub(super) fn unknown_key<'k>(
    path: String,
    name: &str,
    missing: &[&'k str],
    known_keys: &[&'k str],
) -> (Fault, Option<&'k str>) {
    let (base, unit) = Unit::split(name);
    let same_base = |known: &&&str| {
        let (known_base, known_unit) = Unit::split(known);
        known_base == base && (unit.is_some() || known_unit.is_some())
    };
    if let Some(meant) = missing.iter().find(same_base).copied() {
        let found = unit.map_or("no unit".to_owned(), |unit| format!("the unit {}", unit.name));
        let fault = Fault::new(path, format!("has {found}, which does not match this key"))
            .expected(format!("`{meant}`"))
            .help(conversion(unit, meant));
        return (fault, Some(meant));
    }
    let fault = Fault::new(path, "is an unknown key");
    match nearest(name, known_keys.iter().copied()) {
        Some(meant) => (fault.help(format!("did you mean `{meant}`?")), Some(meant)),
        None => {
            let mut known = known_keys.to_vec();
            known.sort_unstable();
            known.dedup();
            (fault.help(format!("valid keys: {}", known.join(", "))), None)
        }
    }
}

fn conversion(found: Option<Unit>, meant: &str) -> String {
    match (found, Unit::split(meant).1) {
        (Some(a), Some(b)) if a.quantity == b.quantity && a.quantity != Quantity::Other => {
            format!("write `{meant}`, with the value multiplied by {}", rounded(a.si / b.si))
        }
        _ => format!("write `{meant}`"),
    }
}

/// A factor for people, without the noise of its last bits.
fn rounded(factor: f64) -> f64 {
    format!("{factor:.9e}").parse().unwrap_or(factor)
}

/// Description of a range of numbers.
pub(super) fn describe(range: &impl RangeBounds<f64>) -> String {
    match (range.start_bound(), range.end_bound()) {
        (Bound::Included(a), Bound::Included(b)) => format!("a number from {a} to {b}"),
        (Bound::Included(a), Bound::Excluded(b)) => format!("a number from {a} to below {b}"),
        (Bound::Excluded(a), Bound::Included(b)) => format!("a number above {a}, at most {b}"),
        (Bound::Excluded(a), Bound::Excluded(b)) => format!("a number above {a} and below {b}"),
        (Bound::Included(a), Bound::Unbounded) => format!("a number of {a} or more"),
        (Bound::Excluded(a), Bound::Unbounded) => format!("a number above {a}"),
        (Bound::Unbounded, Bound::Included(b)) => format!("a number of at most {b}"),
        (Bound::Unbounded, Bound::Excluded(b)) => format!("a number below {b}"),
        (Bound::Unbounded, Bound::Unbounded) => "a finite number".to_owned(),
    }
}
