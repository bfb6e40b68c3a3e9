//! Which numbers the data determine, and with what the others move together.
//!
//! Columns are taken in order. One whose rest, after all columns taken before it, shows less than [`SHOWN`] noises for the largest change
//! that a sound robot may have is not determined: it moves together with those before it. This is a QR factorisation pivoted by
//! preference instead of by size (contract `effects.md`, last section, says whose a shared direction is).
//!
//! Promises: what is kept is independent; what is not kept is named with its partners and their shares.
//! Never: a guess: what is not determined stays where it is believed to be.

use crate::triangle::{Triangle, dot};

/// A number is determined when the largest sensible change of it shows at least as many noises as this: less would be a number with an
/// uncertainty that nobody can use.
const SHOWN: f64 = 10.0;
/// Below this share of its own length, what is left of a column is rounding.
const ROUNDING: f64 = 1e-9;
/// Partners are named down to this share of the strongest.
const PARTNER: f64 = 0.2;

/// A column that the data do not determine.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Dependent {
    /// Which column.
    pub(crate) column: usize,
    /// Columns taken before it that do the same together, strongest first, with their shares in units of the widths; none where the column does nothing.
    pub(crate) partners: Vec<(usize, f64)>,
}

/// The columns of `triangle` (data, in units of noise) that are determined, and the others; `widths` is the largest sensible change of each.
pub(crate) fn sort(triangle: &Triangle, widths: &[f64]) -> (Vec<usize>, Vec<Dependent>) {
    sort_beside(triangle, widths, |_| false)
}

/// As [`sort`], with columns that are kept whatever they show.
pub(crate) fn sort_beside(
    triangle: &Triangle,
    widths: &[f64],
    is_kept: impl Fn(usize) -> bool,
) -> (Vec<usize>, Vec<Dependent>) {
    let width = triangle.width();
    let (mut kept, mut others) = (Vec::new(), Vec::new());
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut made_of: Vec<Vec<f64>> = Vec::new();
    for (column, much) in widths.iter().enumerate().take(width) {
        let mut rest = vec![0.0; width];
        rest[..=column].copy_from_slice(triangle.column(column));
        rest.iter_mut().for_each(|x| *x *= much);
        let length = dot(&rest, &rest).sqrt();
        let mut shares = vec![0.0; basis.len()];
        // Twice is enough (Kahan and Parlett): the second pass removes what rounding left of the first.
        for _ in 0..2 {
            for (share, unit) in shares.iter_mut().zip(&basis) {
                let along = dot(unit, &rest);
                rest.iter_mut().zip(unit).for_each(|(x, u)| *x -= along * u);
                *share += along;
            }
        }
        let left = dot(&rest, &rest).sqrt();
        if is_kept(column) || left >= SHOWN && left > ROUNDING * length {
            rest.iter_mut().for_each(|x| *x /= left);
            basis.push(rest);
            shares.push(left);
            made_of.push(shares);
            kept.push(column);
        } else {
            let shares = in_columns(&made_of, shares);
            others.push(Dependent { column, partners: strongest(&kept, &shares) });
        }
    }
    (kept, others)
}

/// From shares in the basis to shares in the columns that it was made of.
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

    fn triangle(rows: &[[f64; 4]]) -> Triangle {
        let mut triangle = Triangle::new(4);
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
        let (kept, others) = sort(&triangle(&rows), &[10.0; 4]);
        assert_eq!(kept, [0, 1, 3]);
        assert_eq!(others.len(), 1);
        assert_eq!(others[0].column, 2);
        let shares: Vec<f64> = others[0].partners.iter().map(|p| p.1).collect();
        assert!((shares[0] - 2.0).abs() < 1e-9 && (shares[1] + 1.0).abs() < 1e-9, "{shares:?}");
    }

    #[test]
    fn a_column_without_information_is_named_alone() {
        let rows: Vec<[f64; 4]> = (0..50).map(|i| [1.0, f64::from(i), 0.0, 1e-9]).collect();
        let (kept, others) = sort(&triangle(&rows), &[2.0; 4]);
        assert_eq!(kept, [0, 1]);
        assert_eq!(others[0], Dependent { column: 2, partners: vec![] });
        assert_eq!(others[1].column, 3);
    }

    #[test]
    fn what_shows_less_than_the_noise_is_not_determined() {
        let rows: Vec<[f64; 4]> = (0..4).map(|i| [1.0, f64::from(i % 2), 0.0, 0.0]).collect();
        assert_eq!(sort(&triangle(&rows), &[3.0; 4]).0.len(), 0);
        assert_eq!(sort(&triangle(&rows), &[19.0, 19.0, 19.0, 19.0]).0, [0, 1]);
    }
}
