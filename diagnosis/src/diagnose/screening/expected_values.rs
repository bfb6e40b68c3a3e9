//! Expected values of a channel: in any measuring frame, each coordinate of a point is a linear function of the nominal tool position (and, for a
//! reflector, of the tool's orientation); a link-side joint position is one of the commanded joint position. Only the nominal geometry is used.

use nalgebra::{DMatrix, DVector};
use physics::{Arm, Chain};
use recording::series::Channel;

use crate::campaign_import::JointPositions;
use crate::engine::statistics::median;

/// Least number of rows per coefficient of the regression.
const ROWS_PER_COEFFICIENT: usize = 4;
/// Standard deviation of a normal distribution divided by its median absolute deviation.
const SIGMA_PER_MAD: f64 = 1.4826;

/// Regressors of a channel, row by row.
pub(super) struct Regressors {
    width: usize,
    /// Values of all rows, row by row.
    all: Vec<f64>,
}

impl Regressors {
    /// Regressors of `channel` at the joint positions `q` of `rows` rows; `None` for other kinds of channels.
    pub(super) fn of(arm: &Arm, channel: Channel, q: &JointPositions, rows: usize) -> Option<Self> {
        let tool = |row| Chain::nominal(arm, &q.at(row)).base_from_tool;
        let (width, mut all) = match channel {
            Channel::Position(_) => (3, Vec::with_capacity(3 * rows)),
            Channel::Target(..) => (12, Vec::with_capacity(12 * rows)),
            Channel::Link(_) => (1, Vec::with_capacity(rows)),
            _ => return None,
        };
        for row in 0..rows {
            match channel {
                Channel::Link(joint) => all.push(q.at(row)[joint]),
                _ => {
                    let tool = tool(row);
                    all.extend(tool.origin.to_array());
                    if width > 3 {
                        all.extend(tool.rotation.to_cols_array());
                    }
                }
            }
        }
        Some(Self { width, all })
    }

    fn rows(&self) -> usize {
        self.all.len() / self.width
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.all[row * self.width..(row + 1) * self.width]
    }
}

/// Expected values of a channel, row by row.
pub(super) struct LinearPrediction {
    pub(super) expected: Vec<f64>,
    /// Robust standard deviation of the residual, SI.
    pub(super) sigma: f64,
}

/// Linear regression of `values` on the rows `sound`; `None` if these are too few.
pub(super) fn predict(
    followed: &Regressors,
    values: &[f64],
    sound: &[usize],
) -> Option<LinearPrediction> {
    let width = followed.width;
    if sound.len() < ROWS_PER_COEFFICIENT * (width + 1) {
        return None;
    }
    let count = sound.len() as f64;
    let mean = |k: usize| sound.iter().map(|row| followed.row(*row)[k]).sum::<f64>() / count;
    let means: Vec<f64> = (0..width).map(mean).collect();
    let level = sound.iter().map(|row| values[*row]).sum::<f64>() / count;
    let centred = |row: usize| followed.row(row).iter().zip(&means).map(|(x, m)| x - m);
    let (mut normal, mut right) = (DMatrix::zeros(width, width), DVector::zeros(width));
    let mut x = DVector::zeros(width);
    for row in sound {
        x.iter_mut().zip(centred(*row)).for_each(|(x, centred)| *x = centred);
        normal.ger(1.0, &x, &x, 1.0);
        right.axpy(values[*row] - level, &x, 1.0);
    }
    // A small ridge term keeps constant regressors from making the matrix singular.
    let ridge = 1e-9 * normal.trace().max(f64::MIN_POSITIVE);
    (0..width).for_each(|k| normal[(k, k)] += ridge);
    let slope = normal.cholesky()?.solve(&right);
    let predicted = |row| level + centred(row).zip(slope.iter()).map(|(x, b)| x * b).sum::<f64>();
    let expected: Vec<f64> = (0..followed.rows()).map(predicted).collect();
    let sizes = sound.iter().map(|row| (values[*row] - expected[*row]).abs());
    Some(LinearPrediction { sigma: SIGMA_PER_MAD * median(sizes), expected })
}

/// Least and largest standard deviation of the first three regressors (position) along any direction, over these rows.
pub(super) fn position_spread(followed: &Regressors, rows: &[usize]) -> (f64, f64) {
    // Rotation of the tool is excluded.
    let width = followed.width.min(3);
    let count = rows.len().max(1) as f64;
    let mut mean = DVector::zeros(width);
    let position =
        |row: usize| DVector::from_iterator(width, followed.row(row).iter().copied().take(width));
    rows.iter().for_each(|row| mean += position(*row) / count);
    let mut spread = DMatrix::zeros(width, width);
    for row in rows {
        let centred = position(*row) - &mean;
        spread.ger(1.0 / count, &centred, &centred, 1.0);
    }
    let squares = spread.symmetric_eigenvalues();
    let root = |square: f64| square.max(0.0).sqrt();
    (root(squares.min()), root(squares.max()))
}
