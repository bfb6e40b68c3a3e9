//! Gross errors: swapped or inverted channels, or another scale.
//!
//! The stated cut, for every tooth angle, is compared with every permutation and sign of the recorded channels, and with another scale. Channels are
//! accepted if the model fits best without permutation, whatever effects are missing.

use std::f64::consts::TAU;

use super::NoComparison;
use super::case::{Case, Estimates};

/// Largest number of rows used.
const ROWS: usize = 3000;
/// Number of tooth angles tried per pitch.
const ANGLES: u32 = 36;
/// Largest ratio of the residual energy of another arrangement to that of the recorded one for channels to count as swapped.
const ARRANGEMENT_RATIO_MOST: f64 = 0.3;
/// Residual energy, as a share of the variance of the forces, above which the recorded arrangement, and below which a scaled prediction, is tested.
const RESIDUAL_SHARE: f64 = 0.2;
/// Ratio of recorded to predicted force, or its inverse, from which the scale is wrong.
const MAGNITUDE_RATIO_MOST: f64 = 5.0;

/// Permutations of the channels: the model's axis of each recorded one.
const PERMUTATIONS: [[usize; 3]; 6] =
    [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]];

/// Sums of products of measured and predicted forces about their means.
#[derive(Default)]
struct ProductSums {
    measured: [f64; 3],
    predicted: [f64; 3],
    products: [[f64; 3]; 3],
}

/// Tests for swapped or inverted channels, or another scale.
pub(super) fn check(case: &Case) -> Result<(), NoComparison> {
    let count = case.model.rows.len();
    let rows: Vec<usize> = (0..count).step_by(count.div_ceil(ROWS).max(1)).collect();
    let pitch = TAU / f64::from(case.model.cutter.teeth.max(1));
    let angles = if case.model.cutter.turning { 1 } else { ANGLES };
    let stated = case.coefficients();
    // If only one direction is stated, permutations cannot be judged.
    let is_whole = stated.iter().any(|(_, three)| three.abs().min_element() > 0.0);
    let (mut as_stated, mut other) = (f64::INFINITY, f64::INFINITY);
    let (mut smallest, mut size, mut whole, mut loudest) = (f64::INFINITY, 1.0, 0.0, 0.0_f64);
    for angle in 0..angles {
        let sums = product_sums(case, &rows, f64::from(angle) * pitch / f64::from(angles));
        let measured_axes: Vec<usize> = (0..3).filter(|k| case.measured[*k].is_some()).collect();
        whole = measured_axes.iter().map(|k| sums.measured[*k]).sum();
        for (number, places) in PERMUTATIONS.iter().enumerate() {
            let (mut straight, mut turned) = (0.0, 0.0);
            for &axis in &measured_axes {
                let place = places[axis];
                let apart = sums.measured[axis] + sums.predicted[place];
                straight += apart - 2.0 * sums.products[axis][place];
                turned += apart - 2.0 * sums.products[axis][place].abs();
            }
            if number == 0 {
                as_stated = as_stated.min(straight);
            }
            other = other.min(turned);
        }
        let both: f64 = measured_axes.iter().map(|k| sums.products[*k][*k]).sum();
        let square: f64 = measured_axes.iter().map(|k| sums.predicted[*k]).sum();
        loudest = loudest.max(square);
        let left = whole - both * both / square.max(f64::MIN_POSITIVE);
        if left < smallest && square > 0.0 {
            (smallest, size) = (left, both / square);
        }
    }
    if is_whole && as_stated > RESIDUAL_SHARE * whole && other < ARRANGEMENT_RATIO_MOST * as_stated
    {
        return Err(NoComparison::SwappedChannels);
    }
    // Forces that hardly vary where the predicted ones do cannot be of the stated cut.
    let is_still = whole * MAGNITUDE_RATIO_MOST * MAGNITUDE_RATIO_MOST < loudest;
    if is_still
        || smallest < RESIDUAL_SHARE * whole
            && !(1.0 / MAGNITUDE_RATIO_MOST..MAGNITUDE_RATIO_MOST).contains(&size)
    {
        return Err(NoComparison::WrongMagnitude);
    }
    Ok(())
}

fn product_sums(case: &Case, rows: &[usize], phase: f64) -> ProductSums {
    let mut estimates = Estimates::as_stated(case.estimates.spindle.clone());
    estimates.spindle.phases.fill(phase);
    let reader = case.model.reading_model(&estimates.parameters);
    let predicted: Vec<[f64; 3]> = rows
        .iter()
        .map(|row| {
            let state = &case.model.rows[*row];
            let bite = case.model.tooth_forces(&estimates.spindle, state, 0.0);
            reader.reading(*row, &bite).to_array()
        })
        .collect();
    let measured =
        |axis: usize, row: usize| case.measured[axis].as_ref().map_or(0.0, |values| values[row]);
    let count = rows.len().max(1) as f64;
    let mean_predicted: [f64; 3] =
        std::array::from_fn(|k| predicted.iter().map(|force| force[k]).sum::<f64>() / count);
    let mean: [f64; 3] =
        std::array::from_fn(|k| rows.iter().map(|row| measured(k, *row)).sum::<f64>() / count);
    let mut sums = ProductSums::default();
    for (row, force) in rows.iter().zip(&predicted) {
        for axis in 0..3 {
            let deviation = measured(axis, *row) - mean[axis];
            sums.measured[axis] += deviation * deviation;
            sums.predicted[axis] +=
                (force[axis] - mean_predicted[axis]) * (force[axis] - mean_predicted[axis]);
            for place in 0..3 {
                sums.products[axis][place] += deviation * (force[place] - mean_predicted[place]);
            }
        }
    }
    sums
}
