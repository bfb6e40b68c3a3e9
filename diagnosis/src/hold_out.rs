//! Validation of a calibration: errors on held-out poses.
//!
//! Held-out poses are used only for these errors; the same seed gives the same split. No split depends on measured values.

use crate::campaign::Campaign;
use crate::diagnose::{ExtendedModel, select_effects};
use crate::fit::{FitSettings, fit};
use crate::fit_result::Fit;
use crate::geometry::{Tolerances, geometry_with_tolerances};
use crate::hypothesis::Hypothesis;
use crate::progress::{Listener, Stage, StageProgress};
use crate::robust_weights::Influence;
use physics::Model;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Two poses are repetitions of one pose if all joint positions differ by less, rad or m.
const REPEAT_TOLERANCE: f64 = 3e-3;

/// With at least this many runs, whole runs are held out.
const RUNS_MANY: usize = 10;
/// Number of blocks into which a campaign of few runs is divided.
const BLOCKS: f64 = 20.0;
/// Every n-th block is held out.
const HELD_EVERY: usize = 5;
/// Offset of the blocks of the validation set from those of the test set.
const VALIDATION_OFFSET: u64 = 2;
/// With fewer measured poses there is no validation set.
const VALIDATION_POSES_MIN: usize = 150;

/// Division of poses into training set and test set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HoldOutSplit {
    /// Whether each pose is in the training set.
    pub training: Vec<bool>,
    /// Description of the split, for users.
    pub description: String,
}

impl HoldOutSplit {
    /// A random part of the poses is the training set, the rest is held out. Repetitions of one pose are on the same side.
    #[must_use]
    pub fn random(campaign: &Campaign, share: f64, seed: u64) -> Self {
        let count = campaign.poses.len();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut order: Vec<usize> = (0..count).collect();
        // Fisher-Yates shuffle.
        for last in (1..count).rev() {
            order.swap(last, rng.random_range(0..=last));
        }
        let trained = (share * count as f64).round() as usize;
        let mut training = vec![false; count];
        let index = RepeatIndex::of(campaign);
        let mut drawn = 0;
        let mut sides: Vec<Option<bool>> = vec![None; count];
        for pose in order {
            if sides[pose].is_none() {
                let trains = drawn < trained;
                for repeat in index.repeats(campaign, pose) {
                    if sides[repeat].is_none() {
                        sides[repeat] = Some(trains);
                        training[repeat] = trains;
                        drawn += usize::from(trains);
                    }
                }
            }
        }
        let trained = drawn;
        let description =
            format!("{trained} of {count} poses in the training set, drawn with seed {seed}");
        Self { training, description }
    }

    /// The first part of the poses in time is the training set, the rest is held out.
    #[must_use]
    pub fn in_time(campaign: &Campaign, share: f64) -> Self {
        let count = campaign.poses.len();
        let trained = (share * count as f64).round() as usize;
        let training = (0..count).map(|pose| pose < trained).collect();
        Self {
            training,
            description: format!("the first {trained} of {count} poses in the training set"),
        }
    }

    /// The split that recordings reserve: for each pose, whether it is held out.
    #[must_use]
    pub fn reserved(held_out: &[bool]) -> Self {
        Self {
            description: "what the recordings reserve for validation".to_owned(),
            training: held_out.iter().map(|held| !held).collect(),
        }
    }

    /// Every fifth run, or block of runs if there are few, is held out, beginning with a block given by `seed`. Each frame, anchor and touched object
    /// keeps at least half of its measurements in the training set, because it would not be determined otherwise; runs are divided further if
    /// necessary.
    #[must_use]
    pub fn in_blocks(campaign: &Campaign, seed: u64) -> Self {
        Self::of_blocks(campaign, seed, &vec![true; campaign.poses.len()])
    }

    /// Holds out every fifth block of this training set as a validation set; none with few measurements.
    #[must_use]
    pub fn with_validation_set(&self, campaign: &Campaign, seed: u64) -> Self {
        let read = campaign.poses.iter().zip(&self.training);
        let read = read.filter(|(pose, trains)| **trains && !pose.seen.is_empty()).count();
        if read < VALIDATION_POSES_MIN {
            return self.clone();
        }
        let other = Self::of_blocks(campaign, seed.wrapping_add(VALIDATION_OFFSET), &self.training);
        Self { training: other.training, description: self.description.clone() }
    }

    /// Holds out every fifth block of the training set, with the largest blocks that keep enough measurements of each extrinsic object.
    fn of_blocks(campaign: &Campaign, seed: u64, training: &[bool]) -> Self {
        let runs = runs(campaign);
        let pieces = |fineness: usize, run: &std::ops::Range<usize>| {
            let share = run.len() as f64 / campaign.poses.len().max(1) as f64;
            let of_all = (BLOCKS * share).round() as usize;
            [1, of_all.max(1), of_all.max(HELD_EVERY)][fineness]
        };
        let cut = |fineness: usize| {
            let mut blocks: Vec<std::ops::Range<usize>> = Vec::new();
            for run in &runs {
                let pieces = pieces(fineness, run);
                let bound = |k: usize| run.start + k * run.len() / pieces;
                blocks
                    .extend((0..pieces).map(|k| bound(k)..bound(k + 1)).filter(|b| !b.is_empty()));
            }
            let mut left = training.to_vec();
            let first = (seed % HELD_EVERY as u64) as usize;
            let held = blocks.iter().skip(first).step_by(HELD_EVERY);
            let held = held.map(|block| left[block.clone()].fill(false)).count();
            let what = if fineness == 0 { "segments" } else { "stretches" };
            let count = blocks.len();
            let description = format!("{held} of {count} {what}, not used in selection or fit");
            Self { training: left, description }
        };
        let whole = usize::from(runs.len() < RUNS_MANY);
        let enough = |split: &Self| all_keep_half(campaign, training, &split.training);
        (whole..2).map(cut).find(enough).unwrap_or_else(|| cut(2))
    }

    /// One split per pose: leave-one-out, where repetitions of the pose are left out too.
    #[must_use]
    pub fn leave_one_out(campaign: &Campaign) -> Vec<Self> {
        let count = campaign.poses.len();
        let without = |pose: usize| {
            let training = (0..count).map(|other| !repeats(campaign, pose, other)).collect();
            Self {
                training,
                description: format!(
                    "all but pose {} and its repeats in the training set",
                    pose + 1
                ),
            }
        };
        (0..count).map(without).collect()
    }

    /// The held-out poses.
    #[must_use]
    pub fn held_out(&self) -> Vec<bool> {
        self.training.iter().map(|trains| !trains).collect()
    }
}

/// Ranges of consecutive poses of one recording with increasing time.
pub(crate) fn runs(campaign: &Campaign) -> Vec<std::ops::Range<usize>> {
    let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
    for (k, pose) in campaign.poses.iter().enumerate() {
        let before = k.checked_sub(1).map(|b| &campaign.poses[b]);
        let is_contiguous = before.is_some_and(|before| {
            before.recording == pose.recording && before.inputs.time_s < pose.inputs.time_s
        });
        match runs.last_mut().filter(|_| is_contiguous) {
            Some(run) => run.end = k + 1,
            None => runs.push(k..k + 1),
        }
    }
    runs
}

/// Whether each extrinsic object keeps, in `after`, at least half of its measurements of `before`.
fn all_keep_half(campaign: &Campaign, before: &[bool], after: &[bool]) -> bool {
    let mut counts: BTreeMap<(u8, usize), [usize; 2]> = BTreeMap::new();
    for (k, pose) in campaign.poses.iter().enumerate() {
        for against in
            pose.seen.iter().filter_map(|observation| observation.reading.extrinsic_object())
        {
            let [all, kept] = counts.entry(against).or_default();
            *all += usize::from(before[k]);
            *kept += usize::from(after[k]);
        }
    }
    counts.values().all(|[all, kept]| 2 * kept >= *all)
}

/// Whether two poses are repetitions of one; full turns of a joint are ignored.
fn repeats(campaign: &Campaign, one: usize, other: usize) -> bool {
    let (a, b) = (&campaign.poses[one].inputs.q, &campaign.poses[other].inputs.q);
    one == other
        || a.iter().zip(b).all(|(a, b)| libm::remainder(a - b, TAU).abs() < REPEAT_TOLERANCE)
}

/// Poses sorted by the position of the first joint, to find repetitions quickly.
struct RepeatIndex(Vec<(f64, usize)>);

impl RepeatIndex {
    fn of(campaign: &Campaign) -> Self {
        let turn = |pose: &crate::Pose| pose.inputs.q[0].rem_euclid(TAU);
        let mut order: Vec<(f64, usize)> =
            campaign.poses.iter().enumerate().map(|(k, pose)| (turn(pose), k)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self(order)
    }

    /// All repetitions of a pose, including itself, in order.
    fn repeats(&self, campaign: &Campaign, pose: usize) -> Vec<usize> {
        let angle = campaign.poses[pose].inputs.q[0].rem_euclid(TAU);
        let within = |middle: f64| {
            let from = self.0.partition_point(|(turn, _)| *turn < middle - 2.0 * REPEAT_TOLERANCE);
            let to = self.0.partition_point(|(turn, _)| *turn <= middle + 2.0 * REPEAT_TOLERANCE);
            &self.0[from..to]
        };
        let candidates = [angle - TAU, angle, angle + TAU].into_iter().flat_map(within);
        let others = candidates.map(|(_, other)| *other);
        let mut same: Vec<usize> = others.filter(|k| repeats(campaign, pose, *k)).collect();
        same.sort_unstable();
        same.dedup();
        same
    }
}

/// Distances between measured and predicted points, m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PositionErrors {
    /// In increasing order.
    pub sorted_m: Vec<f64>,
}

impl PositionErrors {
    /// Errors of all length measurements of the poses `wanted`.
    #[must_use]
    pub fn of(fit: &Fit, campaign: &Campaign, wanted: &[bool]) -> Self {
        let residuals = fit.residuals(campaign);
        let lengths =
            residuals.iter().filter(|residual| residual.is_length && wanted[residual.pose]);
        let mut sorted_m: Vec<f64> = lengths.map(|residual| residual.residual.length()).collect();
        sorted_m.sort_by(f64::total_cmp);
        Self { sorted_m }
    }

    /// Mean, m.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.sorted_m.iter().sum::<f64>() / self.sorted_m.len().max(1) as f64
    }

    /// Quantile at `share` (0 to 1), interpolated linearly, m.
    #[must_use]
    pub fn quantile(&self, share: f64) -> f64 {
        let place = share * self.sorted_m.len().saturating_sub(1) as f64;
        let value_at =
            |k: usize| self.sorted_m.get(k).or(self.sorted_m.last()).copied().unwrap_or(0.0);
        let below = place.floor();
        value_at(below as usize)
            + (value_at(below as usize + 1) - value_at(below as usize)) * (place - below)
    }

    /// Maximum, m.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.sorted_m.last().copied().unwrap_or(0.0)
    }
}

/// The three models fitted to the training set.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Only the extrinsic parameters fitted.
    pub nominal: Fit,
    /// With the geometry of every joint fitted.
    pub calibrated: Fit,
    /// With the selected effects fitted as well.
    pub advanced: ExtendedModel,
}

/// Fits the three models to the training set. `sigma`: stated standard uncertainties of the model's own effects, one list per effect, SI;
/// `listener` is told of the progress.
#[must_use]
pub fn calibrate(
    campaign: &Campaign,
    model: &Model,
    sigma: &[Vec<f64>],
    training: &[bool],
    listener: Listener<'_>,
) -> Calibration {
    let influence = Influence::Redescending;
    let settings = FitSettings::full(training, influence);
    StageProgress::begin(listener, Stage::CalibrationGivenModel);
    let nominal = fit(campaign, &Hypothesis::fixed(*model), &settings);
    StageProgress::begin(listener, Stage::CalibrationGeometry);
    let within = geometry_with_tolerances(model, sigma, &Tolerances::default(), campaign);
    let calibrated = fit(campaign, &within, &settings);
    let advanced = select_effects(campaign, &calibrated, &settings, listener);
    Calibration { nominal, calibrated, advanced }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Reading;

    #[test]
    fn a_pose_that_was_measured_again_is_on_the_side_of_the_first() {
        let mut campaign = crate::test_campaigns::unmeasured_campaign(0, 20);
        for pose in 0..10 {
            campaign.poses[10 + pose].inputs.q = campaign.poses[pose].inputs.q;
            campaign.poses[10 + pose].inputs.q[5] += if pose % 2 == 0 { TAU } else { 1e-3 };
        }
        for seed in 0..20 {
            let training = HoldOutSplit::random(&campaign, 0.5, seed).training;
            assert_eq!(training[..10], training[10..]);
            assert_eq!(training.iter().filter(|trains| **trains).count(), 10);
        }
        let alone = &HoldOutSplit::leave_one_out(&campaign)[3].held_out();
        assert_eq!((0..20).filter(|pose| alone[*pose]).collect::<Vec<_>>(), [3, 13]);
    }

    #[test]
    fn a_frame_keeps_readings_to_be_found_by_whatever_is_held_out() {
        // Thirteen runs of 20 poses each, except the first with 200; only the last two are measured in a second frame.
        let mut campaign = crate::test_campaigns::unmeasured_campaign(0, 420);
        for (k, pose) in campaign.poses.iter_mut().enumerate() {
            let run = if k < 200 { 0 } else { 1 + (k - 200) / 20 };
            pose.inputs.time_s = if run == 0 { k } else { (k - 200) % 20 } as f64;
            if let Reading::Point { frame, .. } = &mut pose.seen[0].reading {
                *frame = usize::from(run > 9);
            }
        }
        for seed in 0..10 {
            let split = HoldOutSplit::in_blocks(&campaign, seed);
            for split in [split.with_validation_set(&campaign, seed), split] {
                let train = |poses: std::ops::Range<usize>| {
                    split.training[poses].iter().filter(|trains| **trains).count()
                };
                assert!(train(380..420) >= 10, "seed {seed}: {}", split.description);
                assert!((230..=380).contains(&train(0..420)), "seed {seed}: {}", split.description);
            }
        }
    }

    #[test]
    fn quantiles_lie_between_their_neighbours() {
        let errors = PositionErrors { sorted_m: vec![1.0, 2.0, 3.0, 4.0, 5.0] };
        assert!((errors.mean() - 3.0).abs() < 1e-15);
        assert!((errors.quantile(0.5) - 3.0).abs() < 1e-15);
        assert!((errors.quantile(0.95) - 4.8).abs() < 1e-12);
        assert!((errors.max() - 5.0).abs() < 1e-15);
        assert!(PositionErrors::default().quantile(0.95).abs() < 1e-15);
    }
}
