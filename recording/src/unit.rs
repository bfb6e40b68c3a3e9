//! Units in names: meaning of each suffix, and conversion to SI.
//!
//! One table for columns, models and configurations. SI inside: m, rad, N, N m, s, K (temperatures
//! stay in °C), A, Hz.

/// What a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Plane angle, SI rad.
    Angle,
    /// Length, SI m.
    Length,
    /// Time, SI s.
    Time,
    /// Force, SI N.
    Force,
    /// Moment, SI N m.
    Moment,
    /// Mass, SI kg.
    Mass,
    /// Current, SI A.
    Current,
    /// Temperature, °C.
    Temperature,
    /// Frequency, SI Hz.
    Frequency,
    /// Rotational speed, kept in revolutions per minute.
    Revolutions,
    /// Angular speed, SI rad/s.
    AngularSpeed,
    /// Speed, SI m/s.
    Speed,
    /// Acceleration, SI m/s².
    Acceleration,
    /// Compliance against a moment, SI rad/(N m).
    AngularCompliance,
    /// Compliance against a force, SI m/N.
    LinearCompliance,
    /// Anything else; two such units do not convert into each other.
    Other,
}

/// A unit: its spelling in names, its quantity, and its size in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// As written after the underscore.
    pub name: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// SI value of one.
    pub si: f64,
}

const fn unit(name: &'static str, quantity: Quantity, si: f64) -> Unit {
    Unit { name, quantity, si }
}

const DEG: f64 = std::f64::consts::PI / 180.0;

/// Every unit that a name may carry.
pub const UNITS: &[Unit] = &[
    unit("rad", Quantity::Angle, 1.0),
    unit("mrad", Quantity::Angle, 1e-3),
    unit("deg", Quantity::Angle, DEG),
    unit("m", Quantity::Length, 1.0),
    unit("mm", Quantity::Length, 1e-3),
    unit("um", Quantity::Length, 1e-6),
    unit("s", Quantity::Time, 1.0),
    unit("ms", Quantity::Time, 1e-3),
    unit("us", Quantity::Time, 1e-6),
    unit("ns", Quantity::Time, 1e-9),
    unit("N", Quantity::Force, 1.0),
    unit("kN", Quantity::Force, 1e3),
    unit("Nm", Quantity::Moment, 1.0),
    unit("kNm", Quantity::Moment, 1e3),
    unit("kg", Quantity::Mass, 1.0),
    unit("g", Quantity::Mass, 1e-3),
    unit("A", Quantity::Current, 1.0),
    unit("mA", Quantity::Current, 1e-3),
    unit("C", Quantity::Temperature, 1.0),
    unit("Hz", Quantity::Frequency, 1.0),
    unit("kHz", Quantity::Frequency, 1e3),
    unit("rpm", Quantity::Revolutions, 1.0),
    unit("rad_s", Quantity::AngularSpeed, 1.0),
    unit("mrad_s", Quantity::AngularSpeed, 1e-3),
    unit("deg_s", Quantity::AngularSpeed, DEG),
    unit("m_s", Quantity::Speed, 1.0),
    unit("mm_s", Quantity::Speed, 1e-3),
    unit("m_s2", Quantity::Acceleration, 1.0),
    unit("mrad_per_kNm", Quantity::AngularCompliance, 1e-6),
    unit("rad_per_Nm", Quantity::AngularCompliance, 1.0),
    unit("um_per_N", Quantity::LinearCompliance, 1e-6),
    unit("mm_per_kN", Quantity::LinearCompliance, 1e-6),
    unit("mrad_per_kNm3", Quantity::Other, 1.0),
    unit("mm_per_kN3", Quantity::Other, 1.0),
    unit("mrad_per_K", Quantity::Other, 1.0),
    unit("mm_per_K", Quantity::Other, 1.0),
    unit("um_per_K", Quantity::Other, 1.0),
    unit("um_per_krpm", Quantity::Other, 1.0),
    unit("per_rev", Quantity::Other, 1.0),
    unit("per_m", Quantity::Other, 1.0),
    unit("N_per_m", Quantity::Other, 1.0),
    unit("N_per_mm", Quantity::Other, 1.0),
    unit("N_per_um", Quantity::Other, 1.0),
];

/// Ten to the largest number of decimals in files.
const DECIMALS: f64 = 1e9;

impl Unit {
    /// The unit with this spelling.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        UNITS.iter().copied().find(|unit| unit.name == name)
    }

    /// Splits a name into its base and its unit: `offset_mrad` is `offset` and mrad. The longest
    /// unit counts, so that `feed_mm_s` is a speed.
    #[must_use]
    pub fn split(name: &str) -> (&str, Option<Self>) {
        let fits = |unit: &Self| {
            let base = name.strip_suffix(unit.name)?.strip_suffix('_')?;
            (!base.is_empty()).then_some((base, Some(*unit)))
        };
        let longest = UNITS.iter().filter_map(fits).min_by_key(|(base, _)| base.len());
        longest.unwrap_or((name, None))
    }

    /// A value in this unit as SI. Angles in degrees use the exact quotient π/180.
    #[must_use]
    pub fn to_si(self, value: f64) -> f64 {
        value * self.si
    }

    /// The value in this unit that [`Self::to_si`] converts to `si`, exactly if there is one;
    /// otherwise the nearest. Of several, one with at most nine decimals, as in files.
    #[must_use]
    pub fn from_si(self, si: f64) -> f64 {
        let quotient = si / self.si;
        let written = (quotient * DECIMALS).round() / DECIMALS;
        let exact = [written, quotient, quotient.next_up(), quotient.next_down()];
        exact.into_iter().find(|value| self.to_si(*value) == si).unwrap_or(quotient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_longest_unit_wins() {
        assert_eq!(Unit::split("feed_mm_s").1.unwrap().name, "mm_s");
        assert_eq!(Unit::split("offset_mrad"), ("offset", Unit::from_name("mrad")));
        assert_eq!(Unit::split("mm"), ("mm", None));
        assert_eq!(Unit::split("from_joint").1, None);
    }

    proptest! {
        #[test]
        fn what_was_read_in_a_unit_is_written_in_it_without_loss(value in -1e4..1e4_f64) {
            for unit in UNITS {
                let si = unit.to_si(value);
                prop_assert_eq!(unit.to_si(unit.from_si(si)).to_bits(), si.to_bits());
            }
        }

        #[test]
        fn a_number_of_six_decimals_is_written_with_the_same_digits(millionths in -400_000_000..400_000_000_i64) {
            let value = millionths as f64 / 1e6;
            for unit in UNITS {
                prop_assert_eq!(unit.from_si(unit.to_si(value)), value, "{}", unit.name);
            }
        }
    }
}
