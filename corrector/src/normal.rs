//! Normal equations of at most six rows, factored once and solved for many right-hand sides (Cholesky without roots).
//!
//! Promises: what is not positive definite has no factor. Never: a heap, an index from outside.

/// Rows of a task.
pub(crate) const ROWS: usize = 6;

/// The factors of `N = L D Lᵀ`, L with ones on its diagonal; of D the inverse. No root is taken.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Factor {
    lower: [[f64; ROWS]; ROWS],
    inverse: [f64; ROWS],
}

impl Factor {
    /// Of a symmetric matrix, of which the lower half is looked at; none where it is not positive definite.
    #[inline(always)]
    pub(crate) fn of<const N: usize>(normal: &[[f64; N]; ROWS]) -> Option<Self> {
        let mut factor = Self { lower: [[0.0; ROWS]; ROWS], inverse: [0.0; ROWS] };
        let Self { lower, inverse } = &mut factor;
        for i in 0..ROWS {
            // A row of `L D`.
            let mut row = [0.0; ROWS];
            for k in 0..i {
                let known: f64 = (0..k).map(|j| row[j] * lower[k][j]).sum();
                row[k] = normal[i][k] - known;
                lower[i][k] = row[k] * inverse[k];
            }
            let known: f64 = (0..i).map(|j| row[j] * lower[i][j]).sum();
            let left = normal[i][i] - known;
            // Not a number is not positive either.
            if !(left > 0.0 && left < f64::INFINITY) {
                return None;
            }
            inverse[i] = 1.0 / left;
        }
        Some(factor)
    }

    /// `N⁻¹ b`.
    #[inline(always)]
    pub(crate) fn solve(&self, b: &[f64; ROWS]) -> [f64; ROWS] {
        let Self { lower, inverse } = self;
        let mut x = *b;
        for i in 1..ROWS {
            x[i] -= (0..i).map(|k| lower[i][k] * x[k]).sum::<f64>();
        }
        x.iter_mut().zip(inverse).for_each(|(x, inverse)| *x *= inverse);
        for i in (0..ROWS - 1).rev() {
            x[i] -= (i + 1..ROWS).map(|k| lower[k][i] * x[k]).sum::<f64>();
        }
        x
    }

    /// The sum of the diagonal of `N⁻¹`: the square of the norm of the inverse of what N is the square of.
    pub(crate) fn trace_of_inverse(&self) -> f64 {
        let Self { lower, inverse } = self;
        let mut trace = 0.0;
        for j in 0..ROWS {
            // A column of `L⁻¹`.
            let mut column = [0.0; ROWS];
            column[j] = 1.0;
            trace += inverse[j];
            for i in j + 1..ROWS {
                column[i] = -(j..i).map(|k| lower[i][k] * column[k]).sum::<f64>();
                trace += column[i] * column[i] * inverse[i];
            }
        }
        trace
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_solved_gives_the_right_hand_side_back(
            rows in prop::array::uniform6(prop::array::uniform6(-1.0..1.0_f64)),
            b in prop::array::uniform6(-1.0..1.0_f64),
        ) {
            let normal: [[f64; ROWS]; ROWS] = std::array::from_fn(|i| std::array::from_fn(|k| {
                let product: f64 = (0..ROWS).map(|j| rows[i][j] * rows[k][j]).sum();
                product + if i == k { 0.1 } else { 0.0 }
            }));
            let factor = Factor::of(&normal).expect("positive definite");
            let column = |i| factor.solve(&std::array::from_fn(|k| f64::from(u8::from(i == k))));
            let trace: f64 = (0..ROWS).map(|i| column(i)[i]).sum();
            prop_assert!((factor.trace_of_inverse() / trace - 1.0).abs() < 1e-9);
            let x = factor.solve(&b);
            for i in 0..ROWS {
                let back: f64 = (0..ROWS).map(|k| normal[i][k] * x[k]).sum();
                prop_assert!((back - b[i]).abs() < 1e-11, "{back} {}", b[i]);
            }
        }
    }

    #[test]
    fn what_is_singular_or_no_number_has_no_factor() {
        assert!(Factor::of(&[[1.0; ROWS]; ROWS]).is_none());
        assert!(Factor::of(&[[f64::NAN; ROWS]; ROWS]).is_none());
    }
}
