//! Times in the formats of various programs, compared with `date` and a count of days.

use super::*;
use proptest::prelude::*;

fn seconds(format: &str, cell: &str) -> Option<f64> {
    let instant = TimeFormat::parse(format).unwrap().read(cell)?;
    Some(instant.nanoseconds as f64 / 1e9)
}

/// The same instant, by `date -u -d '2026-11-26 14:03:05' +%s`.
const INSTANT_S: f64 = 1_795_701_785.0;

#[test]
fn dates_of_many_programs_are_the_same_instant() {
    for (format, cell) in [
        ("iso", "2026-11-26T14:03:05"),
        ("iso", "2026-11-26 14:03:05.000"),
        ("iso", "2026-11-26T15:03:05+01:00"),
        ("iso", "2026-11-26T14:03:05Z"),
        ("%d.%m.%Y %H:%M:%S", "26.11.2026 14:03:05"),
        ("%d.%m.%y  %H:%M:%S", "26.11.26 14:03:05,0"),
        ("%m/%d/%Y %I:%M:%S %p", "11/26/2026 2:03:05 pm"),
        ("%Y%m%dT%H%M%S", "20261126T140305"),
        ("%d.%m.%Y %H:%M:%S.%f %z", "26.11.2026 09:03:05.0 -0500"),
    ] {
        assert_eq!(seconds(format, cell), Some(INSTANT_S), "{cell} by {format}");
    }
    assert_eq!(seconds("%H:%M:%S", "00:00:01,5"), Some(1.5));
    assert_eq!(seconds("%M:%S.%f", "01:02.25"), Some(62.25));
    assert_eq!(seconds("%I:%M %p", "12:30 AM"), Some(1800.0));
    assert_eq!(seconds("iso", "2000-02-29"), Some(951_782_400.0));
    assert_eq!(seconds("iso", "1969-12-31T23:59:59.5"), Some(-0.5));
}

#[test]
fn invalid_times_are_not_read() {
    for (format, cell) in [
        ("iso", "2026-02-29"),
        ("iso", "2026-13-01"),
        ("iso", "26.11.2026"),
        ("iso", "2026-11-26T24:00:00"),
        ("iso", "2026-11-26T14:03:05 somewhat later"),
        ("iso", "2026-11-26T14:03:05."),
        ("%d.%m.%Y", "31.04.2026"),
        ("%m/%d/%Y", "26/11/2026"),
        ("%I:%M %p", "14:03 PM"),
        ("%H:%M:%S", ""),
        ("iso", "2026-11-26T14:03:05+01:99"),
        ("iso", "2026-11-26T14:03:05+15:00"),
        ("iso", "2026-12-31T23:59:60Z"),
    ] {
        assert_eq!(seconds(format, cell), None, "{cell} by {format}");
    }
    assert!(TimeFormat::Iso.is_leap_second("2026-12-31T23:59:60Z"));
    assert!(!TimeFormat::Iso.is_leap_second("2026-12-32T23:59:60Z"));
    for format in ["", "seconds", "%d. %b %Y", "%", "%H:%M %p", "%I:%M", "%I %H:%M %p"] {
        assert!(TimeFormat::parse(format).is_err(), "{format}");
    }
}

proptest! {
    #[test]
    fn each_day_is_one_more_than_the_day_before(day in -700_000..2_900_000_i64) {
        // Found by counting up from the first of January of the year.
        let (mut year, mut month, mut rest) = (1970, 1, day);
        let long = |year: i64| year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
        while rest < 0 { year -= 1; rest += 365 + i64::from(long(year)); }
        while rest >= 365 + i64::from(long(year)) { rest -= 365 + i64::from(long(year)); year += 1; }
        let lengths = [31, 28 + i64::from(long(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
        for length in lengths {
            if rest < length { break; }
            rest -= length;
            month += 1;
        }
        prop_assert_eq!(days_since_1970(year, month, rest + 1), day);
    }

    #[test]
    fn no_text_makes_it_panic(cell in "[ -~\u{e9}]{0,30}", format in "[%A-z :.]{0,12}") {
        let _ = TimeFormat::Iso.read(&cell);
        if let Ok(clock) = TimeFormat::parse(&format) {
            let _ = clock.read(&cell);
        }
    }
}
