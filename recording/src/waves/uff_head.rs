//! The header of a dataset 58 (records 1 to 11), and the system of units of the file (dataset 164).
//!
//! Source: Structural Dynamics Research Laboratory, University of Cincinnati, description of
//! datasets 58 and 164. Fields are in fixed columns; record 6 is also read if its fields are only
//! separated by blanks.

use std::f64::consts::TAU;

use super::quantity;
use super::uff::Cursor;
use super::uff_numbers::{Form, UffError, in_line};
use crate::faults::{Fault, Location};
use crate::unit::Quantity;

/// Specific data types of an axis.
const DISPLACEMENT: i64 = 8;
const VELOCITY: i64 = 11;
const ACCELERATION: i64 = 12;
const FORCES: [i64; 2] = [9, 13];
const PRESSURE: i64 = 15;
const TIME: i64 = 17;
const FREQUENCY: i64 = 18;

/// Units of length and force by their factor in dataset 164: the number of units per SI unit. Others are multiples of the first.
const LENGTHS: &[(f64, &str)] =
    &[(1.0, "m"), (1e3, "mm"), (1e2, "cm"), (1.0 / 0.0254, "in"), (1.0 / 0.3048, "ft")];
const FORCE_UNITS: &[(f64, &str)] = &[
    (1.0, "N"),
    (1e-3, "kN"),
    (1e3, "mN"),
    (1e2, "cN"),
    (1.0 / 9.806_65, "kgf"),
    (0.224_808_943_1, "lbf"),
    (1.0 / 0.138_254_954_376, "pdl"),
];
/// Factors are written with seven digits or more.
const FACTOR_PART: f64 = 1e-5;

/// Records 1 to 11.
#[derive(Debug)]
pub(super) struct Head {
    pub(super) function_type: i64,
    pub(super) source: ChannelProperties,
    /// Node and direction of the reference.
    pub(super) reference: String,
    pub(super) form: Form,
    pub(super) abscissa: Axis,
    pub(super) denominator: Axis,
}

/// Properties that distinguish measured channels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChannelProperties {
    /// ID lines 1, 2, 4 and 5; empty if the file says NONE.
    pub(super) texts: [String; 4],
    /// ID line 3: by convention date and time.
    pub(super) date: String,
    /// Function identification number, version (or sequence), load case.
    pub(super) numbers: [i64; 3],
    /// Name of the response entity.
    pub(super) component: String,
    /// Node of the response; 0 where no geometry was exported.
    pub(super) node: i64,
    /// Node and direction of the response: `2+x`.
    pub(super) dof: String,
    pub(super) ordinate: Axis,
}

/// What the functions of one channel have in common: place, quantity and rate, and without a
/// geometry also their ID lines.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PlaceKey {
    component: String,
    dof: String,
    ordinate: Axis,
    rate_bits: u64,
    texts: Option<[String; 4]>,
}

/// Records 8 to 11: quantity of an axis.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Axis {
    kind: i64,
    pub(super) label: String,
    /// As in the file; completed by the type of data and dataset 164 if it states none, `1` if
    /// these do not either.
    pub(super) unit: String,
}

/// Quantity of an abscissa, and the SI value of its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum AbscissaQuantity {
    Time(f64),
    Frequency(f64),
    /// Neither quantity nor unit is stated.
    Unspecified,
    /// Another quantity, or an unknown unit.
    Else,
}

/// The system of units, for axes that state no unit; `None`: unknown.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Units {
    length: Option<String>,
    force: Option<String>,
}

impl Units {
    pub(super) fn si() -> Self {
        Self { length: Some("m".to_owned()), force: Some("N".to_owned()) }
    }

    /// Reads dataset 164 after its number; unreadable parts leave the units unknown.
    pub(super) fn read(cursor: &mut Cursor<'_>) -> Self {
        cursor.line();
        let factors = cursor.text().and_then(|line| in_line(&line)).unwrap_or_default();
        let named = |at: usize, list: &[(f64, &'static str)]| {
            let factor = *factors.get(at).filter(|factor| factor.is_finite() && **factor > 0.0)?;
            let same = |(known, _): &&(f64, &str)| (factor / known - 1.0).abs() < FACTOR_PART;
            let multiple = || Some(format!("{:e} {}", 1.0 / factor, list.first()?.1));
            list.iter().find(same).map(|(_, name)| (*name).to_owned()).or_else(multiple)
        };
        Self { length: named(0, LENGTHS), force: named(1, FORCE_UNITS) }
    }
}

impl Head {
    pub(super) fn read(cursor: &mut Cursor<'_>) -> Result<Self, UffError> {
        let cut = || Fault::new("", "ends inside a header").expected("11 lines of header");
        let mut ids: [String; 5] = Default::default();
        for id in &mut ids {
            *id = header_text(&cursor.text().ok_or_else(cut)?);
        }
        let dofs = cursor.text().ok_or_else(cut)?;
        let dofs_line = cursor.line;
        let form = cursor.text().ok_or_else(cut)?;
        let form = Form::of(&form, cursor.line)?;
        let mut axes = Vec::new();
        for _ in 0..4 {
            axes.push(Axis::of(&cursor.text().ok_or_else(cut)?));
        }
        let Ok([mut abscissa, ordinate, denominator, _]) = <[Axis; 4]>::try_from(axes) else {
            return Err(cut().into());
        };
        // Times and frequencies are of one unit in every system.
        abscissa.complete(&Units::si());
        let dofs = Dofs::of(&dofs).ok_or_else(|| {
            Fault::new("", "states no degree of freedom")
                .expected("function type, node and direction")
                .at(Location::from_line(dofs_line, &dofs, &(0..dofs.len())))
        })?;
        let [first, second, date, fourth, fifth] = ids;
        let source = ChannelProperties {
            texts: [first, second, fourth, fifth],
            date,
            numbers: dofs.numbers,
            component: dofs.component,
            node: dofs.node,
            dof: dofs.response,
            ordinate,
        };
        let (function_type, reference) = (dofs.function_type, dofs.reference);
        Ok(Self { function_type, source, reference, form, abscissa, denominator })
    }
}

impl PlaceKey {
    pub(super) fn of(source: &ChannelProperties, rate_hz: f64) -> Self {
        Self {
            component: source.component.clone(),
            dof: source.dof.clone(),
            ordinate: source.ordinate.clone(),
            rate_bits: rate_hz.to_bits(),
            texts: (source.node == 0).then(|| source.texts.clone()),
        }
    }
}

impl ChannelProperties {
    /// Whether both have the same date and time of day.
    pub(super) fn has_same_time(&self, other: &Self) -> bool {
        self.date.contains(':') && self.date == other.date
    }

    /// Whether both have dates, and these differ.
    pub(super) fn has_other_date(&self, other: &Self) -> bool {
        !self.date.is_empty() && !other.date.is_empty() && self.date != other.date
    }
}

impl Axis {
    fn of(line: &str) -> Self {
        let column = columns(line);
        let (label, unit) = (header_text(&column(26, 46)), header_text(&column(46, 67)));
        let first = line.split_whitespace().next();
        let kind = first.and_then(|kind| kind.parse::<i64>().ok()).unwrap_or(0);
        Self { kind, label, unit }
    }

    /// Sets a missing unit to that of the axis's type of data in a system of units.
    pub(super) fn complete(&mut self, units: &Units) {
        if self.unit.is_empty() {
            self.unit = by_kind(self.kind, units);
        }
    }

    /// The quantity of an abscissa, by its unit, or by the type of data if the unit is missing.
    pub(super) fn counts(&self) -> AbscissaQuantity {
        match (quantity::of(&self.unit), self.kind) {
            (Some((Quantity::Time, si)), _) => AbscissaQuantity::Time(si),
            (Some((Quantity::Frequency, si)), _) => AbscissaQuantity::Frequency(si),
            _ if self.unit.eq_ignore_ascii_case("rad/s") => AbscissaQuantity::Frequency(1.0 / TAU),
            (None, 0 | 1) if self.unit == "1" => AbscissaQuantity::Unspecified,
            _ => AbscissaQuantity::Else,
        }
    }
}

/// The unit of data of a type, in the file's system of units.
fn by_kind(kind: i64, units: &Units) -> String {
    let of_length = |end: &str| units.length.as_ref().map(|length| format!("{length}{end}"));
    let unit = match kind {
        DISPLACEMENT => of_length(""),
        VELOCITY => of_length("/s"),
        ACCELERATION => of_length("/s^2"),
        kind if FORCES.contains(&kind) => units.force.clone(),
        PRESSURE if *units == Units::si() => Some("Pa".to_owned()),
        TIME => Some("s".to_owned()),
        FREQUENCY => Some("Hz".to_owned()),
        _ => None,
    };
    unit.unwrap_or_else(|| "1".to_owned())
}

/// Record 6: function type, its numbers, and the degrees of freedom of response and reference.
struct Dofs {
    function_type: i64,
    numbers: [i64; 3],
    component: String,
    node: i64,
    response: String,
    reference: String,
}

impl Dofs {
    fn of(line: &str) -> Option<Self> {
        let column = columns(line);
        let fields: Vec<&str> = line.split_whitespace().collect();
        let fixed = [
            (0, 5),
            (5, 15),
            (15, 20),
            (20, 30),
            (31, 41),
            (41, 51),
            (51, 55),
            (56, 66),
            (66, 76),
            (76, 80),
        ]
        .map(|(from, to)| column(from, to));
        let free: [String; 10] =
            std::array::from_fn(|index| fields.get(index).copied().unwrap_or_default().to_owned());
        Self::of_fields(&fixed).or_else(|| Self::of_fields(&free))
    }

    fn of_fields(fields: &[String; 10]) -> Option<Self> {
        let [kind, id, version, load, component, node, direction, _, to_node, to_direction] =
            fields;
        let number = |field: &String| field.parse::<i64>().unwrap_or(0);
        Some(Self {
            function_type: kind.parse().ok()?,
            numbers: [number(id), number(version), number(load)],
            component: header_text(component),
            node: node.parse().ok()?,
            response: dof(node, direction)?,
            reference: dof(to_node, to_direction).unwrap_or_default(),
        })
    }
}

/// `2+x` for node 2 and direction 1; a turn about an axis is `2+rx`.
fn dof(node: &str, direction: &str) -> Option<String> {
    let node: i64 = node.parse().ok()?;
    let direction: i64 = direction.parse().ok()?;
    let sign = if direction < 0 { '-' } else { '+' };
    let axis = ["", "x", "y", "z", "rx", "ry", "rz"];
    let axis = axis.get(usize::try_from(direction.unsigned_abs()).ok()?)?;
    Some(if axis.is_empty() { node.to_string() } else { format!("{node}{sign}{axis}") })
}

/// The fields of a line in fixed columns, trimmed.
fn columns(line: &str) -> impl Fn(usize, usize) -> String {
    let characters: Vec<char> = line.chars().collect();
    move |from, to| {
        let end = characters.len();
        let part = characters.get(from.min(end)..to.min(end));
        part.unwrap_or_default().iter().collect::<String>().trim().to_owned()
    }
}

/// A text of the header; empty for NONE.
fn header_text(text: &str) -> String {
    let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
    if text.eq_ignore_ascii_case("none") { String::new() } else { text.to_owned() }
}
