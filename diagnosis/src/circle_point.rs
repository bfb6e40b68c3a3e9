//! Circle-point analysis: the axis of rotation from the tracks of targets.
//!
//! All tracks of one sweep share the axis; each has its own height along it and its own radius. Start: plane of total least squares (eigenvector of
//! the smallest eigenvalue of the scatter matrix) and Kåsa's algebraic circle (1976). Then Gauss-Newton on the orthogonal distance of every point to
//! its circle in space (along the axis and perpendicular to it), which neither the plane nor the algebraic circle alone minimises. Thesis 3.1;
//! Mooring, Roth and Driels 1991, 5.3.
//!
//! Input and output: m, in one frame. Exact circles are recovered to rounding; the covariance is that of the linearised problem under equal noise in
//! all directions. Outliers are not rejected, and gravity deflection is not removed (see [`crate::single_joint`]).

use crate::qr::QrFactor;
use crate::rigid_motion::mean;
use glam::{DMat3, DVec3};
use nalgebra::Matrix3;
use physics::frame::{normals, rotation_from_vector};
use thiserror::Error;

const STEPS_MAX: usize = 60;
/// Steps below this fraction of the size of the tracks are rounding errors.
const ENOUGH: f64 = 1e-14;
/// Tracks whose spread across their main direction is below this fraction of that along it count as straight.
const STRAIGHT: f64 = 1e-12;

/// Parameters of the circle of one target about the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    /// Along the axis from [`Axis::point`] to the circle's centre, m.
    pub height_m: f64,
    /// Radius, m.
    pub radius_m: f64,
    /// Standard uncertainty of the height, m.
    pub sigma_height_m: f64,
    /// Standard uncertainty of the radius, m.
    pub sigma_radius_m: f64,
}

/// An axis in space with its uncertainty, in the frame of the measured points.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Unit vector.
    pub direction: DVec3,
    /// The point on the axis at the mean height of all points, m; with one track the centre of its circle.
    pub point: DVec3,
    /// Covariance of the rotations about `n1` and `n2` (rad) and the translations along `n1` and `n2` (m) at [`Axis::point`]; `n1`, `n2` are the
    /// [`normals`] of the direction.
    pub covariance: [[f64; 4]; 4],
    /// One circle per track, in the order of the tracks.
    pub circles: Vec<Circle>,
    /// Root mean square residual per degree of freedom, m: the estimated standard deviation of one coordinate.
    pub residual_rms_m: f64,
}

/// Why tracks do not determine an axis.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum CircleError {
    /// Not enough points.
    #[error(
        "track {track} has {found} points, expected three or more; measure more steps along the sweep"
    )]
    TooFew {
        /// 1-based.
        track: usize,
        /// Number of its points.
        found: usize,
    },
    /// No track.
    #[error("no target was measured along the sweep; give at least one that moves with the joint")]
    NoTrack,
    /// A coordinate is not finite.
    #[error("track {track}: a coordinate is not finite")]
    NotFinite {
        /// 1-based.
        track: usize,
    },
    /// The curvature of the tracks is not significant.
    #[error(
        "the tracks are straight within their noise and do not determine an axis; sweep further, or place the target further from the axis"
    )]
    Straight,
}

impl Axis {
    /// The centre of a track's circle, m.
    #[must_use]
    pub fn centre(&self, track: usize) -> Option<DVec3> {
        Some(self.point + self.direction * self.circles.get(track)?.height_m)
    }

    /// Standard uncertainty of the direction about `n1` and `n2`, rad.
    #[must_use]
    pub fn sigma_turn_rad(&self) -> [f64; 2] {
        [0, 1].map(|i| self.covariance[i][i].sqrt())
    }

    /// Standard uncertainty of the point along `n1` and `n2`, m.
    #[must_use]
    pub fn sigma_point_m(&self) -> [f64; 2] {
        [2, 3].map(|i| self.covariance[i][i].sqrt())
    }

    /// Smallest rotation (rotation vector, rad) that takes `nominal` (unit vector) to this direction.
    #[must_use]
    pub fn tilt_from(&self, nominal: DVec3) -> DVec3 {
        smallest_turn(nominal, self.direction)
    }

    /// The point of the axis nearest to `p`, m.
    #[must_use]
    pub fn nearest(&self, p: DVec3) -> DVec3 {
        self.point + self.direction * self.direction.dot(p - self.point)
    }
}

/// Smallest rotation that takes the direction of `from` to that of `to`, as a rotation vector, rad; accurate for small angles.
#[must_use]
pub fn smallest_turn(from: DVec3, to: DVec3) -> DVec3 {
    let across = from.cross(to);
    let sin = across.length();
    if sin == 0.0 { DVec3::ZERO } else { across * (libm::atan2(sin, from.dot(to)) / sin) }
}

/// The common axis of rotation of all `tracks` (m), with the sign closer to `towards`. `noise_m` is the standard deviation of one coordinate if
/// known; otherwise it is estimated from the residuals.
///
/// # Errors
/// Tracks that determine no axis, see [`CircleError`].
pub fn axis(
    tracks: &[Vec<DVec3>],
    towards: DVec3,
    noise_m: Option<f64>,
) -> Result<Axis, CircleError> {
    check(tracks)?;
    let mut estimate = start(tracks, towards)?;
    let size = estimate.radius.iter().fold(0.0_f64, |most, r| most.max(*r));
    for _ in 0..STEPS_MAX {
        let step = estimate.linearised(tracks).solve(&[]);
        estimate.step(&step);
        estimate.amid(tracks);
        let step_max = step.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        if !step_max.is_finite() {
            return Err(CircleError::Straight);
        }
        if step_max <= ENOUGH * size {
            break;
        }
    }
    estimate.finish(tracks, noise_m)
}

fn check(tracks: &[Vec<DVec3>]) -> Result<(), CircleError> {
    if tracks.is_empty() {
        return Err(CircleError::NoTrack);
    }
    for (k, track) in tracks.iter().enumerate() {
        if track.len() < 3 {
            return Err(CircleError::TooFew { track: k + 1, found: track.len() });
        }
        if !track.iter().all(|p| p.is_finite()) {
            return Err(CircleError::NotFinite { track: k + 1 });
        }
    }
    Ok(())
}

/// Parameters of the fit: an axis through a point, a height and a radius for each track.
struct AxisEstimate {
    direction: DVec3,
    point: DVec3,
    height: Vec<f64>,
    radius: Vec<f64>,
}

fn start(tracks: &[Vec<DVec3>], towards: DVec3) -> Result<AxisEstimate, CircleError> {
    let centres: Vec<DVec3> = tracks.iter().map(|track| mean(track)).collect();
    let mut scatter = DMat3::ZERO;
    for (track, centre) in tracks.iter().zip(&centres) {
        for w in track.iter().map(|p| *p - *centre) {
            scatter += DMat3::from_cols(w * w.x, w * w.y, w * w.z);
        }
    }
    let eigen = Matrix3::from_column_slice(&scatter.to_cols_array()).symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    if eigen.eigenvalues[order[1]] <= STRAIGHT * eigen.eigenvalues[order[2]] {
        return Err(CircleError::Straight);
    }
    let smallest = eigen.eigenvectors.column(order[0]);
    let found = DVec3::new(smallest[0], smallest[1], smallest[2]).normalize_or_zero();
    let direction = if found.dot(towards) < 0.0 { -found } else { found };
    // Kåsa: |w|² = 2 c·w + (r² − |c|²), linear in c and in one constant per track.
    let (n1, n2) = normals(direction);
    let origin = mean(&centres);
    let mut triangle = QrFactor::new(2 + tracks.len());
    for (k, track) in tracks.iter().enumerate() {
        let mut row = vec![0.0; 2 + tracks.len()];
        row[2 + k] = 1.0;
        for w in track.iter().map(|p| *p - origin) {
            let (x, y) = (w.dot(n1), w.dot(n2));
            (row[0], row[1]) = (2.0 * x, 2.0 * y);
            triangle.push(&row, x * x + y * y);
        }
    }
    triangle.reduce();
    let x = triangle.solve(&[]);
    let squares = x[2..].iter().map(|rest| rest + x[0] * x[0] + x[1] * x[1]);
    let height = centres.iter().map(|c| direction.dot(*c - origin)).collect();
    let point = origin + n1 * x[0] + n2 * x[1];
    let estimate = AxisEstimate {
        direction,
        point,
        height,
        radius: squares.map(|square| square.max(0.0).sqrt()).collect(),
    };
    Ok(estimate)
}

impl AxisEstimate {
    /// Rows in m: for each point the residual along the axis and the radial one. Columns: two rotations, two translations, heights, radii.
    fn linearised(&self, tracks: &[Vec<DVec3>]) -> QrFactor {
        let count = tracks.len();
        let (n1, n2) = normals(self.direction);
        let mut triangle = QrFactor::new(4 + 2 * count);
        for (k, track) in tracks.iter().enumerate() {
            for w in track.iter().map(|p| *p - self.point) {
                let h = self.direction.dot(w);
                let across = w - self.direction * h;
                let rho = across.length();
                let turned = self.direction.cross(w);
                let lever = if rho > 0.0 { h / rho } else { 0.0 };
                let outward = across.normalize_or_zero();
                let mut along = vec![0.0; 4 + 2 * count];
                let mut radial = along.clone();
                for (i, n) in [n1, n2].into_iter().enumerate() {
                    // The residual is measured minus predicted, hence the sign.
                    along[i] = -n.dot(turned);
                    radial[i] = lever * n.dot(turned);
                    radial[2 + i] = outward.dot(n);
                }
                along[4 + k] = 1.0;
                radial[4 + count + k] = 1.0;
                triangle.push(&along, h - self.height[k]);
                triangle.push(&radial, rho - self.radius[k]);
            }
        }
        triangle.reduce();
        triangle
    }

    fn step(&mut self, step: &[f64]) {
        let (n1, n2) = normals(self.direction);
        self.point += n1 * step[2] + n2 * step[3];
        let turned = rotation_from_vector(n1 * step[0] + n2 * step[1]) * self.direction;
        self.direction = turned.normalize_or(self.direction);
        let (heights, radii) = step[4..].split_at(self.height.len());
        self.height.iter_mut().zip(heights).for_each(|(h, by)| *h += by);
        self.radius.iter_mut().zip(radii).for_each(|(r, by)| *r += by);
    }

    /// Moves the point along the axis to the mean height of all points, where rotations and translations are least correlated.
    fn amid(&mut self, tracks: &[Vec<DVec3>]) {
        let all: usize = tracks.iter().map(Vec::len).sum();
        let weighed: f64 = tracks.iter().zip(&self.height).map(|(t, h)| t.len() as f64 * h).sum();
        let by = weighed / all as f64;
        self.point += self.direction * by;
        self.height.iter_mut().for_each(|h| *h -= by);
    }

    fn finish(self, tracks: &[Vec<DVec3>], noise_m: Option<f64>) -> Result<Axis, CircleError> {
        let triangle = self.linearised(tracks);
        let free = triangle.rows().saturating_sub(triangle.width()).max(1) as f64;
        let residual_rms_m = (triangle.rest() / free).sqrt();
        let variance = noise_m.unwrap_or(residual_rms_m).powi(2);
        let inverse = triangle.inverse();
        let full = |i: usize, j: usize| -> f64 {
            (i.max(j)..triangle.width()).map(|k| inverse[i][k - i] * inverse[j][k - j]).sum::<f64>()
                * variance
        };
        let count = tracks.len();
        let circles: Vec<Circle> = (0..count)
            .map(|k| Circle {
                height_m: self.height[k],
                radius_m: self.radius[k],
                sigma_height_m: full(4 + k, 4 + k).sqrt(),
                sigma_radius_m: full(4 + count + k, 4 + count + k).sqrt(),
            })
            .collect();
        let covariance: [[f64; 4]; 4] =
            std::array::from_fn(|i| std::array::from_fn(|j| full(i, j)));
        let sound = circles.iter().any(|c| c.radius_m > 3.0 * c.sigma_radius_m);
        if !(sound && covariance.iter().flatten().all(|x| x.is_finite())) {
            return Err(CircleError::Straight);
        }
        Ok(Axis {
            direction: self.direction,
            point: self.point,
            covariance,
            circles,
            residual_rms_m,
        })
    }
}

#[cfg(test)]
mod tests;
