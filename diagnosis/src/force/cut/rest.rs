//! Structure that no effect of cutter or sensor explains, and its covariates.
//!
//! Promises: claimed only if confirmed by rows that were not used for its selection. Never: a formula.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use super::case::{Belief, Case, DRIFTS};
use super::laws::{self, Law};
use crate::engine::validation::sum;

/// Turns from which on it is asked whether the force wanders from turn to turn.
const TURNS: f64 = 30.0;
/// It does where it is so many times what the noise makes of it, and so many standard deviations beyond.
const WANDERS: f64 = 1.6;
const CHANCE: f64 = 8.0;

/// Drifts of an axis are more than an amplifier's where their squares, in units of what is believed of them, sum to so many standard deviations, and so much, beyond their count.
const CREEPS: [f64; 2] = [4.0, 6.0];

/// What the rest follows.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// From 0: x, y, z.
    pub axis: usize,
    /// The contract's words.
    pub words: Vec<String>,
    /// Root mean square of what is left on held-out rows of the axis without and with it, N.
    pub held: [f64; 2],
    /// The tone that it is, Hz, where it is one.
    pub tone_hz: Option<f64>,
    /// What it carries of the energy of what is left on rows held out, in units of what is new in the noise.
    pub(super) carries: f64,
}

/// What explains most of what is left beside some columns of the library: a law, or a force that wanders beside that law.
pub(super) fn rest(case: &Case, beside: &[usize]) -> Option<Rest> {
    let law = laws::law(case, beside, &case.belief);
    let (law, left) = match law {
        Some(Law { rest, left, .. }) => (Some(rest), left),
        None => (None, case.left(&case.belief)),
    };
    let carried = law.as_ref().map_or(0.0, |one| one.carries);
    wandering(case, &case.belief, &left).filter(|one| one.carries > carried).or(law)
}

/// An amplifier that drifts much further than amplifiers do: a sensor that creeps after a segment began.
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

/// A force that is larger in one turn and smaller in another, beyond what the noise makes of it, and follows no word but time: an edge that builds up, a tool that swings.
fn wandering(case: &Case, belief: &Belief, left: &[Vec<f64>; 3]) -> Option<Rest> {
    let air = case.law.reader(&belief.numbers).in_air();
    let turn = |row: usize| {
        let stood = &case.law.rows[row];
        (stood.segment, (belief.spindle.angle(stood) / TAU).floor() as i64)
    };
    let mut force = case.readings(belief);
    force.iter_mut().zip(air).for_each(|(axis, air)| axis.iter_mut().for_each(|x| *x -= air));
    // Per turn: products of what is left with the force, and of the force with itself.
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
    // What is so in all of a segment wanders nowhere.
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
