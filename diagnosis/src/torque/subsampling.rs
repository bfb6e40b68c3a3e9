//! Subsampling of long recordings by evenly distributed sections.
//!
//! Sections instead of single samples, because effects with memory and filters need the preceding samples; the computing time of a searched parameter
//! is proportional to their total length.

/// Largest total number of rows of all runs.
const ROWS_MOST: usize = 40_000;
/// Rows per section: short enough that whole sections can be held out, and long compared with the ends that a filter loses.
const SECTION_ROWS: usize = 1000;

/// Of every `period` samples, the first `kept` are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Subsampling {
    kept: usize,
    period: usize,
}

impl Subsampling {
    /// For recordings with `rows` rows in total, `stride` samples apart; `None` if all are used.
    pub(super) fn of(rows: usize, stride: usize) -> Option<Self> {
        let kept = SECTION_ROWS * stride;
        (rows > ROWS_MOST).then(|| Self {
            kept,
            period: (kept as u128 * rows as u128).div_ceil(ROWS_MOST as u128) as usize,
        })
    }

    /// The sections of pieces without gaps.
    pub(super) fn apply<T: Clone>(self, pieces: &[Vec<T>]) -> Vec<Vec<T>> {
        let stretch = |part: &[T]| part[..self.kept.min(part.len())].to_vec();
        pieces.iter().flat_map(|piece| piece.chunks(self.period).map(stretch)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_lie_evenly_over_a_long_recording_and_a_short_one_is_taken_whole() {
        assert_eq!(Subsampling::of(ROWS_MOST, 5), None);
        let samples = 1_000_000;
        let stretches = Subsampling::of(samples / 5, 5).expect("long");
        let kept = stretches.apply(&[(0..samples).collect::<Vec<usize>>()]);
        assert_eq!(kept.len(), 40);
        assert!(kept.iter().all(|stretch| stretch.len() == 5 * SECTION_ROWS));
        let apart: Vec<usize> = kept.windows(2).map(|two| two[1][0] - two[0][0]).collect();
        assert!(apart.iter().all(|samples| *samples == 25_000), "{apart:?}");
    }

    #[test]
    fn a_little_more_than_is_looked_at_loses_only_a_little() {
        let stretches = Subsampling::of(ROWS_MOST + 400, 1).expect("long");
        let kept = stretches.apply(&[vec![(); ROWS_MOST + 400]]);
        assert_eq!(kept.iter().map(Vec::len).sum::<usize>(), ROWS_MOST);
    }
}
