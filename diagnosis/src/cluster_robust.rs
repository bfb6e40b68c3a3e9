//! Cluster-robust (sandwich) standard uncertainty of the fitted parameters, with blocks of consecutive poses as clusters
//! ([`crate::engine::sandwich`]).

use crate::engine::sandwich::{BlockSettings, BlockSums, covariance};
use crate::score_test::ScoreTest;
use nalgebra::{DMatrix, DVectorView};
use std::cell::Cell;

impl ScoreTest<'_> {
    /// Standard uncertainty of each fitted column, SI, in the order of [`crate::fit_result::Fit::columns`]: the larger of the cluster-robust value and
    /// that of the noise model.
    pub(crate) fn uncertainty(&self) -> Vec<f64> {
        let of_blocks = self.covariance(self.block_sums());
        let sigma = |(k, column): (usize, &usize)| {
            self.fit.sigma(*column).unwrap_or_default().max(of_blocks[(k, k)].sqrt())
        };
        self.fit.columns().iter().enumerate().map(sigma).collect()
    }

    /// Scores and normal matrices of the fitted columns, SI, by block of consecutive poses.
    pub(crate) fn block_sums(&self) -> Vec<BlockSums> {
        let settings = BlockSettings::POSITION;
        let width = self.fit.columns().len();
        let poses = self.campaign.poses.len().max(1);
        let block = Cell::new(0);
        let mut blocks = vec![BlockSums::new(width); settings.blocks];
        self.rows(
            0,
            |pose, _| block.set(pose * settings.blocks / poses),
            |row, _, left| {
                let row = DVectorView::from_slice(row, width);
                let BlockSums { score, gram } = &mut blocks[block.get()];
                score.axpy(left, &row, 1.0);
                gram.ger(1.0, &row, &row, 1.0);
            },
        );
        blocks
    }

    /// Cluster-robust covariance of the fitted columns, SI, in their order.
    pub(crate) fn covariance(&self, blocks: Vec<BlockSums>) -> DMatrix<f64> {
        let width = self.fit.columns().len();
        let triangle = &self.fit.triangle;
        let mut inverse = DMatrix::zeros(width, width);
        for column in 0..width {
            let mut unit = vec![0.0; width];
            unit[column] = 1.0;
            inverse.column_mut(column).copy_from_slice(&triangle.back(triangle.forward(unit)));
        }
        covariance(&inverse, blocks, &BlockSettings::POSITION)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{FitSettings, fit};
    use crate::hypothesis::Hypothesis;
    use crate::robust_weights::Influence;
    use crate::{Campaign, Reading, campaign_simulation, test_campaigns};
    use glam::DVec3;

    /// Ratio of the block-based to the noise-model uncertainty, averaged over all columns.
    fn wider(campaign: &Campaign) -> f64 {
        let used = vec![true; campaign.poses.len()];
        let influence = Influence::Equal;
        let settings = FitSettings::full(&used, influence);
        let found = fit(campaign, &Hypothesis::fixed(test_campaigns::thesis_robot()), &settings);
        let sigmas = ScoreTest::new(campaign, &found, &settings).uncertainty();
        let ratios = found.columns().iter().zip(&sigmas);
        let ratios = ratios.map(|(column, sigma)| sigma / found.sigma(*column).expect("fitted"));
        ratios.sum::<f64>() / sigmas.len() as f64
    }

    #[test]
    fn noise_that_goes_on_for_long_makes_numbers_less_sure_than_it_says() {
        let clean = test_campaigns::unmeasured_campaign(0, 400);
        let white = campaign_simulation::simulate_readings(
            &clean,
            &test_campaigns::thesis_robot(),
            &clean.surroundings,
            1.0,
            5,
        );
        let mut slow = white.clone();
        for (k, pose) in slow.poses.iter_mut().enumerate() {
            // A noise step that is shared by forty consecutive poses.
            let step =
                DVec3::splat(5e-5 * f64::from([1_i8, -1, -1, 1, -1, 1, 1, -1, 1, -1][k / 40]));
            for observation in &mut pose.seen {
                if let Reading::Point { at, .. } = &mut observation.reading {
                    *at += step;
                }
            }
        }
        let (white, slow) = (wider(&white), wider(&slow));
        assert!((1.0..1.3).contains(&white), "{white}");
        assert!(slow > 2.0, "{slow}");
    }
}
