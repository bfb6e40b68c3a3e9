//! Gross errors: swapped channels or signs, or another scale.
//!
//! The model of the cut, for every angle of the tooth, is compared with every permutation of channels and signs, and with another scale.
//!
//! Promises: correct channels are not questioned if the model fits best without permutation, whatever effects are missing. Never: a finding.

use std::f64::consts::TAU;

use super::Silence;
use super::case::{Belief, Case};

/// Rows that are looked at, at most.
const ROWS: usize = 3000;
/// Angles of the tooth that are tried.
const ANGLES: u32 = 36;
/// Another arrangement leaves less than this share of what the recorded one leaves.
const CLEAR: f64 = 0.3;
/// As they are recorded, forces leave at least this share of what they vary by.
const WRONG: f64 = 0.2;
/// The recorded force is so many times the told law's, or that part of it.
const SIZE: f64 = 5.0;

/// The places that channels may have: which axis of the law each recorded one is.
const PLACES: [[usize; 3]; 6] = [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]];

/// Sums of products of measured and told axes about their means.
#[derive(Default)]
struct Sums {
    measured: [f64; 3],
    told: [f64; 3],
    both: [[f64; 3]; 3],
}

/// Whether channels are in each other's places, or of another size.
pub(super) fn look(case: &Case) -> Result<(), Silence> {
    let count = case.law.rows.len();
    let rows: Vec<usize> = (0..count).step_by(count.div_ceil(ROWS).max(1)).collect();
    let pitch = TAU / f64::from(case.law.cutter.teeth.max(1));
    let angles = if case.law.cutter.turning { 1 } else { ANGLES };
    let told = case.coefficients();
    // A cut of which one direction alone is told says nothing of places.
    let is_whole = told.iter().any(|(_, three)| three.abs().min_element() > 0.0);
    let (mut as_told, mut other) = (f64::INFINITY, f64::INFINITY);
    let (mut least, mut size, mut whole, mut loudest) = (f64::INFINITY, 1.0, 0.0, 0.0_f64);
    for angle in 0..angles {
        let sums = sums(case, &rows, f64::from(angle) * pitch / f64::from(angles));
        let there: Vec<usize> = (0..3).filter(|k| case.measured[*k].is_some()).collect();
        whole = there.iter().map(|k| sums.measured[*k]).sum();
        for (number, places) in PLACES.iter().enumerate() {
            let (mut straight, mut turned) = (0.0, 0.0);
            for &axis in &there {
                let of = places[axis];
                let apart = sums.measured[axis] + sums.told[of];
                straight += apart - 2.0 * sums.both[axis][of];
                turned += apart - 2.0 * sums.both[axis][of].abs();
            }
            if number == 0 {
                as_told = as_told.min(straight);
            }
            other = other.min(turned);
        }
        let both: f64 = there.iter().map(|k| sums.both[*k][*k]).sum();
        let square: f64 = there.iter().map(|k| sums.told[*k]).sum();
        loudest = loudest.max(square);
        let left = whole - both * both / square.max(f64::MIN_POSITIVE);
        if left < least && square > 0.0 {
            (least, size) = (left, both / square);
        }
    }
    if is_whole && as_told > WRONG * whole && other < CLEAR * as_told {
        return Err(Silence::Places);
    }
    // Forces that hardly swing where the told ones do are of no such cut, whatever they are.
    let is_still = whole * SIZE * SIZE < loudest;
    if is_still || least < WRONG * whole && !(1.0 / SIZE..SIZE).contains(&size) {
        return Err(Silence::Size);
    }
    Ok(())
}

fn sums(case: &Case, rows: &[usize], phase: f64) -> Sums {
    let mut belief = Belief::as_told(case.belief.spindle.clone());
    belief.spindle.phases.fill(phase);
    let reader = case.law.reader(&belief.numbers);
    let told: Vec<[f64; 3]> = rows
        .iter()
        .map(|row| {
            let stood = &case.law.rows[*row];
            let bite = case.law.bite(&belief.spindle, stood, 0.0);
            reader.reading(*row, &bite).to_array()
        })
        .collect();
    let measured =
        |axis: usize, row: usize| case.measured[axis].as_ref().map_or(0.0, |values| values[row]);
    let count = rows.len().max(1) as f64;
    let mean_told: [f64; 3] =
        std::array::from_fn(|k| told.iter().map(|force| force[k]).sum::<f64>() / count);
    let mean: [f64; 3] =
        std::array::from_fn(|k| rows.iter().map(|row| measured(k, *row)).sum::<f64>() / count);
    let mut sums = Sums::default();
    for (row, force) in rows.iter().zip(&told) {
        for axis in 0..3 {
            let off = measured(axis, *row) - mean[axis];
            sums.measured[axis] += off * off;
            sums.told[axis] += (force[axis] - mean_told[axis]) * (force[axis] - mean_told[axis]);
            for of in 0..3 {
                sums.both[axis][of] += off * (force[of] - mean_told[of]);
            }
        }
    }
    sums
}
