//! Numeric times that count from an epoch: the first one is subtracted before they become floats.
//!
//! A 64-bit float holds a time since 1970 to no better than 0.2 µs, and an integer of nanoseconds to 256 ns: at 4 kHz that is 0.05 to 0.1 % of a step.
//! Cells are therefore decimals until the first one is subtracted; the difference is rounded once. Times below [`EPOCH_S`] are read as they are.

use std::fmt;

use super::{RawTable, Recording};
use crate::faults::{Fault, Faults};

/// From this time on, s, a column counts from its first value: 1e8 s are three years, which is no duration of a recording, and a float then still
/// resolves 0.015 µs.
pub(crate) const EPOCH_S: f64 = 1e8;

/// No time of a recording in seconds begins later, s: the year 5138. Milliseconds since 1970 taken for seconds do.
const EPOCH_MOST_S: f64 = 1e11;

/// A decimal number: `digits`·10^`exponent`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Decimal {
    digits: i128,
    exponent: i32,
}

/// All its digits, without an exponent unless it is far from 0.
impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { digits, exponent } = *self;
        match u32::try_from(-i64::from(exponent)).ok().and_then(|n| 10_i128.checked_pow(n)) {
            Some(1) => write!(f, "{digits}"),
            Some(one) => {
                let sign = if digits < 0 { "-" } else { "" };
                let width = usize::try_from(-i64::from(exponent)).unwrap_or_default();
                let (whole, rest) = ((digits / one).abs(), (digits % one).abs());
                let text = format!("{sign}{whole}.{rest:0width$}");
                f.write_str(text.trim_end_matches('0').trim_end_matches('.'))
            }
            None => write!(f, "{digits}e{exponent}"),
        }
    }
}

impl Decimal {
    /// The value of a number in Rust's notation; `None` if it has too many digits, or is no finite number.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let (mantissa, exponent) = match text.split_once(['e', 'E']) {
            Some((mantissa, exponent)) => (mantissa, exponent.parse().ok()?),
            None => (text, 0_i32),
        };
        let (whole, decimals) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let decimals = decimals.trim_end_matches('0');
        if !decimals.bytes().all(|byte| byte.is_ascii_digit()) {
            return None;
        }
        let digits = format!("{whole}{decimals}").parse().ok()?;
        let exponent = exponent.checked_sub(i32::try_from(decimals.len()).ok()?)?;
        Some(Self { digits, exponent })
    }

    fn at_exponent(self, exponent: i32) -> Option<i128> {
        let power = u32::try_from(self.exponent.checked_sub(exponent)?).ok()?;
        self.digits.checked_mul(10_i128.checked_pow(power)?)
    }

    fn combined(self, other: Self, combine: fn(i128, i128) -> Option<i128>) -> Option<Self> {
        let exponent = self.exponent.min(other.exponent);
        let digits = combine(self.at_exponent(exponent)?, other.at_exponent(exponent)?)?;
        Some(Self { digits, exponent })
    }

    pub(crate) fn plus(self, other: Self) -> Option<Self> {
        self.combined(other, i128::checked_add)
    }

    pub(crate) fn minus(self, other: Self) -> Option<Self> {
        self.combined(other, i128::checked_sub)
    }

    /// The product; `None` if it has too many digits.
    pub(crate) fn times(self, other: Self) -> Option<Self> {
        let digits = self.digits.checked_mul(other.digits)?;
        Some(Self { digits, exponent: self.exponent.checked_add(other.exponent)? })
    }

    /// The decimal number of which a float is made.
    pub(crate) fn of(value: f64) -> Option<Self> {
        Self::parse(&format!("{value:?}"))
    }

    /// The nearest float.
    pub(crate) fn to_f64(self) -> f64 {
        format!("{}e{}", self.digits, self.exponent).parse().unwrap_or(f64::NAN)
    }
}

/// Times in the unit of their column.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Times {
    pub(crate) values: Vec<f64>,
    /// What was subtracted from all of them.
    pub(crate) origin: Option<Decimal>,
}

/// The origin of the times of a recording, s, if they count from their first one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Epoch(pub(crate) Decimal);

impl Recording {
    /// The time that was subtracted from all times; none for times that are as in the file.
    #[must_use]
    pub fn epoch(&self) -> Option<Epoch> {
        self.epoch
    }

    /// Lets the times count from another origin, so that two recordings by one clock have common times.
    pub fn count_from(&mut self, origin: Option<Epoch>) {
        let zero = Decimal { digits: 0, exponent: 0 };
        let decimal = |epoch: Option<Epoch>| epoch.map_or(zero, |Epoch(decimal)| decimal);
        let shift = decimal(self.epoch).minus(decimal(origin));
        let shift_s = shift.map_or(f64::NAN, Decimal::to_f64);
        if shift_s.is_finite() {
            self.t_s.iter_mut().for_each(|t| *t += shift_s);
            self.epoch = origin;
        }
    }
}

impl Times {
    pub(super) fn as_read(values: Vec<f64>) -> Self {
        Self { values, origin: None }
    }
}

/// The remark on a column whose times count from the first one.
pub(crate) fn epoch_note(column: &str, origin: Decimal, unit: &str) -> String {
    format!(
        "`{column}` counts from an epoch: its first time, {origin}{unit}, is subtracted from all"
    )
}

impl RawTable<'_> {
    /// The fault of times that begin at `origin_s`, if they cannot be in the unit in which they are read.
    pub(crate) fn fault_of_epoch(&self, column: usize, origin_s: f64) -> Option<Fault> {
        if origin_s.abs() < EPOCH_MOST_S {
            return None;
        }
        let name = self.header.get(column).cloned().unwrap_or_default();
        let message =
            format!("begins at {origin_s:e} s, later than any time in seconds since an epoch");
        let fault = Fault::new(name, message).expected("times in the unit in which they are read").help(
            "if they are in ms, us or ns, state it in a mapping: `t_s = { from = …, unit = \"ms\" }`",
        );
        Some(self.cell_fault(0, column, fault))
    }

    /// The sum of numeric columns as times. If the first one is at least [`EPOCH_S`], where one unit is `unit_s` seconds, it is subtracted from all.
    pub(crate) fn numeric_times(
        &self,
        columns: &[usize],
        unit_s: f64,
        faults: &mut Faults,
    ) -> Times {
        let mut values = vec![0.0; self.len()];
        for column in columns {
            let numbers = self.numbers(*column, faults);
            values.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += number);
        }
        let first = values.iter().position(|value| value.is_finite());
        let is_epoch = |row: &usize| (values[*row] * unit_s).abs() >= EPOCH_S;
        match first.filter(is_epoch) {
            Some(first) => self.since_row(first, columns, values),
            None => Times::as_read(values),
        }
    }

    /// The differences from the time in a row, rounded once where the cells are decimals.
    pub(super) fn since_row(&self, first: usize, columns: &[usize], values: Vec<f64>) -> Times {
        let exact = |row: usize| {
            let cells = columns.iter().map(|column| self.decimal_in(row, *column));
            cells.reduce(|sum, cell| sum?.plus(cell?)).flatten()
        };
        let origin = exact(first).or_else(|| Decimal::of(*values.get(first)?));
        let Some(origin) = origin else { return Times::as_read(values) };
        let since = |(row, value): (usize, f64)| {
            let difference = exact(row).and_then(|now| now.minus(origin));
            difference.map_or(value - origin.to_f64(), Decimal::to_f64)
        };
        let values = values.into_iter().enumerate().map(since).collect();
        Times { values, origin: Some(origin) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_decimal_keeps_every_digit_of_a_time() {
        let difference = |now: &str, first: &str| {
            Some(Decimal::parse(now)?.minus(Decimal::parse(first)?)?.to_f64())
        };
        for (now, first, expected) in [
            ("1732880000123456789", "1732880000123206789", 250_000.0),
            ("1732880000.123457", "1732880000.123456", 1e-6),
            ("1.73288000012345e9", "1732880000.123", 0.000_45),
            ("-1.5", "+2", -3.5),
            ("1732880000.", "1732880000", 0.0),
        ] {
            assert_eq!(difference(now, first), Some(expected), "{now} - {first}");
        }
        let shown = |text: &str| Decimal::parse(text).map(|decimal| decimal.to_string());
        for text in ["1732880000123456789", "1732880000.123456789", "-0.05", "0", "7.5"] {
            assert_eq!(shown(text).as_deref(), Some(text));
        }
        assert_eq!(shown("2e3").as_deref(), Some("2e3"));
        for text in ["", "x", "nan", "inf", "1.-5", "1e", "1e99999999999", "--1"] {
            assert_eq!(Decimal::parse(text), None, "{text}");
        }
        assert_eq!(difference("1e300", "1"), None);
    }

    proptest! {
        #[test]
        fn no_text_makes_a_decimal_panic(text in "[-+]?[0-9]{0,40}[.]?[0-9]{0,40}(e-?[0-9]{0,12})?") {
            let decimal = Decimal::parse(&text);
            let one = Decimal::parse("1");
            let _ = decimal.zip(one).and_then(|(now, one)| now.minus(one)).map(Decimal::to_f64);
        }
    }
}
