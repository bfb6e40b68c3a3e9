//! Inverts the normal equations of at most six rows, for many right-hand sides.
//!
//! Invariant: a matrix that is not positive definite has no inverse.

use physics::lanes::{Lanes, WIDTH};
use physics::{JOINTS_MAX, Joints};

/// Rows of a task.
pub(crate) const ROWS: usize = 6;

/// A matrix with a row per task coordinate and a column per joint.
pub(crate) type Matrix = [Joints; ROWS];

/// A symmetric matrix of that size in lanes; the two unused columns are zero.
pub(crate) type Normal<S> = [[<S as Lanes>::Four; 2]; ROWS];

/// The inverse of a matrix with `more` added to its diagonal; `None` if it is not positive
/// definite. Gauss-Jordan elimination in row order, two rows at a time, because each elimination
/// waits for the quotient of the previous one; all lanes at once.
#[inline(always)]
pub(crate) fn invert<S: Lanes>(
    lanes: S,
    mut rows: Normal<S>,
    more: &[f64; ROWS],
) -> Option<Normal<S>> {
    for (i, row) in rows.iter_mut().enumerate() {
        for (k, part) in row.iter_mut().enumerate() {
            *part = lanes.mul_add(lanes.part(&IDENTITY[i], k), lanes.splat(more[i]), *part);
        }
    }
    sweep::<S, 0, 1>(lanes, &mut rows)?;
    sweep::<S, 2, 3>(lanes, &mut rows)?;
    sweep::<S, 4, 5>(lanes, &mut rows)?;
    Some(rows)
}

/// Eliminates rows `K` and `L`, which are compile-time constants so that all rows stay in
/// registers; `None` if their block is not positive definite.
#[inline(always)]
fn sweep<S: Lanes, const K: usize, const L: usize>(lanes: S, rows: &mut Normal<S>) -> Option<()> {
    let (first, both) = (entry::<S, K>(lanes, &rows[K]), entry::<S, L>(lanes, &rows[K]));
    let second = entry::<S, L>(lanes, &rows[L]);
    let determinant = first * second - both * both;
    // Also false for NaN.
    if !(first > 0.0 && determinant > 0.0 && determinant < f64::INFINITY) {
        return None;
    }
    let inverse = lanes.splat(1.0 / determinant);
    let [first, both, second] = [first, both, second].map(|number| lanes.splat(number));
    // Columns of the inverse replace the eliminated columns: with a one on the diagonal in their
    // place, the operations on all other columns also produce them.
    let ones = [K, L].map(|i| [lanes.part(&IDENTITY[i], 0), lanes.part(&IDENTITY[i], 1)]);
    let (mut swept, mut swept_too) = (ones[0], ones[1]);
    for part in 0..2 {
        let k = lanes.add(rows[K][part], ones[0][part]);
        let l = lanes.add(rows[L][part], ones[1][part]);
        swept[part] = lanes.mul(inverse, lanes.neg_mul_add(both, l, lanes.mul(second, k)));
        swept_too[part] = lanes.mul(inverse, lanes.neg_mul_add(both, k, lanes.mul(first, l)));
    }
    for (i, row) in rows.iter_mut().enumerate() {
        let (of_k, of_l) =
            (lanes.splat(entry::<S, K>(lanes, row)), lanes.splat(entry::<S, L>(lanes, row)));
        for part in 0..2 {
            row[part] = if i == K {
                lanes.sub(swept[part], ones[0][part])
            } else if i == L {
                lanes.sub(swept_too[part], ones[1][part])
            } else {
                lanes.neg_mul_add(
                    swept_too[part],
                    of_l,
                    lanes.neg_mul_add(swept[part], of_k, row[part]),
                )
            };
        }
    }
    Some(())
}

#[inline(always)]
fn entry<S: Lanes, const K: usize>(lanes: S, row: &[S::Four; 2]) -> f64 {
    lanes.to_array(row[K / WIDTH])[K % WIDTH]
}

/// Rows of the unit matrix.
static IDENTITY: Matrix = {
    let mut rows = [[0.0; JOINTS_MAX]; ROWS];
    let mut i = 0;
    while i < ROWS {
        rows[i][i] = 1.0;
        i += 1;
    }
    rows
};

#[cfg(test)]
mod tests {
    use super::*;
    use physics::lanes::{Kernel, run_widest};
    use proptest::prelude::*;

    struct Invert<'a>(&'a Matrix, f64);

    impl Kernel for Invert<'_> {
        type Output = Option<Matrix>;

        fn run<S: Lanes>(self, lanes: S) -> Option<Matrix> {
            let rows = self.0.map(|row| [lanes.part(&row, 0), lanes.part(&row, 1)]);
            let mut found = [[0.0; JOINTS_MAX]; ROWS];
            for (row, found) in invert(lanes, rows, &[self.1; ROWS])?.iter().zip(&mut found) {
                row.iter().enumerate().for_each(|(k, part)| lanes.store(*part, found, k));
            }
            Some(found)
        }
    }

    fn inverse(normal: &Matrix, more: f64) -> Option<Matrix> {
        run_widest(ROWS, Invert(normal, more))
    }

    proptest! {
        #[test]
        fn an_inverse_times_its_matrix_is_the_unit_matrix(rows in prop::array::uniform6(prop::array::uniform6(-1.0..1.0_f64))) {
            let mut normal = Matrix::default();
            for (i, k) in (0..ROWS).flat_map(|i| (0..ROWS).map(move |k| (i, k))) {
                let product: f64 = (0..ROWS).map(|j| rows[i][j] * rows[k][j]).sum();
                normal[i][k] = product;
            }
            let found = inverse(&normal, 0.1).expect("positive definite");
            (0..ROWS).for_each(|i| normal[i][i] += 0.1);
            for (i, k) in (0..ROWS).flat_map(|i| (0..ROWS).map(move |k| (i, k))) {
                let unit: f64 = (0..ROWS).map(|j| normal[i][j] * found[j][k]).sum();
                let expected = f64::from(u8::from(i == k));
                prop_assert!((unit - expected).abs() < 1e-11, "{i} {k} {unit}");
                prop_assert!((found[i][k] - found[k][i]).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn what_is_singular_or_no_number_has_no_inverse() {
        assert!(inverse(&[[1.0; JOINTS_MAX]; ROWS], 0.0).is_none());
        assert!(inverse(&[[f64::NAN; JOINTS_MAX]; ROWS], 1.0).is_none());
    }
}
