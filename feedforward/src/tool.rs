//! Tool errors caused by joint errors: deviation from the target position at each instant, and distance from the path.
//!
//! With the controller's geometry (`physics::Chain::tool_at`). The distance from the path is that to the nearest point of the polygon through the target points,
//! searched within half a second; a tool that is only late on its path has zero distance.

use glam::DVec3;
use physics::{Arm, Chain, Joints};

/// The nearest point of the path is searched within this time before and after an instant, s.
const NEARBY_S: f64 = 0.5;

/// Largest and root mean square, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Size {
    /// m.
    pub largest_m: f64,
    /// m.
    pub rms_m: f64,
}

/// Errors of the tool on a path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolError {
    /// Distance from the target at that instant.
    pub in_time: Size,
    /// Distance from the nearest point of the path.
    pub from_path: Size,
}

/// Tool positions, row by row, m, base frame; joints as lists, rad or m.
#[must_use]
pub fn points(arm: &Arm, joints: &[Vec<f64>]) -> Vec<DVec3> {
    let rows = joints.first().map_or(0, Vec::len);
    let point_at = |row: usize| {
        let mut q = Joints::default();
        q.iter_mut().zip(joints).for_each(|(q, joint)| *q = joint[row]);
        Chain::tool_at(arm, &q).origin
    };
    (0..rows).map(point_at).collect()
}

/// The errors of a tool at `reached` with target `wanted`, every `step_s`.
#[must_use]
pub fn error(wanted: &[DVec3], reached: &[DVec3], step_s: f64) -> ToolError {
    let rows = (NEARBY_S / step_s).ceil() as usize;
    let in_time = wanted.iter().zip(reached).map(|(w, r)| w.distance(*r)).collect::<Vec<_>>();
    let from_path = (reached.iter().enumerate())
        .map(|(k, reached)| {
            let nearby = &wanted[k.saturating_sub(rows)..(k + rows + 1).min(wanted.len())];
            nearby.windows(2).map(|ends| distance(*reached, ends)).fold(in_time[k], f64::min)
        })
        .collect::<Vec<_>>();
    ToolError { in_time: size(&in_time), from_path: size(&from_path) }
}

fn distance(point: DVec3, ends: &[DVec3]) -> f64 {
    let (from, along) = (ends[0], ends[1] - ends[0]);
    let square = along.length_squared();
    let share =
        if square > 0.0 { ((point - from).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    point.distance(from + share * along)
}

fn size(distances: &[f64]) -> Size {
    let largest_m = distances.iter().copied().fold(0.0, f64::max);
    let square = distances.iter().map(|d| d * d).sum::<f64>() / distances.len().max(1) as f64;
    Size { largest_m, rms_m: square.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tool_that_is_late_is_still_on_its_path() {
        let path: Vec<DVec3> =
            (0..100).map(|k| DVec3::new(f64::from(k) * 1e-3, 0.0, 0.0)).collect();
        let late: Vec<DVec3> = (0..100).map(|k| path[(k as usize).saturating_sub(7)]).collect();
        let error = error(&path, &late, 4e-3);
        assert!((error.in_time.largest_m - 7e-3).abs() < 1e-12);
        assert!(error.from_path.largest_m < 1e-12);
    }
}
