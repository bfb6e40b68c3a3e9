//! A measurement of the tool, by which the daemon checks whether its model still holds.

use shm_schema::{JOINTS_MAX, Operation, Request};

/// Where the tool centre point was measured, at rest and with nothing pulling at the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured<'a> {
    /// The joint positions that were published there (corrected ones, where corrected), rad (m where prismatic).
    pub joints: &'a [f64],
    /// From which side each joint came, −1 or 1, 0 where unknown; may be shorter than `joints`.
    pub direction: &'a [i8],
    /// The tool centre point in the robot's base frame, m.
    pub point_m: [f64; 3],
    /// Standard uncertainty of each of its numbers, m, above zero: instrument and model together, as the model was proven.
    pub sigma_m: f64,
    /// Temperature around the robot, °C; NaN where unknown.
    pub ambient_c: f64,
}

impl Measured<'_> {
    /// Numbers beyond what a request holds are left out; the daemon refuses a wrong count of joints.
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
