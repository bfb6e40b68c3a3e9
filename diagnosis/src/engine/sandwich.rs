//! Cluster-robust covariance of fitted parameters from blocks of time: the block jackknife, which is the sandwich estimator of Liang and Zeger (1986)
//! with each block corrected for its leverage (CR3: Cameron and Miller, A practitioner's guide to cluster-robust inference, 2015, section VI B).
//!
//! The covariance of a fit is valid if its noise model is. If noise is correlated over longer times or not stationary, the scores of the blocks
//! scatter more than the noise model predicts. With many parameters and few blocks, overfitting makes the residual of a block smaller than its noise;
//! the correction for leverage compensates that.
//!
//! Invariant: no variance is below that of the noise model.

use nalgebra::{DMatrix, DVector};

/// Division of the rows into blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlockSettings {
    /// Number of blocks that the recordings are cut into; 20 to 100. Each has to be longer than the correlation time of the noise; with fewer than
    /// about 40 clusters the coverage of intervals is too small (Cameron and Miller 2015, section VI) unless they are corrected for leverage, as
    /// here.
    pub(crate) blocks: usize,
    /// Number of blocks with rows below which the covariance of the noise model is used; 2 to `blocks`. Default 8: Student's quantile is then within
    /// a fifth of the normal one.
    pub(crate) blocks_least: usize,
}

impl BlockSettings {
    /// For poses and paths measured from outside: an instrument drifts over tens of rows.
    pub(crate) const POSITION: Self = Self { blocks: 20, blocks_least: 8 };
    /// For torques and forces: thousands of rows, with a correlation time below a fortieth of them.
    pub(crate) const DRIVE_OR_CUT: Self = Self { blocks: 40, ..Self::POSITION };
}

/// The normal quantile of a 95 % interval.
const NORMAL: f64 = 1.959_964;

/// Contribution of the rows of one block to the score `Xᵀ r` (r the residual) and to the normal matrix `Xᵀ X` of `count` parameters.
#[derive(Clone, Debug)]
pub(crate) struct BlockSums {
    pub(crate) score: DVector<f64>,
    pub(crate) gram: DMatrix<f64>,
}

impl BlockSums {
    /// A block without rows.
    pub(crate) fn new(count: usize) -> Self {
        Self { score: DVector::zeros(count), gram: DMatrix::zeros(count, count) }
    }

    /// Whether it has rows that depend on a parameter.
    pub(crate) fn has_rows(&self) -> bool {
        self.score.iter().any(|x| *x != 0.0)
    }
}

/// Covariance of parameters whose inverse normal matrix is `inverse`; with too few non-empty blocks, that of the noise model.
pub(crate) fn covariance(
    inverse: &DMatrix<f64>,
    blocks: Vec<BlockSums>,
    settings: &BlockSettings,
) -> DMatrix<f64> {
    let count = inverse.nrows();
    let filled = blocks.iter().filter(|block| block.has_rows()).count();
    if count == 0 || filled < settings.blocks_least {
        return inverse.clone();
    }
    let mut meat = DMatrix::zeros(count, count);
    for BlockSums { score, gram } in blocks {
        let leverage = DMatrix::identity(count, count) - gram * inverse;
        // A parameter that a single block determines has full leverage and no jackknife estimate: the uncorrected score is used.
        let freed = leverage.lu().solve(&score).filter(|freed| freed.iter().all(|x| x.is_finite()));
        let freed = freed.unwrap_or(score);
        meat.ger(1.0, &freed, &freed, 1.0);
    }
    let free = filled as f64 - 1.0;
    let wider = student(free);
    let mut all = inverse * meat * inverse * (free / filled as f64 * wider * wider);
    for i in 0..count {
        all[(i, i)] = all[(i, i)].max(inverse[(i, i)]);
    }
    all
}

/// Ratio of Student's 95 % quantile with `free` degrees of freedom to the normal one (expansion of Cornish and Fisher 1960).
fn student(free: f64) -> f64 {
    let square = NORMAL * NORMAL;
    let second = (5.0 * square + 16.0) * square + 3.0;
    1.0 + (square + 1.0) / (4.0 * free) + second / (96.0 * free * free)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    #[test]
    fn an_interval_from_few_blocks_is_as_wide_as_students() {
        for (free, quantile) in [(3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (31.0, 2.040)] {
            assert!((student(free) * NORMAL / quantile - 1.0).abs() < 0.04, "{free}");
        }
    }

    /// Standard uncertainty of the mean of 40 blocks of ten values, and that of the white-noise model. The values of a block share an offset of
    /// standard deviation `shared` and have white noise besides; the variance of each value is 1.
    fn of_mean(shared: f64, seed: u64) -> (f64, f64) {
        let (blocks, size) = (40, 10);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { random.sample(StandardNormal) };
        let unshared = (1.0 - shared * shared).sqrt();
        let values: Vec<Vec<f64>> = (0..blocks)
            .map(|_| {
                let level = shared * normal();
                (0..size).map(|_| level + unshared * normal()).collect()
            })
            .collect();
        let count = (blocks * size) as f64;
        let mean = values.iter().flatten().sum::<f64>() / count;
        let block = |values: &Vec<f64>| BlockSums {
            score: DVector::from_element(1, values.iter().map(|x| x - mean).sum()),
            gram: DMatrix::from_element(1, 1, size as f64),
        };
        let inverse = DMatrix::from_element(1, 1, 1.0 / count);
        let estimated =
            covariance(&inverse, values.iter().map(block).collect(), &BlockSettings::DRIVE_OR_CUT)
                [(0, 0)]
                .sqrt();
        (estimated, inverse[(0, 0)].sqrt())
    }

    #[test]
    fn noise_that_a_block_shares_widens_by_what_theory_says() {
        let mean = |shared: f64| (0..40).map(|seed| of_mean(shared, seed).0).sum::<f64>() / 40.0;
        let white = of_mean(0.0, 0).1;
        assert!((1.0..1.2).contains(&(mean(0.0) / white)), "{}", mean(0.0) / white);
        // Variance of the mean: (0.81 + 0.19 / 10) / 40.
        let truth = ((0.81 + 0.019) / 40.0_f64).sqrt();
        assert!((mean(0.9) / truth - 1.0).abs() < 0.1, "{} {truth}", mean(0.9));
    }
}
