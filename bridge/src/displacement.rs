//! Displacement of the tool by a correction of the joints, in the controller's geometry.
//!
//! No allocation. Effects are evaluated by the daemon only.

use glam::DVec3;
use physics::{Arm, Chain, Frame, JOINTS_MAX, Joints};

/// Motions shorter than this give no direction, m.
const MOVE_MIN_M: f64 = 1e-6;
/// Sine of the angle below which two directions count as parallel.
const PARALLEL_SINE: f64 = 1e-3;

/// Tool pose at `q`, and with `correction` added, rad.
pub(crate) fn tool_poses(arm: &Arm, q: &[f64], correction: &[f64; JOINTS_MAX]) -> (Frame, Frame) {
    let mut positions: Joints = [0.0; JOINTS_MAX];
    positions.iter_mut().zip(q).for_each(|(to, q)| *to = *q);
    let before = Chain::nominal(arm, &positions).base_from_tool;
    positions.iter_mut().zip(correction).for_each(|(q, more)| *q += more);
    (before, Chain::nominal(arm, &positions).base_from_tool)
}

/// The frame of a path: x along it, y = tool z × x, z = x × y.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PathFrame {
    before: Option<DVec3>,
    across: Option<(DVec3, DVec3)>,
}

impl PathFrame {
    /// Advances the path to `tool`. At rest, or along the tool's z, the frame is kept.
    pub(crate) fn advance(&mut self, tool: &Frame) {
        let Some(before) = self.before else {
            self.before = Some(tool.origin);
            return;
        };
        let moved = tool.origin - before;
        if moved.length() < MOVE_MIN_M {
            return;
        }
        self.before = Some(tool.origin);
        let along = moved.normalize();
        let across = tool.rotation.z_axis.cross(along);
        if across.length() > PARALLEL_SINE {
            let y = across.normalize();
            self.across = Some((y, along.cross(y)));
        }
    }

    /// Components of a shift (m, base axes) along y and z of the path, m; zero before the path has
    /// a direction.
    pub(crate) fn across(&self, shift: DVec3) -> (f64, f64) {
        self.across.map_or((0.0, 0.0), |(y, z)| (y.dot(shift), z.dot(shift)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    fn pose(x: f64, y: f64) -> Frame {
        // A tool that points down.
        let down = DMat3::from_cols(DVec3::X, -DVec3::Y, -DVec3::Z);
        Frame::new(down, DVec3::new(x, y, 0.5))
    }

    #[test]
    fn components_across_a_path_exclude_the_one_along_it() {
        let mut path = PathFrame::default();
        path.advance(&pose(0.0, 0.0));
        assert_eq!(path.across(DVec3::ONE), (0.0, 0.0), "no direction yet");
        path.advance(&pose(0.01, 0.0));
        let (y, z) = path.across(DVec3::new(0.5, 0.2, 0.1));
        assert!((y + 0.2).abs() < 1e-15 && (z + 0.1).abs() < 1e-15, "{y} {z}");
        path.advance(&pose(0.01, 0.0));
        assert_eq!(path.across(DVec3::new(0.5, 0.2, 0.1)), (y, z), "standing still it stays");
        path.advance(&pose(0.01, 0.01));
        let (y, _) = path.across(DVec3::new(0.5, 0.2, 0.1));
        assert!((y - 0.5).abs() < 1e-15, "round the corner: {y}");
    }
}
