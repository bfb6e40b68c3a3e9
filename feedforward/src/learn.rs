//! Iterative learning: the commands of the next run from the error of the last one.
//!
//! Norm-optimal learning with the model as inverse ([`joint_dynamics::inverse`]), which converges monotonically for every plant whose parameters deviate by up to the stated
//! fraction. At each frequency the error is weighted by its share above the noise (Wiener filter): for several runs of the same commands the noise is their difference,
//! for one run the level far above the bandwidth. Differences between runs cannot be learned and are reported as repeatability.
//!
//! The plant's parameters are also estimated from the run (`identify`); if they explain it much better than the model's, they are used for this step,
//! and the assumed deviation is reduced according to the residual.

use crate::FeedforwardError;
use crate::bounds::JointBounds;
use crate::fourier::Transform;
use crate::identify::{self, IdentifiedPlant, identify};
use crate::measured::{MeasuredErrors, MeasuredQuantity};
use crate::preview::{joint_of, settle_s};
use crate::settings::Settings;
use crate::step::{CorrectionStep, StepInput};
use joint_dynamics::plant::{Plant, Plants};
use realfft::num_complex::Complex64;

/// Number of bins to each side over which the power of an error is averaged.
const SMOOTHING_BINS: usize = 12;
/// Least part of the stated relative deviation that is kept for a plant identified from a run.
const MIN_DEVIATION_SHARE: f64 = 0.25;
/// From this multiple of the bandwidth on an error counts as noise.
const NOISE_BANDWIDTH_RATIO: f64 = 2.0;

/// Commands and measurements of runs.
#[derive(Clone, Copy, Debug)]
pub struct Runs<'a> {
    /// Time from one row to the next, s.
    pub step_s: f64,
    /// Commands without dynamic correction, rad or m, a list per joint.
    pub wanted: &'a [Vec<f64>],
    /// Commands that were sent.
    pub commanded: &'a [Vec<f64>],
    /// One or several runs of the same commands.
    pub measured: &'a [MeasuredErrors],
}

/// Result of learning for a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnedJoint {
    /// The measured quantity.
    pub quantity: MeasuredQuantity,
    /// The mean error of the runs, rad or m.
    pub error: Vec<f64>,
    /// The next correction, and its remaining error by the model.
    pub next: CorrectionStep,
    /// Standard deviation of one run from the mean, rad or m; `None` for a single run.
    pub repeatability: Option<f64>,
    /// The joint's plant identified from this run, if that explains it much better than the
    /// model's.
    pub identified: Option<IdentifiedPlant>,
}

/// The next run.
#[derive(Clone, Debug, PartialEq)]
pub struct NextRun {
    /// The commands.
    pub commanded: Vec<Vec<f64>>,
    /// Result per joint; `None` without a measurement of it, or if only the motor of a joint with
    /// modes was measured: a motor that follows its target exactly excites them.
    pub joints: Vec<Option<LearnedJoint>>,
}

impl NextRun {
    /// Where joints with target `wanted` are with one of their errors; without a measurement at their target.
    #[must_use]
    pub fn reached(
        &self,
        wanted: &[Vec<f64>],
        error: fn(&LearnedJoint) -> &Vec<f64>,
    ) -> Vec<Vec<f64>> {
        let reached = |(wanted, learned): (&Vec<f64>, &Option<LearnedJoint>)| match learned {
            Some(learned) => wanted.iter().zip(error(learned)).map(|(w, e)| w - e).collect(),
            None => wanted.clone(),
        };
        wanted.iter().zip(&self.joints).map(reached).collect()
    }
}

/// The next commands; `bounds`: limits of the joints, none where they are unknown.
///
/// # Errors
/// Settings out of their range, too few rows, nothing measured, a sampling that is too coarse.
pub fn learn(
    plants: &Plants,
    bounds: &[JointBounds],
    runs: &Runs<'_>,
    settings: &Settings,
) -> Result<NextRun, FeedforwardError> {
    settings.check()?;
    settings.check_step("the path", runs.step_s)?;
    let rows = runs.wanted.first().map_or(0, Vec::len);
    if rows < crate::grid::ROWS_LEAST {
        return Err(FeedforwardError::TooShort(rows));
    }
    let transform = Transform::new(rows, runs.step_s, settle_s(plants));
    let mut next =
        NextRun { commanded: runs.commanded.to_vec(), joints: vec![None; runs.wanted.len()] };
    for joint_index in 0..runs.wanted.len() {
        let (wanted, commanded) = (&runs.wanted[joint_index], &runs.commanded[joint_index]);
        let errors: Vec<&[f64]> = runs
            .measured
            .iter()
            .filter_map(|run| {
                run.joints.get(joint_index)?.as_ref().map(|(_, errors)| errors.as_slice())
            })
            .collect();
        let quantity =
            runs.measured.iter().find_map(|run| Some(run.joints.get(joint_index)?.as_ref()?.0));
        let plant = &plants.joints[joint_index];
        let Some(quantity) = quantity
            .filter(|quantity| *quantity != MeasuredQuantity::Motor || plant.modes.is_empty())
        else {
            continue;
        };
        let (error, spectrum) = (mean(&errors), |samples: &[f64]| transform.spectrum(samples));
        let (path, sent, error_bins) = (spectrum(wanted), spectrum(commanded), spectrum(&error));
        let reached: Vec<f64> = wanted.iter().zip(&error).map(|(w, e)| w - e).collect();
        let run = identify::Run {
            transform: &transform,
            bins_hz: &transform.bins_hz(),
            commanded: &sent,
            reached: &reached,
            band_hz: settings.bandwidth_hz,
        };
        let identified = identify(plant, &run);
        let used = identified.as_ref().map_or(plant, |identified| &identified.plant);
        let unexplained = identified.as_ref().map_or(1.0, |identified| identified.unexplained);
        let robust_to = settings.robust_to * unexplained.max(MIN_DEVIATION_SHARE);
        let settings = &Settings { robust_to, ..*settings };
        let limits = bounds.get(joint_index).copied().unwrap_or(JointBounds::NONE);
        let joint = joint_of(used, (wanted, limits), &transform, runs.step_s, settings);
        let before: Vec<f64> = commanded.iter().zip(wanted).map(|(c, w)| c - w).collect();
        let trusted = signal_shares(&transform, &errors, &error, settings);
        let trusted: Vec<_> =
            error_bins.iter().zip(trusted).map(|(bin, share)| bin * share).collect();
        let source =
            StepInput::Run { path: identified.as_ref().map(|_| path.as_slice()), error: &trusted };
        let stepped = joint.step(&source, &before, &error);
        next.commanded[joint_index] =
            wanted.iter().zip(&stepped.correction).map(|(w, c)| w + c).collect();
        let repeatability = repeatability(&errors, &error);
        next.joints[joint_index] =
            Some(LearnedJoint { quantity, error, next: stepped, repeatability, identified });
    }
    if next.joints.iter().all(Option::is_none) {
        return Err(FeedforwardError::NothingMeasured);
    }
    Ok(next)
}

/// The errors that the model predicts for joints with target `wanted` and commands `commanded`, rad
/// or m.
#[must_use]
pub fn expected_error(
    plants: &Plants,
    step_s: f64,
    wanted: &[Vec<f64>],
    commanded: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let rows = wanted.first().map_or(0, Vec::len);
    let transform = Transform::new(rows, step_s, settle_s(plants));
    let of_joint = |((plant, wanted), commanded): ((&Plant, &Vec<f64>), &Vec<f64>)| {
        let response: Vec<Complex64> =
            transform.bins_hz().iter().map(|hz| plant.response(*hz)).collect();
        let reached = transform.through(commanded, &response);
        wanted.iter().zip(reached).map(|(w, r)| w - r).collect()
    };
    plants.joints.iter().zip(wanted).zip(commanded).map(of_joint).collect()
}

fn mean(errors: &[&[f64]]) -> Vec<f64> {
    let rows = errors.first().map_or(0, |errors| errors.len());
    let mean_at =
        |row: usize| errors.iter().map(|errors| errors[row]).sum::<f64>() / errors.len() as f64;
    (0..rows).map(mean_at).collect()
}

/// Standard deviation of one run from the mean of all.
fn repeatability(errors: &[&[f64]], mean: &[f64]) -> Option<f64> {
    let freedoms = errors.len().checked_sub(1).filter(|freedoms| *freedoms > 0)? * mean.len();
    let of_run = |errors: &&[f64]| {
        errors.iter().zip(mean).map(|(error, mean)| (error - mean).powi(2)).sum::<f64>()
    };
    Some((errors.iter().map(of_run).sum::<f64>() / freedoms as f64).sqrt())
}

/// The share of the mean error at each bin that is above the noise.
fn signal_shares(
    transform: &Transform,
    errors: &[&[f64]],
    mean: &[f64],
    settings: &Settings,
) -> Vec<f64> {
    let power = |samples: &[f64]| -> Vec<f64> {
        transform.spectrum(samples).iter().map(Complex64::norm_sqr).collect()
    };
    let of_mean = smoothed(&power(mean));
    let runs = errors.len() as f64;
    let noise = if errors.len() > 1 {
        let mut noise = vec![0.0; of_mean.len()];
        for errors in errors {
            let deviations: Vec<f64> =
                errors.iter().zip(mean).map(|(error, mean)| error - mean).collect();
            noise.iter_mut().zip(power(&deviations)).for_each(|(sum, of_run)| *sum += of_run);
        }
        // Variance of the mean of the runs.
        noise.iter_mut().for_each(|sum| *sum /= runs * (runs - 1.0));
        smoothed(&noise)
    } else {
        let bins_hz = transform.bins_hz();
        let above = |hz: &f64| *hz > NOISE_BANDWIDTH_RATIO * settings.bandwidth_hz;
        let beyond: Vec<f64> =
            bins_hz.iter().zip(&of_mean).filter(|(hz, _)| above(hz)).map(|(_, p)| *p).collect();
        vec![beyond.iter().sum::<f64>() / beyond.len().max(1) as f64; of_mean.len()]
    };
    let share = |(power, noise): (&f64, f64)| {
        if *power > 0.0 { (1.0 - noise / power).max(0.0) } else { 0.0 }
    };
    of_mean.iter().zip(noise).map(share).collect()
}

/// The mean over neighbouring bins.
fn smoothed(power: &[f64]) -> Vec<f64> {
    let about =
        |k: usize| k.saturating_sub(SMOOTHING_BINS)..(k + SMOOTHING_BINS + 1).min(power.len());
    (0..power.len()).map(|k| power[about(k)].iter().sum::<f64>() / about(k).len() as f64).collect()
}

#[cfg(test)]
mod tests;
