//! Spellings of units by instruments: quantity and size in SI.
//!
//! More general than [`crate::unit`], the spelling of our own formats: here `g` is the acceleration
//! of gravity and `lbf` a force.

use crate::unit::Quantity;

/// Standard acceleration of free fall, m/s² (CGPM 1901).
const STANDARD_GRAVITY: f64 = 9.806_65;
/// Pound-force, N (CGPM 1901's gravity times the international pound).
const POUND_FORCE: f64 = 4.448_221_615_260_5;
/// Poundal, N: a pound (0.453 592 37 kg) by a foot per second squared.
const POUNDAL: f64 = 0.138_254_954_376;
/// Inch and foot, m (international yard and pound agreement of 1959).
const INCH: f64 = 0.025_4;
const FOOT: f64 = 0.304_8;

/// Spellings in which upper and lower case differ.
const SPELLINGS_BY_CASE: &[(&str, Quantity, f64)] =
    &[("mN", Quantity::Force, 1e-3), ("MN", Quantity::Force, 1e6)];

/// Spellings in lower case, without blanks, points and carets.
const SPELLINGS: &[(&[&str], Quantity, f64)] = &[
    (&["n", "newton", "newtons"], Quantity::Force, 1.0),
    (&["kn"], Quantity::Force, 1e3),
    (&["dan"], Quantity::Force, 10.0),
    (&["cn"], Quantity::Force, 1e-2),
    (&["un", "µn"], Quantity::Force, 1e-6),
    (&["dyn", "dyne"], Quantity::Force, 1e-5),
    (&["kgf", "kp"], Quantity::Force, STANDARD_GRAVITY),
    (&["gf"], Quantity::Force, 1e-3 * STANDARD_GRAVITY),
    (&["lbf", "lb", "lbs", "pounds", "pound"], Quantity::Force, POUND_FORCE),
    (&["ozf"], Quantity::Force, POUND_FORCE / 16.0),
    (&["kip", "klbf"], Quantity::Force, 1e3 * POUND_FORCE),
    (&["pdl", "poundal"], Quantity::Force, POUNDAL),
    (&["nm", "n*m", "n-m"], Quantity::Moment, 1.0),
    (&["knm"], Quantity::Moment, 1e3),
    (&["nmm"], Quantity::Moment, 1e-3),
    (&["m/s2", "m_s2", "m/s/s", "m/s**2", "ms-2"], Quantity::Acceleration, 1.0),
    (&["mm/s2", "mm/s/s"], Quantity::Acceleration, 1e-3),
    (&["cm/s2"], Quantity::Acceleration, 1e-2),
    (&["in/s2"], Quantity::Acceleration, INCH),
    (&["ft/s2"], Quantity::Acceleration, FOOT),
    (&["g", "gn", "g's"], Quantity::Acceleration, STANDARD_GRAVITY),
    (&["m/s", "m_s"], Quantity::Speed, 1.0),
    (&["mm/s", "mm_s"], Quantity::Speed, 1e-3),
    (&["cm/s"], Quantity::Speed, 1e-2),
    (&["in/s"], Quantity::Speed, INCH),
    (&["ft/s"], Quantity::Speed, FOOT),
    (&["m"], Quantity::Length, 1.0),
    (&["mm"], Quantity::Length, 1e-3),
    (&["cm"], Quantity::Length, 1e-2),
    (&["in", "inch"], Quantity::Length, INCH),
    (&["ft"], Quantity::Length, FOOT),
    (&["mil", "thou"], Quantity::Length, 1e-3 * INCH),
    (&["um", "µm", "micron", "microns"], Quantity::Length, 1e-6),
    (&["nanometre", "nanometer"], Quantity::Length, 1e-9),
    (&["s", "sec", "second", "seconds"], Quantity::Time, 1.0),
    (&["ms", "msec"], Quantity::Time, 1e-3),
    (&["us", "µs"], Quantity::Time, 1e-6),
    (&["ns"], Quantity::Time, 1e-9),
    (&["min", "minute", "minutes"], Quantity::Time, 60.0),
    (&["h", "hr", "hour", "hours"], Quantity::Time, 3600.0),
    (&["hz"], Quantity::Frequency, 1.0),
    (&["khz"], Quantity::Frequency, 1e3),
];

/// What a unit measures, and its SI value. A number before the unit multiplies it: `10 ms`.
pub(super) fn of(unit: &str) -> Option<(Quantity, f64)> {
    spelled(unit).or_else(|| {
        let unit = unit.trim_start();
        // The factor is the longest prefix that is a number: 1e3 in `1e3N`.
        let (at, factor) = unit
            .char_indices()
            .filter_map(|(at, _)| Some((at, unit.get(..at)?.trim_end().parse::<f64>().ok()?)))
            .next_back()?;
        let (quantity, si) = spelled(unit.get(at..)?)?;
        (factor.is_finite() && factor > 0.0).then_some((quantity, factor * si))
    })
}

fn spelled(unit: &str) -> Option<(Quantity, f64)> {
    let by_case = SPELLINGS_BY_CASE.iter().find(|(name, ..)| *name == unit.trim());
    if let Some((_, quantity, si)) = by_case {
        return Some((*quantity, *si));
    }
    let plain: String = unit
        .chars()
        .filter(|c| !c.is_whitespace() && !matches!(c, '^' | '.' | '·'))
        .flat_map(char::to_lowercase)
        .map(|c| match c {
            '²' => '2',
            // The Greek letter and the micro sign look alike.
            'μ' => 'µ',
            c => c,
        })
        .collect();
    let found = SPELLINGS.iter().find(|(names, ..)| names.contains(&plain.as_str()));
    found.map(|(_, quantity, si)| (*quantity, *si))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_instruments_have_their_size_and_unknown_ones_none() {
        for (unit, quantity, si) in [
            ("daN", Quantity::Force, 10.0),
            ("kgf", Quantity::Force, 9.806_65),
            ("mN", Quantity::Force, 1e-3),
            ("MN", Quantity::Force, 1e6),
            ("lbs", Quantity::Force, 4.448_221_615_260_5),
            ("9.80665 N", Quantity::Force, 9.806_65),
            ("1e-2 m/s^2", Quantity::Acceleration, 1e-2),
            ("10ms", Quantity::Time, 1e-2),
            ("min", Quantity::Time, 60.0),
        ] {
            let (found, size) = of(unit).unwrap();
            assert_eq!(found, quantity, "{unit}");
            assert!((size / si - 1.0).abs() < 1e-12, "{unit}: {size}");
        }
        for unit in ["V", "ticks", "10", "-3 N", "inf N", "0 N", ""] {
            assert_eq!(of(unit), None, "{unit}");
        }
    }
}
