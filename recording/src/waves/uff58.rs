//! One function at nodal degrees of freedom: dataset 58 of a universal file, as text or binary (58b).
//!
//! Source: Structural Dynamics Research Laboratory, University of Cincinnati, description of dataset 58. Binary: IEEE 754 of
//! four or eight bytes in either order; the old VAX form is refused.

use super::spacing::{Spacing, tidy};
use super::uff::Cursor;
use super::uff_head::{AbscissaQuantity, Axis, ChannelProperties, Head, Units};
use super::uff_numbers::{UffError, ascii, binary as binary_numbers};
use crate::faults::Fault;

/// Steps are written with six digits: a rate this close to an integer is one.
const SIX_DIGITS: f64 = 5e-6;

/// A function that was read.
#[derive(Debug)]
pub(super) struct Function {
    pub(super) source: ChannelProperties,
    /// Node and direction of the reference.
    pub(super) reference: String,
    pub(super) denominator: Axis,
    pub(super) content: Content,
    /// Assumptions and omissions.
    pub(super) note: Option<&'static str>,
}

/// Content of a function.
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
    /// An unsupported function, with a description.
    Other(String),
}

impl Function {
    /// Reads a function after its line `58`; `binary` is that line if the numbers are binary.
    ///
    /// # Errors
    /// The first error; the cursor is then after the dataset, or inside it if its end is unknown.
    pub(super) fn read(cursor: &mut Cursor<'_>, binary: Option<&str>) -> Result<Self, UffError> {
        let head = Head::read(cursor);
        let numbers = match (binary, &head) {
            (Some(line), Ok(head)) => {
                let numbers = binary_numbers(cursor, line, &head.form);
                // Between the numbers and the end there is only padding.
                if numbers.is_ok() {
                    cursor.skip_to_mark();
                }
                numbers
            }
            _ => ascii(cursor),
        };
        let (head, mut numbers) = (head?, numbers?);
        let filled = head.form.cut_filling(&mut numbers);
        let content = head.content(&numbers)?;
        let assumed = head.abscissa.counts() == AbscissaQuantity::Unspecified;
        let note = match content {
            Content::Time { .. } if assumed => Some("has no abscissa unit; s is assumed"),
            Content::Response { .. } if assumed => Some("has no abscissa unit; Hz is assumed"),
            Content::Other(_) => None,
            _ => filled
                .then_some("is padded with zeros after its last sample; the padding was removed"),
        };
        let Head { source, reference, denominator, .. } = head;
        Ok(Self { source, reference, denominator, content, note })
    }

    /// Completes its units by the file's system.
    pub(super) fn complete(&mut self, units: &Units) {
        self.source.ordinate.complete(units);
        self.denominator.complete(units);
    }
}

/// A function's points.
struct Rows {
    x: Vec<f64>,
    /// Real and imaginary part; the latter 0 where the file has none.
    values: Vec<[f64; 2]>,
}

impl Head {
    fn content(&self, numbers: &[f64]) -> Result<Content, UffError> {
        let other = |what: String| Ok(Content::Other(what));
        let kind = kind_name(self.function_type);
        let unit = &self.abscissa.unit;
        match (self.function_type, self.abscissa.counts(), self.form.complex) {
            (0 | 1, AbscissaQuantity::Time(_) | AbscissaQuantity::Unspecified, true) => {
                other(format!("complex {kind}"))
            }
            (0 | 1, AbscissaQuantity::Time(si), false) => self.over_time(self.rows(numbers)?, si),
            (0 | 1, AbscissaQuantity::Unspecified, false) => {
                self.over_time(self.rows(numbers)?, 1.0)
            }
            (4, AbscissaQuantity::Frequency(si), _) => self.over_frequency(self.rows(numbers)?, si),
            (4, AbscissaQuantity::Unspecified, _) => self.over_frequency(self.rows(numbers)?, 1.0),
            (0 | 1 | 4, _, _) => other(format!("{kind} over an abscissa in `{unit}`")),
            _ => other(kind),
        }
    }

    fn rows(&self, numbers: &[f64]) -> Result<Rows, UffError> {
        let form = &self.form;
        let width = form.width();
        let points = numbers.len() / width;
        if numbers.len() != form.points.saturating_mul(width) || points < 2 {
            let message = format!(
                "contains {} numbers, but its header states {} points",
                numbers.len(),
                form.points
            );
            let expected = format!("{width} for each point, and 2 points or more");
            return Err(Fault::new("", message).expected(expected).into());
        }
        if numbers.iter().any(|number| number.is_infinite()) {
            let fault = Fault::new("", "contains infinite numbers");
            return Err(fault.expected("finite numbers").into());
        }
        let x = if form.even {
            (0..points).map(|i| form.start + form.step * i as f64).collect()
        } else {
            numbers.chunks_exact(width).map(|row| row[0]).collect()
        };
        let value = |row: &[f64]| match form.complex {
            true => [row[width - 2], row[width - 1]],
            false => [row[width - 1], 0.0],
        };
        Ok(Rows { x, values: numbers.chunks_exact(width).map(value).collect() })
    }

    fn over_frequency(&self, rows: Rows, si: f64) -> Result<Content, UffError> {
        let frequency_hz: Vec<f64> = rows.x.iter().map(|x| si * x).collect();
        if !frequency_hz.windows(2).all(|pair| pair[1] > pair[0]) {
            let fault = Fault::new("", "its frequencies do not increase");
            return Err(fault.expected("increasing frequencies").into());
        }
        Ok(Content::Response { frequency_hz, values: rows.values })
    }

    fn over_time(&self, rows: Rows, si: f64) -> Result<Content, UffError> {
        let (start, step) = if self.form.even {
            (self.form.start, self.form.step)
        } else {
            let spacing = Spacing::of(&rows.x, |_| false).map_err(|(_, fault)| fault)?;
            if spacing.runs.len() != 1 {
                let fault = Fault::new("", "its times have gaps");
                return Err(fault.expected("even steps").into());
            }
            (rows.x.first().copied().unwrap_or(0.0), spacing.step)
        };
        let rate_hz = tidy(1.0 / (si * step), SIX_DIGITS);
        if !(rate_hz > 0.0 && rate_hz.is_finite() && (si * start).is_finite()) {
            let fault = Fault::new("", format!("its step is {step}"));
            return Err(fault.expected("a finite step above 0").into());
        }
        let values = rows.values.into_iter().map(|[value, _]| value).collect();
        Ok(Content::Time { start_s: si * start, rate_hz, values })
    }
}

/// The function types of dataset 58, from 0.
const KINDS: &[&str] = &[
    "function of unknown type",
    "time response",
    "auto spectrum",
    "cross spectrum",
    "response function",
    "transmissibility",
    "coherence",
    "auto correlation",
    "cross correlation",
    "power spectral density",
    "energy spectral density",
    "probability density",
    "spectrum",
    "cumulative frequency distribution",
    "peaks and valleys",
    "stress over cycles",
    "strain over cycles",
    "orbit",
    "mode indicator function",
    "force pattern",
    "partial power",
    "partial coherence",
    "eigenvalue",
    "eigenvector",
    "shock response spectrum",
    "impulse response filter",
    "multiple coherence",
    "order function",
    "phase compensation",
];

fn kind_name(kind: i64) -> String {
    let known = usize::try_from(kind).ok().and_then(|kind| KINDS.get(kind));
    known.map_or_else(|| format!("function of type {kind}"), |name| (*name).to_owned())
}
