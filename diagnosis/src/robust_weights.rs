//! Robust weights of measurements.
//!
//! The norm of a whitened residual with `d` components is converted to a normal deviate (Wilson and Hilferty 1931). Up to the knee a measurement has
//! weight one, so that clean data are fitted by least squares; beyond it, the influence is constant in the first pass (Huber 1964) and redescends to
//! zero in the second (Hampel 1974). The scale is the median of those norms, with a breakdown point of one half.
//!
//! Weights are between 0 and 1, and one for clean measurements. Measurements with a weight below one half are listed as outliers.

use crate::engine::statistics::median;

/// Deviate up to which a measurement has weight one: one clean measurement in a thousand lies beyond.
const KNEE: f64 = 3.0;
/// A redescending weight is zero from this multiple of the knee on.
const REACH: f64 = 2.5;

/// Influence function for large residuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Influence {
    /// All weights are one (least squares).
    Equal,
    /// Constant influence beyond the knee.
    Huber,
    /// Influence decreases to zero.
    Redescending,
}

/// Norm of a whitened residual with `count` components that corresponds to the normal deviate `deviate`.
#[must_use]
pub fn norm_at_deviate(count: usize, deviate: f64) -> f64 {
    let d = count as f64;
    let share = 2.0 / (9.0 * d);
    let root = (1.0 - share + deviate * share.sqrt()).max(0.0);
    (d * root * root * root).sqrt()
}

/// Weight of a measurement with `count` components whose whitened residual, in units of the scale, has the norm `length`.
#[must_use]
pub fn weight(influence: Influence, count: usize, length: f64) -> f64 {
    let knee = norm_at_deviate(count, KNEE);
    if length <= knee {
        return 1.0;
    }
    match influence {
        Influence::Equal => 1.0,
        Influence::Huber => knee / length,
        Influence::Redescending => {
            let down = ((REACH * knee - length) / ((REACH - 1.0) * knee)).max(0.0);
            down * down
        }
    }
}

/// Factor on the stated noise, estimated from the norms of residuals: one if the noise was stated correctly. `lengths`: number of components and norm
/// of each.
#[must_use]
pub fn robust_noise_factor(lengths: impl Iterator<Item = (usize, f64)>) -> Option<f64> {
    let scale = median(lengths.map(|(count, length)| length / norm_at_deviate(count, 0.0)));
    (scale > 0.0).then_some(scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_knee_is_where_one_clean_reading_in_a_thousand_lies() {
        // Quantiles of chi by tables: P(chi_1 > 3.2905) = 0.001, P(chi_3 > 4.0331) = 0.001; the deviate 3 is 0.00135.
        assert!((norm_at_deviate(1, 3.0902) - 3.2905).abs() < 0.06);
        assert!((norm_at_deviate(3, 3.0902) - 4.0331).abs() < 0.04);
        assert!((norm_at_deviate(3, 0.0) - 1.5382).abs() < 0.01, "the median of chi_3");
    }

    #[test]
    fn weights_fall_from_one_and_only_the_second_pass_reaches_nothing() {
        for count in [1, 3] {
            let knee = norm_at_deviate(count, KNEE);
            for influence in [Influence::Equal, Influence::Huber, Influence::Redescending] {
                assert_eq!(weight(influence, count, 0.99 * knee), 1.0);
            }
            assert!((weight(Influence::Huber, count, 4.0 * knee) - 0.25).abs() < 1e-12);
            assert_eq!(weight(Influence::Redescending, count, 4.0 * knee), 0.0);
            let beyond_knee = weight(Influence::Redescending, count, 1.1 * knee);
            assert!(beyond_knee > 0.8 && beyond_knee < 1.0, "{beyond_knee}");
        }
    }

    #[test]
    fn a_third_of_wild_readings_hardly_moves_the_scale() {
        let clean = (0..200).map(|i| (3, norm_at_deviate(3, -2.0 + 0.02 * f64::from(i))));
        let outliers = (0..100).map(|_| (3, 1e6));
        let found = robust_noise_factor(clean.chain(outliers)).expect("readings");
        assert!((0.9..1.6).contains(&found), "{found}");
    }
}
