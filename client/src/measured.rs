//! A measurement of the tool, with which the daemon checks whether its model still holds.

use shm_schema::{JOINTS_MAX, Operation, Request};

/// A measurement of the tool centre point, at rest and without external force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured<'a> {
    /// The joint targets sent for this pose (corrected ones, if corrected), rad (m if prismatic).
    pub joints: &'a [f64],
    /// Direction of approach of each joint, −1 or 1, 0 if unknown; can be shorter than `joints`.
    pub direction: &'a [i8],
    /// The tool centre point in the robot's base frame, m.
    pub point_m: [f64; 3],
    /// Standard uncertainty per axis, m, above zero: of the instrument and of the model (its held-out error) combined.
    pub sigma_m: f64,
    /// Temperature around the robot, °C; NaN where unknown.
    pub ambient_c: f64,
}

impl Measured<'_> {
    /// Excess values are dropped; the daemon refuses a wrong number of joints.
    pub(crate) fn request(&self) -> Request {
        let mut request = Request {
            operation: Operation::Measured.code(),
            joints: u32::try_from(self.joints.len()).unwrap_or(u32::MAX),
            point_m: self.point_m,
            sigma_m: self.sigma_m,
            ambient_c: self.ambient_c,
            ..Request::default()
        };
        request.q.iter_mut().zip(self.joints).take(JOINTS_MAX).for_each(|(to, q)| *to = *q);
        request.direction.iter_mut().zip(self.direction).for_each(|(to, side)| *to = *side);
        request
    }
}
