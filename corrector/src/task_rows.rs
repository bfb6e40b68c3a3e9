//! The task as rows: residual between the actual and the desired pose of the tool.
//!
//! Rows are in m; rotations are multiplied by the task's length.

use crate::normal_equations::ROWS;
use crate::outcome::Residual;
use crate::settings::Task;
use core::array;
use glam::{DMat3, DVec3};
use physics::frame::vector_from_rotation;
use physics::lanes::{Lanes, Vec3Lanes};
use physics::{Frame, Joints};

/// The error counts as zero below this, m: rounding of the geometry.
const ERROR_ZERO_M: f64 = 1e-14;

/// Axes and weights of the task's rows, m, rotations times the task's length: along the base axes
/// if all six count alike; along the axes of the desired tool pose if one of them is free.
pub(crate) struct TaskRows {
    desired: Frame,
    length_m: f64,
    pub(crate) free_tool_axis: bool,
}

impl TaskRows {
    /// For the tool pose that the command has by the nominal geometry.
    pub(crate) fn new(commanded: &Frame, task: &Task) -> Self {
        let desired = Frame { origin: commanded.origin + task.offset_m, ..*commanded };
        Self { desired, length_m: task.length_m, free_tool_axis: task.free_tool_axis }
    }

    /// A motion of the tool, m and rad in base axes.
    pub(crate) fn motion(&self, linear: DVec3, angular: DVec3) -> [f64; ROWS] {
        let (mut v, mut w) = (linear, angular * self.length_m);
        if self.free_tool_axis {
            let axes = self.desired.rotation;
            (v, w) = (axes.transpose_mul_vec3(v), axes.transpose_mul_vec3(w).with_z(0.0));
        }
        [v.x, v.y, v.z, w.x, w.y, w.z]
    }

    /// Motions of the tool with four joints, m and rad in base axes, into the places of these
    /// joints in each row.
    #[inline(always)]
    pub(crate) fn put_motions<S: Lanes>(
        &self,
        lanes: S,
        (linear, angular): (Vec3Lanes<S>, Vec3Lanes<S>),
        into: &mut [Joints; ROWS],
        k: usize,
    ) {
        let (mut v, mut w) = (linear, angular.times(lanes.splat(self.length_m)));
        if self.free_tool_axis {
            let DMat3 { x_axis, y_axis, z_axis } = self.desired.rotation;
            let [x, y, z] = [x_axis, y_axis, z_axis].map(|axis| Vec3Lanes::same(lanes, axis));
            v = Vec3Lanes::of(lanes, [x.dot(v), y.dot(v), z.dot(v)]);
            w = Vec3Lanes::of(lanes, [x.dot(w), y.dot(w), lanes.splat(0.0)]);
        }
        for (row, four) in into.iter_mut().zip([v.x, v.y, v.z, w.x, w.y, w.z]) {
            lanes.store(four, row, k);
        }
    }

    pub(crate) fn error(&self, linear: DVec3, angular: DVec3) -> TaskError {
        TaskError(self.motion(linear, angular))
    }

    /// The error of the actual tool pose.
    pub(crate) fn pose_error(&self, pose: &Frame) -> TaskError {
        let turn = vector_from_rotation(&(self.desired.rotation * pose.rotation.transpose()));
        self.error(self.desired.origin - pose.origin, turn)
    }
}

/// Difference between the desired and the actual tool pose, in [`TaskRows`].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TaskError(pub(crate) [f64; ROWS]);

impl TaskError {
    pub(crate) fn residual(&self, task: &Task) -> Residual {
        let [x, y, z, a, b, c] = self.0;
        Residual {
            m: DVec3::new(x, y, z).length(),
            rad: DVec3::new(a, b, c).length() / task.length_m,
        }
    }

    /// The error minus `done`.
    #[inline(always)]
    pub(crate) fn minus(&self, done: &[f64; ROWS]) -> Self {
        Self(array::from_fn(|row| self.0[row] - done[row]))
    }

    /// Whether the error is zero up to rounding: then even a singular pose has a solution.
    pub(crate) fn is_zero(&self) -> bool {
        self.0.iter().map(|x| x * x).sum::<f64>() < ERROR_ZERO_M * ERROR_ZERO_M
    }
}
