//! Best-fit rigid motion between two sets of points (Horn 1987: the largest eigenvector of a symmetric 4 × 4 matrix).
//!
//! The result is always a proper rotation; mirrored points give a large residual, not a reflection. All points have equal weight, and outliers are
//! not detected.

use glam::{DMat3, DQuat, DVec3};
use physics::Frame;

/// The motion `x ↦ R x + p` that maps `from` to `to` with the least sum of squares; `None` with fewer than three points.
#[must_use]
pub fn fit_rigid_motion(from: &[DVec3], to: &[DVec3]) -> Option<Frame> {
    if from.len() < 3 || from.len() != to.len() {
        return None;
    }
    let (a, b) = (mean(from), mean(to));
    let mut s = DMat3::ZERO;
    for (x, y) in from.iter().zip(to) {
        let (x, y) = (*x - a, *y - b);
        s += DMat3::from_cols(x * y.x, x * y.y, x * y.z);
    }
    // s[row i, column j] = Σ x_i y_j
    let (xx, yx, zx) = (s.x_axis.x, s.x_axis.y, s.x_axis.z);
    let (xy, yy, zy) = (s.y_axis.x, s.y_axis.y, s.y_axis.z);
    let (xz, yz, zz) = (s.z_axis.x, s.z_axis.y, s.z_axis.z);
    let horn = [
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ];
    let [w, x, y, z] = largest_eigenvector(horn);
    let rotation = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
    Some(Frame::new(rotation, b - rotation * a))
}

/// Root mean square distance between the moved points and `to`, m.
#[must_use]
pub fn rms_distance(motion: &Frame, from: &[DVec3], to: &[DVec3]) -> f64 {
    let sum: f64 = from.iter().zip(to).map(|(x, y)| (motion.point(*x) - *y).length_squared()).sum();
    (sum / from.len().max(1) as f64).sqrt()
}

/// The mean of points.
#[must_use]
pub fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len().max(1) as f64
}

/// Jacobi's method: plane rotations until the matrix is diagonal.
fn largest_eigenvector(mut a: [[f64; 4]; 4]) -> [f64; 4] {
    let mut v = [[0.0; 4]; 4];
    (0..4).for_each(|i| v[i][i] = 1.0);
    for _ in 0..30 {
        for p in 0..3 {
            for q in p + 1..4 {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                apply_jacobi_rotation(&mut a, &mut v, (p, q), (c, t * c));
            }
        }
    }
    let largest = (0..4).max_by(|i, j| a[*i][*i].total_cmp(&a[*j][*j])).unwrap_or(0);
    std::array::from_fn(|i| v[i][largest])
}

fn apply_jacobi_rotation(
    a: &mut [[f64; 4]; 4],
    v: &mut [[f64; 4]; 4],
    (p, q): (usize, usize),
    (c, s): (f64, f64),
) {
    for row in a.iter_mut() {
        let (x, y) = (row[p], row[q]);
        (row[p], row[q]) = (c * x - s * y, s * x + c * y);
    }
    let (first, second) = (a[p], a[q]);
    a[p] = std::array::from_fn(|k| c * first[k] - s * second[k]);
    a[q] = std::array::from_fn(|k| s * first[k] + c * second[k]);
    for row in v.iter_mut() {
        let (x, y) = (row[p], row[q]);
        (row[p], row[q]) = (c * x - s * y, s * x + c * y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::frame::rotation_from_vector;
    use proptest::prelude::*;

    fn cloud() -> impl Strategy<Value = Vec<DVec3>> {
        prop::collection::vec(
            prop::array::uniform3(-1.0..1.0_f64).prop_map(DVec3::from_array),
            5..20,
        )
    }

    proptest! {
        #[test]
        fn a_moved_cloud_gives_its_motion_back(points in cloud(), turn in prop::array::uniform3(-1.7..1.7_f64), shift in prop::array::uniform3(-5.0..5.0_f64)) {
            let motion = Frame::new(rotation_from_vector(DVec3::from_array(turn)), DVec3::from_array(shift));
            let moved: Vec<DVec3> = points.iter().map(|p| motion.point(*p)).collect();
            let found = fit_rigid_motion(&points, &moved).expect("enough points");
            prop_assert!(rms_distance(&found, &points, &moved) < 1e-12);
            prop_assert!((found.rotation.determinant() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_mirrored_cloud_leaves_a_residual() {
        let points: Vec<DVec3> = (0..20)
            .map(f64::from)
            .map(|t| DVec3::new(t.sin(), (2.0 * t).cos(), (0.7 * t).sin()))
            .collect();
        let mirrored: Vec<DVec3> = points.iter().map(|p| DVec3::new(-p.x, p.y, p.z)).collect();
        let motion = fit_rigid_motion(&points, &mirrored).expect("enough points");
        assert!(rms_distance(&motion, &points, &mirrored) > 0.3);
    }
}
