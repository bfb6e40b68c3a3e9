//! The line of units that many programs write below the header: `s;deg;deg;mm`.
//!
//! Its units are compared with those of the columns' names or of the mapping; they never take their place.

use super::RawTable;
use crate::faults::{Fault, Faults};
use crate::unit::Unit;

/// Spellings beside those of [`crate::unit`].
const SPELLINGS: &[(&str, &[&str])] = &[
    ("deg", &["°", "degree", "degrees"]),
    ("C", &["°C", "℃", "degC"]),
    ("s", &["sec", "second", "seconds"]),
    ("us", &["µs", "μs"]),
    ("um", &["µm", "μm"]),
    ("Nm", &["N·m", "N*m", "N m"]),
    ("m_s", &["m/s"]),
    ("mm_s", &["mm/s"]),
    ("rad_s", &["rad/s"]),
    ("deg_s", &["deg/s", "°/s"]),
    ("m_s2", &["m/s²", "m/s^2", "m/s2"]),
    ("rpm", &["1/min", "min-1", "min^-1", "rev/min", "U/min"]),
];
/// What stands in such a line and names none of our units.
const WORDS: &[&str] = &["", "-", "%", "V", "mV", "K", "W", "bar", "counts"];

/// The units below a header.
pub(super) struct UnitsLine {
    /// From 1.
    line: usize,
    /// By column; none where nothing stands that could be compared.
    units: Vec<Option<Unit>>,
}

impl UnitsLine {
    /// The units in these cells; none where they hold anything else, unless `stated` to hold units.
    pub(super) fn of<'c>(
        line: usize,
        cells: impl Iterator<Item = &'c str>,
        stated: bool,
    ) -> Option<Self> {
        let mut units = Vec::new();
        for cell in cells {
            let bare = cell.trim_matches(['[', ']', '(', ')', '<', '>']).trim();
            if !stated && !is_unit(bare) {
                return None;
            }
            units.push(unit(bare));
        }
        (stated || units.iter().any(Option::is_some)).then_some(Self { line, units })
    }
}

impl RawTable<'_> {
    /// Notes a fault where the line of units contradicts the unit that a column is read in.
    pub(crate) fn check_unit(&self, column: usize, read_in: Option<Unit>, faults: &mut Faults) {
        let Some(units) = &self.units else { return };
        let found = units.units.get(column).copied().flatten();
        let (Some(found), Some(read_in)) = (found, read_in) else { return };
        if (found.quantity, found.si) != (read_in.quantity, read_in.si) {
            let name = self.header.get(column).cloned().unwrap_or_default();
            let message = format!("has the unit {} and is read in {}", found.name, read_in.name);
            let fault = Fault::new(name, message).expected(read_in.name).help(format!(
                "name the column so, or state `unit = \"{}\"` in a mapping",
                found.name
            ));
            faults.push(self.line_fault(units.line, column, fault));
        }
    }
}

/// Whether a text may stand in a line of units.
pub(crate) fn is_unit(text: &str) -> bool {
    WORDS.contains(&text) || unit(text).is_some()
}

fn unit(spelling: &str) -> Option<Unit> {
    let ours = SPELLINGS.iter().find(|(_, spellings)| spellings.contains(&spelling));
    Unit::named(ours.map_or(spelling, |(ours, _)| ours))
}
