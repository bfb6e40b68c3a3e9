//! Dates and times of the day as seconds: ISO 8601, stated patterns, and the serial days of spreadsheets.
//!
//! Gregorian calendar without leap seconds, to 1 ns. Seconds count from the first row's time, so that they keep the digits of the file: from 1970 on a
//! 64-bit float holds no more than 0.2 µs.

use std::collections::BTreeSet;

use super::RawTable;
use super::epoch_time::Times;
use crate::faults::{Fault, Faults};

/// Format of the times in a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum TimeFormat {
    /// ISO 8601, a blank in place of the `T` allowed: `2026-11-26 14:03:05.123+01:00`.
    Iso,
    /// A pattern of `strftime`.
    Pattern(String),
    /// Days as a number, as in spreadsheets.
    Days,
}

/// A point in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Instant {
    /// Since 1970: UTC if the time has a zone, otherwise by the clock that wrote it.
    nanoseconds: i128,
    has_zone: bool,
}

const FIELDS: &str = "%Y %y %m %d %H %I %M %S %f %p %z";
/// Largest difference of a zone from UTC.
const ZONE_HOURS_MAX: i64 = 14;
const SECOND_NS: i128 = 1_000_000_000;
const DAY_S: f64 = 86_400.0;

/// An ISO 8601 time with its zone, as µs since 1970 in UTC; `None` for anything else.
pub(crate) fn instant_us(text: &str) -> Option<i64> {
    let instant = TimeFormat::Iso.read(text).filter(|instant| instant.has_zone)?;
    i64::try_from(instant.nanoseconds.div_euclid(1000)).ok()
}

impl TimeFormat {
    /// Parses a mapping's `format`.
    ///
    /// # Errors
    /// What was expected instead.
    pub(crate) fn parse(format: &str) -> Result<Self, String> {
        match format {
            "iso" => return Ok(Self::Iso),
            "days" => return Ok(Self::Days),
            _ => {}
        }
        let mut fields = BTreeSet::new();
        let mut rest = format.chars();
        while let Some(c) = rest.next() {
            if c == '%' {
                let name = rest.next().map(|c| format!("%{c}")).unwrap_or_default();
                if !FIELDS.split(' ').any(|field| field == name) {
                    return Err(format!("of {FIELDS}, not `{name}`"));
                }
                fields.insert(name);
            }
        }
        if fields.is_empty() {
            return Err(format!("\"iso\", \"days\", or a pattern of {FIELDS}"));
        }
        let [of_24, of_12, half] = ["%H", "%I", "%p"].map(|field| fields.contains(field));
        if of_12 != half || (of_24 && of_12) {
            return Err("`%I` with `%p`, or `%H` without them".to_owned());
        }
        Ok(Self::Pattern(format.to_owned()))
    }

    /// Whether a cell has this format.
    pub(super) fn reads(&self, cell: &str) -> bool {
        self.read(cell).is_some()
    }

    fn read(&self, cell: &str) -> Option<Instant> {
        self.fields(cell)?.instant()
    }

    fn is_leap_second(&self, cell: &str) -> bool {
        self.fields(cell).is_some_and(|fields| {
            fields.second == 60 && TimeParser { second: 59, ..fields }.instant().is_some()
        })
    }

    /// The fields of a complete cell, without a check of their ranges.
    fn fields<'c>(&self, cell: &'c str) -> Option<TimeParser<'c>> {
        let mut reader = TimeParser::of(cell);
        match self {
            Self::Iso => reader.iso()?,
            Self::Pattern(pattern) => reader.pattern(pattern)?,
            Self::Days => return None,
        }
        reader.rest.is_empty().then_some(reader)
    }

    fn shown(&self) -> &str {
        match self {
            Self::Iso => "2026-11-26T14:03:05.123",
            Self::Pattern(pattern) => pattern,
            Self::Days => "days",
        }
    }
}

impl RawTable<'_> {
    /// Seconds since the first row's time, of one column or several (date, time of the day);
    /// without a `clock` from a column of ISO 8601, or of numbers of `unit_s` seconds: see [`RawTable::numeric_times`].
    pub(crate) fn times(
        &self,
        columns: &[usize],
        clock: Option<&TimeFormat>,
        unit_s: f64,
        faults: &mut Faults,
    ) -> Times {
        let Some(first) = columns.first().copied() else { return Times::as_read(Vec::new()) };
        let cell = |row: usize| {
            let cells = columns.iter().map(|column| self.cell(row, *column).unwrap_or_default());
            cells.collect::<Vec<_>>().join(" ").trim().to_owned()
        };
        let sample = || (0..self.len()).map(cell).find(|cell| !cell.is_empty()).unwrap_or_default();
        let clock = match clock {
            Some(TimeFormat::Days) => return Times::as_read(self.days_as_seconds(first, faults)),
            Some(clock) => clock,
            None if TimeFormat::Iso.read(&sample()).is_some() => &TimeFormat::Iso,
            None => return self.numbers_or_hint(first, &sample(), unit_s, faults),
        };
        let mut times = Vec::with_capacity(self.len());
        let mut start: Option<Instant> = None;
        for row in 0..self.len() {
            let cell = cell(row);
            let instant = clock.read(&cell);
            start = start.or(instant);
            let message = match instant {
                Some(instant) if start.is_some_and(|start| start.has_zone != instant.has_zone) => {
                    Some(format!(
                        "`{cell}` differs from the first row in having a time zone or not"
                    ))
                }
                Some(_) => None,
                None if cell.is_empty() => None,
                None if clock.is_leap_second(&cell) => {
                    Some(format!("`{cell}` is a leap second, which is not supported"))
                }
                None => Some(format!("`{cell}` does not match this time format")),
            };
            if let Some(message) = message {
                faults.push_with(|| {
                    let name = self.header.get(first).cloned().unwrap_or_default();
                    let fault = Fault::new(name, message).expected(clock.shown());
                    self.cell_fault(row, first, fault)
                });
            }
            let since = instant.zip(start).map(|(now, start)| now.nanoseconds - start.nanoseconds);
            times.push(since.map_or(f64::NAN, |ns| ns as f64 / SECOND_NS as f64));
        }
        Times::as_read(times)
    }

    /// A column of numbers. If the first cell is a date or time in another form than ISO 8601, one
    /// fault says so instead of one per row.
    fn numbers_or_hint(
        &self,
        column: usize,
        sample: &str,
        unit_s: f64,
        faults: &mut Faults,
    ) -> Times {
        let marks = sample.matches(['.', '/', ':', '-']).count();
        let digits = sample.bytes().filter(u8::is_ascii_digit).count();
        let is_row = sample.contains([';', '\t', '|']);
        if self.is_number(sample) || is_row || marks < 2 || digits < 4 {
            return self.numeric_times(&[column], unit_s, faults);
        }
        let name = self.header.get(column).cloned().unwrap_or_default();
        let fault = Fault::new(name, format!("`{sample}` has an unknown time format"))
            .expected("seconds as a number, or ISO 8601")
            .help("state the format in a mapping, for example `format = \"%d.%m.%Y %H:%M:%S\"`");
        faults.push(self.cell_fault(0, column, fault));
        // Increasing times, so that this fault causes no further ones.
        Times::as_read((0..self.len()).map(|row| row as f64).collect())
    }

    /// Seconds since the first row of a column of days.
    fn days_as_seconds(&self, column: usize, faults: &mut Faults) -> Vec<f64> {
        let days = self.numbers(column, faults);
        let first = days.iter().position(|day| day.is_finite()).unwrap_or(0);
        let since = self.since_row(first, &[column], days).values;
        since.into_iter().map(|days| days * DAY_S).collect()
    }
}

/// Parser of a time.
struct TimeParser<'c> {
    rest: &'c str,
    year: i64,
    month: i64,
    day: i64,
    hour: i64,
    minute: i64,
    second: i64,
    nanoseconds: i64,
    /// AM or PM of a 12-hour time.
    afternoon: Option<bool>,
    /// Minutes east of UTC.
    zone: Option<i64>,
}

impl<'c> TimeParser<'c> {
    fn of(rest: &'c str) -> Self {
        Self {
            rest,
            year: 1970,
            month: 1,
            day: 1,
            hour: 0,
            minute: 0,
            second: 0,
            nanoseconds: 0,
            afternoon: None,
            zone: None,
        }
    }

    fn iso(&mut self) -> Option<()> {
        self.year = self.number(4, 4)?;
        self.literal('-')?;
        self.month = self.number(2, 2)?;
        self.literal('-')?;
        self.day = self.number(2, 2)?;
        if self.rest.is_empty() {
            return Some(());
        }
        self.literal('T').or_else(|| self.literal(' '))?;
        self.hour = self.number(2, 2)?;
        self.literal(':')?;
        self.minute = self.number(2, 2)?;
        if self.literal(':').is_some() {
            self.second = self.number(2, 2)?;
            self.decimals();
        }
        if !self.rest.is_empty() {
            self.zone()?;
        }
        Some(())
    }

    fn pattern(&mut self, pattern: &str) -> Option<()> {
        let mut pattern = pattern.chars();
        while let Some(c) = pattern.next() {
            if c.is_whitespace() {
                self.rest = self.rest.trim_start();
            } else if c == '%' {
                let field = pattern.next()?;
                self.field(field)?;
                let reads_decimals =
                    pattern.as_str().trim_start_matches(['.', ',']).starts_with("%f");
                if field == 'S' && !reads_decimals {
                    self.decimals();
                }
            } else {
                self.literal(c)?;
            }
        }
        Some(())
    }

    fn field(&mut self, field: char) -> Option<()> {
        match field {
            'Y' => self.year = self.number(4, 4)?,
            'y' => {
                // As in POSIX, 69 to 99 mean 1969 to 1999.
                let year = self.number(2, 2)?;
                self.year = year + if year < 69 { 2000 } else { 1900 };
            }
            'm' => self.month = self.number(1, 2)?,
            'd' => self.day = self.number(1, 2)?,
            'H' => self.hour = self.number(1, 2)?,
            'I' => {
                self.hour = self.number(1, 2).filter(|hour| (1..=12).contains(hour))? % 12;
                self.afternoon.get_or_insert(false);
            }
            'M' => self.minute = self.number(1, 2)?,
            'S' => self.second = self.number(1, 2)?,
            'f' => self.fraction()?,
            'p' => {
                let marker = self.rest.get(..2)?;
                self.afternoon = Some(match marker.to_ascii_uppercase().as_str() {
                    "AM" => false,
                    "PM" => true,
                    _ => return None,
                });
                self.rest = self.rest.get(2..)?;
            }
            'z' => self.zone()?,
            _ => return None,
        }
        Some(())
    }

    /// `Z`, `+01:00`, `+0100` or `+01`.
    fn zone(&mut self) -> Option<()> {
        if self.literal('Z').is_some() {
            self.zone = Some(0);
            return Some(());
        }
        let sign = if self.literal('+').is_some() { 1 } else { self.literal('-').map(|()| -1)? };
        let hours = self.number(2, 2)?;
        let _ = self.literal(':');
        let minutes = if self.rest.is_empty() { 0 } else { self.number(2, 2)? };
        if hours > ZONE_HOURS_MAX || minutes >= 60 {
            return None;
        }
        self.zone = Some(sign * (60 * hours + minutes));
        Some(())
    }

    fn literal(&mut self, c: char) -> Option<()> {
        self.rest = self.rest.strip_prefix(c)?;
        Some(())
    }

    /// A number with `least` to `most` digits.
    fn number(&mut self, digits_min: usize, digits_max: usize) -> Option<i64> {
        let digits = self.rest.bytes().take(digits_max).take_while(u8::is_ascii_digit).count();
        let (number, rest) = self.rest.split_at_checked(digits).filter(|_| digits >= digits_min)?;
        self.rest = rest;
        number.parse().ok()
    }

    /// Digits after the seconds' decimal mark, if there is one.
    fn decimals(&mut self) {
        let rest = self.rest;
        if let Some(decimals) = rest.strip_prefix(['.', ',']) {
            self.rest = decimals;
            if self.fraction().is_none() {
                self.rest = rest;
            }
        }
    }

    /// Decimals of a second; digits below a nanosecond are dropped.
    fn fraction(&mut self) -> Option<()> {
        let digits = self.rest.bytes().take_while(u8::is_ascii_digit).count();
        let (fraction, rest) = self.rest.split_at_checked(digits).filter(|_| digits > 0)?;
        self.nanoseconds = format!("{fraction:0<9}").get(..9)?.parse().ok()?;
        self.rest = rest;
        Some(())
    }

    fn instant(&self) -> Option<Instant> {
        let hour = self.hour + if self.afternoon == Some(true) { 12 } else { 0 };
        let fits = (1..=12).contains(&self.month)
            && (1..=days_in(self.year, self.month)).contains(&self.day)
            && (0..24).contains(&hour)
            && (0..60).contains(&self.minute)
            && (0..60).contains(&self.second);
        let days = i128::from(days_since_1970(self.year, self.month, self.day));
        let minutes = i128::from(60 * hour + self.minute - self.zone.unwrap_or(0));
        let seconds = (days * 1440 + minutes) * 60 + i128::from(self.second);
        let nanoseconds = seconds * SECOND_NS + i128::from(self.nanoseconds);
        fits.then_some(Instant { nanoseconds, has_zone: self.zone.is_some() })
    }
}

fn days_in(year: i64, month: i64) -> i64 {
    let next = if month == 12 { (year + 1, 1) } else { (year, month + 1) };
    days_since_1970(next.0, next.1, 1) - days_since_1970(year, month, 1)
}

/// Days of the Gregorian calendar, counted in years that begin in March, so that the leap day is the last one.
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    let of_year = (153 * month + 2) / 5 + day - 1;
    // 719 468 days lie between the first of March of the year 0 and 1970.
    365 * year + leap_days + of_year - 719_468
}

#[cfg(test)]
mod tests;
