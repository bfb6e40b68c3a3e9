//! Number formatting: sensible digits, a true minus, grouped thousands, powers of ten.
//!
//! Values that are not finite are written as `–`; nothing here fails.

/// Placeholder for a missing number.
const NONE: &str = "–";
const THIN_SPACE: char = '\u{202f}';

/// The value with `digits` significant digits; integers keep all of theirs up to a million.
///
/// Below 1e-4 and from 1e6 on it is written with a power of ten.
///
/// ```
/// assert_eq!(report::significant(0.012345, 3), "0.0123");
/// assert_eq!(report::significant(-2.5e-7, 2), "−2.5×10⁻⁷");
/// ```
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let wanted = digits.clamp(1, 17) - 1;
    let scientific = format!("{value:.wanted$e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if (-4..6).contains(&exponent) {
        let wanted = i32::try_from(wanted).unwrap_or(16);
        return fixed(value, usize::try_from(wanted - exponent).unwrap_or(0));
    }
    format!("{}×{}", mantissa.replace('-', "−"), power_of_ten(exponent))
}

/// The value with a number of decimals, thousands grouped from 10 000 on.
///
/// ```
/// assert_eq!(report::fixed(-0.0004, 2), "0.00");
/// ```
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let plain = format!("{:.*}", decimals.min(17), value.abs());
    let (whole, rest) = plain.split_at(plain.find('.').unwrap_or(plain.len()));
    let mut text = String::with_capacity(plain.len() + 8);
    if value < 0.0 && plain.bytes().any(|byte| byte.is_ascii_digit() && byte != b'0') {
        text.push('−');
    }
    for (i, digit) in whole.chars().enumerate() {
        if i > 0 && whole.len() > 4 && (whole.len() - i).is_multiple_of(3) {
            text.push(THIN_SPACE);
        }
        text.push(digit);
    }
    text + rest
}

/// Three significant digits and the unit, separated by a no-break space.
///
/// ```
/// assert_eq!(report::quantity(0.8432, "mm"), "0.843\u{a0}mm");
/// ```
#[must_use]
pub fn quantity(value: f64, unit: &str) -> String {
    let number = significant(value, 3);
    match unit {
        "" => number,
        _ if !value.is_finite() => number,
        "°" => number + unit,
        _ => format!("{number}\u{a0}{unit}"),
    }
}

/// Numbers below this part of the scale beside which they stand are rounding, not results. Doubles keep sixteen digits, of which a computation loses a
/// few.
const NEGLIGIBLE: f64 = 1e-9;
/// Probabilities below this are not distinguished.
const LEAST_PROBABILITY: f64 = 1e-12;

/// The value, or 0 where it is negligible beside `scale`, the largest magnitude of its column or the range of its quantity.
///
/// ```
/// assert_eq!(report::beside(-9.1e-15, 3.2), 0.0);
/// assert_eq!(report::beside(1e-5, 3.2), 1e-5);
/// ```
#[must_use]
pub fn beside(value: f64, scale: f64) -> f64 {
    if value.abs() < NEGLIGIBLE * scale.abs() { 0.0 } else { value }
}

/// A probability of two significant digits; below 10⁻¹² only that it is below.
///
/// ```
/// assert_eq!(report::probability(1.1e-258), "< 10⁻¹²");
/// assert_eq!(report::probability(0.0312), "0.031");
/// ```
#[must_use]
pub fn probability(value: f64) -> String {
    if value < LEAST_PROBABILITY {
        return format!("< {}", power_of_ten(LEAST_PROBABILITY.log10().round() as i32));
    }
    significant(value, 2)
}

/// A time in s, written in a suitable unit (ns to min).
///
/// ```
/// assert_eq!(report::duration(4.2e-6), "4.20\u{a0}µs");
/// ```
#[must_use]
pub fn duration(time_s: f64) -> String {
    let (factor, unit) = match time_s.abs() {
        0.0 => (1.0, "s"),
        t if t < 1e-6 => (1e9, "ns"),
        t if t < 1e-3 => (1e6, "µs"),
        t if t < 1.0 => (1e3, "ms"),
        t if t < 120.0 => (1.0, "s"),
        _ => (1.0 / 60.0, "min"),
    };
    quantity(time_s * factor, unit)
}

/// `10ⁿ`.
pub(crate) fn power_of_ten(exponent: i32) -> String {
    let digits = exponent.to_string();
    let raised = digits.chars().map(|digit| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        _ => '⁰',
    });
    format!("10{}", raised.collect::<String>())
}

/// Number of decimals that gives the largest of these values `digits` significant digits; `None` if
/// the values spread over so many decades that each needs its own.
pub(crate) fn common_decimals(values: &[f64], digits: usize) -> Option<usize> {
    let sizes = || values.iter().map(|v| v.abs()).filter(|v| v.is_finite() && *v > 0.0);
    let (largest, smallest) = (sizes().fold(0.0, f64::max), sizes().fold(f64::INFINITY, f64::min));
    if largest == 0.0 {
        return Some(0);
    }
    if !(1e-4..1e6).contains(&largest) || smallest < largest * 1e-3 {
        return None;
    }
    let exponent = largest.log10().floor();
    Some((digits as f64 - 1.0 - exponent).max(0.0) as usize)
}

/// A count with its noun: `1 fault`, `2 faults`.
#[must_use]
pub fn pluralise(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

/// The text with its first letter in upper case.
#[must_use]
pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_begins_with_a_capital_whatever_its_letters_are() {
        assert_eq!(
            ["", "a", "übrig", "ßa", "1 fault"].map(capitalised),
            ["", "A", "Übrig", "SSa", "1 fault"]
        );
    }

    #[test]
    fn only_what_is_rounding_beside_its_scale_is_zero() {
        assert_eq!(beside(1.007e-8, 360.0), 0.0);
        assert_eq!(beside(2.16e-128, 1e-3), 0.0);
        assert_eq!(beside(4e-8, 1e-3), 4e-8, "small, but a result");
        assert_eq!(beside(1e-8, 0.0), 1e-8, "without a scale nothing is negligible");
        assert!(beside(f64::NAN, 1.0).is_nan());
    }

    #[test]
    fn a_probability_of_nothing_is_only_bounded() {
        assert_eq!([0.0, 1e-300, 2e-12].map(probability), ["< 10⁻¹²", "< 10⁻¹²", "2.0×10⁻¹²"]);
        assert_eq!(probability(f64::NAN), "–");
    }

    #[test]
    fn rounding_up_to_the_next_decade_keeps_the_digits() {
        assert_eq!(significant(9.9996, 3), "10.0");
        assert_eq!(significant(0.099_996, 3), "0.100");
    }

    #[test]
    fn whole_numbers_keep_their_digits_and_are_grouped() {
        assert_eq!(significant(123_456.0, 3), "123\u{202f}456");
        assert_eq!(significant(4321.0, 3), "4321");
    }

    #[test]
    fn nan_is_a_dash_without_unit() {
        assert_eq!(quantity(f64::NAN, "mm"), "–");
        assert_eq!(significant(f64::NEG_INFINITY, 3), "–");
        assert_eq!(duration(f64::INFINITY), "–");
    }

    #[test]
    fn a_column_shares_its_decimals_unless_it_spreads_over_decades() {
        assert_eq!(common_decimals(&[0.843, 0.121, 0.01], 3), Some(3));
        assert_eq!(common_decimals(&[12.0, 110.0, f64::NAN], 3), Some(0));
        assert_eq!(common_decimals(&[1e-5, 1.0], 3), None);
    }

    #[test]
    fn durations_choose_their_unit() {
        assert_eq!(duration(8.3e-8), "83.0\u{a0}ns");
        assert_eq!(duration(0.0123), "12.3\u{a0}ms");
        assert_eq!(duration(600.0), "10.0\u{a0}min");
    }
}
