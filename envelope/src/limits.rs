//! Limits of one joint's correction in position, rate and jerk.
//!
//! Invariant: a [`Limits`] holds positive, finite numbers; others are refused.

/// Limits on one joint's correction. Joint units: rad, or m for a prismatic joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    angle: f64,
    rate: f64,
    jerk: f64,
}

/// A limit that is not a positive, finite number.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "envelope: {bound} is {value}, expected a finite number above 0 (rad, rad/s, rad/s³; m for a \
     prismatic joint); check the `envelope` table of the cell's configuration"
)]
pub struct LimitsError {
    /// Which limit: `angle`, `rate` or `jerk`.
    pub bound: &'static str,
    /// The value given.
    pub value: f64,
}

impl Limits {
    /// `angle` (rad or m), `rate` (per s), `jerk` (per s³), each finite and above 0.
    ///
    /// # Errors
    /// Names the first value that is not.
    pub fn new(angle: f64, rate: f64, jerk: f64) -> Result<Self, LimitsError> {
        for (bound, value) in [("angle", angle), ("rate", rate), ("jerk", jerk)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(LimitsError { bound, value });
            }
        }
        Ok(Self { angle, rate, jerk })
    }

    /// The larger of both, limit by limit.
    #[must_use]
    pub(crate) fn union(&self, other: &Self) -> Self {
        Self {
            angle: self.angle.max(other.angle),
            rate: self.rate.max(other.rate),
            jerk: self.jerk.max(other.jerk),
        }
    }

    /// The same with the jerk of `other`.
    #[must_use]
    pub(crate) fn with_jerk_of(&self, other: &Self) -> Self {
        Self { jerk: other.jerk, ..*self }
    }

    /// The same jerk with at least this angle and this rate.
    #[must_use]
    pub(crate) fn widened_to(&self, angle: f64, rate: f64) -> Self {
        Self { angle: self.angle.max(angle), rate: self.rate.max(rate), jerk: self.jerk }
    }

    /// The largest correction, rad or m.
    #[must_use]
    pub fn angle(&self) -> f64 {
        self.angle
    }

    /// The fastest change, rad/s or m/s.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// The largest third derivative, rad/s³ or m/s³.
    #[must_use]
    pub fn jerk(&self) -> f64 {
        self.jerk
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_that_bounds_nothing_is_refused_by_name() {
        assert_eq!(Limits::new(0.0, 1.0, 1.0).map_err(|e| e.bound), Err("angle"));
        assert_eq!(Limits::new(1.0, -1.0, 1.0).map_err(|e| e.bound), Err("rate"));
        assert_eq!(Limits::new(1.0, 1.0, f64::NAN).map_err(|e| e.bound), Err("jerk"));
        assert_eq!(Limits::new(1.0, 1.0, f64::INFINITY).map_err(|e| e.bound), Err("jerk"));
        assert!(Limits::new(1e-3, 1e-2, 1.0).is_ok());
    }
}
