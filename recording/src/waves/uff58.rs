//! One function at nodal degrees of freedom: dataset 58 of a universal file, as text or binary (58b).
//!
//! Source: Structural Dynamics Research Laboratory, University of Cincinnati, description of dataset 58: records 1 to 12.
//! Binary: IEEE 754 of four or eight bytes in either order; the old VAX form is refused.

use super::quantity;
use super::spacing::{Spacing, tidy};
use super::uff::Cursor;
use super::uff_numbers::{Form, Refused, ascii, binary as binary_numbers};
use crate::faults::{Fault, Place};
use crate::unit::Quantity;

/// Steps are written with six digits: a rate this near to a whole number is one.
const SIX_DIGITS: f64 = 5e-6;

/// A function that was read.
#[derive(Debug)]
pub(super) struct Function {
    /// Node and direction of the response: `2+x`.
    pub(super) response: String,
    pub(super) reference: String,
    pub(super) unit: String,
    pub(super) reference_unit: String,
    pub(super) content: Content,
}

/// What a function holds.
#[derive(Debug)]
pub(super) enum Content {
    Time {
        start_s: f64,
        rate_hz: f64,
        values: Vec<f64>,
    },
    Response {
        frequency_hz: Vec<f64>,
        values: Vec<[f64; 2]>,
    },
    /// A function of another type, by its name.
    Other(String),
}

/// Records 1 to 11.
struct Head {
    function_type: i64,
    response: String,
    reference: String,
    form: Form,
    abscissa_unit: String,
    unit: String,
    reference_unit: String,
}

impl Function {
    /// Reads a function behind its line `58`; `binary` is that line where the numbers are binary.
    ///
    /// # Errors
    /// What is wrong first; the cursor then stands behind the dataset, or where its end is not told, inside.
    pub(super) fn read(cursor: &mut Cursor<'_>, binary: Option<&str>) -> Result<Self, Refused> {
        let head = Head::read(cursor);
        let numbers = match (binary, &head) {
            (Some(line), Ok(head)) => {
                let numbers = binary_numbers(cursor, line, &head.form);
                // What stands between the numbers and the end is padding.
                if numbers.is_ok() {
                    cursor.skip_to_mark();
                }
                numbers
            }
            _ => ascii(cursor),
        };
        let head = head?;
        let content = head.content(&numbers?)?;
        let Head { response, reference, unit, reference_unit, .. } = head;
        Ok(Self { response, reference, unit, reference_unit, content })
    }
}

impl Head {
    fn read(cursor: &mut Cursor<'_>) -> Result<Self, Refused> {
        let cut = || Fault::new("", "ends inside a header").expected("11 lines of header");
        for _ in 0..5 {
            cursor.line().ok_or_else(cut)?;
        }
        let dofs = cursor.text().ok_or_else(cut)?;
        let dofs_line = cursor.line;
        let form = cursor.text().ok_or_else(cut)?;
        let form = Form::of(&form, cursor.line)?;
        let mut axes = Vec::new();
        for _ in 0..4 {
            axes.push(Axis::of(&cursor.text().ok_or_else(cut)?));
        }
        let [abscissa, ordinate, denominator, _] = axes.as_slice() else {
            return Err(cut().into());
        };
        let (function_type, response, reference) = dofs_of(&dofs).ok_or_else(|| {
            Fault::new("", "names no degree of freedom")
                .expected("function type, node and direction")
                .at(Place::in_line(dofs_line, &dofs, &(0..dofs.len())))
        })?;
        Ok(Self {
            function_type,
            response,
            reference,
            form,
            abscissa_unit: abscissa.unit.clone(),
            unit: ordinate.unit.clone(),
            reference_unit: denominator.unit.clone(),
        })
    }

    fn content(&self, numbers: &[f64]) -> Result<Content, Refused> {
        let is_time = matches!(self.function_type, 0 | 1) && !self.form.complex;
        if !is_time && self.function_type != 4 {
            return Ok(Content::Other(function_name(self.function_type)));
        }
        let form = &self.form;
        let width = 1 + usize::from(form.complex) + usize::from(!form.even);
        let points = numbers.len() / width;
        if points != form.points || points < 2 {
            let message = format!("holds {points} points, its header says {}", form.points);
            return Err(Fault::new("", message).expected("equal numbers, 2 or more").into());
        }
        if numbers.iter().any(|number| number.is_infinite()) {
            let fault = Fault::new("", "holds infinite numbers");
            return Err(fault.expected("finite numbers").into());
        }
        let rows = || numbers.chunks_exact(width);
        let x: Vec<f64> = if form.even {
            (0..points).map(|i| form.start + form.step * i as f64).collect()
        } else {
            rows().map(|row| row[0]).collect()
        };
        let factor = quantity::of(&self.abscissa_unit);
        if is_time {
            let si = factor.filter(|(q, _)| *q == Quantity::Time).map_or(1.0, |(_, si)| si);
            let values = rows().map(|row| row[width - 1]).collect();
            return self.over_time(&x, si, values);
        }
        let si = factor.filter(|(q, _)| *q == Quantity::Frequency).map_or(1.0, |(_, si)| si);
        let frequency_hz: Vec<f64> = x.iter().map(|x| si * x).collect();
        if !frequency_hz.windows(2).all(|pair| pair[1] > pair[0]) {
            let fault = Fault::new("", "its frequencies do not grow");
            return Err(fault.expected("growing frequencies").into());
        }
        let value = |row: &[f64]| match form.complex {
            true => [row[width - 2], row[width - 1]],
            false => [row[width - 1], 0.0],
        };
        Ok(Content::Response { frequency_hz, values: rows().map(value).collect() })
    }

    fn over_time(&self, x: &[f64], si: f64, values: Vec<f64>) -> Result<Content, Refused> {
        let (start, step) = if self.form.even {
            (self.form.start, self.form.step)
        } else {
            let spacing = Spacing::of(x, |_| false).map_err(|(_, fault)| fault)?;
            if spacing.runs.len() != 1 {
                let fault = Fault::new("", "its times have gaps");
                return Err(fault.expected("even steps").into());
            }
            (x.first().copied().unwrap_or(0.0), spacing.step)
        };
        let rate_hz = tidy(1.0 / (si * step), SIX_DIGITS);
        if !(rate_hz > 0.0 && rate_hz.is_finite() && (si * start).is_finite()) {
            let fault = Fault::new("", format!("its step is {step}"));
            return Err(fault.expected("a finite step above 0").into());
        }
        Ok(Content::Time { start_s: si * start, rate_hz, values })
    }
}

/// Records 8 to 11: what an axis measures.
struct Axis {
    unit: String,
}

impl Axis {
    fn of(line: &str) -> Self {
        let characters: Vec<char> = line.chars().collect();
        let column = |from: usize, to: usize| {
            let part = characters.get(from.min(characters.len())..to.min(characters.len()));
            part.unwrap_or_default().iter().collect::<String>().trim().to_owned()
        };
        let label = column(46, 67);
        let label = label.trim_end_matches('\0').trim().to_owned();
        let kind = line.split_whitespace().next().and_then(|kind| kind.parse::<i64>().ok());
        // A label that is missing is what the type of data is measured in, in SI.
        let unit = match (label.as_str(), kind) {
            ("" | "NONE" | "None", Some(8)) => "m",
            ("" | "NONE" | "None", Some(9 | 13)) => "N",
            ("" | "NONE" | "None", Some(11)) => "m/s",
            ("" | "NONE" | "None", Some(12)) => "m/s^2",
            ("" | "NONE" | "None", Some(15)) => "Pa",
            ("" | "NONE" | "None", Some(17)) => "s",
            ("" | "NONE" | "None", Some(18)) => "Hz",
            ("" | "NONE" | "None", _) => "1",
            (label, _) => label,
        };
        Self { unit: unit.to_owned() }
    }
}

/// Record 6: function type, and node and direction of response and reference.
fn dofs_of(line: &str) -> Option<(i64, String, String)> {
    let characters: Vec<char> = line.chars().collect();
    let column = |from: usize, to: usize| {
        let part = characters.get(from.min(characters.len())..to.min(characters.len()));
        part.unwrap_or_default().iter().collect::<String>().trim().to_owned()
    };
    let fixed = || {
        let function = column(0, 5).parse().ok()?;
        let response = dof(&column(41, 51), &column(51, 55))?;
        Some((function, response, dof(&column(66, 76), &column(76, 80)).unwrap_or_default()))
    };
    let free = || {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [function, _, _, _, _, node, direction, rest @ ..] = words.as_slice() else {
            return None;
        };
        let reference = match rest {
            [_, node, direction, ..] => dof(node, direction),
            _ => None,
        };
        Some((function.parse().ok()?, dof(node, direction)?, reference.unwrap_or_default()))
    };
    fixed().or_else(free)
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

fn function_name(kind: i64) -> String {
    let name = match kind {
        2 => "auto spectrum",
        3 => "cross spectrum",
        6 => "coherence",
        7 => "auto correlation",
        8 => "cross correlation",
        9 => "power spectral density",
        12 => "spectrum",
        _ => return format!("function of type {kind}"),
    };
    name.to_owned()
}
