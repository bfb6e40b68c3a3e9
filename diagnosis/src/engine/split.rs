//! Data split by whole blocks of time: training, validation and test rows.
//!
//! Runs are cut into stretches in proportion to their length (block cross-validation: Burman, Chow and Nolan 1994); many runs are not cut. Every
//! fifth stretch belongs to the test set, and every fifth with another offset to the validation set of the selection, which the final fit uses too.
//! Rows next to a border between sets are not used for training.
//!
//! Invariant: the split depends on times and the seed alone, not on measured values.

use recording::series::HeldOut;
use std::ops::Range;

/// Parameters of the split.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplitSettings {
    /// Stretches that all runs together are cut into; 5 to 1000. Default 20: each of test and validation set then consists of four stretches, so that
    /// no single one decides.
    pub(crate) stretches: usize,
    /// Every n-th stretch belongs to the test set, and every n-th with another offset to the validation set; 3 to 10. Default 5: three fifths of the
    /// rows are for training.
    pub(crate) every: usize,
    /// Offset of the validation set from the test set, in stretches; 1 to `every` − 1. Default 2, so that no two of them are neighbours.
    pub(crate) beside: usize,
    /// Number of runs from which they are not cut; at least `every`. Default 10: two of them are the test set.
    pub(crate) runs_many: usize,
}

impl Default for SplitSettings {
    fn default() -> Self {
        Self { stretches: 20, every: 5, beside: 2, runs_many: 10 }
    }
}

/// A run: consecutive rows without a gap.
#[derive(Clone, Debug)]
pub(crate) struct RunSpan {
    pub(crate) rows: Range<usize>,
    /// Rows on either side of a border between sets that are excluded, since filters and autocorrelated noise carry information across it.
    pub(crate) gap: usize,
    /// Whether the recording reserves the run for validation; `None` if it reserves nothing.
    pub(crate) reserved: Option<bool>,
}

/// Whether a recording reserves a segment for validation; `None` if it makes no statement.
pub(crate) fn reserved(heldout: &HeldOut, segment: i64) -> Option<bool> {
    match heldout {
        HeldOut::All => Some(true),
        HeldOut::Segments(list) => Some(list.contains(&segment)),
        HeldOut::Unspecified => None,
    }
}

/// Training, validation and test set.
#[derive(Clone, Debug)]
pub(crate) struct RowSets {
    pub(crate) train: Vec<bool>,
    /// The validation set of the selection; the final fit uses it too.
    pub(crate) validation: Vec<bool>,
    pub(crate) test: Vec<bool>,
    /// Composition of the test set, for users.
    pub(crate) description: String,
}

impl RowSets {
    /// Splits `runs`, which follow one another from row 0. If any recording reserves runs, these are the test set.
    pub(crate) fn of(runs: &[RunSpan], seed: u64, settings: &SplitSettings) -> Self {
        let SplitSettings { stretches, every, beside, runs_many } = *settings;
        let count = runs.last().map_or(0, |run| run.rows.end);
        let is_reserved = runs.iter().any(|run| run.reserved.is_some());
        let whole = runs.len() >= runs_many;
        let first = (seed % every as u64) as usize;
        let (mut test, mut validation) = (vec![false; count], vec![false; count]);
        let (mut stretch, mut kept) = (0, 0);
        for RunSpan { rows, reserved, .. } in runs {
            let share = rows.len() as f64 / count.max(1) as f64;
            let pieces =
                if whole { 1 } else { ((stretches as f64 * share).round() as usize).max(1) };
            for piece in 0..pieces {
                let bound = |k: usize| rows.start + k * rows.len() / pieces;
                let rows = bound(piece)..bound(piece + 1);
                let turn = (stretch + every - first) % every;
                let is_test = if is_reserved { *reserved == Some(true) } else { turn == 0 };
                kept += usize::from(is_test);
                if is_test {
                    test[rows].fill(true);
                } else if turn == beside {
                    validation[rows].fill(true);
                }
                stretch += 1;
            }
        }
        let beside = beside_borders(runs, &test, &validation);
        let is_train = |row: usize| !test[row] && !validation[row] && !beside[row];
        let train = (0..count).map(is_train).collect();
        validation
            .iter_mut()
            .zip(&beside)
            .for_each(|(is_validation, beside)| *is_validation &= !beside);
        let what = if whole { "runs" } else { "stretches" };
        let description = if is_reserved {
            "what the recordings reserve for validation".to_owned()
        } else {
            format!("{kept} of {stretch} {what}, not used in selection or fit")
        };
        Self { train, validation, test, description }
    }

    /// All rows but those of the test set.
    pub(crate) fn fitted(&self) -> Vec<bool> {
        self.train.iter().zip(&self.validation).map(|(a, b)| *a || *b).collect()
    }
}

/// Rows within the gap of a border between sets.
fn beside_borders(runs: &[RunSpan], test: &[bool], validation: &[bool]) -> Vec<bool> {
    let mut beside = vec![false; test.len()];
    for RunSpan { rows, gap, .. } in runs {
        for row in rows.start + 1..rows.end {
            if (test[row], validation[row]) != (test[row - 1], validation[row - 1]) {
                let first = row.saturating_sub(*gap).max(rows.start);
                beside[first..(row + gap).min(rows.end)].fill(true);
            }
        }
    }
    beside
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(rows: Range<usize>, reserved: Option<bool>) -> RunSpan {
        RunSpan { rows, gap: 3, reserved }
    }

    #[test]
    fn sets_are_disjoint_and_rows_beside_a_border_train_nothing() {
        for seed in 0..5 {
            let sets = RowSets::of(&[run(0..1000, None)], seed, &SplitSettings::default());
            let count = |set: &[bool]| set.iter().filter(|is_member| **is_member).count();
            assert_eq!(count(&sets.test), 200, "seed {seed}");
            assert!((150..=200).contains(&count(&sets.validation)), "seed {seed}");
            for row in 0..1000 {
                let memberships = [sets.train[row], sets.validation[row], sets.test[row]];
                assert!(memberships.iter().filter(|is_member| **is_member).count() <= 1);
                let neighbours = row.saturating_sub(2)..(row + 3).min(1000);
                assert!(!(sets.train[row] && sets.test[neighbours].contains(&true)), "row {row}");
            }
        }
    }

    #[test]
    fn what_a_recording_reserves_is_the_test_set_and_nothing_else() {
        let runs = [run(0..100, Some(false)), run(100..150, Some(true))];
        let sets = RowSets::of(&runs, 1, &SplitSettings::default());
        assert!(
            sets.test[100..].iter().all(|is_test| *is_test) && !sets.test[..100].contains(&true)
        );
    }

    #[test]
    fn of_many_runs_whole_ones_are_held_out() {
        let runs: Vec<RunSpan> = (0..10).map(|k| run(10 * k..10 * k + 10, None)).collect();
        let sets = RowSets::of(&runs, 0, &SplitSettings::default());
        let held: Vec<usize> = (0..10)
            .filter(|k| sets.test[10 * k..10 * k + 10].iter().all(|is_test| *is_test))
            .collect();
        assert_eq!(held, [0, 5]);
        assert!(sets.description.starts_with("2 of 10 runs"), "{}", sets.description);
    }
}
