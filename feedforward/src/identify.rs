//! Identification of a joint's plant parameters from a run, with the model as prior.
//!
//! Minimises `Σ |(G(p) C − Y) H|² / s² + Σ ((p − p̂)/σ)²` over the bins of the band: C the commands, Y the joint positions, H a high-pass that removes static errors, s² the
//! mean power of the residual. Frequencies of modes are first searched around the model's, since a sharp peak has a small region of convergence; then Gauss-Newton
//! with step halving.
//!
//! Invariants: no result unless the new parameters explain the run much better than the model's;
//! parameters stay positive. No effect is added.

use crate::fourier::{Transform, product};
use joint_dynamics::plant::{Plant, UncertainValue};
use nalgebra::{SMatrix, SVector};
use realfft::num_complex::Complex64;

/// Corner frequency of the high-pass, Hz: static errors change over seconds.
const STATIC_HZ: f64 = 0.5;
/// The new parameters must leave less than this share of the residual's power.
const MAX_UNEXPLAINED_POWER: f64 = 0.5;
/// Step of the search over frequencies, as a share: half the width of a peak with 1 % damping.
const SEARCH_STEP: f64 = 0.005;
/// Range of the search, as a share of the model's frequency: beyond any `robust_to`.
const SEARCH_RANGE: f64 = 0.5;
/// Gauss-Newton steps.
const STEPS: usize = 12;
/// Plants with more parameters are not identified.
const PARAMETERS_MAX: usize = 16;
/// Least standard uncertainty of a parameter, as a share: a plant is not exactly linear.
const MIN_RELATIVE_SIGMA: f64 = 0.003;

type Normal = SMatrix<f64, PARAMETERS_MAX, PARAMETERS_MAX>;
type ParameterVector = SVector<f64, PARAMETERS_MAX>;

/// A run of one joint.
pub(crate) struct Run<'a> {
    pub(crate) transform: &'a Transform,
    /// Frequencies of the transform's bins, Hz.
    pub(crate) bins_hz: &'a [f64],
    /// Spectrum of the commands.
    pub(crate) commanded: &'a [Complex64],
    /// Position of the joint, rad or m.
    pub(crate) reached: &'a [f64],
    /// Bins above this frequency are ignored, Hz.
    pub(crate) band_hz: f64,
}

/// A plant identified from a run.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentifiedPlant {
    /// The plant with the identified parameters and their standard uncertainties.
    pub plant: Plant,
    /// Its residual of the run, as a share of that of the model (root mean squares).
    pub unexplained: f64,
}

/// The identified plant; `None` if it explains the run little better than the model.
pub(crate) fn identify(plant: &Plant, run: &Run<'_>) -> Option<IdentifiedPlant> {
    let count = plant.clone().parameters_mut().len();
    if count == 0 || count > PARAMETERS_MAX {
        return None;
    }
    let by_model = power(&run.residual(plant));
    let mut found = run.search(plant);
    for _ in 0..STEPS {
        found = run.gauss_newton_step(&found, plant);
    }
    let share = power(&run.residual(&found)) / by_model;
    if by_model == 0.0 || share > MAX_UNEXPLAINED_POWER {
        return None;
    }
    let plant = run.with_sigmas(found, plant)?;
    Some(IdentifiedPlant { plant, unexplained: share.sqrt() })
}

impl Run<'_> {
    /// Residual of the plant. The periodic continuation of a path returns to its start, which the
    /// plant's memory does not: the two are compared in time.
    fn residual(&self, plant: &Plant) -> Vec<Complex64> {
        let response: Vec<Complex64> = self.bins_hz.iter().map(|hz| plant.response(*hz)).collect();
        let by_plant = self.transform.samples(product(self.commanded, &response));
        let differences: Vec<f64> = by_plant.iter().zip(self.reached).map(|(p, r)| p - r).collect();
        let bins = self.transform.spectrum(&differences).into_iter().zip(self.bins_hz).skip(1);
        let high_pass = |hz: f64| hz / (hz * hz + STATIC_HZ * STATIC_HZ).sqrt();
        bins.take_while(|(_, hz)| **hz <= self.band_hz)
            .map(|(bin, hz)| bin * high_pass(*hz))
            .collect()
    }

    /// The frequency of each mode that explains the run best.
    fn search(&self, plant: &Plant) -> Plant {
        let mut best = plant.clone();
        let steps = (SEARCH_RANGE / SEARCH_STEP).ceil() as i32;
        for mode in 0..plant.modes.len() {
            let with_frequency = |k: i32| {
                let mut tried = best.clone();
                tried.modes[mode].frequency_hz.value *= 1.0 + SEARCH_STEP * f64::from(k);
                tried
            };
            let tried = (-steps..=steps)
                .map(with_frequency)
                .map(|tried| (power(&self.residual(&tried)), tried));
            if let Some((_, tried)) = tried.min_by(|a, b| a.0.total_cmp(&b.0)) {
                best = tried;
            }
        }
        best
    }

    /// A Gauss-Newton step, shortened until it reduces the cost.
    fn gauss_newton_step(&self, plant: &Plant, prior: &Plant) -> Plant {
        let residual = self.residual(plant);
        let scale = residual.len() as f64 / power(&residual).max(f64::MIN_POSITIVE);
        let (normal, gradient) = self.normal(plant, prior, &residual, scale);
        let Some(step) = normal.cholesky().map(|factor| factor.solve(&gradient)) else {
            return plant.clone();
        };
        let cost =
            |plant: &Plant| scale * power(&self.residual(plant)) + prior_penalty(plant, prior);
        let before = cost(plant);
        let tried = (0..6).map(|halved| stepped(plant, &step, 0.5_f64.powi(halved)));
        tried.into_iter().find(|tried| cost(tried) < before).unwrap_or_else(|| plant.clone())
    }

    /// Normal matrix and negative gradient at a plant.
    fn normal(
        &self,
        plant: &Plant,
        prior: &Plant,
        residual: &[Complex64],
        scale: f64,
    ) -> (Normal, ParameterVector) {
        let count = plant.clone().parameters_mut().len();
        let columns: Vec<Vec<Complex64>> =
            (0..count).map(|index| self.derivative(plant, index, residual)).collect();
        let (mut normal, mut gradient) = (Normal::identity(), ParameterVector::zeros());
        let (values, priors) = (values(plant), values_and_sigmas(prior));
        for row in 0..count {
            for column in 0..count {
                let product = columns[row].iter().zip(&columns[column]);
                normal[(row, column)] =
                    scale * product.map(|(a, b)| (a.conj() * b).re).sum::<f64>();
            }
            let UncertainValue { value, sigma } = priors[row];
            let weight = 1.0 / (sigma * sigma).max(f64::MIN_POSITIVE);
            normal[(row, row)] += weight;
            let pull =
                columns[row].iter().zip(residual).map(|(a, b)| (a.conj() * b).re).sum::<f64>();
            gradient[row] = -scale * pull - weight * (values[row] - value);
        }
        (normal, gradient)
    }

    fn derivative(&self, plant: &Plant, index: usize, residual: &[Complex64]) -> Vec<Complex64> {
        let mut moved = plant.clone();
        let mut step = 0.0;
        if let Some(number) = moved.parameters_mut().into_iter().nth(index) {
            step = 1e-5 * number.value.abs().max(1e-6);
            number.value += step;
        }
        self.residual(&moved).iter().zip(residual).map(|(a, b)| (a - b) / step).collect()
    }

    fn with_sigmas(&self, mut plant: Plant, prior: &Plant) -> Option<Plant> {
        let residual = self.residual(&plant);
        let scale = residual.len() as f64 / power(&residual).max(f64::MIN_POSITIVE);
        let covariance = self.normal(&plant, prior, &residual, scale).0.try_inverse()?;
        for (index, number) in plant.parameters_mut().into_iter().enumerate() {
            let sigma = covariance[(index, index)].max(0.0).sqrt();
            number.sigma = sigma.max(MIN_RELATIVE_SIGMA * number.value.abs()).min(number.sigma);
        }
        Some(plant)
    }
}

fn power(residual: &[Complex64]) -> f64 {
    residual.iter().map(Complex64::norm_sqr).sum()
}

fn values_and_sigmas(plant: &Plant) -> Vec<UncertainValue> {
    plant.clone().parameters_mut().into_iter().map(|number| *number).collect()
}

fn values(plant: &Plant) -> Vec<f64> {
    values_and_sigmas(plant).iter().map(|number| number.value).collect()
}

/// Deviation of the parameters from those of the model, in standard uncertainties, squared.
fn prior_penalty(plant: &Plant, prior: &Plant) -> f64 {
    let pairs = values(plant).into_iter().zip(values_and_sigmas(prior));
    let penalty_of = |(value, prior): (f64, UncertainValue)| {
        if value == prior.value { 0.0 } else { ((value - prior.value) / prior.sigma).powi(2) }
    };
    pairs.map(penalty_of).sum()
}

/// The plant after a share of a step; no parameter falls below a tenth of its value.
fn stepped(plant: &Plant, step: &ParameterVector, share: f64) -> Plant {
    let mut moved = plant.clone();
    for (number, step) in moved.parameters_mut().into_iter().zip(step.iter()) {
        number.value = (number.value + share * step).max(0.1 * number.value);
    }
    moved
}
