//! The axes of a cut in the frame of the modes: along the feed, across it, up out of the workpiece.

use super::StabilityError;
use nalgebra::{Matrix3, Vector3};

/// Least component of the feed perpendicular to the upward direction, relative to its length.
const PARALLEL: f64 = 1e-6;

/// Cut axes: x along the feed, z up out of the workpiece (opposite to the tool's z), y = z × x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutAxes {
    /// Rows: the axes.
    rows: Matrix3<f64>,
}

impl CutAxes {
    /// From the feed direction and the upward direction, each of any length but 0; only the
    /// component of the feed perpendicular to `up` is used.
    ///
    /// # Errors
    /// [`StabilityError::Axes`]: they are parallel, 0 or not finite.
    pub fn new(feed: [f64; 3], up: [f64; 3]) -> Result<Self, StabilityError> {
        let (feed, up) = (Vector3::from(feed), Vector3::from(up));
        let z = up.try_normalize(0.0).ok_or(StabilityError::Axes)?;
        let across = feed - z * z.dot(&feed);
        let is_plane = across.norm() > PARALLEL * feed.norm() && across.norm().is_finite();
        if !is_plane {
            return Err(StabilityError::Axes);
        }
        let x = across.normalize();
        let y = z.cross(&x);
        Ok(Self { rows: Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]) })
    }

    /// The axes with the feed rotated about the upward axis, counterclockwise seen from above.
    #[must_use]
    pub fn rotated(&self, angle_rad: f64) -> Self {
        let (sin, cos) = angle_rad.sin_cos();
        let turn = Matrix3::new(cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0);
        Self { rows: turn * self.rows }
    }

    /// Unit vector of the feed in the frame of the modes.
    #[must_use]
    pub fn feed(&self) -> [f64; 3] {
        self.rows.row(0).transpose().into()
    }

    /// A vector in cut axes.
    pub(super) fn in_cut_axes(&self, vector: [f64; 3]) -> Vector3<f64> {
        self.rows * Vector3::from(vector)
    }
}
