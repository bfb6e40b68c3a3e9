//! A true robot for a calibrated model: random residual errors of a calibration, by seed.
//!
//! Every parameter is drawn from a normal distribution with its stated standard uncertainty, and
//! redrawn if it leaves its physical range. Missing effects are drawn by [`crate::hidden`].
//!
//! With zero uncertainties the true robot is the calibrated model, bit for bit. The draw depends on
//! the model only, not on its corrections.

use crate::random::{Purpose, stream};
use physics::spec::{Count, Range};
use physics::{AnyEffect, Model};
use rand::RngExt;
use rand_distr::StandardNormal;
use thiserror::Error;

/// Result of a calibration.
#[derive(Clone, Copy, Debug)]
pub struct Calibration<'a> {
    /// The calibrated model.
    pub model: &'a Model,
    /// Standard uncertainty of each effect's values, SI, in the order of [`Model::effects`] and
    /// [`AnyEffect::values`]; an empty list: no uncertainty.
    pub sigmas: &'a [Vec<f64>],
}

/// A true robot.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueRobot {
    /// Its true parameters.
    pub model: Model,
    /// Ambient temperature, °C, constant.
    pub ambient_celsius: f64,
}

/// Why no true robot can be drawn. Effects and values are 0-based.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum DrawError {
    /// The number of lists of uncertainties is not that of the effects.
    #[error("{found} lists of uncertainties for {expected} effects, expected one each")]
    Lists {
        /// Lists given.
        found: usize,
        /// Effects of the model.
        expected: usize,
    },
    /// A list that does not fit its effect.
    #[error(
        "effect {effect}: {found} uncertainties for {expected} values, expected one each or none"
    )]
    Count {
        /// Index of the effect in the model.
        effect: usize,
        /// Uncertainties given.
        found: usize,
        /// Values of the effect.
        expected: usize,
    },
    /// An uncertainty that is not valid.
    #[error(
        "effect {effect}, value {value}: its uncertainty is {sigma}, expected a finite number, 0 or above"
    )]
    Sigma {
        /// Index of the effect in the model.
        effect: usize,
        /// Index of the value in the effect.
        value: usize,
        /// The value given.
        sigma: f64,
    },
}

/// Draws the true robot of `seed`.
///
/// # Errors
/// Uncertainties that do not fit the model.
pub fn draw(calibration: &Calibration<'_>, seed: u64) -> Result<TrueRobot, DrawError> {
    let model = moved(calibration, seed)?;
    Ok(TrueRobot { model, ambient_celsius: ambient_celsius(seed) })
}

/// Ambient temperature for `seed`, °C, constant during the run.
pub fn ambient_celsius(seed: u64) -> f64 {
    stream(seed, Purpose::Climate, 0).random_range(22.0..27.0)
}

fn moved(calibration: &Calibration<'_>, seed: u64) -> Result<Model, DrawError> {
    let mut model = *calibration.model;
    let (found, expected) = (calibration.sigmas.len(), model.effects().len());
    if found != expected {
        return Err(DrawError::Lists { found, expected });
    }
    for (index, sigmas) in calibration.sigmas.iter().enumerate() {
        model.change(index, |effect| move_effect(effect, index, sigmas, seed)).transpose()?;
    }
    Ok(model)
}

fn move_effect(
    effect: &mut AnyEffect,
    index: usize,
    sigmas: &[f64],
    seed: u64,
) -> Result<(), DrawError> {
    let (found, expected) = (sigmas.len(), effect.values().len());
    if found != 0 && found != expected {
        return Err(DrawError::Count { effect: index, found, expected });
    }
    for (k, &sigma) in sigmas.iter().enumerate() {
        if !(sigma.is_finite() && sigma >= 0.0) {
            return Err(DrawError::Sigma { effect: index, value: k, sigma });
        }
        if sigma > 0.0 {
            let range = range_of(effect, k);
            let mut rng = stream(seed, Purpose::Parameters, ((index << 8) | k) as u32);
            let stated = effect.values()[k];
            // A value at the edge of its range is redrawn with probability one half; 64 redraws do
            // not occur in practice.
            let draws = (0..64).map(|_| stated + sigma * rng.sample::<f64, _>(StandardNormal));
            let drawn = draws.into_iter().find(|value| range.holds(*value));
            effect.values_mut()[k] = drawn.unwrap_or(stated);
        }
    }
    Ok(())
}

/// The range of flat value `k`: the entries that a fit may change, each with its length in this
/// effect.
fn range_of(effect: &AnyEffect, k: usize) -> Range {
    let mut first = 0;
    for parameter in effect.fitted() {
        first += match parameter.count {
            Count::One => 1,
            Count::Exactly(n) => n,
            Count::UpTo(_) | Count::ThreePerCarriedBody => effect.values().len() - first,
        };
        if k < first {
            return parameter.range;
        }
    }
    Range::Any
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_arm::{effect, irb1600};

    fn calibrated() -> Model {
        let arm = irb1600();
        let effects = [
            effect(&arm, "joint_offset", 0, "offset", 4e-4),
            effect(&arm, "joint_offset", 1, "offset", -3e-4),
            effect(&arm, "joint_compliance", 1, "compliance", 2.2e-6),
            effect(&arm, "joint_compliance", 2, "compliance", 1.1e-5),
            effect(&arm, "backlash", 4, "width", 2e-4),
        ];
        Model::new(arm, &effects).expect("room")
    }

    #[test]
    fn a_certain_calibration_is_the_true_robot() {
        let model = calibrated();
        for sigmas in [vec![Vec::new(); 5], vec![vec![0.0]; 5]] {
            let calibration = Calibration { model: &model, sigmas: &sigmas };
            let truth = draw(&calibration, 3).expect("sound");
            assert_eq!(truth.model, model);
        }
    }

    #[test]
    fn parameters_move_by_their_uncertainty_and_stay_physical() {
        let model = calibrated();
        let sigmas: Vec<Vec<f64>> = [5e-5, 5e-5, 2e-7, 1e-6, 3e-4].map(|s| vec![s]).to_vec();
        let calibration = Calibration { model: &model, sigmas: &sigmas };
        let n = 400;
        let mut squares = [0.0; 5];
        for seed in 0..n {
            let truth = draw(&calibration, seed).expect("sound");
            let pairs = truth.model.effects().zip(model.effects());
            for (i, (drawn, stated)) in pairs.enumerate() {
                let ratio = (drawn.values()[0] - stated.values()[0]) / sigmas[i][0];
                squares[i] += ratio * ratio / n as f64;
                assert!(i != 4 || drawn.values()[0] >= 0.0, "a gap is never negative");
            }
        }
        // The standard deviation of a variance estimated from n draws is sqrt(2/n) = 0.07; the bound is four of these.
        assert!(squares[..4].iter().all(|s| (s - 1.0).abs() < 0.28), "{squares:?}");
    }

    #[test]
    fn a_seed_means_one_robot() {
        let model = calibrated();
        let sigmas = vec![vec![1e-7]; 5];
        let calibration = Calibration { model: &model, sigmas: &sigmas };
        let truth = |seed| draw(&calibration, seed).expect("sound");
        assert_eq!(truth(11), truth(11));
        assert_ne!(truth(11).model, truth(12).model);
    }

    #[test]
    fn uncertainties_that_do_not_fit_are_refused() {
        let model = calibrated();
        let refused = |sigmas: &[Vec<f64>]| draw(&Calibration { model: &model, sigmas }, 0).err();
        assert_eq!(refused(&[]), Some(DrawError::Lists { found: 0, expected: 5 }));
        let mut sigmas = vec![Vec::new(); 5];
        sigmas[2] = vec![1.0, 1.0];
        assert_eq!(refused(&sigmas), Some(DrawError::Count { effect: 2, found: 2, expected: 1 }));
        sigmas[2] = vec![-1.0];
        assert_eq!(refused(&sigmas), Some(DrawError::Sigma { effect: 2, value: 0, sigma: -1.0 }));
    }
}
