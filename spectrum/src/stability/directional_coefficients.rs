//! Directional coefficients W: cutting force per axial depth and displacement of the tool, as exact
//! means over ranges of the rotation angle.
//!
//! A tooth at φ contributes `f nᵀ` (header of `stability.rs`), products of sines and cosines. The
//! mean over a span has a closed form by their antiderivative, the mean over the lag of a helical
//! tooth by the second antiderivative. Cut axes; N/m².

use super::Cutter;
use nalgebra::{Matrix3x2, Vector5};
use std::f64::consts::TAU;

/// A smaller lag from tip to top is treated as a straight tooth, rad.
const STRAIGHT_RAD: f64 = 1e-5;

/// The coefficients of a cutter at a depth, as functions of the rotation angle.
pub(super) struct DirectionalCoefficients<'a> {
    cutter: &'a Cutter,
    lag_rad: f64,
}

impl<'a> DirectionalCoefficients<'a> {
    pub(super) fn new(cutter: &'a Cutter, depth_m: f64) -> Self {
        Self { cutter, lag_rad: cutter.lag_rad(depth_m) }
    }

    /// Range of angles of a tooth's tip in which any part of the tooth cuts.
    pub(super) fn engaged_range_rad(&self) -> [f64; 2] {
        let Self { cutter, lag_rad } = self;
        [cutter.entry_rad + lag_rad.min(0.0), cutter.exit_rad + lag_rad.max(0.0)]
    }

    /// Sum of W over all teeth, averaged while one of them rotates from an angle by a span above 0.
    pub(super) fn mean_over_teeth(&self, from_rad: f64, span_rad: f64) -> Matrix3x2<f64> {
        if self.cutter.turning {
            return self.coefficient_matrix(products(0.25 * TAU));
        }
        let pitch_rad = TAU / f64::from(self.cutter.teeth);
        let [low, high] = self.engaged_range_rad();
        // Teeth whose tips are in the engaged range at some time of the span.
        let first = ((low - from_rad - span_rad) / pitch_rad).ceil() as i64;
        let last = ((high - from_rad) / pitch_rad).floor() as i64;
        let one =
            |tooth: i64| self.mean_products_of_tooth(from_rad + tooth as f64 * pitch_rad, span_rad);
        self.coefficient_matrix((first..=last).map(one).sum())
    }

    /// Mean products of one tooth over the span and over its lag angle.
    fn mean_products_of_tooth(&self, from_rad: f64, span_rad: f64) -> Vector5<f64> {
        let to_rad = from_rad + span_rad;
        if self.lag_rad.abs() < STRAIGHT_RAD {
            return (self.integral_from_entry(to_rad) - self.integral_from_entry(from_rad))
                / span_rad;
        }
        let lag = self.lag_rad;
        let tip =
            self.double_integral_from_entry(to_rad) - self.double_integral_from_entry(from_rad);
        let top = self.double_integral_from_entry(to_rad - lag)
            - self.double_integral_from_entry(from_rad - lag);
        (tip - top) / (lag * span_rad)
    }

    /// Integral of the products from the entry angle, zero outside the engagement.
    fn integral_from_entry(&self, to_rad: f64) -> Vector5<f64> {
        let Cutter { entry_rad, exit_rad, .. } = *self.cutter;
        integral(to_rad.clamp(entry_rad, exit_rad)) - integral(entry_rad)
    }

    /// Integral of [`Self::integral_from_entry`] from the entry angle.
    fn double_integral_from_entry(&self, to_rad: f64) -> Vector5<f64> {
        let Cutter { entry_rad, exit_rad, .. } = *self.cutter;
        if to_rad <= entry_rad {
            return Vector5::zeros();
        }
        let inside = to_rad.min(exit_rad);
        let within = second_integral(inside)
            - second_integral(entry_rad)
            - integral(entry_rad) * (inside - entry_rad);
        within + self.integral_from_entry(exit_rad) * (to_rad - inside)
    }

    fn coefficient_matrix(&self, products: Vector5<f64>) -> Matrix3x2<f64> {
        let [tangential, radial, axial] = self.cutter.chip_n_m2;
        let [sin_cos, sin_sin, cos_cos, sin, cos] = products.into();
        Matrix3x2::new(
            -tangential * sin_cos - radial * sin_sin,
            -tangential * cos_cos - radial * sin_cos,
            tangential * sin_sin - radial * sin_cos,
            tangential * sin_cos - radial * cos_cos,
            axial * sin,
            axial * cos,
        )
    }
}

/// `sin cos`, `sin²`, `cos²`, `sin`, `cos` of an angle.
fn products(angle: f64) -> Vector5<f64> {
    let (sin, cos) = angle.sin_cos();
    Vector5::new(sin * cos, sin * sin, cos * cos, sin, cos)
}

/// Antiderivatives of [`products`].
fn integral(angle: f64) -> Vector5<f64> {
    let (sin, cos) = angle.sin_cos();
    let [half, sin_cos] = [0.5 * angle, 0.5 * sin * cos];
    Vector5::new(0.5 * sin * sin, half - sin_cos, half + sin_cos, -cos, sin)
}

/// Antiderivatives of [`integral`].
fn second_integral(angle: f64) -> Vector5<f64> {
    let (sin, cos) = angle.sin_cos();
    let [square, sin_sin] = [0.25 * angle * angle, 0.25 * sin * sin];
    Vector5::new(0.25 * (angle - sin * cos), square - sin_sin, square + sin_sin, -sin, -cos)
}
