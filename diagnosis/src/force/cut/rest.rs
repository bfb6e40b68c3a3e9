//! Structure that no effect of cutter or sensor explains, and its covariates. Claimed only if rows that were not used for its selection support it.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use super::case::{Belief, Case, DRIFTS};
use super::laws::{self, Law};
use crate::engine::validation::sum;

/// Minimum number of revolutions for a test of variation between revolutions.
const TURNS: f64 = 30.0;
/// Minimum ratio of χ² to its degrees of freedom, and minimum excess in standard deviations of it, for significant variation.
const WANDERS: f64 = 1.6;
const CHANCE: f64 = 8.0;

/// A drift exceeds that of an amplifier if χ² of the drifts relative to their prior exceeds its degrees of freedom by this many standard deviations
/// plus a constant.
const CREEPS: [f64; 2] = [4.0, 6.0];

/// A dependence of the residual on covariates.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// Axis: 0 x, 1 y, 2 z.
    pub axis: usize,
    /// Names of the covariates, as in docs/reference/results.md.
    pub words: Vec<String>,
    /// RMS residual of the axis on test rows without and with it, N.
    pub held: [f64; 2],
    /// Frequency, Hz, if it is a spectral line.
    pub tone_hz: Option<f64>,
    /// Reduction of the residual energy on test rows, in units of the innovation variance.
    pub(super) carries: f64,
}

/// The strongest unmodelled structure beside some columns of the library: a smooth law, or variation between revolutions in addition to it.
pub(super) fn rest(case: &Case, beside: &[usize]) -> Option<Rest> {
    let law = laws::law(case, beside, &case.belief);
    let (law, left) = match law {
        Some(Law { rest, left, .. }) => (Some(rest), left),
        None => (None, case.left(&case.belief)),
    };
    let carried = law.as_ref().map_or(0.0, |one| one.carries);
    wandering(case, &case.belief, &left).filter(|one| one.carries > carried).or(law)
}

/// An unusually large drift of an axis over segments, such as a creeping sensor.
pub(super) fn creeping(case: &Case, belief: &Belief) -> Option<Rest> {
    let segments = belief.spindle.phases.len();
    let free = segments as f64;
    let least = free + CREEPS[0] * libm::sqrt(2.0 * free) + CREEPS[1];
    let far = |axis: usize| {
        let sigma = DRIFTS * case.table.noise[axis].1;
        let each = (0..segments).map(|segment| belief.drift[3 * segment + axis] / sigma);
        each.map(|x| x * x).sum::<f64>()
    };
    let furthest = case.table.joints().map(|axis| (axis, far(axis)));
    let (axis, _) = furthest.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, far)| *far > least)?;
    let left = case.left(belief);
    let mut still = belief.clone();
    still.drift.fill(0.0);
    let without = case.left(&still);
    let rows = sum(&case.table, axis, &vec![1.0; left[axis].len()], &case.sets.test).max(1.0);
    let rms = |all: &[f64]| libm::sqrt(sum(&case.table, axis, all, &case.sets.test) / rows);
    let held = [rms(&without[axis]), rms(&left[axis])];
    Some(Rest { axis, words: vec!["t_s".to_owned()], held, tone_hz: None, carries: 0.0 })
}

/// Significant variation of the force from revolution to revolution that follows no covariate but time, such as a built-up edge or a vibrating tool.
fn wandering(case: &Case, belief: &Belief, left: &[Vec<f64>; 3]) -> Option<Rest> {
    let air = case.law.reader(&belief.numbers).in_air();
    let turn = |row: usize| {
        let stood = &case.law.rows[row];
        (stood.segment, (belief.spindle.angle(stood) / TAU).floor() as i64)
    };
    let mut force = case.readings(belief);
    force.iter_mut().zip(air).for_each(|(axis, air)| axis.iter_mut().for_each(|x| *x -= air));
    // Per revolution: sum of products of residual and force, and of the force with itself.
    let mut turns: BTreeMap<(usize, i64), [f64; 2]> = BTreeMap::new();
    for axis in case.table.joints() {
        let [left, force] = [left, &force].map(|all| case.table.whitened(axis, &all[axis]));
        let counts = &case.table.counts[axis];
        for row in (0..left.len()).filter(|row| counts[*row] && case.law.rows[*row].cuts) {
            let sums = turns.entry(turn(row)).or_default();
            sums[0] += left[row] * force[row];
            sums[1] += force[row] * force[row];
        }
    }
    turns.retain(|_, [_, square]| *square > 0.0);
    // Subtracts the mean of each segment, which is not a variation.
    let mut usual = vec![[0.0; 2]; case.belief.spindle.phases.len()];
    for ((segment, _), [both, square]) in &turns {
        usual[*segment][0] += both;
        usual[*segment][1] += square;
    }
    for ((segment, _), [both, square]) in &mut turns {
        *both -= *square * usual[*segment][0] / usual[*segment][1];
    }
    let free = turns.len() as f64;
    let chi: f64 = turns.values().map(|[both, square]| both * both / square).sum();
    if free < TURNS || chi < WANDERS * free || chi < free + CHANCE * libm::sqrt(2.0 * free) {
        return None;
    }
    let share = |row: usize| turns.get(&turn(row)).map_or(0.0, |[both, square]| both / square);
    let held = &case.sets.test;
    let of_axis = |axis: usize| {
        let counts = &case.table.counts[axis];
        let rows = (0..held.len()).filter(|row| held[*row] && counts[*row]);
        let sums = rows.fold([0.0; 3], |[without, with, count], row| {
            let rest = left[axis][row] - share(row) * force[axis][row];
            [without + left[axis][row] * left[axis][row], with + rest * rest, count + 1.0]
        });
        (axis, [sums[0], sums[1]].map(|sum| libm::sqrt(sum / f64::max(sums[2], 1.0))))
    };
    let (axis, held_rms) = case
        .table
        .joints()
        .map(of_axis)
        .max_by(|a, b| (a.1[0] / a.1[1]).total_cmp(&(b.1[0] / b.1[1])))?;
    let kept = held.iter().filter(|held| **held).count() as f64 / held.len().max(1) as f64;
    let words = vec!["t_s".to_owned()];
    Some(Rest { axis, words, held: held_rms, tone_hz: None, carries: kept * (chi - free) })
}
