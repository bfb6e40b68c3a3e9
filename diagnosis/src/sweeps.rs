//! Detection and analysis of single-joint sweeps in a campaign (thesis 3.1 to 3.2.7, 3.5, 3.7 to 3.18).
//!
//! A sweep is a sequence of poses in which one joint moves and all others are at rest. Its measurements are part of the global fit like all others;
//! here they are analysed separately, joint by joint, which needs no global model and reveals its errors.
//!
//! Removed gravity deflection is reported with its effect; a sweep without an axis is reported with the reason. The axes estimated here are
//! independent of a global fit, so that each can validate the other.

use crate::campaign::{Campaign, Pose, Reading, ToolPoint};
use crate::extrinsics::Extrinsics;
use crate::joint_error::JointErrors;
use crate::joint_regression::{SingleJointRegression, regress, thesis_model};
use crate::single_joint::{
    AxisError, JointAxis, SAME_STEP_RAD, SagCorrection, Step, Sweep, SweepError,
};
use glam::DVec3;
use physics::{Arm, JointKind, Model};

/// Smallest number of different positions in a sweep.
const STEPS_LEAST: usize = 5;
/// Smallest range of a sweep, rad.
const SWING_LEAST_RAD: f64 = 0.1;

/// A sweep with its location in a campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct LocatedSweep {
    /// The sweep; target 0 is the TCP, followed by the targets of the campaign.
    pub sweep: Sweep,
    /// Its recording, 0-based.
    pub recording: usize,
    /// Its first and last row, 0-based.
    pub rows: (usize, usize),
}

/// Results of one sweep.
#[derive(Clone, Debug)]
pub struct SweepResult {
    /// The sweep.
    pub found: LocatedSweep,
    /// The axis, or why it is not determined.
    pub axis: Result<JointAxis, SweepError>,
    /// Deviation of the axis from the nominal one.
    pub error: Option<AxisError>,
    /// Error of the joint at each step.
    pub errors: Option<JointErrors>,
}

/// Parameters of the thesis' model of one joint, from all sweeps of it.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSweepModel {
    /// 0-based.
    pub joint: usize,
    /// The fitted model.
    pub model: SingleJointRegression,
}

/// Relative position of two successive axes, independent of the measuring frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeAxes {
    /// Both joints, 0-based.
    pub joints: (usize, usize),
    /// Angle between the directions, 0 to π, rad.
    pub angle_rad: f64,
    /// Standard uncertainty of the angle, rad.
    pub sigma_angle_rad: f64,
    /// Shortest distance between the axes, m.
    pub distance_m: f64,
    /// Standard uncertainty of the distance, m.
    pub sigma_distance_m: f64,
}

/// The sweeps of a campaign, in the order of its poses. Points are transformed to the base frame by the stations of `surroundings`.
#[must_use]
pub fn sweeps(arm: &Arm, campaign: &Campaign, surroundings: &Extrinsics) -> Vec<LocatedSweep> {
    let measured: Vec<&Pose> = campaign.poses.iter().filter(|pose| has_point(pose)).collect();
    let mut found = Vec::new();
    let mut from = 0;
    while from < measured.len() {
        let (joint, end) = run(arm, &measured, from);
        let poses = &measured[from..end];
        let turns = |joint: &usize| arm.joints()[*joint].kind == JointKind::Revolute;
        let swept = joint.filter(turns).filter(|joint| is_sweep(poses, *joint));
        found.extend(swept.map(|joint| LocatedSweep {
            sweep: sweep(poses, joint, surroundings),
            recording: poses[0].recording,
            rows: (poses[0].row, poses[poses.len() - 1].row),
        }));
        // The last pose of a run may be the first of the next.
        from = if end > from + 1 { end - 1 } else { end };
        if end == measured.len() {
            break;
        }
    }
    found
}

fn has_point(pose: &Pose) -> bool {
    pose.seen.iter().any(|observation| matches!(observation.reading, Reading::Point { .. }))
}

/// The only joint that moves from pose `from` on, and the end of its run.
fn run(arm: &Arm, poses: &[&Pose], from: usize) -> (Option<usize>, usize) {
    let first = poses[from];
    let mut moving = None;
    for (end, pose) in poses.iter().enumerate().skip(from + 1) {
        let differ =
            |joint: &usize| (pose.inputs.q[*joint] - first.inputs.q[*joint]).abs() > SAME_STEP_RAD;
        let moved: Vec<usize> = (0..arm.count()).filter(differ).collect();
        let one = match moved.as_slice() {
            [] => moving,
            [one] if moving.is_none_or(|joint| joint == *one) => Some(*one),
            _ => return (moving, end),
        };
        if pose.recording != first.recording || pose.inputs.time_s < first.inputs.time_s {
            return (moving, end);
        }
        moving = one;
    }
    (moving, poses.len())
}

fn is_sweep(poses: &[&Pose], joint: usize) -> bool {
    let mut positions: Vec<f64> = poses.iter().map(|pose| pose.inputs.q[joint]).collect();
    positions.sort_by(f64::total_cmp);
    let steps = positions.chunk_by(|a, b| b - a <= SAME_STEP_RAD).count();
    let swing = positions.last().zip(positions.first()).map_or(0.0, |(high, low)| high - low);
    steps >= STEPS_LEAST && swing >= SWING_LEAST_RAD
}

fn sweep(poses: &[&Pose], joint: usize, surroundings: &Extrinsics) -> Sweep {
    let mut before: Option<f64> = None;
    let step = |pose: &&Pose| {
        let mut targets = vec![None; surroundings.targets.len() + 1];
        for observation in &pose.seen {
            if let Reading::Point { place, frame, at } = observation.reading {
                let station = &surroundings.frames[frame].value.measuring_from_base;
                let slot = match place {
                    ToolPoint::Tcp => 0,
                    ToolPoint::Target(target) => target + 1,
                };
                targets[slot] = Some(station.inverse().point(at));
            }
        }
        let mut inputs = pose.inputs;
        let q = inputs.q[joint];
        // Within a sweep the preceding row gives the direction of approach.
        if let Some(before) = before.filter(|before| *before != q) {
            inputs.direction[joint] = (q - before).signum();
        }
        before = Some(q);
        Step { inputs, targets }
    };
    Sweep { joint, steps: poses.iter().map(step).collect() }
}

/// Results of each sweep; `model` provides the gravity-dependent effects.
#[must_use]
pub fn analyse_sweeps(
    model: &Model,
    sag: SagCorrection,
    found: Vec<LocatedSweep>,
) -> Vec<SweepResult> {
    let one = |found: LocatedSweep| {
        let sweep = &found.sweep;
        let axis = sweep.axis(model, sag, None);
        let first = sweep.steps.first().map(|step| step.inputs.q);
        let error = axis.as_ref().ok().zip(first).and_then(|(axis, q)| axis.error(&model.arm, &q));
        let errors = axis.as_ref().ok().map(|axis| sweep.errors(model, axis, 0.0));
        SweepResult { found, axis, error, errors }
    };
    found.into_iter().map(one).collect()
}

/// The thesis' model of each joint with sweeps, from all its sweeps.
#[must_use]
pub fn joint_models(arm: &Arm, results: &[SweepResult]) -> Vec<JointSweepModel> {
    let one = |joint: usize| {
        let of_joint = results.iter().filter(|result| result.found.sweep.joint == joint);
        let errors: Vec<JointErrors> =
            of_joint.filter_map(|result| result.errors.clone()).collect();
        if errors.is_empty() {
            return None;
        }
        let model = regress(&thesis_model(arm, joint).ok()?, &errors);
        model.determined.contains(&true).then_some(JointSweepModel { joint, model })
    };
    (0..arm.count()).filter_map(one).collect()
}

/// Relative positions of successive axes, for sweeps with the preceding joints at the same positions.
#[must_use]
pub fn relative_axes(results: &[SweepResult]) -> Vec<RelativeAxes> {
    let mut list = Vec::new();
    for (k, first) in results.iter().enumerate() {
        let joint = first.found.sweep.joint;
        let next = results[k + 1..].iter().chain(&results[..k]).find(|next| {
            next.found.sweep.joint == joint + 1
                && next.found.recording == first.found.recording
                && have_equal_preceding_joints(&first.found.sweep, &next.found.sweep, joint)
        });
        if let Some(next) = next
            && let (Ok(a), Ok(b)) = (&first.axis, &next.axis)
        {
            list.push(between(a, b));
        }
    }
    list
}

/// Whether the joints before `joint` are at the same positions in both sweeps.
fn have_equal_preceding_joints(one: &Sweep, other: &Sweep, joint: usize) -> bool {
    let (Some(a), Some(b)) = (one.steps.first(), other.steps.first()) else { return false };
    (0..joint).all(|k| (a.inputs.q[k] - b.inputs.q[k]).abs() <= SAME_STEP_RAD)
}

fn between(a: &JointAxis, b: &JointAxis) -> RelativeAxes {
    let (d, e) = (a.axis.direction, b.axis.direction);
    let apart = b.axis.point - a.axis.point;
    let across = d.cross(e);
    let sin = across.length();
    let turn = |axis: &JointAxis| axis.axis.sigma_turn_rad().into_iter().fold(0.0, f64::max);
    let shift = |axis: &JointAxis| axis.axis.sigma_point_m().into_iter().fold(0.0, f64::max);
    let sigma_angle_rad = turn(a).hypot(turn(b));
    // If the axes are parallel within their uncertainty, the common normal is not determined.
    let (distance_m, lever) = if sin > 10.0 * sigma_angle_rad && sin > 1e-2 {
        let along: DVec3 = across / sin;
        (along.dot(apart).abs(), apart.length() / sin)
    } else {
        (d.cross(apart).length(), apart.length())
    };
    RelativeAxes {
        joints: (a.joint, b.joint),
        angle_rad: libm::atan2(sin, d.dot(e)),
        sigma_angle_rad,
        distance_m,
        sigma_distance_m: shift(a).hypot(shift(b)).hypot(lever * sigma_angle_rad),
    }
}

#[cfg(test)]
mod tests;
