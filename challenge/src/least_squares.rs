//! Least squares by orthonormal columns: projection and residual. Columns that are linearly dependent on the others (to 1e-9 of their norm) are
//! dropped.

/// Orthonormal basis of columns added one by one (modified Gram-Schmidt with reorthogonalisation).
#[derive(Clone, Debug, Default)]
pub struct OrthonormalBasis {
    basis: Vec<Vec<f64>>,
    /// For each basis vector: index of its column in the order of [`OrthonormalBasis::add_column`], and its coefficients on the preceding basis vectors, followed by
    /// its norm.
    factors: Vec<(usize, Vec<f64>)>,
    added: usize,
}

/// Scalar product.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl OrthonormalBasis {
    /// Adds a column; returns whether it was linearly independent.
    pub fn add_column(&mut self, mut column: Vec<f64>) -> bool {
        let place = self.added;
        self.added += 1;
        let before = dot(&column, &column).sqrt();
        let mut coefficients = self.project_out(&mut column);
        let after = dot(&column, &column).sqrt();
        // A NaN column is dropped too.
        if after.is_nan() || after <= 1e-9 * before {
            return false;
        }
        column.iter_mut().for_each(|x| *x /= after);
        coefficients.push(after);
        self.basis.push(column);
        self.factors.push((place, coefficients));
        true
    }

    /// Subtracts from `vector` its projection on the columns; returns the coefficients of the basis.
    pub fn project_out(&self, vector: &mut [f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.basis.len()];
        for _ in 0..2 {
            for (unit, sum) in self.basis.iter().zip(&mut sums) {
                let share = dot(unit, vector);
                vector.iter_mut().zip(unit).for_each(|(x, u)| *x -= share * u);
                *sum += share;
            }
        }
        sums
    }

    /// Residual of a vector after projection.
    #[must_use]
    pub fn residual(&self, vector: &[f64]) -> Vec<f64> {
        let mut rest = vector.to_vec();
        self.project_out(&mut rest);
        rest
    }

    /// Least-squares coefficients of the columns in the order in which they were added; zero for dependent ones.
    #[must_use]
    pub fn solve(&self, vector: &[f64]) -> Vec<f64> {
        let mut work = vector.to_vec();
        let mut on_units = self.project_out(&mut work);
        let mut found = vec![0.0; self.added];
        for k in (0..self.basis.len()).rev() {
            let (place, made) = &self.factors[k];
            let value = on_units[k] / made[k];
            found[*place] = value;
            for (sum, share) in on_units.iter_mut().zip(made).take(k) {
                *sum -= value * share;
            }
        }
        found
    }

    /// Number of independent columns.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.basis.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_and_what_it_leaves_is_square_to_it() {
        let x: Vec<f64> = (0..20).map(f64::from).collect();
        let noise: Vec<f64> = (0..20).map(|k| if k % 2 == 0 { 0.1 } else { -0.1 }).collect();
        let y: Vec<f64> = x.iter().zip(&noise).map(|(x, e)| 3.0 - 0.5 * x + e).collect();
        let mut basis = OrthonormalBasis::default();
        assert!(basis.add_column(vec![1.0; 20]));
        assert!(basis.add_column(x.clone()));
        assert!(!basis.add_column(x.iter().map(|x| 2.0 * x - 7.0).collect()), "nothing new");
        let found = basis.solve(&y);
        // Closed-form normal equations of the straight line.
        let (sx, sxx) = (190.0, 2470.0);
        let (sy, sxy) = (y.iter().sum::<f64>(), dot(&x, &y));
        let slope = (20.0 * sxy - sx * sy) / (20.0 * sxx - sx * sx);
        assert!((found[1] - slope).abs() < 1e-12 && found[2] == 0.0);
        let rest = basis.residual(&y);
        assert!(dot(&rest, &x).abs() < 1e-10 && rest.iter().sum::<f64>().abs() < 1e-10);
    }
}
