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
    let in_time = wanted.iter().zip(reached).map(|(w, r)| w.distance(*r)).collect::<Vec<_>>();
    let from_path =
        nearest(wanted, reached, step_s).iter().map(|near| near.distance_m).collect::<Vec<_>>();
    ToolError { in_time: size(&in_time), from_path: size(&from_path) }
}

/// The point of a path nearest to the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// From the tool to it, m.
    pub distance_m: f64,
    /// Its place in rows of the path: row, and share of the way to the next one.
    pub place: f64,
}

/// The nearest points of the path, row by row.
#[must_use]
pub fn nearest(wanted: &[DVec3], reached: &[DVec3], step_s: f64) -> Vec<Nearest> {
    let nearby = (NEARBY_S / step_s).ceil() as usize;
    let mut along_m = Vec::with_capacity(wanted.len());
    let mut sum_m = 0.0;
    for (row, point) in wanted.iter().enumerate() {
        sum_m += row.checked_sub(1).map_or(0.0, |before| wanted[before].distance(*point));
        along_m.push(sum_m);
    }
    let of_row = |(row, point): (usize, &DVec3)| {
        let distance_m = wanted.get(row).map_or(f64::INFINITY, |target| target.distance(*point));
        let mut best = Nearest { distance_m, place: row as f64 };
        let last = (row + nearby).min(wanted.len().saturating_sub(1));
        let mut at = row.saturating_sub(nearby);
        while at < last {
            // No point less far along the path than the excess of this distance can be nearer.
            let spare_m = wanted[at].distance(*point) - best.distance_m;
            let skipped = along_m[at + 1..=last].partition_point(|s_m| s_m - along_m[at] < spare_m);
            if skipped > 0 {
                at += skipped;
                continue;
            }
            let (distance_m, share) = distance(*point, &wanted[at..=at + 1]);
            if distance_m < best.distance_m {
                best = Nearest { distance_m, place: at as f64 + share };
            }
            at += 1;
        }
        best
    };
    reached.iter().enumerate().map(of_row).collect()
}

/// Errors of the tool in each row: distance from the path, m, and orientation relative to that at the nearest point of the
/// path, rad; joints as lists, rad or m.
#[must_use]
pub fn row_errors(
    arm: &Arm,
    wanted: &[Vec<f64>],
    reached: &[Vec<f64>],
    step_s: f64,
) -> Vec<(f64, f64)> {
    let near = nearest(&points(arm, wanted), &points(arm, reached), step_s);
    let rotation = |joints: &dyn Fn(&Vec<f64>) -> f64, of: &[Vec<f64>]| {
        let mut q = Joints::default();
        q.iter_mut().zip(of).for_each(|(q, joint)| *q = joints(joint));
        Chain::tool_at(arm, &q).rotation
    };
    let error = |(row, near): (usize, &Nearest)| {
        let (from, share) = (near.place as usize, near.place.fract());
        let between = |joint: &Vec<f64>| {
            let next = joint[(from + 1).min(joint.len() - 1)];
            joint[from] + share * (next - joint[from])
        };
        let target = rotation(&between, wanted);
        let is = rotation(&|joint: &Vec<f64>| joint[row], reached);
        // Of a rotation by θ the difference has the Frobenius norm 2 √2 sin(θ/2).
        let difference = target - is;
        let square: f64 = difference.to_cols_array().iter().map(|x| x * x).sum();
        (near.distance_m, 2.0 * (0.125 * square).sqrt().min(1.0).asin())
    };
    near.iter().enumerate().map(error).collect()
}

/// Distance of a point from a segment, and the share of the segment at which it is nearest.
fn distance(point: DVec3, ends: &[DVec3]) -> (f64, f64) {
    let (from, along) = (ends[0], ends[1] - ends[0]);
    let square = along.length_squared();
    let share =
        if square > 0.0 { ((point - from).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    (point.distance(from + share * along), share)
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

    #[test]
    fn the_nearest_point_is_that_of_all_segments_nearby() {
        let at = |k: i32, scale: f64| {
            let t = 0.01 * f64::from(k);
            scale * DVec3::new(t.sin(), (1.7 * t).cos() * (0.3 * t).sin(), (2.3 * t).sin())
        };
        // With a rest, which has segments of no length.
        let path: Vec<DVec3> = (0..900).map(|k| at((k - 200).clamp(0, 500), 0.3)).collect();
        let reached: Vec<DVec3> = (0..900).map(|k| at((k - 230).clamp(0, 500), 0.29)).collect();
        for (row, near) in nearest(&path, &reached, 4e-3).iter().enumerate() {
            let all = &path[row.saturating_sub(125)..(row + 126).min(900)];
            let least = all
                .windows(2)
                .map(|ends| distance(reached[row], ends).0)
                .fold(f64::INFINITY, f64::min);
            assert!((near.distance_m - least).abs() < 1e-15, "{row}: {near:?} {least}");
        }
    }
}
