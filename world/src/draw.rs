//! A true robot for a calibrated model: what a calibration leaves unknown, drawn by seed.
//!
//! Every parameter moves by a normal draw of its stated standard uncertainty, redrawn where it would leave its physical
//! range; then come effects that the calibrated model lacks (see [`crate::extras`]).
//!
//! Promises: with no uncertainty and no extras the true robot is the calibrated model, bit for bit. The draw looks
//! at the model and the poses alone, never at what a correction makes of it.

use crate::extras::{Extra, ExtraSize, draw_extras};
use crate::random::{Purpose, stream};
use physics::spec::{Count, Range};
use physics::{AnyEffect, BuildError, Joints, Model, ModelError};
use rand::RngExt;
use rand_distr::StandardNormal;
use thiserror::Error;

/// What a calibration states.
#[derive(Clone, Copy, Debug)]
pub struct Calibration<'a> {
    /// The calibrated model.
    pub model: &'a Model,
    /// Standard uncertainty of each effect's values, SI, in the order of [`Model::effects`] and
    /// [`AnyEffect::values`]; an empty list: the effect is certain.
    pub sigmas: &'a [Vec<f64>],
}

/// A true robot.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueRobot {
    /// How it really is.
    pub model: Model,
    /// Temperature around it, °C, constant.
    pub ambient_celsius: f64,
    /// What the calibrated model lacks.
    pub extras: Vec<Extra>,
}

/// Why no true robot can be drawn. Effects and values are 0-based.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum DrawError {
    /// Not one list of uncertainties per effect.
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
        /// Place of the effect in the model.
        effect: usize,
        /// Uncertainties given.
        found: usize,
        /// Values of the effect.
        expected: usize,
    },
    /// An uncertainty that is none.
    #[error(
        "effect {effect}, value {value}: its uncertainty is {sigma}, expected a finite number, 0 or above"
    )]
    Sigma {
        /// Place of the effect in the model.
        effect: usize,
        /// Place of the value in the effect.
        value: usize,
        /// What was given.
        sigma: f64,
    },
    /// No effects of the asked size were found that the calibrated model lacks.
    #[error(
        "found no {count} effects of {least_m} to {largest_m} m at the TCP that the model lacks"
    )]
    NoExtras {
        /// How many were asked for.
        count: usize,
        /// Least size asked for, m.
        least_m: f64,
        /// Largest size asked for, m.
        largest_m: f64,
    },
    /// An effect of the menu could not be built: the menu and the physics have parted.
    #[error("the menu's `{kind}` cannot be built: {error}")]
    Menu {
        /// Its name.
        kind: &'static str,
        /// Why.
        error: BuildError,
    },
    /// The model has no room for the extras.
    #[error(transparent)]
    Room(#[from] ModelError),
}

/// Draws the true robot of `seed`; the extras' sizes are taken over `poses`, run through as a path.
///
/// # Errors
/// Uncertainties that do not fit the model; no extras of the asked size.
pub fn draw(
    calibration: &Calibration<'_>,
    extras: &ExtraSize,
    poses: &[Joints],
    seed: u64,
) -> Result<TrueRobot, DrawError> {
    let model = moved(calibration, seed)?;
    let ambient_celsius = stream(seed, Purpose::Climate, 0).random_range(21.0..27.0);
    let mut truth = TrueRobot { model, ambient_celsius, extras: Vec::new() };
    draw_extras(&mut truth, extras, poses, &mut stream(seed, Purpose::Extras, 0))?;
    Ok(truth)
}

fn moved(calibration: &Calibration<'_>, seed: u64) -> Result<Model, DrawError> {
    let mut model = *calibration.model;
    let (found, expected) = (calibration.sigmas.len(), model.effects().len());
    if found != expected {
        return Err(DrawError::Lists { found, expected });
    }
    for (index, sigmas) in calibration.sigmas.iter().enumerate() {
        if let Some(effect) = model.effect_mut(index) {
            move_effect(effect, index, sigmas, seed)?;
        }
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
            // A value at the edge of its range finds a place inside it every second time; 64 misses do not happen.
            let draws = (0..64).map(|_| stated + sigma * rng.sample::<f64, _>(StandardNormal));
            let drawn = draws.into_iter().find(|value| range.holds(*value));
            effect.values_mut()[k] = drawn.unwrap_or(stated);
        }
    }
    Ok(())
}

/// The range of flat value `k`: the entries that a fit may change, each as long as the effect carries it.
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
    use physics::JOINTS_MAX;
    use std::collections::BTreeSet;

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

    fn poses() -> Vec<Joints> {
        let pose = |k: i32| {
            let mut q = [0.0; JOINTS_MAX];
            let s = 0.1 * (f64::from(k) * 0.2).sin();
            q[..6].copy_from_slice(&[s, 0.2 + s, 0.3 - s, 0.5 * s, 1.1 + s, -s]);
            q
        };
        (0..50).map(pose).collect()
    }

    const NONE: ExtraSize = ExtraSize { count: 0, least_m: 0.0, largest_m: 0.0 };

    #[test]
    fn a_certain_calibration_is_the_true_robot() {
        let model = calibrated();
        for sigmas in [vec![Vec::new(); 5], vec![vec![0.0]; 5]] {
            let calibration = Calibration { model: &model, sigmas: &sigmas };
            let truth = draw(&calibration, &NONE, &poses(), 3).expect("sound");
            assert_eq!(truth.model, model);
            assert!(truth.extras.is_empty());
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
            let truth = draw(&calibration, &NONE, &poses(), seed).expect("sound");
            let pairs = truth.model.effects().zip(model.effects());
            for (i, (drawn, stated)) in pairs.enumerate() {
                let off = (drawn.values()[0] - stated.values()[0]) / sigmas[i][0];
                squares[i] += off * off / n as f64;
                assert!(i != 4 || drawn.values()[0] >= 0.0, "a gap is never negative");
            }
        }
        // The variance of n draws is 1 ± sqrt(2/n): 0.07; four of these.
        assert!(squares[..4].iter().all(|s| (s - 1.0).abs() < 0.28), "{squares:?}");
    }

    #[test]
    fn extras_have_the_stated_size_and_are_lacking_in_the_model_over_100_seeds() {
        let model = calibrated();
        let sigmas = vec![Vec::new(); 5];
        let calibration = Calibration { model: &model, sigmas: &sigmas };
        let mut kinds = BTreeSet::new();
        for seed in 0..100 {
            let truth = draw(&calibration, &ExtraSize::default(), &poses(), seed).expect("found");
            assert_eq!(truth.extras.len(), 2);
            let size = crate::extras::size(&model, &truth.model, &poses(), truth.ambient_celsius);
            assert!((20e-6..=60e-6).contains(&size.rms_m), "seed {seed}: {size:?}");
            for (extra, effect) in truth.extras.iter().zip(truth.model.effects().skip(5)) {
                let same =
                    |e: &&AnyEffect| e.spec().kind == extra.kind && e.joint() == effect.joint();
                assert_eq!(model.effects().find(same), None, "{}", extra.words);
                kinds.insert((extra.kind, effect.joint()));
            }
        }
        assert!(kinds.len() > 4, "the menu is drawn from widely: {kinds:?}");
    }

    #[test]
    fn a_seed_means_one_robot() {
        let model = calibrated();
        let sigmas = vec![vec![1e-7]; 5];
        let calibration = Calibration { model: &model, sigmas: &sigmas };
        let truth =
            |seed| draw(&calibration, &ExtraSize::default(), &poses(), seed).expect("found");
        assert_eq!(truth(11), truth(11));
        assert_ne!(truth(11).model, truth(12).model);
    }

    #[test]
    fn uncertainties_that_do_not_fit_are_refused() {
        let model = calibrated();
        let refused = |sigmas: &[Vec<f64>]| {
            draw(&Calibration { model: &model, sigmas }, &NONE, &poses(), 0).err()
        };
        assert_eq!(refused(&[]), Some(DrawError::Lists { found: 0, expected: 5 }));
        let mut sigmas = vec![Vec::new(); 5];
        sigmas[2] = vec![1.0, 1.0];
        assert_eq!(refused(&sigmas), Some(DrawError::Count { effect: 2, found: 2, expected: 1 }));
        sigmas[2] = vec![-1.0];
        assert_eq!(refused(&sigmas), Some(DrawError::Sigma { effect: 2, value: 0, sigma: -1.0 }));
    }
}
