//! Spellings of units by instruments: quantity and size in SI.
//!
//! More general than [`crate::unit`], the spelling of our own formats: here `g` is the acceleration
//! of gravity and `lbf` a force.

use crate::unit::Quantity;

/// Standard acceleration of free fall, m/s² (CGPM 1901).
const STANDARD_GRAVITY: f64 = 9.806_65;
/// Pound-force, N (CGPM 1901's gravity times the international pound).
const POUND_FORCE: f64 = 4.448_221_615_260_5;
/// Inch and foot, m (international yard and pound agreement of 1959).
const INCH: f64 = 0.025_4;
const FOOT: f64 = 0.304_8;

/// Spellings in lower case, without blanks, points and carets.
const SPELLINGS: &[(&[&str], Quantity, f64)] = &[
    (&["n", "newton", "newtons"], Quantity::Force, 1.0),
    (&["kn"], Quantity::Force, 1e3),
    (&["lbf", "lb", "pounds", "pound"], Quantity::Force, POUND_FORCE),
    (&["nm", "n*m", "n-m"], Quantity::Moment, 1.0),
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
    (&["um", "µm", "micron", "microns"], Quantity::Length, 1e-6),
    (&["nanometre", "nanometer"], Quantity::Length, 1e-9),
    (&["s", "sec", "second", "seconds"], Quantity::Time, 1.0),
    (&["ms", "msec"], Quantity::Time, 1e-3),
    (&["us", "µs"], Quantity::Time, 1e-6),
    (&["hz"], Quantity::Frequency, 1.0),
    (&["khz"], Quantity::Frequency, 1e3),
];

/// What a unit measures, and its SI value.
pub(super) fn of(unit: &str) -> Option<(Quantity, f64)> {
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
