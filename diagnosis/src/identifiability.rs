//! Parameters determined by the data, and the confounding of the others.
//!
//! Columns are taken in order, nearly dependent ones last. A column whose residual, after projection on the preceding ones, is less than [`DETERMINED_SIGMAS`]
//! standard deviations of the noise for the largest plausible change is not determined: it is confounded with those before it. This is a QR
//! factorisation pivoted by preference instead of by size (the last section of docs/reference/effects.md gives the parameter to which a shared
//! direction is assigned).
//!
//! Invariant: kept columns are independent; the others are listed with the columns they are confounded with, and their shares. Parameters that are
//! not determined stay at their prior.

use crate::qr::QrFactor;
use crate::simd::dot;

/// A parameter is determined if its largest plausible change, after projection on the preceding columns, is at least this many standard deviations of
/// the noise; below, its uncertainty would be too large to be useful.
pub(crate) const DETERMINED_SIGMAS: f64 = 10.0;
/// A column whose projected length is below this fraction of its full length is taken last. No unit, 0 to 1. Default 0.01: neighbouring axes that are
/// nominally parallel deviate by milliradians in the real robot, which makes gauge freedoms appear determined by that much.
const NEARLY_DEPENDENT: f64 = 0.01;
/// A column whose projected length is below this fraction of its full length is zero up to rounding.
const ROUNDING: f64 = 1e-9;
/// Confounded columns are listed down to this fraction of the largest share.
const PARTNER: f64 = 0.2;

/// A column that the data do not determine.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ConfoundedColumn {
    /// Index of the column.
    pub(crate) column: usize,
    /// Preceding columns with the same combined effect, largest share first, in units of the widths; empty if the column is zero.
    pub(crate) partners: Vec<(usize, f64)>,
}

/// Splits the columns of `triangle` (data, in units of the noise) into determined and other ones; `widths` is the largest plausible change of each.
pub(crate) fn split_identifiable(
    triangle: &QrFactor,
    widths: &[f64],
) -> (Vec<usize>, Vec<ConfoundedColumn>) {
    split_identifiable_keeping(triangle, widths, |_| false)
}

/// As [`split_identifiable`], with columns that are always kept.
pub(crate) fn split_identifiable_keeping(
    triangle: &QrFactor,
    widths: &[f64],
    is_kept: impl Fn(usize) -> bool,
) -> (Vec<usize>, Vec<ConfoundedColumn>) {
    let mut taken = ColumnSelection::of(triangle, widths);
    let mut nearly = Vec::new();
    for column in 0..triangle.width().min(widths.len()) {
        match taken.rest(column) {
            rest if is_kept(column)
                || rest.left >= DETERMINED_SIGMAS && rest.left > NEARLY_DEPENDENT * rest.length =>
            {
                taken.take(column, rest);
            }
            rest if rest.left >= DETERMINED_SIGMAS && rest.left > ROUNDING * rest.length => {
                nearly.push(column);
            }
            rest => taken.leave(column, rest),
        }
    }
    // Nearly dependent columns come last: taken in order, one would represent the direction of a later column that determines it well.
    for column in nearly {
        match taken.rest(column) {
            rest if rest.left >= DETERMINED_SIGMAS && rest.left > ROUNDING * rest.length => {
                taken.take(column, rest);
            }
            rest => taken.leave(column, rest),
        }
    }
    taken.sorted()
}

/// A column after projection on those that were taken before.
struct ProjectedColumn {
    column: Vec<f64>,
    /// Length after projection, and full length.
    left: f64,
    length: f64,
    /// Coefficients of the removed part in the basis.
    shares: Vec<f64>,
}

/// Taken and rejected columns.
struct ColumnSelection<'a> {
    triangle: &'a QrFactor,
    widths: &'a [f64],
    kept: Vec<usize>,
    others: Vec<ConfoundedColumn>,
    basis: Vec<Vec<f64>>,
    made_of: Vec<Vec<f64>>,
}

impl<'a> ColumnSelection<'a> {
    fn of(triangle: &'a QrFactor, widths: &'a [f64]) -> Self {
        let (kept, others, basis, made_of) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { triangle, widths, kept, others, basis, made_of }
    }

    fn rest(&self, column: usize) -> ProjectedColumn {
        let mut rest = vec![0.0; self.triangle.width()];
        rest[..=column].copy_from_slice(self.triangle.column(column));
        rest.iter_mut().for_each(|x| *x *= self.widths[column]);
        let length = dot(&rest, &rest).sqrt();
        let mut shares = vec![0.0; self.basis.len()];
        // Two passes suffice (Kahan and Parlett): the second removes the rounding errors of the first.
        for _ in 0..2 {
            for (share, unit) in shares.iter_mut().zip(&self.basis) {
                let along = dot(unit, &rest);
                rest.iter_mut().zip(unit).for_each(|(x, u)| *x -= along * u);
                *share += along;
            }
        }
        let left = dot(&rest, &rest).sqrt();
        ProjectedColumn { column: rest, left, length, shares }
    }

    fn take(&mut self, column: usize, mut rest: ProjectedColumn) {
        rest.column.iter_mut().for_each(|x| *x /= rest.left);
        self.basis.push(rest.column);
        rest.shares.push(rest.left);
        self.made_of.push(rest.shares);
        self.kept.push(column);
    }

    fn leave(&mut self, column: usize, rest: ProjectedColumn) {
        let shares = in_columns(&self.made_of, rest.shares);
        self.others.push(ConfoundedColumn { column, partners: strongest(&self.kept, &shares) });
    }

    /// Sorted by column index.
    fn sorted(mut self) -> (Vec<usize>, Vec<ConfoundedColumn>) {
        self.kept.sort_unstable();
        self.others.sort_by_key(|other| other.column);
        (self.kept, self.others)
    }
}

/// Converts coefficients of the basis to coefficients of the original columns.
fn in_columns(made_of: &[Vec<f64>], mut shares: Vec<f64>) -> Vec<f64> {
    for j in (0..shares.len()).rev() {
        let column = &made_of[j];
        shares[j] /= column[j];
        let share = shares[j];
        shares[..j].iter_mut().zip(column).for_each(|(s, c)| *s -= share * c);
    }
    shares
}

fn strongest(kept: &[usize], shares: &[f64]) -> Vec<(usize, f64)> {
    let mut partners: Vec<(usize, f64)> =
        kept.iter().copied().zip(shares.iter().copied()).collect();
    partners.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    let most = partners.first().map_or(0.0, |(_, share)| share.abs());
    partners.retain(|(_, share)| share.abs() > PARTNER * most && most > 1e-6);
    partners
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(rows: &[[f64; 4]]) -> QrFactor {
        let mut triangle = QrFactor::new(4);
        rows.iter().for_each(|row| triangle.push(row, 0.0));
        triangle.reduce();
        triangle
    }

    #[test]
    fn a_column_that_is_the_difference_of_two_others_is_named_with_both() {
        let rows: Vec<[f64; 4]> = (0..50)
            .map(|i| f64::from(i) * 0.37)
            .map(|t| [t.sin(), t.cos(), 2.0 * t.sin() - t.cos(), 1.0])
            .collect();
        let (kept, others) = split_identifiable(&triangle(&rows), &[10.0; 4]);
        assert_eq!(kept, [0, 1, 3]);
        assert_eq!(others.len(), 1);
        assert_eq!(others[0].column, 2);
        let shares: Vec<f64> = others[0].partners.iter().map(|p| p.1).collect();
        assert!((shares[0] - 2.0).abs() < 1e-9 && (shares[1] + 1.0).abs() < 1e-9, "{shares:?}");
    }

    #[test]
    fn a_column_that_is_nearly_another_does_not_take_the_place_of_one_that_shows_the_difference() {
        // Column 2 is column 1 plus a thousandth of column 3: taken in order, it would represent the direction of column 3 a thousand times more
        // weakly.
        let rows: Vec<[f64; 4]> = (0..50)
            .map(|i| f64::from(i) * 0.37)
            .map(|t| [t.sin(), t.sin() + 1e-3 * t.cos(), t.cos(), 0.0])
            .collect();
        let (kept, others) = split_identifiable(&triangle(&rows), &[1e4; 4]);
        assert_eq!(kept, [0, 2]);
        assert_eq!(others[0].column, 1);
        // If no other column contains that direction, it is taken.
        let alone: Vec<[f64; 4]> = rows.iter().map(|row| [row[0], row[1], 0.0, 0.0]).collect();
        assert_eq!(split_identifiable(&triangle(&alone), &[1e4; 4]).0, [0, 1]);
    }

    #[test]
    fn a_column_without_information_is_named_alone() {
        let rows: Vec<[f64; 4]> = (0..50).map(|i| [1.0, f64::from(i), 0.0, 1e-9]).collect();
        let (kept, others) = split_identifiable(&triangle(&rows), &[2.0; 4]);
        assert_eq!(kept, [0, 1]);
        assert_eq!(others[0], ConfoundedColumn { column: 2, partners: vec![] });
        assert_eq!(others[1].column, 3);
    }

    #[test]
    fn what_shows_less_than_the_noise_is_not_determined() {
        let rows: Vec<[f64; 4]> = (0..4).map(|i| [1.0, f64::from(i % 2), 0.0, 0.0]).collect();
        assert_eq!(split_identifiable(&triangle(&rows), &[3.0; 4]).0.len(), 0);
        assert_eq!(split_identifiable(&triangle(&rows), &[19.0, 19.0, 19.0, 19.0]).0, [0, 1]);
    }
}
