//! The numbers of a dataset 58: text in fixed columns, or binary.

use super::uff::Cursor;
use crate::faults::{Fault, Location};

/// Why a dataset was refused.
pub(super) type UffError = Box<Fault>;

/// Record 7: format of the numbers.
#[derive(Debug)]
pub(super) struct Form {
    pub(super) complex: bool,
    pub(super) double: bool,
    pub(super) even: bool,
    pub(super) points: usize,
    pub(super) start: f64,
    pub(super) step: f64,
}

impl Form {
    /// Reads record 7.
    ///
    /// # Errors
    /// A form that cannot be.
    pub(super) fn of(line: &str, number: usize) -> Result<Self, UffError> {
        let fault = |what: &str| {
            Fault::new("", format!("its data form has {what}"))
                .expected("type 2, 4, 5 or 6, points, spacing, start and step")
                .at(Location::from_line(number, line, &(0..line.len())))
        };
        let numbers = in_line(line).ok_or_else(|| fault("text instead of numbers"))?;
        let [kind, points, even, start, step, ..] = numbers.as_slice() else {
            return Err(fault("too few numbers").into());
        };
        let kind = *kind;
        if ![2.0, 4.0, 5.0, 6.0].contains(&kind) {
            return Err(fault("an unknown type").into());
        }
        let whole = *points >= 0.0 && points.fract() == 0.0 && *points < 1e12;
        if !whole {
            return Err(fault("an impossible number of points").into());
        }
        Ok(Self {
            complex: kind >= 5.0,
            double: kind == 4.0 || kind == 6.0,
            even: *even != 0.0,
            points: *points as usize,
            start: *start,
            step: *step,
        })
    }

    /// Numbers of each point.
    pub(super) fn width(&self) -> usize {
        1 + usize::from(self.complex) + usize::from(!self.even)
    }

    /// Bytes of a binary number. With double-precision data, an abscissa is of single precision
    /// only in text.
    fn size(&self) -> usize {
        if self.double { 8 } else { 4 }
    }

    /// Bytes of all binary numbers.
    fn bytes(&self) -> usize {
        self.points.saturating_mul(self.width()).saturating_mul(self.size())
    }

    /// Removes zeros after the last point, with which some programs fill a line or a block; returns
    /// whether there were any.
    pub(super) fn cut_filling(&self, numbers: &mut Vec<f64>) -> bool {
        let needed = self.points.saturating_mul(self.width());
        let filling = numbers.get(needed..).unwrap_or_default();
        let is_filled = !filling.is_empty() && filling.iter().all(|number| *number == 0.0);
        if is_filled {
            numbers.truncate(needed);
        }
        is_filled
    }
}

/// Whether a sign after `word` begins its exponent: Fortran omits the letter if the exponent has
/// three digits.
fn is_bare_exponent(number: &str, behind_sign: &str) -> bool {
    let digits = behind_sign.bytes().take_while(u8::is_ascii_digit).count();
    let ends =
        !behind_sign.get(digits..).unwrap_or_default().starts_with(['.', 'e', 'E', 'd', 'D']);
    digits == 3 && ends && number.contains('.') && !number.contains('e')
}

/// The numbers of a line in fixed columns, which may be adjacent: a sign after a digit begins
/// another number.
pub(super) fn in_line(line: &str) -> Option<Vec<f64>> {
    let mut numbers = Vec::new();
    let mut number = String::new();
    let mut take = |number: &mut String| {
        if number.is_empty() {
            return Some(());
        }
        numbers.push(number.parse().ok()?);
        number.clear();
        Some(())
    };
    for (index, c) in line.char_indices() {
        let exponent = number.ends_with('e');
        let rest = line.get(index + c.len_utf8()..).unwrap_or_default();
        match c {
            _ if c.is_whitespace() => take(&mut number)?,
            '+' | '-' if is_bare_exponent(&number, rest) => {
                number.push('e');
                number.push(c);
            }
            '+' | '-' if !number.is_empty() && !exponent => {
                take(&mut number)?;
                number.push(c);
            }
            // Fortran writes double precision with a D.
            'e' | 'E' | 'd' | 'D' => number.push('e'),
            c => number.push(c),
        }
    }
    take(&mut number)?;
    Some(numbers)
}

/// Reads numbers up to and including the line of -1.
pub(super) fn ascii(cursor: &mut Cursor<'_>) -> Result<Vec<f64>, UffError> {
    let mut numbers = Vec::new();
    let mut fault: Option<UffError> = None;
    loop {
        let Some(line) = cursor.text() else {
            return Err(fault.unwrap_or_else(|| {
                Fault::new("", "has no end")
                    .expected("a line with -1")
                    .help("the file seems to be truncated")
                    .into()
            }));
        };
        if line.trim() == "-1" {
            return fault.map_or(Ok(numbers), Err);
        }
        match in_line(&line) {
            Some(found) => numbers.extend(found),
            None if fault.is_none() => {
                let place = Location::from_line(cursor.line, &line, &(0..line.len()));
                let wrong = Fault::new("", "this line contains no numbers").expected("numbers");
                fault = Some(wrong.at(place).into());
            }
            None => {}
        }
    }
}

/// Reads the numbers stated in the header; `line` is the dataset's first, which states their
/// format.
pub(super) fn binary(
    cursor: &mut Cursor<'_>,
    line: &str,
    form: &Form,
) -> Result<Vec<f64>, UffError> {
    let fields = line.split(['b', 'B']).nth(1).unwrap_or_default();
    let fields: Vec<usize> =
        fields.split_whitespace().filter_map(|field| field.parse().ok()).collect();
    let [order, float, ..] = fields.as_slice() else {
        let fault = Fault::new("", "does not state its byte order");
        return Err(fault.expected("58b, order, float format").into());
    };
    if *float != 2 || !matches!(order, 1 | 2) {
        let message = format!("has byte order {order} and float format {float}");
        return Err(Fault::new("", message).expected("order 1 or 2, format 2 (IEEE 754)").into());
    }
    let bytes = run(cursor, fields.get(3).copied().unwrap_or(0), form)?;
    let size = form.size();
    let number = |bytes: &[u8]| -> Option<f64> {
        Some(match (size, order) {
            (4, 1) => f64::from(f32::from_le_bytes(bytes.try_into().ok()?)),
            (4, _) => f64::from(f32::from_be_bytes(bytes.try_into().ok()?)),
            (_, 1) => f64::from_le_bytes(bytes.try_into().ok()?),
            _ => f64::from_be_bytes(bytes.try_into().ok()?),
        })
    };
    Ok(bytes.chunks_exact(size).filter_map(number).collect())
}

/// The bytes that the numbers need. The number of bytes stated by the dataset (0: none) has to
/// contain them, followed by zeros only: otherwise the header has another type or number of points
/// than the data.
fn run<'b>(cursor: &mut Cursor<'b>, stated: usize, form: &Form) -> Result<&'b [u8], UffError> {
    let needed = form.bytes();
    let numbers = cursor.bytes(needed);
    // pyuff counts a complex number once.
    let holds_them = stated == 0 || stated >= needed || (form.complex && 2 * stated == needed);
    let fault = if !holds_them || (numbers.len() == needed && !cursor.is_before_mark()) {
        let message = match stated {
            0 => "contains more bytes of numbers than its header states".to_owned(),
            _ => format!("states {stated} bytes of numbers"),
        };
        let help = "export it again; single and double precision may have been confused";
        Fault::new("", message).help(help)
    } else if numbers.len() < needed {
        let message = format!("contains {} bytes of numbers", numbers.len());
        Fault::new("", message).help("the file seems to be truncated")
    } else {
        return Ok(numbers);
    };
    Err(fault.expected(format!("{needed}, from its data type and number of points")).into())
}
