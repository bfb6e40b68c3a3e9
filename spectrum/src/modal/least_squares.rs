//! Complex linear least squares with covariance.
//!
//! By orthogonalisation of the columns (modified Gram-Schmidt, twice), which avoids the loss of
//! digits of the normal equations.

use realfft::num_complex::Complex;

/// Relative length below which a column is linearly dependent after orthogonalisation.
const DEPENDENCE_TOLERANCE: f64 = 1e-11;

/// The solution, and its variance for noise of unit variance per (complex) row.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub(super) unknowns: Vec<Complex<f64>>,
    /// Variance of each unknown for noise of unit variance on each row.
    pub(super) variance: Vec<f64>,
}

/// Solves `Σ columns[k] x[k] = right`; `None` if the columns are linearly dependent or contain NaN.
pub(super) fn solve(columns: &[Vec<Complex<f64>>], right: &[Complex<f64>]) -> Option<Solution> {
    let n = columns.len();
    let mut q: Vec<Vec<Complex<f64>>> = Vec::with_capacity(n);
    let mut r = vec![vec![Complex::<f64>::default(); n]; n];
    let mut residual = right.to_vec();
    let mut projected = vec![Complex::<f64>::default(); n];
    for (k, column) in columns.iter().enumerate() {
        let mut direction = column.clone();
        let length = norm(&direction);
        for _ in 0..2 {
            for (j, other) in q.iter().enumerate() {
                let part = dot(other, &direction);
                r[j][k] += part;
                subtract(&mut direction, part, other);
            }
        }
        let length_left = norm(&direction);
        if !(length_left > DEPENDENCE_TOLERANCE * length && length_left.is_finite()) {
            return None;
        }
        direction.iter_mut().for_each(|x| *x /= length_left);
        r[k][k] = length_left.into();
        projected[k] = dot(&direction, &residual);
        subtract(&mut residual, projected[k], &direction);
        q.push(direction);
    }
    let unknowns = back_substitute(&r, &projected);
    let mut variance = vec![0.0; n];
    for j in 0..n {
        let mut unit = vec![Complex::default(); n];
        unit[j] = Complex::new(1.0, 0.0);
        let column = back_substitute(&r, &unit);
        variance.iter_mut().zip(&column).for_each(|(sum, x)| *sum += x.norm_sqr());
    }
    unknowns.iter().all(|x| x.is_finite()).then_some(Solution { unknowns, variance })
}

fn back_substitute(r: &[Vec<Complex<f64>>], right: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let mut x = right.to_vec();
    for k in (0..x.len()).rev() {
        let known: Complex<f64> = (k + 1..x.len()).map(|j| r[k][j] * x[j]).sum();
        x[k] = (x[k] - known) / r[k][k];
    }
    x
}

fn dot(a: &[Complex<f64>], b: &[Complex<f64>]) -> Complex<f64> {
    a.iter().zip(b).map(|(a, b)| a.conj() * b).sum()
}

fn norm(a: &[Complex<f64>]) -> f64 {
    a.iter().map(Complex::norm_sqr).sum::<f64>().sqrt()
}

fn subtract(from: &mut [Complex<f64>], part: Complex<f64>, what: &[Complex<f64>]) {
    from.iter_mut().zip(what).for_each(|(x, y)| *x -= part * y);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_unknowns_come_back_and_dependent_columns_are_refused() {
        let z = |re: f64, im: f64| Complex::new(re, im);
        let columns: Vec<Vec<_>> = (0..3)
            .map(|k| (0..9).map(|i| z(f64::from(i), f64::from(i * i - 3)).powu(k)).collect())
            .collect();
        let known = [z(1.0, 2.0), z(-3.0, 0.5), z(0.0, 1.0)];
        let right: Vec<_> =
            (0..9).map(|i| (0..3).map(|k| columns[k][i] * known[k]).sum()).collect();
        let solution = solve(&columns, &right).expect("independent columns");
        assert!(solution.unknowns.iter().zip(known).all(|(x, k)| (x - k).norm() < 1e-10));
        let twice = vec![columns[1].clone(), columns[1].iter().map(|x| x * z(0.0, 2.0)).collect()];
        assert!(solve(&twice, &right).is_none());
    }

    #[test]
    fn the_variance_of_a_mean_is_one_over_n() {
        let ones = vec![vec![Complex::new(1.0, 0.0); 25]];
        let solution = solve(&ones, &[Complex::new(3.0, 1.0); 25]).expect("a mean");
        assert!((solution.variance[0] - 1.0 / 25.0).abs() < 1e-12);
    }
}
