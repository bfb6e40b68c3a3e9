//! Structure that no effect of cutter or sensor explains, and its covariates. Claimed only if rows that were not used for its selection support it.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use super::case::{Case, DRIFT_PRIOR_RATIO, Estimates};
use super::varying_coefficients::{self, ConfirmedLaw};
use crate::engine::validation::sum_of_squares;

/// Minimum number of revolutions for a test of variation between revolutions.
const REVOLUTIONS_LEAST: f64 = 30.0;
/// Minimum ratio of χ² to its degrees of freedom, and minimum excess in standard deviations of it, for significant variation.
const CHI_SQUARE_RATIO_LEAST: f64 = 1.6;
const CHI_SQUARE_EXCESS_LEAST: f64 = 8.0;

/// A drift exceeds that of an amplifier if χ² of the drifts relative to their prior exceeds its degrees of freedom by this many standard deviations
/// plus a constant.
const DRIFT_EXCESS_LEAST: [f64; 2] = [4.0, 6.0];

/// A dependence of the residual on covariates.
#[derive(Clone, Debug, PartialEq)]
pub struct UnexplainedForce {
    /// Axis: 0 x, 1 y, 2 z.
    pub axis: usize,
    /// Names of the covariates, as in docs/reference/results.md.
    pub depends_on: Vec<String>,
    /// RMS residual of the axis on test rows without and with it, N.
    pub heldout: [f64; 2],
    /// Frequency, Hz, if it is a spectral line.
    pub tone_hz: Option<f64>,
    /// Reduction of the residual energy on test rows, in units of the innovation variance.
    pub(super) energy_explained: f64,
}

/// The strongest unmodelled structure in addition to the given library columns: a smooth law, or variation between revolutions in addition to it.
pub(super) fn strongest_structure(case: &Case, beside: &[usize]) -> Option<UnexplainedForce> {
    let law = varying_coefficients::best_confirmed_law(case, beside, &case.estimates);
    let (law, left) = match law {
        Some(ConfirmedLaw { structure, residual, .. }) => (Some(structure), residual),
        None => (None, case.residual(&case.estimates)),
    };
    let carried = law.as_ref().map_or(0.0, |one| one.energy_explained);
    variation_between_revolutions(case, &case.estimates, &left)
        .filter(|one| one.energy_explained > carried)
        .or(law)
}

/// An unusually large drift of an axis over segments, such as a creeping sensor.
pub(super) fn excessive_drift(case: &Case, estimates: &Estimates) -> Option<UnexplainedForce> {
    let segments = estimates.spindle.phases.len();
    let free = segments as f64;
    let excess_min = free + DRIFT_EXCESS_LEAST[0] * libm::sqrt(2.0 * free) + DRIFT_EXCESS_LEAST[1];
    let excess = |axis: usize| {
        let sigma = DRIFT_PRIOR_RATIO * case.table.noise[axis].1;
        let each = (0..segments).map(|segment| estimates.drift[3 * segment + axis] / sigma);
        each.map(|x| x * x).sum::<f64>()
    };
    let furthest = case.table.joints().map(|axis| (axis, excess(axis)));
    let (axis, _) =
        furthest.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, excess)| *excess > excess_min)?;
    let left = case.residual(estimates);
    let mut still = estimates.clone();
    still.drift.fill(0.0);
    let without = case.residual(&still);
    let rows = sum_of_squares(&case.table, axis, &vec![1.0; left[axis].len()], &case.row_sets.test)
        .max(1.0);
    let rms = |all: &[f64]| {
        libm::sqrt(sum_of_squares(&case.table, axis, all, &case.row_sets.test) / rows)
    };
    let heldout = [rms(&without[axis]), rms(&left[axis])];
    Some(UnexplainedForce {
        axis,
        depends_on: vec!["t_s".to_owned()],
        heldout,
        tone_hz: None,
        energy_explained: 0.0,
    })
}

/// Significant variation of the force from revolution to revolution that follows no covariate but time, such as a built-up edge or a vibrating tool.
fn variation_between_revolutions(
    case: &Case,
    estimates: &Estimates,
    left: &[Vec<f64>; 3],
) -> Option<UnexplainedForce> {
    let air = case.model.reading_model(&estimates.parameters).reading_in_air();
    let turn = |row: usize| {
        let state = &case.model.rows[row];
        (state.segment, (estimates.spindle.angle(state) / TAU).floor() as i64)
    };
    let mut force = case.readings(estimates);
    force.iter_mut().zip(air).for_each(|(axis, air)| axis.iter_mut().for_each(|x| *x -= air));
    // Per revolution: sum of products of residual and force, and of the force with itself.
    let mut turns: BTreeMap<(usize, i64), [f64; 2]> = BTreeMap::new();
    for axis in case.table.joints() {
        let [left, force] = [left, &force].map(|all| case.table.whitened(axis, &all[axis]));
        let counts = &case.table.counts[axis];
        for row in (0..left.len()).filter(|row| counts[*row] && case.model.rows[*row].is_cutting) {
            let sums = turns.entry(turn(row)).or_default();
            sums[0] += left[row] * force[row];
            sums[1] += force[row] * force[row];
        }
    }
    turns.retain(|_, [_, square]| *square > 0.0);
    // Subtracts the mean of each segment, which is not a variation.
    let mut usual = vec![[0.0; 2]; case.estimates.spindle.phases.len()];
    for ((segment, _), [both, square]) in &turns {
        usual[*segment][0] += both;
        usual[*segment][1] += square;
    }
    for ((segment, _), [both, square]) in &mut turns {
        *both -= *square * usual[*segment][0] / usual[*segment][1];
    }
    let free = turns.len() as f64;
    let chi: f64 = turns.values().map(|[both, square]| both * both / square).sum();
    if free < REVOLUTIONS_LEAST
        || chi < CHI_SQUARE_RATIO_LEAST * free
        || chi < free + CHI_SQUARE_EXCESS_LEAST * libm::sqrt(2.0 * free)
    {
        return None;
    }
    let share = |row: usize| turns.get(&turn(row)).map_or(0.0, |[both, square]| both / square);
    let held = &case.row_sets.test;
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
    let depends_on = vec!["t_s".to_owned()];
    Some(UnexplainedForce {
        axis,
        depends_on,
        heldout: held_rms,
        tone_hz: None,
        energy_explained: kept * (chi - free),
    })
}
