//! Times as dates, and lengths of time in months.

use chrono::DateTime;

/// µs of a mean month of the Gregorian calendar (365.2425 days / 12).
pub const MONTH_US: f64 = 30.436_875 * 86_400e6;

/// The day of a time in µs since 1970, UTC: `2026-03-01`.
#[must_use]
pub fn day(us: i64) -> String {
    DateTime::from_timestamp_micros(us)
        .map_or_else(|| format!("{us} µs"), |time| time.format("%Y-%m-%d").to_string())
}

/// Months from one time to another, µs since 1970.
#[must_use]
pub fn months(from_us: i64, to_us: i64) -> f64 {
    to_us.saturating_sub(from_us) as f64 / MONTH_US
}

/// So many months after a time; none beyond the range of dates.
#[must_use]
pub fn after(from_us: i64, months: f64) -> Option<i64> {
    let us = from_us as f64 + months * MONTH_US;
    // A hundred thousand years: what lies beyond is no forecast.
    (us.abs() < 3e18).then_some(us as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twelve_months_are_a_year() {
        assert_eq!(day(0), "1970-01-01");
        assert_eq!(after(0, 4800.0).map(day).as_deref(), Some("2370-01-01"));
        assert_eq!(after(0, 1e9), None);
        assert!((months(0, after(0, 7.0).unwrap()) - 7.0).abs() < 1e-6);
    }
}
