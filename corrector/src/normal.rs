//! Normal equations of at most six rows, inverted for many right-hand sides.
//!
//! Promises: what is not positive definite has no inverse. Never: a heap, an index from outside.

use physics::lanes::{Lanes, WIDTH};
use physics::{JOINTS_MAX, Joints};

/// Rows of a task.
pub(crate) const ROWS: usize = 6;

/// As many rows, of a number for each joint.
pub(crate) type Matrix = [Joints; ROWS];

/// A symmetric matrix of that many rows in lanes; the two columns too many are zero.
pub(crate) type Normal<S> = [[<S as Lanes>::Four; 2]; ROWS];

/// The inverse of a matrix with `more` on its diagonal; none where it is not positive definite. Rows are swept out in their order (Gauss and Jordan), all lanes
/// at once: the pivots are those of a Cholesky factor.
#[inline(always)]
pub(crate) fn invert<S: Lanes>(
    lanes: S,
    mut rows: Normal<S>,
    more: &[f64; ROWS],
) -> Option<Normal<S>> {
    for (i, row) in rows.iter_mut().enumerate() {
        for (k, part) in row.iter_mut().enumerate() {
            *part = lanes.times_plus(lanes.part(&ONE[i], k), lanes.same(more[i]), *part);
        }
    }
    sweep::<S, 0>(lanes, &mut rows)?;
    sweep::<S, 1>(lanes, &mut rows)?;
    sweep::<S, 2>(lanes, &mut rows)?;
    sweep::<S, 3>(lanes, &mut rows)?;
    sweep::<S, 4>(lanes, &mut rows)?;
    sweep::<S, 5>(lanes, &mut rows)?;
    Some(rows)
}

/// Sweeps row `K` out, which is known to the compiler so that all rows stay in registers; none where its pivot is not positive.
#[inline(always)]
fn sweep<S: Lanes, const K: usize>(lanes: S, rows: &mut Normal<S>) -> Option<()> {
    let pivot = entry::<S, K>(lanes, &rows[K]);
    // Not a number is not positive either.
    if !(pivot > 0.0 && pivot < f64::INFINITY) {
        return None;
    }
    let inverse = lanes.same(1.0 / pivot);
    // The column that is swept out makes room for that of the inverse: with one more than the pivot in its place, what all other columns do does that too.
    let one = [lanes.part(&ONE[K], 0), lanes.part(&ONE[K], 1)];
    let (low, high) = (lanes.plus(rows[K][0], one[0]), lanes.plus(rows[K][1], one[1]));
    for (i, row) in rows.iter_mut().enumerate() {
        *row = if i == K {
            let swept = [lanes.times(low, inverse), lanes.times(high, inverse)];
            [lanes.minus(swept[0], one[0]), lanes.minus(swept[1], one[1])]
        } else {
            let factor = lanes.same(entry::<S, K>(lanes, row));
            let (low, high) = (lanes.times(low, factor), lanes.times(high, factor));
            [lanes.times_from(low, inverse, row[0]), lanes.times_from(high, inverse, row[1])]
        };
    }
    Some(())
}

#[inline(always)]
fn entry<S: Lanes, const K: usize>(lanes: S, row: &[S::Four; 2]) -> f64 {
    lanes.numbers(row[K / WIDTH])[K % WIDTH]
}

/// One where the column is the row's.
static ONE: Matrix = {
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
    use physics::lanes::{Work, widest};
    use proptest::prelude::*;

    struct Invert<'a>(&'a Matrix, f64);

    impl Work for Invert<'_> {
        type Output = Option<Matrix>;

        fn run<S: Lanes>(self, lanes: S) -> Option<Matrix> {
            let rows = self.0.map(|row| [lanes.part(&row, 0), lanes.part(&row, 1)]);
            let mut found = [[0.0; JOINTS_MAX]; ROWS];
            for (row, found) in invert(lanes, rows, &[self.1; ROWS])?.iter().zip(&mut found) {
                row.iter().enumerate().for_each(|(k, part)| lanes.put(*part, found, k));
            }
            Some(found)
        }
    }

    fn inverse(normal: &Matrix, more: f64) -> Option<Matrix> {
        widest(ROWS, Invert(normal, more))
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
