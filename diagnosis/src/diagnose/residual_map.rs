//! Map of the differences between model and recording, by joint and covariate.
//!
//! In every cell (a joint, a covariate, a part of its range) the position error of that joint alone is estimated by least squares from all
//! measurements, with its standard uncertainty. Cells are ranked by significance. Input is the fit of the model as given, with frames and targets
//! estimated. A cell shows where the error is, not its cause: errors of other joints contribute as well.

use super::covariates::Covariate;
use crate::campaign::{Campaign, Reading, ToolPoint};
use crate::extrinsics::Extrinsics;
use crate::fit::FitSettings;
use crate::fit_result::Fit;
use crate::least_squares::{VisitScope, visit_poses, visit_readings};
use crate::score_test::ScoreTest;
use crate::tool_motion::ToolMotion;
use glam::DVec3;
use physics::{Chain, Frame, Joints, Model};

/// Number of intervals into which the range of a covariate is divided.
const PARTS_PER_COVARIATE: usize = 6;
/// Largest number of cells that are reported.
const CELLS_MAX: usize = 40;
/// Share of the largest displacement from which a channel is listed (RMS over the recording), and from which a pose belongs to a time interval.
const CHANNEL_SHARE_MIN: f64 = 0.5;
const INTERVAL_SHARE_MIN: f64 = 0.7;
/// Cells with a larger standard uncertainty are omitted, rad or m.
const SIGMA_MAX: f64 = 0.1;
/// Largest number of reported time intervals.
const INTERVALS_MAX: usize = 5;

/// One cell of the map.
#[derive(Clone, Debug)]
pub struct MapCell {
    /// Index of the joint whose error is estimated, from 0.
    pub joint: usize,
    /// Name of the covariate (docs/reference/results.md).
    pub word: String,
    /// Lower and upper limit of the covariate, SI.
    pub range: [f64; 2],
    /// Estimated position error of the joint, rad or m.
    pub off: f64,
    /// Its standard uncertainty, rad or m.
    pub sigma: f64,
}

/// The map of the model as given, the most significant cells first.
pub(super) fn map(
    campaign: &Campaign,
    given: &Fit,
    settings: &FitSettings<'_>,
    covariates: &[Covariate],
) -> Vec<MapCell> {
    let fitted = ScoreTest::new(campaign, given, settings);
    let arm = &given.hypothesis.model.arm;
    let joints = arm.count();
    let mut sums = vec![(0.0, 0.0); joints * covariates.len() * PARTS_PER_COVARIATE];
    let scope = VisitScope { used: Some(settings.used), derivatives: false };
    let (mut now, mut units) = (usize::MAX, Vec::new());
    visit_readings(campaign, &fitted.state, scope, |reading| {
        if now != reading.pose {
            now = reading.pose;
            let chain = Chain::nominal(arm, &campaign.poses[now].inputs.q);
            units = (0..joints).map(|joint| ToolMotion::of_joint(arm, &chain, joint)).collect();
        }
        let scale = fitted.weighing.scale(reading);
        for (joint, unit) in units.iter().enumerate() {
            let along = reading.rows.derivative_along(unit) * scale;
            let (information, pull) =
                (along.length_squared(), along.dot(reading.rows.residual) * scale);
            for (k, covariate) in covariates.iter().enumerate() {
                let part = (0.5
                    * (covariate.values[reading.pose] + 1.0)
                    * PARTS_PER_COVARIATE as f64) as usize;
                let cell = &mut sums[(joint * covariates.len() + k) * PARTS_PER_COVARIATE
                    + part.min(PARTS_PER_COVARIATE - 1)];
                (cell.0, cell.1) = (cell.0 + information, cell.1 + pull);
            }
        }
    });
    let mut cells = Vec::new();
    for (place, (information, pull)) in sums.into_iter().enumerate().filter(|(_, sum)| sum.0 > 0.0)
    {
        let (rest, part) = (place / PARTS_PER_COVARIATE, place % PARTS_PER_COVARIATE);
        let covariate = &covariates[rest % covariates.len()];
        let edge = |k: usize| {
            covariate.centre
                + covariate.half_range * (2.0 * k as f64 / PARTS_PER_COVARIATE as f64 - 1.0)
        };
        let sigma = (given.design_effect / information).sqrt();
        if sigma > SIGMA_MAX {
            continue;
        }
        cells.push(MapCell {
            joint: rest / covariates.len(),
            word: covariate.name.clone(),
            range: [edge(part), edge(part + 1)],
            off: pull / information,
            sigma,
        });
    }
    let clear = |cell: &MapCell| (cell.off / cell.sigma).abs();
    cells.sort_by(|a, b| clear(b).total_cmp(&clear(a)));
    cells.truncate(CELLS_MAX);
    cells
}

/// Where an effect is visible.
#[derive(Clone, Debug, Default)]
pub struct Visibility {
    /// Columns of the recording that it changes most.
    pub channels: Vec<String>,
    /// Time intervals in which it is largest, s.
    pub intervals_s: Vec<[f64; 2]>,
}

/// Predicted tool frame and joint deviations at each pose.
fn predicted_poses(campaign: &Campaign, model: &Model) -> Vec<(Frame, Joints)> {
    let mut places = Vec::with_capacity(campaign.poses.len());
    visit_poses(model, campaign, None, |_, evaluation, _| {
        places.push((evaluation.real.base_from_tool, evaluation.deviation.joints));
    });
    places
}

/// Difference of the predicted tool poses of two models, pose by pose.
pub(super) fn displacements(campaign: &Campaign, from: &Model, to: &Model) -> Vec<ToolMotion> {
    let pairs = predicted_poses(campaign, from).into_iter().zip(predicted_poses(campaign, to));
    pairs.map(|(below, above)| ToolMotion::between(&below, &above, 1.0)).collect()
}

/// Where the difference of two models is visible in the measurements.
pub(super) fn visibility(
    campaign: &Campaign,
    around: &Extrinsics,
    with: &Model,
    without: &Model,
) -> Visibility {
    let (with, without) = (predicted_poses(campaign, with), predicted_poses(campaign, without));
    let mut channels: Vec<(String, f64)> = Vec::new();
    let mut add = |name: String, square: f64| match channels.iter_mut().find(|c| c.0 == name) {
        Some(channel) => channel.1 += square,
        None => channels.push((name, square)),
    };
    let mut sizes = vec![0.0; campaign.poses.len()];
    for (k, pose) in campaign.poses.iter().enumerate() {
        let ((tool, joints), (other, other_joints)) = (&with[k], &without[k]);
        for reading in pose.seen.iter().map(|observation| &observation.reading) {
            match reading {
                Reading::Point { place, frame, .. } => {
                    let (prefix, point) = match place {
                        ToolPoint::Tcp => (String::new(), DVec3::ZERO),
                        ToolPoint::Target(t) => {
                            (format!("target{}_", t + 1), around.targets[*t].value)
                        }
                    };
                    let station = &around.frames[*frame].value.measuring_from_base;
                    let moved = station.rotation * (tool.point(point) - other.point(point));
                    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
                        add(format!("{prefix}{name}_mm"), moved[axis] * moved[axis]);
                    }
                    sizes[k] += moved.length_squared();
                }
                Reading::JointPosition { joint, .. } => {
                    let moved = joints[*joint] - other_joints[*joint];
                    add(format!("ql{}", joint + 1), moved * moved);
                    sizes[k] += moved * moved;
                }
                _ => {}
            }
        }
    }
    let most = channels.iter().map(|c| c.1).fold(0.0, f64::max);
    channels
        .retain(|channel| channel.1 >= CHANNEL_SHARE_MIN * CHANNEL_SHARE_MIN * most && most > 0.0);
    let channels = channels.into_iter().map(|channel| channel.0).collect();
    Visibility { channels, intervals_s: intervals(campaign, &sizes) }
}

/// The longest time intervals in which the effect is near its maximum.
fn intervals(campaign: &Campaign, sizes: &[f64]) -> Vec<[f64; 2]> {
    let most = sizes.iter().copied().fold(0.0, f64::max);
    let mut found: Vec<[f64; 2]> = Vec::new();
    let mut open = false;
    for (pose, size) in campaign.poses.iter().zip(sizes) {
        if pose.seen.is_empty() {
            continue;
        }
        let (acts, now) = (
            most > 0.0 && *size >= INTERVAL_SHARE_MIN * INTERVAL_SHARE_MIN * most,
            pose.inputs.time_s,
        );
        match found.last_mut().filter(|last| open && now >= last[1]) {
            Some(last) if acts => last[1] = now,
            _ if acts => found.push([now, now]),
            _ => {}
        }
        open = acts;
    }
    found.sort_by(|a, b| (b[1] - b[0]).total_cmp(&(a[1] - a[0])));
    found.truncate(INTERVALS_MAX);
    found.sort_by(|a, b| a[0].total_cmp(&b[0]));
    found
}
