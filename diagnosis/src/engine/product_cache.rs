//! Cache of products of columns: only changed columns are whitened and multiplied again.
//!
//! Products are over the requested rows in use, with the present noise model; products for other rows or another AR model are discarded.

use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView, DVector};

use super::normal_equations::{FURTHER_SHARE_MIN, NormalEquations};
use super::regression_data::{RegressionData, Regressor};
use crate::autocorrelation::ArModel;

/// Number of rows that are multiplied at once, so that the transposed block stays in the processor's cache.
const PIECE: usize = 256;
/// Up to this number of columns, products are computed column by column: `gemm` would access them row by row.
const FEW: usize = 5;

/// Values of a column at the time of its multiplication; `None` if the column no longer acts on this joint.
type CachedValues = Option<Arc<[f64]>>;

/// The columns that act on one joint, with the noise's autocorrelation removed, over the rows that count. Division by the noise's standard deviation
/// comes last, so that products remain valid if only that changes.
#[derive(Clone, Debug)]
struct ChannelProducts {
    joint: usize,
    rows: Vec<usize>,
    colour: ArModel,
    /// Standard deviation of the noise, N m or N.
    size: f64,
    /// The right-hand side, then one column for each of `column_values`, filtered.
    white: Vec<f64>,
    /// Indices of columns, with the values that were multiplied.
    column_values: Vec<(usize, CachedValues)>,
    /// Products of all columns in `white`.
    products: DMatrix<f64>,
}

/// Products of all joints.
#[derive(Clone, Debug)]
pub(crate) struct ProductCache {
    blocks: Vec<ChannelProducts>,
    columns: usize,
}

impl ProductCache {
    /// Products of `columns` over the rows that count and are `used`. `before`: cached products with the same right-hand side.
    pub(crate) fn updated(
        before: Option<Self>,
        table: &RegressionData,
        columns: &[Regressor],
        used: &[bool],
    ) -> Self {
        let mut before = before.map_or(Vec::new(), |sums| sums.blocks);
        let block = |joint: usize| {
            let counts = |row: &usize| used[*row] && table.counts[joint][*row];
            let rows: Vec<usize> = (0..table.rows()).filter(counts).collect();
            let (colour, size) = &table.noise[joint];
            let previous = before.iter().position(|block| block.joint == joint);
            let mut block = match previous.map(|index| before.swap_remove(index)) {
                Some(block) if block.rows == rows && block.colour == *colour => block,
                previous => ChannelProducts::none(
                    table,
                    joint,
                    rows,
                    previous.map_or(Vec::new(), |previous| previous.white),
                ),
            };
            block.size = *size;
            block.take(table, columns);
            block
        };
        Self { blocks: table.joints().map(block).collect(), columns: columns.len() }
    }

    /// Sums over the joints, weighted by the noise. `prior`: precision of each coefficient, 1/σ²; 0 without a prior.
    pub(crate) fn products(&self, prior: Vec<f64>) -> NormalEquations {
        let rows = self.blocks.iter().map(|block| block.rows.len()).sum();
        let mut gram = DMatrix::zeros(self.columns, self.columns);
        let mut right = DVector::zeros(self.columns);
        for ChannelProducts { size, column_values, products, .. } in &self.blocks {
            let weight = 1.0 / (size * size);
            for (a, (k, _)) in column_values.iter().enumerate() {
                right[*k] += weight * products[(0, a + 1)];
                for (b, (other, _)) in column_values.iter().enumerate() {
                    gram[(*other, *k)] += weight * products[(b + 1, a + 1)];
                }
            }
        }
        NormalEquations { gram, right, rows, prior, further_share_min: FURTHER_SHARE_MIN }
    }
}

impl NormalEquations {
    /// Products over the rows that count and are `used`, without a cache.
    pub(crate) fn new(
        table: &RegressionData,
        columns: &[&Regressor],
        prior: Vec<f64>,
        used: &[bool],
    ) -> Self {
        let columns: Vec<Regressor> = columns.iter().copied().cloned().collect();
        ProductCache::updated(None, table, &columns, used).products(prior)
    }
}

impl ChannelProducts {
    /// A block without columns; `room`: storage to be reused.
    fn none(table: &RegressionData, joint: usize, rows: Vec<usize>, mut room: Vec<f64>) -> Self {
        room.clear();
        room.resize(rows.len(), 0.0);
        let (colour, size) = table.noise[joint].clone();
        let products = DMatrix::zeros(1, 1);
        let mut block =
            Self { joint, rows, colour, size, white: room, column_values: Vec::new(), products };
        table.target[joint].iter().for_each(|target| block.put(0, table, target));
        block
    }

    /// Filters the values of a column and stores them at position `place` of `white`.
    fn put(&mut self, place: usize, table: &RegressionData, values: &[f64]) {
        let free = table.decorrelated(self.joint, values);
        let count = self.rows.len();
        let column = self.white[place * count..].iter_mut();
        column.zip(&self.rows).for_each(|(white, row)| *white = free[*row]);
    }

    /// Filters the columns that have changed, and multiplies them.
    fn take(&mut self, table: &RegressionData, columns: &[Regressor]) {
        let part = |k: usize| {
            let mut parts = columns.get(k)?.parts.iter();
            parts.find(|(joint, _)| *joint == self.joint).map(|(_, values)| values)
        };
        let count = self.rows.len();
        while self.column_values.last().is_some_and(|(k, _)| part(*k).is_none()) {
            self.column_values.pop();
        }
        for k in (0..columns.len()).filter(|k| part(*k).is_some()) {
            if self.column_values.iter().all(|(other, _)| *other != k) {
                self.column_values.push((k, None));
            }
        }
        let changed = |(index, (k, previous)): (usize, &(usize, CachedValues))| {
            let now = part(*k);
            let same = match (previous, now) {
                (Some(previous), Some(now)) => Arc::ptr_eq(previous, now),
                (previous, now) => previous.is_none() && now.is_none(),
            };
            (!same).then(|| (index, now.cloned()))
        };
        let changed: Vec<(usize, CachedValues)> =
            self.column_values.iter().enumerate().filter_map(changed).collect();
        let wide = self.column_values.len() + 1;
        self.white.resize(count * wide, 0.0);
        self.products.resize_mut(wide, wide, 0.0);
        let mut moved = Vec::with_capacity(changed.len());
        for (index, values) in changed {
            match &values {
                Some(values) => self.put(index + 1, table, values),
                None => self.white[(index + 1) * count..(index + 2) * count].fill(0.0),
            }
            self.column_values[index].1 = values;
            moved.push(index + 1);
        }
        self.multiply(&moved);
    }

    /// Products of the columns at these positions with all.
    fn multiply(&mut self, places: &[usize]) {
        if places.is_empty() {
            return;
        }
        let (count, wide) = (self.rows.len(), self.column_values.len() + 1);
        let white = DMatrixView::from_slice(&self.white, count, wide);
        let mut product = DMatrix::zeros(places.len(), wide);
        for from in (0..count).step_by(PIECE) {
            let piece = white.rows(from, PIECE.min(count - from));
            let selected = piece.select_columns(places);
            if places.len() > FEW {
                product.gemm(1.0, &selected.transpose(), &piece, 1.0);
            } else {
                product.gemm_tr(1.0, &selected, &piece, 1.0);
            }
        }
        for (row, place) in places.iter().enumerate() {
            self.products.row_mut(*place).copy_from(&product.row(row));
            self.products.column_mut(*place).tr_copy_from(&product.row(row));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn sums_of_which_some_columns_have_changed_are_those_taken_anew() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut values =
            || -> Vec<f64> { (0..60).map(|_| random.random_range(-1.0..1.0)).collect() };
        let mut column = |joints: &[usize]| Regressor {
            parts: joints.iter().map(|joint| (*joint, values().into())).collect(),
        };
        let mut columns = vec![column(&[0, 1]), column(&[1]), column(&[0]), column(&[0, 1])];
        let used: Vec<bool> = (0..60).map(|row| row % 7 != 0).collect();
        let mut target = || column(&[0]).parts.remove(0).1.to_vec();
        let table = RegressionData {
            runs: vec![0..25, 25..60],
            target: vec![Some(target()), Some(target())],
            moves: vec![vec![true; 60]; 2],
            counts: vec![(0..60).map(|row| row != 11).collect(), vec![true; 60]],
            noise: vec![(ArModel::default(), 0.5), (ArModel::default(), 2.0)],
        };
        let kept = ProductCache::updated(None, &table, &columns, &used);
        columns[1] = column(&[1]);
        // One that changes to another joint, one that acts on none any more, and a new one.
        columns[2] = column(&[1]);
        columns[3].parts.clear();
        columns.push(column(&[0]));
        let products = |before: Option<&ProductCache>, table: &RegressionData, used: &[bool]| {
            ProductCache::updated(before.cloned(), table, &columns, used).products(Vec::new())
        };
        let (again, anew) = (products(Some(&kept), &table, &used), products(None, &table, &used));
        assert!((&again.gram - &anew.gram).amax() < 1e-12, "{}", &again.gram - &anew.gram);
        assert!((&again.right - &anew.right).amax() < 1e-12);
        assert!((&anew.gram - anew.gram.transpose()).amax() < 1e-12);
        let fewer: Vec<bool> = used.iter().enumerate().map(|(row, u)| *u && row > 30).collect();
        let others = products(Some(&kept), &table, &fewer);
        assert!((&others.gram - &anew.gram).amax() > 0.1);
        assert!((&others.gram - products(None, &table, &fewer).gram).amax() < 1e-12);
        let louder = RegressionData {
            noise: table.noise.iter().map(|n| (n.0.clone(), 3.0)).collect(),
            ..table
        };
        let (again, anew) = (products(Some(&kept), &louder, &used), products(None, &louder, &used));
        assert!((&again.gram - &anew.gram).amax() < 1e-12);
    }
}
