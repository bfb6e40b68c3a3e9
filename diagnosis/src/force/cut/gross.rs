//! Gross errors: swapped or inverted channels, or another scale.
//!
//! The stated cut, for every tooth angle, is compared with every permutation and sign of the recorded channels, and with another scale. Channels are
//! accepted if the model fits best without permutation, whatever effects are missing.

use std::f64::consts::TAU;

use super::Silence;
use super::case::{Belief, Case};

/// Largest number of rows used.
const ROWS: usize = 3000;
/// Number of tooth angles tried per pitch.
const ANGLES: u32 = 36;
/// Largest ratio of the residual energy of another arrangement to that of the recorded one for channels to count as swapped.
const CLEAR: f64 = 0.3;
/// Residual energy, as a share of the variance of the forces, above which the recorded arrangement, and below which a scaled prediction, is tested.
const WRONG: f64 = 0.2;
/// Ratio of recorded to predicted force, or its inverse, from which the scale is wrong.
const SIZE: f64 = 5.0;

/// Permutations of the channels: the model's axis of each recorded one.
const PLACES: [[usize; 3]; 6] = [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]];

/// Sums of products of measured and predicted forces about their means.
#[derive(Default)]
struct Sums {
    measured: [f64; 3],
    told: [f64; 3],
    both: [[f64; 3]; 3],
}

/// Tests for swapped or inverted channels, or another scale.
pub(super) fn look(case: &Case) -> Result<(), Silence> {
    let count = case.law.rows.len();
    let rows: Vec<usize> = (0..count).step_by(count.div_ceil(ROWS).max(1)).collect();
    let pitch = TAU / f64::from(case.law.cutter.teeth.max(1));
    let angles = if case.law.cutter.turning { 1 } else { ANGLES };
    let told = case.coefficients();
    // If only one direction is stated, permutations cannot be judged.
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
    // Forces that hardly vary where the predicted ones do cannot be of the stated cut.
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
