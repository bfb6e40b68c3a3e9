//! The test: errors on rows that nothing has used, effect by effect; and the uncertainty of each parameter.
//!
//! Uncertainties come from blocks of time (`blocks`), so that autocorrelated noise does not make them too small; an interval is never narrower than scale factors and
//! the form of the law allow. Test rows are used for nothing else.

use nalgebra::DMatrix;

use super::case::Case;
use super::memory;
use super::refine;
use crate::engine::normal_equations::{Products, Solved};
use crate::engine::stepwise::{Search, Selection};
use crate::engine::table;
use crate::engine::table::Column;
use crate::engine::table::Table;
use crate::engine::validation::{rms_of, sum, supported};

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
    supported(search, names, &left, &|name| case.is_belief(name, search.always))
}

/// The covariance of the numbers of a selection, by blocks of time; at least what white noise would leave. A delay is no surer than a share of a step.
pub(super) fn covariance(case: &Case, solved: &Solved, used: &[bool]) -> DMatrix<f64> {
    let mut all = table::covariance(&case.table, &case.library.columns, solved, used);
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
    let whole = table::covariance(&table, &columns, &solved, used);
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
