//! The proof of a calibration: what the model is off by on poses that neither selection nor fit has seen.
//!
//! Promises: held-out poses take no part in anything but the figures; the same seed gives the same split.
//! Never: a split by what a pose shows.

use crate::campaign::Campaign;
use crate::fit::{Effort, Settings, fit};
use crate::hypothesis::Hypothesis;
use crate::result::Fit;
use crate::robust::Influence;
use crate::select::{Selection, geometry, select};
use physics::Model;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Which poses train and which are held out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// One entry per pose: whether it trains.
    pub training: Vec<bool>,
    /// How it was made, for people.
    pub says: String,
}

impl Split {
    /// A random part of the poses trains, the rest is held out.
    #[must_use]
    pub fn random(campaign: &Campaign, share: f64, seed: u64) -> Self {
        let count = campaign.poses.len();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut order: Vec<usize> = (0..count).collect();
        // Fisher and Yates.
        for last in (1..count).rev() {
            order.swap(last, rng.random_range(0..=last));
        }
        let trained = (share * count as f64).round() as usize;
        let mut training = vec![false; count];
        order.iter().take(trained).for_each(|pose| training[*pose] = true);
        let says = format!("{trained} of {count} poses train, drawn with seed {seed}");
        Self { training, says }
    }

    /// The first part of the poses in time trains, the rest is held out.
    #[must_use]
    pub fn in_time(campaign: &Campaign, share: f64) -> Self {
        let count = campaign.poses.len();
        let trained = (share * count as f64).round() as usize;
        let training = (0..count).map(|pose| pose < trained).collect();
        Self { training, says: format!("the first {trained} of {count} poses train") }
    }

    /// The held-out poses.
    #[must_use]
    pub fn held_out(&self) -> Vec<bool> {
        self.training.iter().map(|trains| !trains).collect()
    }
}

/// Distances of measured points from where a model sees them, m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Errors {
    /// In rising order.
    pub sorted_m: Vec<f64>,
}

impl Errors {
    /// The lengths of all readings of length of the poses `wanted`.
    #[must_use]
    pub fn of(fit: &Fit, campaign: &Campaign, wanted: &[bool]) -> Self {
        let off = fit.off(campaign);
        let lengths = off.iter().filter(|off| off.is_length && wanted[off.pose]);
        let mut sorted_m: Vec<f64> = lengths.map(|off| off.off.length()).collect();
        sorted_m.sort_by(f64::total_cmp);
        Self { sorted_m }
    }

    /// The mean, m.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.sorted_m.iter().sum::<f64>() / self.sorted_m.len().max(1) as f64
    }

    /// The value below which this share lies (linear between neighbours), m.
    #[must_use]
    pub fn quantile(&self, share: f64) -> f64 {
        let place = share * self.sorted_m.len().saturating_sub(1) as f64;
        let at = |k: usize| self.sorted_m.get(k).or(self.sorted_m.last()).copied().unwrap_or(0.0);
        let below = place.floor();
        at(below as usize) + (at(below as usize + 1) - at(below as usize)) * (place - below)
    }

    /// The largest, m.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.sorted_m.last().copied().unwrap_or(0.0)
    }
}

/// The three models on the poses that train.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Only the surroundings fitted.
    pub nominal: Fit,
    /// With the geometry of every joint.
    pub calibrated: Fit,
    /// With the effects that the data ask for.
    pub advanced: Selection,
}

/// Fits the three models to the poses that train. `sigma`: what is stated of the model's own effects, one list per effect; `heard` is told what comes
/// next: what is fitted takes from less than a second to many.
#[must_use]
pub fn calibrate(
    campaign: &Campaign,
    model: &Model,
    sigma: &[Vec<f64>],
    training: &[bool],
    heard: &mut dyn FnMut(&'static str),
) -> Calibration {
    let influence = Influence::Redescending;
    let settings = Settings { used: training, influence, from: None, effort: Effort::Full };
    heard("the model as it is");
    let nominal = fit(campaign, &Hypothesis::fixed(*model), &settings);
    heard("the geometry");
    let calibrated = fit(campaign, &geometry(model, sigma), &settings);
    heard("choosing effects");
    let advanced = select(campaign, &calibrated, &settings);
    Calibration { nominal, calibrated, advanced }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_their_neighbours() {
        let errors = Errors { sorted_m: vec![1.0, 2.0, 3.0, 4.0, 5.0] };
        assert!((errors.mean() - 3.0).abs() < 1e-15);
        assert!((errors.quantile(0.5) - 3.0).abs() < 1e-15);
        assert!((errors.quantile(0.95) - 4.8).abs() < 1e-12);
        assert!((errors.max() - 5.0).abs() < 1e-15);
        assert!(Errors::default().quantile(0.95).abs() < 1e-15);
    }
}
