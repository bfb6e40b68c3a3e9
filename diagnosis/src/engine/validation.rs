//! Validation and test of a selection: significance of parameters, support by rows that took no part, attribution of the error removed.
//!
//! Promises: rows apart can remove a candidate, never select one. Never: a domain's own measure, which callers give.

use nalgebra::{DMatrix, DVector};

use super::normal_equations::Solved;
use super::stepwise::{Search, Selection, others};
use super::table::{Column, Table, residual};
use crate::size::Size;

/// A number is at least so many times its uncertainty.
pub(crate) const SURE: f64 = 2.0;
/// Quantiles of the χ² distribution with one to four degrees of freedom, at the probability at which one squared normal deviate exceeds the square of [`SURE`].
const TOGETHER: [f64; 4] = [SURE * SURE, 6.18, 8.02, 9.72];
/// Root mean square of what is left on `used` rows that `counts` takes, whitened by each channel's noise and in units of their geometric mean.
pub(crate) fn rms_of(
    table: &Table,
    columns: &[Column],
    solved: &Solved,
    used: &[bool],
    counts: &[Vec<bool>],
) -> f64 {
    let (mut sum, mut count, mut scale, mut joints) = (0.0, 0.0, 0.0, 0.0);
    for joint in table.joints() {
        let noise = table.noise[joint].1;
        let left = residual(table, columns, solved, joint);
        for row in (0..left.len()).filter(|row| used[*row]) {
            if counts[joint][row] {
                sum += left[row] * left[row] / (noise * noise);
                count += 1.0;
            }
        }
        scale += noise.ln();
        joints += 1.0;
    }
    if count > 0.0 { libm::sqrt(sum / count) * libm::exp(scale / joints) } else { 0.0 }
}

/// The sum of squares of one joint's values over rows that count.
pub(crate) fn sum(table: &Table, joint: usize, values: &[f64], used: &[bool]) -> f64 {
    let rows = (0..values.len()).filter(|row| used[*row] && table.counts[joint][*row]);
    rows.map(|row| values[row] * values[row]).sum()
}

/// The names whose numbers are not nothing (Wald test): those that chance would give go, the least sure first. `is_belief`: names that are not asked.
pub(crate) fn significant(
    search: &Search<'_>,
    mut names: Vec<usize>,
    covariance: &dyn Fn(&Solved) -> DMatrix<f64>,
    is_belief: &dyn Fn(usize) -> bool,
) -> Vec<usize> {
    loop {
        let solved = search.solve(&names).solved;
        let covariance = covariance(&solved);
        let sure = |name: usize| {
            let columns = search.library.families[name].columns.iter();
            let places = columns.filter_map(|k| solved.columns.iter().position(|own| own == k));
            let places: Vec<usize> = places.collect();
            let count = places.len();
            let values = DVector::from_fn(count, |i, _| solved.values[places[i]]);
            let own = |i: usize, k: usize| covariance[(places[i], places[k])];
            sureness_of(&values, DMatrix::from_fn(count, count, own))
        };
        let asked = names.iter().filter(|name| !is_belief(**name));
        let least = asked.map(|name| (*name, sure(*name)));
        let least = least.min_by(|a, b| a.1.total_cmp(&b.1));
        match least {
            Some((name, sure)) if sure < 1.0 => names.retain(|n| *n != name),
            _ => return names,
        }
    }
}

/// How far from nothing these numbers are together (Wald), as a share of what chance seldom exceeds.
fn sureness_of(values: &DVector<f64>, covariance: DMatrix<f64>) -> f64 {
    let Some(more) = values.len().checked_sub(1) else { return 0.0 };
    let bar = TOGETHER[more.min(TOGETHER.len() - 1)];
    covariance.cholesky().map_or(f64::INFINITY, |factors| values.dot(&factors.solve(values)) / bar)
}

/// The names that rows apart do not speak against, by what `rms` says is left there, and those that make the error larger. Nothing is chosen in their place. `is_belief`: names
/// that are not asked.
pub(crate) fn supported(
    search: &Search<'_>,
    mut names: Vec<usize>,
    rms: &dyn Fn(&Solved) -> f64,
    is_belief: &dyn Fn(usize) -> bool,
) -> (Vec<usize>, Vec<usize>) {
    let of = |names: &[usize]| rms(&search.solve(names).solved);
    let mut refuted = Vec::new();
    loop {
        let whole = of(&names);
        let asked = names.iter().filter(|name| !is_belief(**name));
        // What a name leaves has to stand by itself: a rival that then takes the wrong sign is not that rival.
        let rest = asked.map(|name| (*name, others(&names, *name)));
        let stands = rest.filter(|(_, rest)| search.admissible(rest.clone()) == *rest);
        let harm = stands.map(|(name, rest)| (name, whole - of(&rest)));
        let worst = harm.max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((name, _)) = worst.filter(|(_, harm)| *harm > 0.0) else {
            return (names, refuted);
        };
        names = others(&names, name);
        refuted.push(name);
    }
}

/// What some columns of a fit do to the rows of the joints that they act on.
pub(crate) fn size_of(table: &Table, columns: &[Column], solved: &Solved, own: &[usize]) -> Size {
    let parts: Vec<(&Column, f64)> = (solved.columns.iter().zip(&solved.values))
        .filter(|(column, _)| own.contains(column))
        .map(|(column, value)| (&columns[*column], *value))
        .collect();
    let mut values = Vec::new();
    for joint in table.joints() {
        let moved: Vec<f64> = Column::sum(&parts, joint, table.rows()).into_iter().collect();
        if moved.iter().any(|value| *value != 0.0) {
            let rows = moved.iter().zip(&table.moves[joint]);
            values.extend(rows.filter(|(_, moves)| **moves).map(|(value, _)| *value));
        }
    }
    Size::of(values)
}

/// A name with what it brings on held-out rows, root mean squares.
pub(crate) struct Listed {
    pub(crate) name: usize,
    /// Without it and all that follow it in the list, and with it.
    pub(crate) heldout: [f64; 2],
    /// Where it alone is left out and all else is fitted anew.
    pub(crate) heldout_without: f64,
}

/// Names in the order of what each brings on the test set, with the error before and after each, one after the other: first the one that brings most by itself,
/// which another may stand in for; then by what each brings beside all others. All else is
/// fitted anew each time, so the energy is not quadratic and the Shapley value of positions ([`super::attribution`]) has no short form.
pub(crate) fn attributed(
    search: &Search<'_>,
    selection: &Selection,
    rms: &dyn Fn(&Solved) -> f64,
) -> Vec<Listed> {
    let without = |name: &usize| rms(&search.solve(&others(&selection.names, *name)).solved);
    let mut names: Vec<(usize, f64)> = selection.names.iter().map(|n| (*n, without(n))).collect();
    let alone = |name: &usize| rms(&search.solve(&[*name]).solved);
    let first = selection.names.iter().map(|name| (*name, alone(name)));
    let first = first.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(first, _)| first);
    names.sort_by(|(a, a_left), (b, b_left)| {
        let is_later = |name: &usize| Some(*name) != first;
        is_later(a).cmp(&is_later(b)).then(b_left.total_cmp(a_left)).then(a.cmp(b))
    });
    let mut before = rms(&search.solve(&[]).solved);
    let mut there: Vec<usize> = Vec::new();
    let mut listed = Vec::new();
    for (name, heldout_without) in names {
        there.push(name);
        let after = rms(&search.solve(&there).solved);
        listed.push(Listed { name, heldout: [before, after], heldout_without });
        before = after;
    }
    listed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_nothing_each_may_be_something_together() {
        let values = DVector::from_vec(vec![1.5, -1.5]);
        let alone = DMatrix::identity(2, 2);
        assert!(sureness_of(&values, alone) < 1.0);
        // The variance of each is unchanged, but their difference is well determined.
        let tied = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        assert!(sureness_of(&values, tied) > 5.0);
        // One that is plain is not lost among those that are nothing.
        let values = DVector::from_vec(vec![4.0, 0.1, -0.2]);
        assert!(sureness_of(&values, DMatrix::identity(3, 3)) > 1.0);
        assert!(sureness_of(&DVector::from_vec(vec![1.9]), DMatrix::identity(1, 1)) < 1.0);
        assert!(sureness_of(&DVector::from_vec(vec![2.1]), DMatrix::identity(1, 1)) > 1.0);
    }
}
