//! The axes of a cut in the frame of the modes: along the feed, across it, up out of the workpiece.

use super::StabilityError;
use nalgebra::{Matrix3, Vector3};

/// Sine of the angle between feed and upward direction below which they are parallel.
const PARALLEL: f64 = 1e-6;
/// Largest deviation of feed and upward direction from a right angle, degrees. Chosen: directions
/// entered to two digits keep it, and the feed, which is turned into the plane across `up`, changes
/// by less than any limit shows.
const SKEW_MAX_DEG: f64 = 1.0;

/// Cut axes: x along the feed, z up out of the workpiece (opposite to the tool's z), y = z × x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutAxes {
    /// Rows: the axes.
    rows: Matrix3<f64>,
}

impl CutAxes {
    /// From the feed direction and the upward direction, each of any length but 0, at right angles
    /// within a degree.
    ///
    /// # Errors
    /// [`StabilityError::Axes`]: they are parallel, 0 or not finite; [`StabilityError::Skew`]: they are not at
    /// right angles, so that either the feed or the plane of the cut would not be the stated one.
    pub fn new(feed: [f64; 3], up: [f64; 3]) -> Result<Self, StabilityError> {
        let (x, z) = unit(feed).zip(unit(up)).ok_or(StabilityError::Axes)?;
        let across = x - z * z.dot(&x);
        let sine = across.norm();
        if sine < PARALLEL {
            return Err(StabilityError::Axes);
        }
        let angle_deg = sine.atan2(z.dot(&x)).to_degrees();
        if (angle_deg - 90.0).abs() > SKEW_MAX_DEG {
            let across_feed = z - x * x.dot(&z);
            let (feed, up) = (across.normalize().into(), across_feed.normalize().into());
            return Err(StabilityError::Skew { angle_deg, feed, up });
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

    /// Unit vector out of the workpiece in the frame of the modes.
    #[must_use]
    pub fn up(&self) -> [f64; 3] {
        self.rows.row(2).transpose().into()
    }

    /// A vector in cut axes.
    pub(super) fn in_cut_axes(&self, vector: [f64; 3]) -> Vector3<f64> {
        self.rows * Vector3::from(vector)
    }
}

/// A vector of length 1, of any finite vector but 0: scaled first, since squares of large and small
/// numbers overflow.
fn unit(vector: [f64; 3]) -> Option<Vector3<f64>> {
    let vector = Vector3::from(vector);
    let largest = vector.amax();
    let is_direction = vector.iter().all(|x| x.is_finite()) && largest > 0.0;
    is_direction.then(|| (vector / largest).normalize())
}
