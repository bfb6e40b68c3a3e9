//! Relation between wall-clock and monotonic time.
//!
//! Messages contain `CLOCK_MONOTONIC`, which is never set; the log times of the container are wall-clock times, for display.

use std::fmt;

/// A stamp that differs by more than this, ns, from the last reading of the clocks belongs to
/// another clock: a full ring buffer of the slowest cycle spans less. The record is then logged at
/// the time of that
/// reading.
const STAMP_TRUST_NS: u64 = 60_000_000_000;
/// The wall clock counts as set if it moved by more than this relative to the monotonic clock, ns:
/// longer than the time between the two readings of a pair on a loaded machine. Slewing changes
/// both equally.
const CLOCK_SET_NS: u64 = 5_000_000;

/// Readings of both clocks at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Clocks {
    /// `CLOCK_MONOTONIC`, ns.
    pub monotonic_ns: u64,
    /// Time since 1970 in UTC, ns.
    pub wall_ns: u64,
}

impl Clocks {
    /// The wall-clock time of a monotonic stamp.
    #[must_use]
    pub fn wall_ns(&self, stamp_ns: u64) -> u64 {
        if stamp_ns.abs_diff(self.monotonic_ns) > STAMP_TRUST_NS {
            return self.wall_ns;
        }
        let ahead_ns = stamp_ns.wrapping_sub(self.monotonic_ns).cast_signed();
        self.wall_ns.saturating_add_signed(ahead_ns)
    }

    /// Takes a later reading and keeps the relation, unless the wall clock was set in between;
    /// returns whether it was.
    pub(super) fn advance(&mut self, now: Self) -> bool {
        let expected_ns =
            self.wall_ns.saturating_add(now.monotonic_ns.saturating_sub(self.monotonic_ns));
        let was_set = expected_ns.abs_diff(now.wall_ns) > CLOCK_SET_NS;
        let wall_ns = if was_set { now.wall_ns } else { expected_ns };
        *self = Self { monotonic_ns: now.monotonic_ns, wall_ns };
        was_set
    }
}

/// A wall-clock time as ISO 8601 in UTC, to the millisecond.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Utc(pub u64);

impl fmt::Display for Utc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seconds, milliseconds) = (self.0 / 1_000_000_000, self.0 / 1_000_000 % 1000);
        let (year, month, day) = date(seconds / 86_400);
        let (hour, minute, second) = (seconds / 3600 % 24, seconds / 60 % 60, seconds % 60);
        write!(
            f,
            "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{milliseconds:03}Z"
        )
    }
}

/// Year, month and day from the number of days since 1970-01-01 (Gregorian calendar).
fn date(days: u64) -> (u64, u64, u64) {
    let is_leap = |year: u64| {
        year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
    };
    let (mut year, mut left) = (1970, days);
    loop {
        let of_year = if is_leap(year) { 366 } else { 365 };
        if left < of_year {
            break;
        }
        left -= of_year;
        year += 1;
    }
    let february = if is_leap(year) { 29 } else { 28 };
    let mut month = 1;
    for of_month in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30] {
        if left < of_month {
            break;
        }
        left -= of_month;
        month += 1;
    }
    (year, month, left + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wall_times_are_written_as_iso_8601() {
        assert_eq!(Utc(0).to_string(), "1970-01-01T00:00:00.000Z");
        assert_eq!(Utc(951_782_400_000_000_000).to_string(), "2000-02-29T00:00:00.000Z");
        assert_eq!(Utc(1_798_761_599_123_456_789).to_string(), "2026-12-31T23:59:59.123Z");
        assert!(Utc(u64::MAX).to_string().starts_with("2554-"));
    }

    #[test]
    fn a_stamp_of_another_clock_counts_as_of_now() {
        let now = Clocks { monotonic_ns: 100_000_000_000, wall_ns: 5_000_000_000_000 };
        assert_eq!(now.wall_ns(99_000_000_000), 4_999_000_000_000);
        assert_eq!(now.wall_ns(101_000_000_000), 5_001_000_000_000);
        for foreign in [0, u64::MAX, 1_700_000_000_000_000_000] {
            assert_eq!(now.wall_ns(foreign), now.wall_ns);
        }
    }

    #[test]
    fn a_wall_clock_that_was_set_is_noticed_and_jitter_is_not() {
        let mut clocks = Clocks { monotonic_ns: 0, wall_ns: 1_000_000_000 };
        assert!(!clocks.advance(Clocks { monotonic_ns: 10, wall_ns: 1_000_400_010 }));
        assert_eq!(clocks.wall_ns, 1_000_000_010);
        assert!(clocks.advance(Clocks { monotonic_ns: 20, wall_ns: 9_000_000_000 }));
        assert_eq!(clocks.wall_ns, 9_000_000_000);
    }
}
