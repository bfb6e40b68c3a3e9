//! Cluster-robust uncertainty of fitted parameters from blocks of the recording (sandwich estimator; Liang and Zeger 1986).
//!
//! The covariance of the fit is valid if the noise model is. If the noise is correlated over longer times or is not stationary, the scores of the blocks
//! scatter more.
//!
//! Promises: never below the covariance of the noise model. Never: a change of the fit.

use crate::score::Fitted;
use std::cell::Cell;

/// Stretches that the recordings are cut into.
const STRETCHES: usize = 20;
/// Fewer that were read tell nothing.
const FEW: usize = 8;
/// The normal quantile of 95 %, squared.
const QUANTILE_SQUARED: f64 = 3.84;

impl Fitted<'_> {
    /// The standard uncertainty of each column of the fit, SI, in the order of [`crate::result::Fit::columns`].
    pub(crate) fn uncertainty(&self) -> Vec<f64> {
        let width = self.fit.columns().len();
        let of_noise: Vec<f64> = self
            .fit
            .columns()
            .iter()
            .map(|column| self.fit.sigma(*column).unwrap_or_default())
            .collect();
        let poses = self.campaign.poses.len().max(1);
        let here = Cell::new(0);
        let mut pulls: Vec<Vec<f64>> = vec![Vec::new(); STRETCHES];
        self.rows(
            0,
            |pose, _| here.set(pose * STRETCHES / poses),
            |row, _, left| {
                let own = &mut pulls[here.get()];
                own.resize(width, 0.0);
                own.iter_mut().zip(row).for_each(|(pull, x)| *pull += x * left);
            },
        );
        pulls.retain(|own| !own.is_empty());
        let count = pulls.len() as f64;
        if pulls.len() < FEW {
            return of_noise;
        }
        let mean = |k: usize| pulls.iter().map(|own| own[k]).sum::<f64>() / count;
        let means: Vec<f64> = (0..width).map(mean).collect();
        let mut squares = vec![0.0; width];
        for own in &pulls {
            let pull = own.iter().zip(&means).map(|(pull, mean)| pull - mean).collect();
            let triangle = &self.fit.triangle;
            let shift = triangle.back(triangle.forward(pull));
            squares.iter_mut().zip(shift).for_each(|(sum, x)| *sum += x * x);
        }
        // Student's quantile in units of the normal one (Fisher and Cornish 1960, first term), since there are few stretches.
        let student = 1.0 + (QUANTILE_SQUARED + 1.0) / (4.0 * (count - 1.0));
        let of_stretches = squares.iter().map(|x| student * (x * count / (count - 1.0)).sqrt());
        of_noise.iter().zip(of_stretches).map(|(a, b)| a.max(b)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{Effort, Settings, fit};
    use crate::hypothesis::Hypothesis;
    use crate::robust::Influence;
    use crate::{Campaign, Reading, made, simulate};
    use glam::DVec3;

    /// How much wider stretches say than the noise does, on average over all columns.
    fn wider(campaign: &Campaign) -> f64 {
        let used = vec![true; campaign.poses.len()];
        let influence = Influence::Equal;
        let settings = Settings { used: &used, influence, from: None, effort: Effort::Full };
        let found = fit(campaign, &Hypothesis::fixed(made::thesis()), &settings);
        let told = Fitted::new(campaign, &found, &settings).uncertainty();
        let ratios = found.columns().iter().zip(&told);
        let ratios = ratios.map(|(column, told)| told / found.sigma(*column).expect("fitted"));
        ratios.sum::<f64>() / told.len() as f64
    }

    #[test]
    fn noise_that_goes_on_for_long_makes_numbers_less_sure_than_it_says() {
        let clean = made::empty(0, 400);
        let white = simulate::readings(&clean, &made::thesis(), &clean.surroundings, 1.0, 5);
        let mut slow = white.clone();
        for (k, pose) in slow.poses.iter_mut().enumerate() {
            // A step of a noise from every fortieth pose to the next.
            let step =
                DVec3::splat(5e-5 * f64::from([1_i8, -1, -1, 1, -1, 1, 1, -1, 1, -1][k / 40]));
            for seen in &mut pose.seen {
                if let Reading::Point { at, .. } = &mut seen.reading {
                    *at += step;
                }
            }
        }
        let (white, slow) = (wider(&white), wider(&slow));
        assert!((1.0..1.3).contains(&white), "{white}");
        assert!(slow > 2.0, "{slow}");
    }
}
