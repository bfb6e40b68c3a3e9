//! Gross errors of a recording, detected before identification: swapped columns, units, signs, a mirrored frame,
//! a wrong tool, misaligned rows.
//!
//! Each hypothesis is one change of the recording; the extrinsic parameters are fitted with and without it. A robot's error is a few millimetres; a
//! gross error causes centimetres, and only the right remedy removes it.
//!
//! A valid recording of an uncalibrated robot raises no suspicion; messages state the remedy. The recording itself is not changed.

mod link_positions;
mod partial_corruption;
mod targets;

pub use link_positions::detect_link_position_error;
pub use partial_corruption::detect_partial_corruption;

use crate::campaign::{Campaign, Reading, ToolPoint};
use crate::engine::statistics::median;
use crate::extrinsics::FitParameter;
use crate::rigid_motion::mean;
use glam::DVec3;
use physics::{Arm, JointKind, Joints, Model};
use std::f64::consts::{FRAC_PI_2, PI};

/// A remedy has to reduce the error to this fraction, and below [`UNEXPLAINED_FRACTION`].
const REMEDY: f64 = 0.25;
/// Remedies whose remaining error is within this factor of the best one are reported too.
const AS_GOOD: f64 = 1.3;
/// Remaining errors of two remedies are equal within this fraction.
const SAME: f64 = 1e-3;
/// Errors below this fraction of the workspace are not gross.
const GROSS: f64 = 4e-3;
/// Errors above this fraction of the workspace are gross, even if no remedy is known.
const UNEXPLAINED_FRACTION: f64 = 2e-2;
/// Errors below this are not gross, however small the motion, m.
const LEAST_M: f64 = 2e-3;
/// The same if no remedy is known: smaller errors may be those of the robot, m.
const UNEXPLAINED_LEAST_M: f64 = 5e-3;
/// In standard uncertainties of an instrument: three coordinates exceed this with a probability of one in a thousand (χ² with 3 degrees of freedom).
const NOISE_SIGMAS: f64 = 4.0;
/// Largest number of poses that are evaluated.
pub(crate) const POSES_MAX: usize = 150;

/// A suspected gross error, with the evidence for it.
#[derive(Clone, Debug, PartialEq)]
pub struct SuspectedError {
    /// Text for users: the error and its remedy.
    pub message: String,
    /// Median error of the worst target without a change, m (rad for a revolute joint).
    pub before_m: f64,
    /// The same with the remedy, m; equal to `before_m` if none is known.
    pub after_m: f64,
}

/// All gross errors of the campaign, given that `model` is the measured robot: [`detect_global_errors`] and [`detect_link_position_error`]; if there are none, [`detect_partial_corruption`].
#[must_use]
pub fn detect_gross_errors(campaign: &Campaign, model: &Model) -> Vec<SuspectedError> {
    let mut found = detect_global_errors(campaign, model);
    found.extend(detect_link_position_error(campaign, &model.arm));
    if found.is_empty() {
        found.extend(detect_partial_corruption(campaign, model));
    }
    found
}

/// Gross errors of the whole campaign, given that `model` is the measured robot; best remedy first.
#[must_use]
pub fn detect_global_errors(campaign: &Campaign, model: &Model) -> Vec<SuspectedError> {
    let few = thinned(campaign);
    let before_m = worst_target_error_m(&few, model);
    let spread_m = workspace_radius(&few);
    let noise_m = NOISE_SIGMAS * noise_m(&few);
    if before_m <= LEAST_M.max(GROSS * spread_m).max(noise_m) || few.poses.len() < 5 {
        return Vec::new();
    }
    let mut found: Vec<SuspectedError> = remedies(&few, model)
        .into_iter()
        .map(|(message, changed)| {
            let after_m = worst_target_error_m(&changed, model);
            (SuspectedError { message, before_m, after_m }, workspace_radius(&changed))
        })
        .filter(|(s, reach)| {
            s.after_m < REMEDY * before_m && s.after_m < UNEXPLAINED_FRACTION * reach
        })
        .map(|(suspected, _)| suspected)
        .collect();
    // Two remedies may be equivalent; of these the earlier one is taken, independent of rounding.
    let step =
        |suspected: &SuspectedError| (suspected.after_m.max(f64::MIN_POSITIVE).ln() / SAME).round();
    found.sort_by(|a, b| step(a).total_cmp(&step(b)));
    let best = found.first().map_or(0.0, |s| s.after_m);
    found.retain(|s| s.after_m <= AS_GOOD * best);
    if found.is_empty()
        && before_m > UNEXPLAINED_LEAST_M.max(UNEXPLAINED_FRACTION * spread_m).max(noise_m)
    {
        let message = format!(
            "{} was measured {:.0} mm from its predicted position, and no single swapped column, unit, sign or tool explains \
             it: check that the model is of this robot, that joints and measurement of each row belong together, and that the tracker was not moved \
             during a recording",
            targets::worst(&few, model),
            before_m * 1e3
        );
        found.push(SuspectedError { message, before_m, after_m: before_m });
    }
    found
}

/// Median error of the worst target with only the extrinsic parameters fitted, m; the maximum over targets, so that one bad target is not averaged
/// out.
fn worst_target_error_m(campaign: &Campaign, model: &Model) -> f64 {
    targets::medians(campaign, model).into_values().fold(0.0, f64::max)
}

/// Median stated standard uncertainty of a coordinate, m.
fn noise_m(campaign: &Campaign) -> f64 {
    let observations = campaign.poses.iter().flat_map(|pose| &pose.seen);
    let lengths = observations.filter(|observation| observation.reading.is_length());
    median(lengths.map(|observation| observation.whitening.x_axis.length().recip()))
}

/// Largest distance of a measured point from their mean, m: the scale for gross errors.
fn workspace_radius(campaign: &Campaign) -> f64 {
    let points: Vec<DVec3> = points(campaign).collect();
    let middle = mean(&points);
    let radius = points.iter().map(|p| (*p - middle).length()).fold(0.0, f64::max);
    if radius > 0.0 { radius } else { 1.0 }
}

fn points(campaign: &Campaign) -> impl Iterator<Item = DVec3> {
    campaign.poses.iter().flat_map(|pose| &pose.seen).filter_map(|observation| {
        match observation.reading {
            Reading::Point { at, .. } => Some(at),
            _ => None,
        }
    })
}

/// A subset of at most [`POSES_MAX`] measured poses, evenly spaced, without memory of the poses between them.
fn thinned(campaign: &Campaign) -> Campaign {
    let measured: Vec<_> = campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).collect();
    let step = measured.len().div_ceil(POSES_MAX).max(1);
    let poses = measured.into_iter().step_by(step).cloned().collect();
    let Campaign { surroundings, instruments, recordings, .. } = campaign;
    Campaign {
        poses,
        surroundings: surroundings.clone(),
        instruments: instruments.clone(),
        recordings: recordings.clone(),
    }
}

fn with_joints(campaign: &Campaign, change: impl Fn(&mut Joints)) -> Campaign {
    let mut changed = campaign.clone();
    changed.poses.iter_mut().for_each(|pose| change(&mut pose.inputs.q));
    changed
}

fn with_points(campaign: &Campaign, change: impl Fn(DVec3) -> DVec3) -> Campaign {
    let mut changed = campaign.clone();
    for observation in changed.poses.iter_mut().flat_map(|pose| &mut pose.seen) {
        if let Reading::Point { at, .. } = &mut observation.reading {
            *at = change(*at);
        }
    }
    changed
}

/// Each change that may correct a recording, with its description.
fn remedies(campaign: &Campaign, model: &Model) -> Vec<(String, Campaign)> {
    let mut list = of_joints(campaign, &model.arm);
    let mirrored = "the measuring frame is mirrored: one axis has the wrong sign, or two axes are swapped; correct the columns x, y, z";
    list.push((mirrored.to_owned(), with_points(campaign, |p| DVec3::new(-p.x, p.y, p.z))));
    for (factor, message) in [
        (1e3, "measured points are a factor of 1000 too small: m and mm are confused"),
        (1e-3, "measured points are a factor of 1000 too large: mm and m are confused"),
        (25.4, "measured points are in inches, not in mm"),
        (1.0 / 25.4, "measured points are in mm, not in inches"),
    ] {
        list.push((message.to_owned(), with_points(campaign, |p| p * factor)));
    }
    list.extend(targets::remedies(campaign, model));
    list.extend(of_rows(campaign));
    list.extend(of_tool(campaign));
    list
}

fn of_joints(campaign: &Campaign, arm: &Arm) -> Vec<(String, Campaign)> {
    let mut list = Vec::new();
    let turns = |joint: usize| arm.joints()[joint].kind == JointKind::Revolute;
    for (factor, message) in [
        (
            PI / 180.0,
            "the joint positions are in degrees, but radians are stated: name the columns q1_deg …",
        ),
        (
            180.0 / PI,
            "the joint positions are in radians, but degrees are stated: name the columns q1_rad …",
        ),
    ] {
        let change = |q: &mut Joints| {
            (0..arm.count()).filter(|joint| turns(*joint)).for_each(|joint| q[joint] *= factor);
        };
        list.push((message.to_owned(), with_joints(campaign, change)));
    }
    for i in 0..arm.count() {
        let message = format!("joint {} has the opposite sign: invert its column", i + 1);
        list.push((message, with_joints(campaign, |q| q[i] = -q[i])));
    }
    for i in 0..arm.count() {
        for j in i + 1..arm.count() {
            let message = format!("the columns of joints {} and {} are swapped", i + 1, j + 1);
            list.push((message, with_joints(campaign, |q| q.swap(i, j))));
        }
        // The offset of the first joint is confounded with the frame, that of the last joint with the targets: neither can be detected.
        for (turn, degrees) in [(FRAC_PI_2, 90), (-FRAC_PI_2, -90), (PI, 180)] {
            let message = format!("the zero of joint {} is {degrees} degrees off", i + 1);
            list.push((message, with_joints(campaign, |q| q[i] += turn)));
        }
    }
    list
}

/// Changes that assign measurements to the row before or after.
fn of_rows(campaign: &Campaign) -> Vec<(String, Campaign)> {
    let shifted = |later: bool| {
        let mut changed = campaign.clone();
        let count = changed.poses.len();
        for k in 1..count {
            let (shifted_row, source_row) = if later { (k - 1, k) } else { (k, k - 1) };
            let q = campaign.poses[source_row].inputs.q;
            changed.poses[shifted_row].inputs.q = q;
        }
        changed.poses.remove(if later { count - 1 } else { 0 });
        changed
    };
    [(false, "after"), (true, "before")]
        .map(|(later, side)| {
            let message = format!("each measurement is one row {side} its joint positions: shift the columns by one row");
            (message, shifted(later))
        })
        .to_vec()
}

/// A wrong tool: its known points are estimated instead.
fn of_tool(campaign: &Campaign) -> Vec<(String, Campaign)> {
    let mut changed = campaign.clone();
    let mut tcp = None;
    for observation in changed.poses.iter_mut().flat_map(|pose| &mut pose.seen) {
        if let Reading::Point { place: place @ ToolPoint::Tcp, .. } = &mut observation.reading {
            *place = ToolPoint::Target(*tcp.get_or_insert(campaign.surroundings.targets.len()));
        }
    }
    let known = campaign.surroundings.targets.iter().any(|target| !target.free);
    if tcp.is_none() && !known {
        return Vec::new();
    }
    for target in &mut changed.surroundings.targets {
        target.free = true;
    }
    if tcp.is_some() {
        changed.surroundings.targets.push(FitParameter::unknown(DVec3::ZERO));
    }
    let message = "the tool differs from the model: the measured point is elsewhere on the flange; correct `tcp_mm` (or the target positions)";
    vec![(message.to_owned(), changed)]
}

#[cfg(test)]
mod tests;
