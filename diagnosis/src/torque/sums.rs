//! Sums of products of columns, kept from one question to the next: only columns that have changed are whitened and multiplied anew.
//!
//! Promises: sums over the rows that count and that were asked for, with the noise as it is; what was kept of other rows or another noise is
//! thrown away. Never: a choice.

use nalgebra::{DMatrix, DVector};

use super::columns::Column;
use super::table::{BRINGS, Products, Table};
use crate::colour::Colour;

/// Rows that are multiplied at once: so many stay near while they are turned.
const PIECE: usize = 256;

/// The columns that act on one joint, free of the noise's memory, over the rows that count.
#[derive(Clone, Debug)]
struct Block {
    joint: usize,
    rows: Vec<usize>,
    /// The right-hand side, then one column for each of `of`.
    white: DMatrix<f64>,
    of: Vec<usize>,
}

/// Sums, and what they were taken of.
#[derive(Clone, Debug)]
pub(crate) struct Sums {
    used: Vec<bool>,
    counts: Vec<Vec<bool>>,
    noise: Vec<(Colour, f64)>,
    columns: Vec<Column>,
    blocks: Vec<Block>,
    gram: DMatrix<f64>,
    right: DVector<f64>,
}

impl Sums {
    /// The sums of `columns` over the rows that count and that `used` takes. `before`: what was kept, of the same right-hand side.
    pub(crate) fn taken(
        before: Option<Self>,
        table: &Table,
        columns: &[Column],
        used: &[bool],
    ) -> Self {
        let holds = |sums: &Self| {
            sums.used == used && sums.counts == table.counts && sums.noise == table.noise
        };
        let mut sums = before.filter(holds).unwrap_or_else(|| Self::none(table, used));
        let is_new = |k: &usize| sums.columns.get(*k).is_none_or(|had| !had.is(&columns[*k]));
        let changed: Vec<usize> = (0..columns.len()).filter(is_new).collect();
        sums.gram.resize_mut(columns.len(), columns.len(), 0.0);
        sums.right.resize_vertically_mut(columns.len(), 0.0);
        for k in &changed {
            sums.gram.row_mut(*k).fill(0.0);
            sums.gram.column_mut(*k).fill(0.0);
            sums.right[*k] = 0.0;
        }
        for block in &mut sums.blocks {
            block.take(table, columns, &changed, (&mut sums.gram, &mut sums.right));
        }
        sums.columns = columns.to_vec();
        sums
    }

    /// Of no columns yet.
    fn none(table: &Table, used: &[bool]) -> Self {
        Self {
            used: used.to_vec(),
            counts: table.counts.clone(),
            noise: table.noise.clone(),
            columns: Vec::new(),
            blocks: table.joints().map(|joint| Block::none(table, joint, used)).collect(),
            gram: DMatrix::zeros(0, 0),
            right: DVector::zeros(0),
        }
    }

    /// `prior`: one over the square of what is believed of each number; 0 where nothing is.
    pub(crate) fn products(&self, prior: Vec<f64>) -> Products {
        let rows = self.blocks.iter().map(|block| block.rows.len()).sum();
        Products { gram: self.gram.clone(), right: self.right.clone(), rows, prior, brings: BRINGS }
    }
}

impl Block {
    fn none(table: &Table, joint: usize, used: &[bool]) -> Self {
        let counts = |row: &usize| used[*row] && table.counts[joint][*row];
        let rows: Vec<usize> = (0..table.rows()).filter(counts).collect();
        let white = DMatrix::zeros(rows.len(), 1);
        let mut block = Self { joint, rows, white, of: Vec::new() };
        table.target[joint].iter().for_each(|target| block.put(0, &table.whitened(joint, target)));
        block
    }

    fn put(&mut self, place: usize, values: &[f64]) {
        let mut column = self.white.column_mut(place);
        column.iter_mut().zip(&self.rows).for_each(|(white, row)| *white = values[*row]);
    }

    /// Takes in the columns that have changed, and adds their products to the sums.
    fn take(
        &mut self,
        table: &Table,
        columns: &[Column],
        changed: &[usize],
        (gram, right): (&mut DMatrix<f64>, &mut DVector<f64>),
    ) {
        let part = |k: usize| columns[k].parts.iter().find(|(joint, _)| *joint == self.joint);
        let here: Vec<(usize, &[f64])> =
            changed.iter().filter_map(|k| Some((*k, &*part(*k)?.1))).collect();
        let gone: Vec<usize> = changed.iter().copied().filter(|k| part(*k).is_none()).collect();
        let open: Vec<usize> =
            here.iter().map(|(k, _)| *k).filter(|k| !self.of.contains(k)).collect();
        self.of.extend(open);
        self.white.resize_mut(self.rows.len(), self.of.len() + 1, 0.0);
        let place = |of: &[usize], k: usize| of.iter().position(|other| *other == k);
        for k in gone {
            place(&self.of, k).into_iter().for_each(|at| self.white.column_mut(at + 1).fill(0.0));
        }
        let mut moved = Vec::with_capacity(here.len());
        for (k, values) in here {
            if let Some(at) = place(&self.of, k) {
                self.put(at + 1, &table.whitened(self.joint, values));
                moved.push(at);
            }
        }
        let places: Vec<usize> = moved.iter().map(|at| at + 1).collect();
        let mut product = DMatrix::zeros(moved.len(), self.of.len() + 1);
        for from in (0..self.rows.len()).step_by(PIECE) {
            let piece = self.white.rows(from, PIECE.min(self.rows.len() - from));
            // Not `tr_mul`, which takes one scalar product after the other.
            product.gemm(1.0, &piece.select_columns(&places).transpose(), &piece, 1.0);
        }
        for (row, at) in moved.iter().enumerate() {
            let k = self.of[*at];
            right[k] += product[(row, 0)];
            for (b, other) in self.of.iter().enumerate() {
                gram[(k, *other)] += product[(row, b + 1)];
                if !moved.contains(&b) {
                    gram[(*other, k)] += product[(row, b + 1)];
                }
            }
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
        let mut column = |joints: &[usize]| Column {
            parts: joints.iter().map(|joint| (*joint, values().into())).collect(),
        };
        let mut columns = vec![column(&[0, 1]), column(&[1]), column(&[0]), column(&[0, 1])];
        let used: Vec<bool> = (0..60).map(|row| row % 7 != 0).collect();
        let mut target = || column(&[0]).parts.remove(0).1.to_vec();
        let table = Table {
            runs: vec![0..25, 25..60],
            target: vec![Some(target()), Some(target())],
            moves: vec![vec![true; 60]; 2],
            counts: vec![(0..60).map(|row| row != 11).collect(), vec![true; 60]],
            noise: vec![(Colour::default(), 0.5), (Colour::default(), 2.0)],
        };
        let kept = Sums::taken(None, &table, &columns, &used);
        columns[1] = column(&[1]);
        // One that comes to act on another joint, one that acts on none, and a new one.
        columns[2] = column(&[1]);
        columns[3].parts.clear();
        columns.push(column(&[0]));
        let again = Sums::taken(Some(kept.clone()), &table, &columns, &used);
        let anew = Sums::taken(None, &table, &columns, &used);
        assert!((&again.gram - &anew.gram).amax() < 1e-12, "{}", &again.gram - &anew.gram);
        assert!((&again.right - &anew.right).amax() < 1e-12);
        assert!((&anew.gram - anew.gram.transpose()).amax() < 1e-12);
        let fewer: Vec<bool> = used.iter().enumerate().map(|(row, u)| *u && row > 30).collect();
        let others = Sums::taken(Some(kept), &table, &columns, &fewer);
        assert!((others.gram - &anew.gram).amax() > 0.1);
    }
}
