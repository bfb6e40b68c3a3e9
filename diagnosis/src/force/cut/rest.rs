//! Structure that no name of cutter or sensor explains, in the contract's words.
//!
//! Promises: a law is claimed where rows that took no part in its choice bear it out. Never: a formula.

use std::f64::consts::TAU;

use super::case::{Belief, Case};
use crate::torque::table::Solved;
use crate::torque::unknown::{Word, law_of};

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
    /// What it carries of the energy of what is left, N².
    pub(super) carries: f64,
}

/// The law that explains most of what is left on one axis beside a belief.
pub(super) fn rest(case: &Case, solved: &Solved, belief: &Belief) -> Option<Rest> {
    let spindle = &belief.spindle;
    let angle = |row: usize| spindle.angle(&case.law.rows[row]);
    let of = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..case.law.rows.len()).map(value).collect()
    };
    let pitch = TAU / f64::from(case.law.cutter.teeth.max(1));
    let word = |name: &str, values: Vec<f64>| Word { name: name.to_owned(), values };
    let sets = [&case.sets.train[..], &case.sets.look[..], &case.sets.held[..]];
    let read = case.readings(belief);
    let mut best: Option<Rest> = None;
    for axis in case.table.joints() {
        let left = crate::torque::noise::residual(&case.table, &case.library.columns, solved, axis);
        let mut words = vec![
            word("spindle_rpm", of(&|row| angle(row).rem_euclid(pitch))),
            word("feed_mm_s", of(&|row| case.law.rows[row].feed_per_tooth_m)),
            word("wrench", read[axis].clone()),
            word("t_s", of(&|row| case.law.rows[row].time_s)),
        ];
        if case.law.cutter.teeth > 1 {
            words.push(word("spindle_rpm", of(&|row| angle(row).rem_euclid(TAU))));
        }
        words.retain(|word| word.values.iter().any(|x| *x != word.values[0]));
        let Some(law) = law_of(&words, &case.table, axis, &left, sets) else { continue };
        let counts = &case.table.counts[axis];
        let count = counts.iter().zip(sets[2]).filter(|(a, b)| **a && **b).count().max(1) as f64;
        let held = law.held.map(|sum| libm::sqrt(sum / count));
        let size = case.table.noise[axis].1;
        let carries = (law.held[0] - law.held[1]) / (size * size);
        let mut names = law.words;
        names.dedup();
        if best.as_ref().is_none_or(|one| carries > one.carries) {
            best = Some(Rest { axis, words: names, held, tone_hz: None, carries });
        }
    }
    best
}
