//! The test: errors on rows that nothing has used, effect by effect; and the uncertainty of each parameter.
//!
//! Uncertainties come from blocks of time (`blocks`), so that autocorrelated noise does not make them too small; an interval is never narrower than scale factors and
//! the form of the law allow. Test rows are used for nothing else.

use nalgebra::{DMatrix, DVector};

use super::blocks::covariance_of;
use super::case::Case;
use super::columns::Column;
use super::memory;
use super::noise;
use super::refine;
use super::selection::{Search, Selection, others};
use super::table::{Products, Solved, Table};
use crate::size::Size;

/// A number is at least so many times its uncertainty.
pub(super) const SURE: f64 = 2.0;
/// What the squares of one to four numbers together, in units of their uncertainty, exceed by chance as seldom as one alone exceeds the square of [`SURE`].
const TOGETHER: [f64; 4] = [SURE * SURE, 6.18, 8.02, 9.72];
/// Of what a law would bring on rows unseen if it were true, it brings at least this share.
const BORNE_OUT: f64 = 0.2;
/// Where within a step between rows a motion reverses is not known better than to this share, and friction turns there.
pub(super) const WITHIN_A_STEP: f64 = 0.01;

/// Root mean square of what is left on `used` rows, whitened by each joint's noise and in units of their geometric mean, N m.
pub(super) fn rms(case: &Case, solved: &Solved, used: &[bool]) -> f64 {
    rms_of(&case.table, &case.library.columns, solved, used, &case.table.moves)
}

/// The same without the rows of zones, of which no name claims anything.
pub(super) fn rms_outside(case: &Case, solved: &Solved, used: &[bool]) -> f64 {
    rms_of(&case.table, &case.library.columns, solved, used, &case.table.counts)
}

/// The same of any table, on rows that `counts` takes.
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
        let left = noise::residual(table, columns, solved, joint);
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

/// Root mean square of what is new in what is left, in units of the noise: what a law that is quick beside the noise's memory changes.
pub(super) fn news(case: &Case, solved: &Solved, used: &[bool]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for joint in case.table.joints() {
        let left = case.table.whitened(joint, &case.residual(solved, joint));
        let counts = &case.table.counts[joint];
        for row in (0..left.len()).filter(|row| used[*row] && counts[*row]) {
            sum += left[row] * left[row];
            count += 1.0;
        }
    }
    libm::sqrt(sum / f64::max(count, 1.0))
}

/// The sum of squares of one joint's values over rows that count.
pub(crate) fn sum(table: &Table, joint: usize, values: &[f64], used: &[bool]) -> f64 {
    let rows = (0..values.len()).filter(|row| used[*row] && table.counts[joint][*row]);
    rows.map(|row| values[row] * values[row]).sum()
}

/// Whether rows that took no part bring at least a share of what they would if what changes a joint's torque so were true, as far as chance lets them.
pub(super) fn is_borne_out(
    table: &Table,
    joint: usize,
    left: [&Vec<f64>; 2],
    used: &[bool],
) -> bool {
    let told: Vec<f64> =
        left[0].iter().zip(left[1]).map(|(before, after)| before - after).collect();
    let [before, after, told] = [left[0], left[1], &told]
        .map(|values| sum(table, joint, &table.whitened(joint, values), used));
    let [gain, wanted] = [0.5 * (before - after), 0.5 * told];
    gain > BORNE_OUT * wanted - libm::sqrt(wanted)
}

/// Root mean square of one joint on `used` rows, N m or N.
pub(super) fn of_joint(case: &Case, solved: &Solved, joint: usize, used: &[bool]) -> f64 {
    let left = case.residual(solved, joint);
    let kept = left.iter().zip(used).filter(|(_, used)| **used).map(|(x, _)| x * x);
    let (sum, count) = kept.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    if count > 0.0 { libm::sqrt(sum / count) } else { 0.0 }
}

/// How many times its uncertainty, by blocks of time, a column's number is among these names.
pub(super) fn sure(
    case: &Case,
    search: &Search<'_>,
    names: &[usize],
    column: usize,
    seen: &[bool],
) -> f64 {
    let solved = search.solve(names).solved;
    let covariance = covariance(case, &solved, seen);
    let at = solved.columns.iter().position(|k| *k == column);
    at.map_or(0.0, |at| solved.values[at].abs() / covariance[(at, at)].sqrt())
}

/// The names whose numbers are not nothing: those that chance would give go, the least sure first.
pub(super) fn told(
    case: &Case,
    search: &Search<'_>,
    names: Vec<usize>,
    seen: &[bool],
) -> Vec<usize> {
    let covariance = |solved: &Solved| covariance(case, solved, seen);
    told_by(search, names, &covariance, &|_| false)
}

/// The same by any covariance; `is_belief`: names that are not asked.
pub(crate) fn told_by(
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

/// The names that held-out rows do not speak against, and those that make the error larger there. Nothing is chosen in their place.
pub(super) fn borne_out(
    case: &Case,
    search: &Search<'_>,
    names: Vec<usize>,
    held: &[bool],
) -> (Vec<usize>, Vec<usize>) {
    // Within zones no law that is known holds: they have half a say, and what is plain outside stands against them.
    let left =
        |solved: &Solved| libm::sqrt(rms(case, solved, held) * rms_outside(case, solved, held));
    borne_out_by(search, names, &left, &|name| case.is_belief(name, search.always))
}

/// The same by any measure of what is left; `is_belief`: names that are not asked.
pub(crate) fn borne_out_by(
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

/// Names in the order of what each brings on held-out rows, with the error before and after each, one after the other: first the one that brings most by
/// itself, which another may stand in for; then by what each brings beside all others.
pub(super) fn order(
    case: &Case,
    search: &Search<'_>,
    selection: &Selection,
    held: &[bool],
) -> Vec<Listed> {
    order_by(search, selection, &|solved| rms(case, solved, held))
}

/// The same by any measure of what is left.
pub(crate) fn order_by(
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

/// The covariance of the numbers of a selection, by blocks of time; at least what white noise would leave. A delay is no surer than a share of a step.
pub(super) fn covariance(case: &Case, solved: &Solved, used: &[bool]) -> DMatrix<f64> {
    let mut all = covariance_of(&case.table, &case.library.columns, solved, used);
    let step_s = case.motion.runs.iter().map(|run| run.step_s).fold(0.0, f64::max);
    let delays = case.library.families.iter().filter(|family| family.kind == "torque_delay");
    for column in delays.flat_map(|family| &family.columns) {
        if let Some(at) = solved.columns.iter().position(|k| k == column) {
            all[(at, at)] += (WITHIN_A_STEP * step_s) * (WITHIN_A_STEP * step_s);
        }
    }
    all
}

/// The same with what searched numbers and the bend of warmth leave open, and how sure searched numbers are: per name, the standard uncertainty as a
/// share of the number. `viscous`: a joint's friction, stated and found.
pub(super) fn sureness(
    case: &Case,
    selection: &Selection,
    used: &[bool],
    viscous: &dyn Fn(usize) -> f64,
) -> (DMatrix<f64>, Vec<(usize, f64)>) {
    let (solved, columns) = (&selection.solved, &case.library.columns);
    let own = |column: &usize| is_told(case, selection, *column);
    let places: Vec<usize> =
        (0..solved.columns.len()).filter(|k| own(&solved.columns[*k])).collect();
    let covariance = covariance(case, solved, used);
    let covariance = memory::at_least(covariance, (&case.table, columns), solved, &places, used);
    let slopes: Vec<(usize, Column)> = selection
        .names
        .iter()
        .filter_map(|name| Some((*name, refine::slope(case, *name, &selection.solved)?)))
        .collect();
    let bent = refine::bent(case, selection, viscous);
    if slopes.is_empty() && bent.is_empty() {
        return (covariance, Vec::new());
    }
    let own = selection.solved.columns.iter().map(|column| {
        let bent = bent.iter().find(|(place, _)| place == column);
        bent.map_or(&case.library.columns[*column], |(_, bent)| bent)
    });
    let columns: Vec<&Column> = own.chain(slopes.iter().map(|(_, slope)| slope)).collect();
    let mut prior: Vec<f64> =
        selection.solved.columns.iter().map(|column| case.library.prior[*column]).collect();
    prior.resize(columns.len(), 0.0);
    let all: Vec<usize> = (0..columns.len()).collect();
    // The fit as a straight one about where it stands: what is left is left.
    let mut table = case.table.clone();
    for joint in case.table.joints() {
        table.target[joint] = Some(case.residual(&selection.solved, joint));
    }
    let mut solved = Products::new(&table, &columns, prior, used).solve(&all);
    solved.values.fill(0.0);
    let columns: Vec<Column> = columns.into_iter().cloned().collect();
    let whole = covariance_of(&table, &columns, &solved, used);
    let told = places.into_iter().chain(selection.solved.columns.len()..columns.len());
    let told = told.filter_map(|column| solved.columns.iter().position(|k| *k == column));
    let whole =
        memory::at_least(whole, (&table, &columns), &solved, &told.collect::<Vec<usize>>(), used);
    let at = |column: usize| solved.columns.iter().position(|k| *k == column);
    let count = selection.solved.columns.len();
    let all = DMatrix::from_fn(count, count, |i, j| match (at(i), at(j)) {
        // Freedom more leaves nothing surer.
        (Some(a), Some(b)) if i == j => whole[(a, b)].max(covariance[(i, j)]),
        (Some(a), Some(b)) => whole[(a, b)],
        _ => covariance[(i, j)],
    });
    let spread = |k: usize| at(count + k).map_or(1.0, |at| libm::sqrt(whole[(at, at)]));
    (all, slopes.iter().enumerate().map(|(k, (name, _))| (*name, spread(k))).collect())
}

/// Whether a column's number is told: a name's or the model's own.
fn is_told(case: &Case, selection: &Selection, column: usize) -> bool {
    let families = &case.library.families;
    selection.names.iter().any(|name| families[*name].columns.contains(&column))
        || case.known.iter().any(|known| known.0 == column)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_nothing_each_may_be_something_together() {
        let values = DVector::from_vec(vec![1.5, -1.5]);
        let alone = DMatrix::identity(2, 2);
        assert!(sureness_of(&values, alone) < 1.0);
        // Each is as unsure as before, but their difference is well known.
        let tied = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        assert!(sureness_of(&values, tied) > 5.0);
        // One that is plain is not lost among those that are nothing.
        let values = DVector::from_vec(vec![4.0, 0.1, -0.2]);
        assert!(sureness_of(&values, DMatrix::identity(3, 3)) > 1.0);
        assert!(sureness_of(&DVector::from_vec(vec![1.9]), DMatrix::identity(1, 1)) < 1.0);
        assert!(sureness_of(&DVector::from_vec(vec![2.1]), DMatrix::identity(1, 1)) > 1.0);
    }
}
