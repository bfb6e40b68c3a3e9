//! Damping that keeps a bounded correction continuous through singular poses; it acts only in
//! directions in which the joints hardly move the tool.
//!
//! It is a function of the matrix `JᵀJ` alone (each eigenvalue is mapped to its damping), hence
//! continuous also where eigenvalues coincide.

use crate::bounded_minimum::JointMatrix;
use libm::sqrt;
use physics::JOINTS_MAX;

/// Directions in which a unit joint motion moves the tool by less than this are damped, m/rad.
/// Below the 0.07 m/rad of a regular wrist with a radian weighted as 0.1 m.
const WEAK_MOTION: f64 = 0.06;
/// Sweeps of the Jacobi eigenvalue method: six suffice for matrices of this size, to rounding.
const SWEEPS: usize = 12;

/// The matrix with the eigenvectors of `of` and the eigenvalues `most · (1 − of / WEAK²)²`, none where `of` is at least `WEAK²`.
pub(crate) fn damping(count: usize, matrix: &JointMatrix, most: f64) -> JointMatrix {
    let (values, vectors) = eigen(count, matrix);
    let mut damped = [[0.0; JOINTS_MAX]; JOINTS_MAX];
    for (j, value) in values.iter().enumerate().take(count) {
        let weak = (1.0 - value / (WEAK_MOTION * WEAK_MOTION)).clamp(0.0, 1.0);
        for i in 0..count {
            for k in 0..count {
                damped[i][k] += most * weak * weak * vectors[i][j] * vectors[k][j];
            }
        }
    }
    damped
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi rotations.
fn eigen(count: usize, matrix: &JointMatrix) -> ([f64; JOINTS_MAX], JointMatrix) {
    let mut a = *matrix;
    let mut v = [[0.0; JOINTS_MAX]; JOINTS_MAX];
    (0..count).for_each(|i| v[i][i] = 1.0);
    for _ in 0..SWEEPS {
        let mut turned = false;
        for p in 0..count {
            for q in p + 1..count {
                if a[p][q] * a[p][q] <= 1e-32 * (a[p][p] * a[q][q]).abs() || a[p][q] == 0.0 {
                    continue;
                }
                turned = true;
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + sqrt(theta * theta + 1.0));
                let c = 1.0 / sqrt(t * t + 1.0);
                let s = t * c;
                for row in &mut a[..count] {
                    let (x, y) = (row[p], row[q]);
                    (row[p], row[q]) = (c * x - s * y, s * x + c * y);
                }
                let (mut rows_p, mut rows_q) = (a[p], a[q]);
                for (x, y) in rows_p[..count].iter_mut().zip(&mut rows_q[..count]) {
                    (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
                }
                (a[p], a[q]) = (rows_p, rows_q);
                for row in &mut v[..count] {
                    let (x, y) = (row[p], row[q]);
                    (row[p], row[q]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
        if !turned {
            break;
        }
    }
    let mut values = [0.0; JOINTS_MAX];
    (0..count).for_each(|i| values[i] = a[i][i]);
    (values, v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eigenvectors_make_up_their_matrix(count in 1..=JOINTS_MAX, rows in prop::collection::vec(prop::array::uniform16(-1.0..1.0_f64), 6)) {
            let mut a = [[0.0; JOINTS_MAX]; JOINTS_MAX];
            for (i, k) in (0..count).flat_map(|i| (0..count).map(move |k| (i, k))) {
                a[i][k] = rows.iter().map(|row| row[i] * row[k]).sum();
            }
            let (values, v) = eigen(count, &a);
            for (i, k) in (0..count).flat_map(|i| (0..count).map(move |k| (i, k))) {
                let made: f64 = (0..count).map(|j| v[i][j] * values[j] * v[k][j]).sum();
                prop_assert!((made - a[i][k]).abs() < 1e-12, "{i} {k}: {made} for {}", a[i][k]);
            }
        }
    }
}
