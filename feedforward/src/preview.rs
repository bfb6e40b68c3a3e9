//! Preview compensation: the commands that bring each joint, by the model, to its target position at each instant.
//!
//! The path is known ahead, so that commands can precede it by delay and lag, without exciting modes.

use crate::FeedforwardError;
use crate::bounds::{JointBounds, LimitedBy};
use crate::fourier::Transform;
use crate::grid::SourceRows;
use crate::path_check::{PathCheck, PathDeviation};
use crate::settings::Settings;
use crate::step::{BANDWIDTHS, CorrectionStep, Joint, StepInput};
use joint_dynamics::plant::{Plant, Plants};
use physics::Arm;
use realfft::num_complex::Complex64;

/// Shares of the delay that are left uncompensated, tried where the whole correction would take the tool further from
/// the path: a tool that is late stays on it, and needs smaller corrections.
const LATE_SHARES: [f64; 4] = [0.0, 0.35, 0.7, 1.0];
/// Rounding of a command at a joint limit, rad or m.
const LIMIT_ROUNDING: f64 = 1e-9;

/// Result of a preview; all in rad or m, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Preview {
    /// The commands.
    pub commanded: Vec<Vec<f64>>,
    /// Predicted positions without correction.
    pub without: Vec<Vec<f64>>,
    /// Predicted positions with the correction.
    pub with: Vec<Vec<f64>>,
    /// Per joint; `None` if there was nothing to compensate.
    pub joints: Vec<Option<CorrectionStep>>,
    /// A reduction of all corrections; `None` where none was necessary.
    pub reduced: Option<Reduction>,
}

/// A reduction of all corrections, so that the tool does not get further from its path than without them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reduction {
    /// Bandwidth of all joints, Hz; 0 where nothing is compensated.
    pub bandwidth_hz: f64,
    /// What all joints remain late, s.
    pub late_s: f64,
    /// Largest distances from the path by the model without the reduction.
    pub unreduced: PathDeviation,
    /// The limit that kept the corrections small in most rows; `None` if none did.
    pub limited_by: Option<LimitedBy>,
}

/// The commands for joints with targets `wanted` (a list per joint, rad or m, every `step_s`). The
/// path begins and ends at rest, for as long as [`lead_s`] states. `arm`: its joints limit the commands, and its tool
/// must not get further from the path than without correction; `None`: neither is considered.
///
/// # Errors
/// Settings out of their range, too few rows, a model without anything to compensate, a sampling
/// that is too coarse.
pub fn preview(
    plants: &Plants,
    arm: Option<&Arm>,
    step_s: f64,
    wanted: &[Vec<f64>],
    settings: &Settings,
) -> Result<Preview, FeedforwardError> {
    settings.check()?;
    settings.check_step("the path", step_s)?;
    if plants.is_empty() {
        return Err(FeedforwardError::NothingInTime);
    }
    let rows = wanted.first().map_or(0, Vec::len);
    if rows < crate::grid::ROWS_LEAST {
        return Err(FeedforwardError::TooShort(rows));
    }
    let transform = Transform::new(rows, step_s, settle_s(plants));
    let bounds = arm.map_or_else(Vec::new, JointBounds::of);
    let path = Path { plants, bounds: &bounds, transform: &transform, step_s, wanted, settings };
    let mut joints = path.joints();
    let mut reduced = None;
    if let Some(arm) = arm {
        let check = PathCheck::new(arm, plants, &transform, (step_s, wanted), settings);
        reduced = path.reduce(&check, &mut joints);
    }
    let responses = plants.joints.iter().map(|plant| path.response(plant));
    let responses: Vec<Vec<Complex64>> = responses.collect();
    let through = |joints: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let all = joints.iter().zip(&responses).zip(&plants.joints);
        let one = |((joint, response), plant): ((&Vec<f64>, &Vec<Complex64>), &Plant)| {
            let stays = plant.is_identity() || joint.iter().all(|q| *q == joint[0]);
            if stays { joint.clone() } else { transform.through(joint, response) }
        };
        all.map(one).collect()
    };
    let commanded = path.commanded(&joints);
    let (without, with) = (through(wanted), through(&commanded));
    Ok(Preview { commanded, without, with, joints, reduced })
}

/// Corrections of all joints that take the tool no further from its path.
struct Tried {
    /// Tracking error of the tool, m.
    rms_m: f64,
    bandwidth_hz: f64,
    late_s: f64,
    joints: Vec<Option<CorrectionStep>>,
}

/// A path whose commands are computed.
struct Path<'a> {
    plants: &'a Plants,
    /// None where they are unknown.
    bounds: &'a [JointBounds],
    transform: &'a Transform,
    step_s: f64,
    wanted: &'a [Vec<f64>],
    settings: &'a Settings,
}

impl Path<'_> {
    fn response(&self, plant: &Plant) -> Vec<Complex64> {
        self.transform.bins_hz().iter().map(|hz| plant.response(*hz)).collect()
    }

    /// A joint with something to compensate, and its error without correction.
    fn joint(&self, index: usize) -> Option<(Joint<'_>, Vec<f64>)> {
        let (plant, wanted) = (&self.plants.joints[index], &self.wanted[index]);
        let is_at_rest = wanted.iter().all(|q| *q == wanted[0]);
        if plant.is_identity() || is_at_rest {
            return None;
        }
        let bounds = self.bounds.get(index).copied().unwrap_or(JointBounds::NONE);
        let joint = joint_of(plant, (wanted, bounds), self.transform, self.step_s, self.settings);
        let without = self.transform.through(wanted, &joint.response());
        let error = wanted.iter().zip(&without).map(|(q, y)| q - y).collect();
        Some((joint, error))
    }

    /// The correction of each joint with the smallest error of its own.
    fn joints(&self) -> Vec<Option<CorrectionStep>> {
        let one = |index: usize| {
            let (joint, error) = self.joint(index)?;
            let spectrum = self.transform.spectrum(joint.wanted);
            Some(joint.step(&StepInput::Path(&spectrum), &vec![0.0; error.len()], &error))
        };
        (0..self.wanted.len()).map(one).collect()
    }

    fn commanded(&self, joints: &[Option<CorrectionStep>]) -> Vec<Vec<f64>> {
        let one = |(wanted, joint): (&Vec<f64>, &Option<CorrectionStep>)| match joint {
            Some(stepped) => wanted.iter().zip(&stepped.correction).map(|(q, c)| q + c).collect(),
            None => wanted.clone(),
        };
        self.wanted.iter().zip(joints).map(one).collect()
    }

    /// Reduces the corrections of all joints where they would take the tool further from the path: to the
    /// bandwidth and the common delay with the smallest tracking error that do not.
    fn reduce(
        &self,
        check: &PathCheck<'_>,
        joints: &mut [Option<CorrectionStep>],
    ) -> Option<Reduction> {
        let full = self.commanded(joints);
        if check.is_no_worse(&full) {
            return None;
        }
        let unreduced = check.deviation(&full);
        let mut best: Option<Tried> = None;
        for place in 0..BANDWIDTHS {
            for (late_s, tried) in self.late(place) {
                let commanded = self.commanded(&tried);
                let rms_m = check.in_time_rms_m(&commanded);
                let is_better = best.as_ref().is_none_or(|best| rms_m < best.rms_m);
                if is_better && check.is_no_worse(&commanded) {
                    let hz = tried.iter().flatten().map(|joint| joint.bandwidth_hz);
                    let bandwidth_hz = hz.fold(0.0, f64::max);
                    best = Some(Tried { rms_m, bandwidth_hz, late_s, joints: tried });
                }
            }
        }
        let limited_by = main_limit(joints);
        let (bandwidth_hz, late_s, reduced) = match best {
            Some(best) => (best.bandwidth_hz, best.late_s, best.joints),
            None => (0.0, 0.0, self.uncompensated()),
        };
        // What limited the corrections in the first place also made them smaller now.
        for (joint, reduced) in joints.iter_mut().zip(reduced) {
            if let (Some(joint), Some(mut reduced)) = (joint.as_mut(), reduced) {
                reduced.limited = std::mem::take(&mut joint.limited);
                *joint = reduced;
            }
        }
        Some(Reduction { bandwidth_hz, late_s, unreduced, limited_by })
    }

    /// The corrections at one of the bandwidths that leave a share of the delay, by the delay that is left, s.
    fn late(&self, place: i32) -> Vec<(f64, Vec<Option<CorrectionStep>>)> {
        let delay_s = self.plants.joints.iter().map(Plant::delay_s).fold(0.0, f64::max);
        let has_delay = delay_s > 0.0;
        let shares = LATE_SHARES.into_iter().filter(|share| has_delay || *share == 0.0);
        let with = |share: f64| {
            let one = |index: usize| {
                let (joint, error) = self.joint(index)?;
                let mut early = joint.plant.clone();
                early.delays_s.iter_mut().for_each(|delay| delay.value *= 1.0 - share);
                let designed = Joint { plant: &early, ..joint };
                let spectrum = self.transform.spectrum(joint.wanted);
                let request = designed.preview_request(place, &spectrum);
                Some(joint.bounded_preview(place, &request, &error))
            };
            (share * delay_s, (0..self.wanted.len()).map(one).collect())
        };
        shares.map(with).collect()
    }

    /// No correction of any joint.
    fn uncompensated(&self) -> Vec<Option<CorrectionStep>> {
        let one = |index: usize| {
            let (_, residual) = self.joint(index)?;
            let rows = residual.len();
            let (correction, limited) = (vec![0.0; rows], vec![None; rows]);
            Some(CorrectionStep { correction, residual, bandwidth_hz: 0.0, limited })
        };
        (0..self.wanted.len()).map(one).collect()
    }
}

/// The limit that reduced corrections in most rows.
fn main_limit(joints: &[Option<CorrectionStep>]) -> Option<LimitedBy> {
    let mut rows: Vec<LimitedBy> =
        joints.iter().flatten().flat_map(|joint| joint.limited.iter().flatten().copied()).collect();
    rows.sort_unstable();
    rows.chunk_by(|a, b| a == b).max_by_key(|same| same.len()).map(|same| same[0])
}

/// Checks that commands at `times_s` stay within the limits of the joints; `source`: the rows of the file.
///
/// # Errors
/// The first command beyond a limit.
pub fn check_joint_limits(
    arm: &Arm,
    commanded: &[Vec<f64>],
    times_s: &[f64],
    source: &SourceRows,
) -> Result<(), FeedforwardError> {
    for (index, (joint, commanded)) in arm.joints().iter().zip(commanded).enumerate() {
        let (lower, upper) = joint.limits;
        if let Some(row) = commanded
            .iter()
            .position(|q| !(lower - LIMIT_ROUNDING..=upper + LIMIT_ROUNDING).contains(q))
        {
            let (joint, position) = (index + 1, commanded[row]);
            let at = source.at(times_s.get(row).copied().unwrap_or(f64::NAN));
            return Err(FeedforwardError::JointLimit { at, joint, position, lower, upper });
        }
    }
    Ok(())
}

/// For how long a path is at rest at both ends, s: the delay and five time constants of the slowest joint, and three periods of the bandwidth.
#[must_use]
pub fn lead_s(plants: &Plants, settings: &Settings) -> f64 {
    let slowest = plants.joints.iter().map(Plant::response_time_s).fold(0.0, f64::max);
    slowest + 3.0 / settings.bandwidth_hz
}

/// A joint on a path whose correction fades over a period of the bandwidth at both ends.
pub(crate) fn joint_of<'a>(
    plant: &'a Plant,
    (wanted, bounds): (&'a [f64], JointBounds),
    transform: &'a Transform,
    step_s: f64,
    settings: &'a Settings,
) -> Joint<'a> {
    let fade_rows = (1.0 / settings.bandwidth_hz / step_s).ceil() as usize;
    Joint { plant, wanted, bounds, transform, step_s, fade_rows, settings }
}

/// Rest of a path in its transform, s: until every mode has decayed.
pub(crate) fn settle_s(plants: &Plants) -> f64 {
    plants
        .joints
        .iter()
        .map(|plant| plant.response_time_s() + plant.decay_time_s())
        .fold(1.0, f64::max)
}

#[cfg(test)]
mod tests;
