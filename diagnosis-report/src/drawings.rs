//! Drawings shared by several pages: arm with tool errors, sizes of effects, effects by joint.
//!
//! The only values computed here are means of errors over the measurements of a pose.

use std::collections::BTreeMap;

use diagnosis::{Campaign, Fit, Reading};
use glam::DVec3;
use physics::{Arm, Chain, Joints};
use report::{ArmPicture, Axis, Bars, Cell, Column, Point, Role, Svg, Table, ToolError};

/// Joints whose total effect is at least this fraction of the largest are highlighted.
const HIGHLIGHTED_SHARE_LEAST: f64 = 0.3;
/// Values below this fraction of the largest are shown as zero.
const ZERO_SHARE_MOST: f64 = 1e-3;
/// Largest number of bars of a ranking.
const BARS_MOST: usize = 12;

/// An entry of a ranking.
pub struct RankedEffect {
    /// Label.
    pub name: String,
    /// Size in the unit of the ranking; `None` if unknown.
    pub size: Option<f64>,
}

/// An effect of one joint, or of the whole robot.
pub struct JointEffect {
    /// Name for users.
    pub effect: String,
    /// 1-based; `None` for effects of the whole robot.
    pub joint: Option<usize>,
    /// Size in the unit of the drawing.
    pub size: f64,
}

/// Positions of an arm's joints from the base on, followed by that of its tool; base frame, m.
pub fn joint_points(arm: &Arm, q: &Joints) -> Vec<Point> {
    let chain = Chain::nominal(arm, q);
    let joints = (0..arm.count()).map(|joint| chain.point(joint).to_array());
    joints.chain([Chain::tool_at(arm, q).origin.to_array()]).collect()
}

/// Errors of measured points with two fits, for the poses selected by `wanted`: one per pose, the mean over its points.
pub fn tool_errors(
    campaign: &Campaign,
    arm: &Arm,
    fits: [&Fit; 2],
    wanted: impl Fn(usize) -> bool,
) -> Vec<ToolError> {
    let [before, after] = fits.map(|fit| mean_error_by_pose(campaign, fit));
    let error = |(pose, before): (&usize, &DVec3)| {
        let q = &campaign.poses.get(*pose)?.inputs.q;
        let after = after.get(pose)?.to_array();
        let position = Chain::tool_at(arm, q).origin.to_array();
        Some(ToolError { at: position, before: before.to_array(), after })
    };
    before.iter().filter(|(pose, _)| wanted(**pose)).filter_map(error).collect()
}

/// Mean error of the measured points of each pose, base axes, m.
fn mean_error_by_pose(campaign: &Campaign, fit: &Fit) -> BTreeMap<usize, DVec3> {
    let readings: Vec<&Reading> = campaign
        .poses
        .iter()
        .flat_map(|pose| &pose.seen)
        .map(|observation| &observation.reading)
        .collect();
    let mut sums: BTreeMap<usize, (DVec3, f64)> = BTreeMap::new();
    for residual in fit.residuals(campaign) {
        let Some(Reading::Point { frame, .. }) = readings.get(residual.reading) else { continue };
        let Some(station) = fit.surroundings.frames.get(*frame) else { continue };
        let turn = station.value.measuring_from_base.rotation;
        let sum = sums.entry(residual.pose).or_default();
        *sum = (sum.0 + turn.transpose() * residual.residual, sum.1 + 1.0);
    }
    sums.into_iter().map(|(pose, (sum, count))| (pose, sum / count)).collect()
}

/// The arm at the most central measured pose, with the errors at its tool; `None` if no point was measured. `lit`: highlighted joints, 0-based.
pub fn arm_with_errors(
    arm: &Arm,
    campaign: &Campaign,
    errors: &[ToolError],
    lit: &[usize],
) -> Option<(Svg, f64)> {
    let count = errors.len() as f64;
    let middle: DVec3 = errors.iter().map(|one| DVec3::from_array(one.at)).sum::<DVec3>() / count;
    let away = |q: &Joints| Chain::tool_at(arm, q).origin.distance_squared(middle);
    let poses = campaign.poses.iter().map(|pose| &pose.inputs.q);
    let q = poses.min_by(|a, b| away(a).total_cmp(&away(b))).filter(|_| !errors.is_empty())?;
    let mut places = joint_points(arm, q);
    let tool = places.pop()?;
    let start = ArmPicture::new("Errors at the tool, before and after", tool);
    let joints = places.into_iter().enumerate();
    let picture = joints.fold(start, |picture, (joint, position)| {
        picture.joint((joint + 1).to_string(), position, lit.contains(&joint))
    });
    let picture = picture.errors(errors.iter().copied());
    Some((picture.render(), picture.magnified()))
}

/// Joints (0-based) with a total effect of at least 0.3 of the largest.
pub fn dominant_joints(joints: usize, found: &[JointEffect]) -> Vec<usize> {
    let mut sums = vec![0.0_f64; joints];
    for one in found {
        if let Some(sum) = one.joint.and_then(|joint| sums.get_mut(joint - 1)) {
            *sum = sum.hypot(one.size);
        }
    }
    let most = sums.iter().copied().fold(0.0, f64::max);
    let sums = sums.into_iter().enumerate();
    sums.filter(|(_, sum)| most > 0.0 && *sum >= HIGHLIGHTED_SHARE_LEAST * most)
        .map(|(joint, _)| joint)
        .collect()
}

/// Bars of the entries, largest first; `None` if no size is known.
pub fn ranking(
    title: &str,
    axis: Axis,
    found: impl IntoIterator<Item = RankedEffect>,
) -> Option<Svg> {
    let mut known: Vec<(String, f64)> =
        found.into_iter().filter_map(|one| Some((one.name, one.size?))).collect();
    known.sort_by(|a, b| b.1.total_cmp(&a.1));
    let bars = Bars::new(title, axis).roles([Role::After]);
    let shown = known.iter().take(BARS_MOST);
    (!known.is_empty())
        .then(|| shown.fold(bars, |bars, (name, size)| bars.row(name, [*size])).render())
}

/// Table with effects in rows and joints in columns; the effect with the largest total first.
pub fn effects_by_joint(caption: &str, joints: usize, found: &[JointEffect]) -> Table {
    let mut rows: Vec<(&str, Vec<f64>)> = Vec::new();
    for one in found {
        let column = one.joint.unwrap_or(joints + 1) - 1;
        let row = match rows.iter().position(|(effect, _)| *effect == one.effect) {
            Some(row) => row,
            None => {
                rows.push((&one.effect, vec![f64::NAN; joints + 1]));
                rows.len() - 1
            }
        };
        if let Some(cell) = rows.get_mut(row).and_then(|(_, cells)| cells.get_mut(column)) {
            let before = if cell.is_nan() { 0.0 } else { *cell };
            *cell = before.hypot(one.size);
        }
    }
    let all = |cells: &[f64]| cells.iter().filter(|x| !x.is_nan()).map(|x| x * x).sum::<f64>();
    rows.sort_by(|a, b| all(&b.1).total_cmp(&all(&a.1)));
    let robot = rows.iter().any(|(_, cells)| cells.last().is_some_and(|last| !last.is_nan()));
    let heads = (1..=joints).map(|joint| format!("Joint {joint}"));
    let heads = std::iter::once("Effect".to_owned()).chain(heads);
    let heads =
        heads.chain(robot.then(|| "Robot".to_owned())).map(|head| Column::new(head).digits(2));
    let largest = rows.iter().flat_map(|(_, cells)| cells).copied().fold(0.0, f64::max);
    rows.into_iter().fold(Table::new(caption, heads), |table, (effect, cells)| {
        let cell = |size: f64| match size {
            size if size.is_nan() => Cell::Text(String::new()),
            size if size < ZERO_SHARE_MOST * largest => Cell::Number(0.0),
            size => Cell::Number(size),
        };
        table.row(std::iter::once(Cell::from(effect)).chain(cells.into_iter().map(cell)))
    })
}
