//! The line of units that many programs write below the header: `s;deg;deg;mm`.
//!
//! Its units are compared with those of the columns' names or of the mapping; they never replace them.

use super::RawTable;
use crate::faults::{Fault, Faults};
use crate::unit::Unit;

/// Spellings in addition to those of [`crate::unit`].
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
/// Cells without a unit.
const NONE: [&str; 2] = ["", "-"];
/// Units that are recognised but not supported.
const FOREIGN: &[&str] = &[
    "%", "V", "mV", "K", "W", "bar", "counts", "in", "inch", "ft", "lbf", "kgf", "rev", "min", "h",
];

/// The units below a header.
pub(super) struct UnitsLine {
    /// From 1.
    line: usize,
    /// By column.
    cells: Vec<UnitCell>,
}

/// The unit in one column's cell.
struct UnitCell {
    /// Without brackets.
    spelling: String,
    /// `None` if it is not supported.
    unit: Option<Unit>,
}

impl UnitsLine {
    /// The units in these cells; `None` if they contain anything else, unless `stated` says that
    /// they are units.
    pub(super) fn of<'c>(
        line: usize,
        cells: impl Iterator<Item = &'c str>,
        stated: bool,
    ) -> Option<Self> {
        let mut found = Vec::new();
        for cell in cells {
            let spelling = cell.trim_matches(['[', ']', '(', ')', '<', '>']).trim();
            if !stated && !is_unit(spelling) {
                return None;
            }
            found.push(UnitCell { spelling: spelling.to_owned(), unit: unit(spelling) });
        }
        let holds_units = stated || found.iter().any(|cell| cell.unit.is_some());
        holds_units.then_some(Self { line, cells: found })
    }
}

impl RawTable<'_> {
    /// Adds a fault if the line of units contradicts the unit of a column, or contains an unknown
    /// one: the latter not if the mapping has `stated` how the column is read.
    pub(crate) fn check_unit(
        &self,
        column: usize,
        read_in: Option<Unit>,
        stated: bool,
        faults: &mut Faults,
    ) {
        let Some(line) = &self.units else {
            if let Some(read_in) = read_in.filter(|_| !stated) {
                self.check_unit_of_name(column, read_in, faults);
            }
            return;
        };
        let (Some(found), Some(read_in)) = (line.cells.get(column), read_in) else { return };
        let message = match found.unit {
            Some(unit) if (unit.quantity, unit.si) == (read_in.quantity, read_in.si) => return,
            Some(unit) => format!("has the unit {}, expected {}", unit.name, read_in.name),
            None if stated || NONE.contains(&found.spelling.as_str()) => return,
            None => format!("has the unit {}, which is not supported", found.spelling),
        };
        let name = self.header.get(column).cloned().unwrap_or_default();
        let fault = Fault::new(name, message).expected(read_in.name).help(found.remedy(read_in));
        faults.push(self.line_fault(line.line, column, fault));
    }

    /// Adds a fault if the unit in a column's name contradicts the one in which it is read: any in brackets, as in `x [m]`; after an underscore only
    /// another size of the same quantity, since `x_m` may mean something else.
    fn check_unit_of_name(&self, column: usize, read_in: Unit, faults: &mut Faults) {
        let Some(name) = self.header.get(column) else { return };
        let found = match unit_in_brackets(name) {
            Some(unit) => Some(unit),
            None => Unit::split(name).1.filter(|unit| unit.quantity == read_in.quantity),
        };
        let Some(found) = found else { return };
        if (found.quantity, found.si) == (read_in.quantity, read_in.si) {
            return;
        }
        let message =
            format!("has the unit {} in its name, but is read in {}", found.name, read_in.name);
        let help = format!(
            "state `unit = \"{}\"` in the mapping; if it is in {}, state that",
            found.name, read_in.name
        );
        let fault = Fault::new(name.clone(), message).expected(read_in.name).help(help);
        faults.push(self.header_fault(column, fault));
    }
}

/// The unit at the end of a name in brackets, if it is known.
fn unit_in_brackets(name: &str) -> Option<Unit> {
    let name = name.trim();
    let within = [('[', ']'), ('(', ')')].into_iter().find_map(|(open, close)| {
        let (_, text) = name.strip_suffix(close)?.rsplit_once(open)?;
        Some(text.trim())
    });
    within.and_then(unit)
}

impl UnitCell {
    /// What to do where a column with this unit is read in another.
    fn remedy(&self, read_in: Unit) -> String {
        let ours = read_in.name;
        match (self.spelling.as_str(), ours, self.unit) {
            ("K", "C", _) => "state `unit = \"C\"` and `offset = -273.15` in a mapping".to_owned(),
            ("g", "m_s2", _) => "state `scale = 9.80665` in a mapping".to_owned(),
            (_, _, Some(unit)) if unit.quantity == read_in.quantity => {
                let name = unit.name;
                format!("rename the column, or state `unit = \"{name}\"` in a mapping")
            }
            (unit, ..) => format!(
                "state the factor from {unit} to {ours} in a mapping (`scale`), or correct the line of units"
            ),
        }
    }
}

/// Whether a text is a unit.
pub(crate) fn is_unit(text: &str) -> bool {
    NONE.contains(&text) || FOREIGN.contains(&text) || unit(text).is_some()
}

fn unit(spelling: &str) -> Option<Unit> {
    let ours = SPELLINGS.iter().find(|(_, spellings)| spellings.contains(&spelling));
    Unit::from_name(ours.map_or(spelling, |(ours, _)| ours))
}
