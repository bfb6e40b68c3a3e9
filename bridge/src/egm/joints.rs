//! Positions of the joints in EGM messages: six among the robot's axes, a seventh as first external axis.

use trued_client::JOINTS_MAX;

use super::messages::Posture;

/// Order of the arm's joints in EGM messages.
#[derive(Debug, Clone, Copy)]
pub struct JointOrder {
    /// Number of joints of the arm.
    pub count: usize,
    /// Number of the robot's axes before the seventh joint; `None` without a seventh.
    pub seventh_after: Option<usize>,
}

impl JointOrder {
    /// Whether joint `i` is among the robot's axes, and its index there.
    fn wire_index(&self, i: usize) -> (bool, usize) {
        match self.seventh_after {
            Some(after) if i == after => (false, 0),
            Some(after) if i > after => (true, i - 1),
            _ => (true, i),
        }
    }

    /// Joints in the arm's order, rad; `None` if they are incomplete, too many or not finite.
    #[must_use]
    pub fn rad(&self, posture: &Posture) -> Option<[f64; JOINTS_MAX]> {
        let (joints, external) = (posture.joints.values(), posture.external.values());
        if joints.len() + usize::from(self.seventh_after.is_some()) != self.count {
            return None;
        }
        let mut q = [0.0; JOINTS_MAX];
        for (i, q) in q.iter_mut().enumerate().take(self.count) {
            let (is_axis, index) = self.wire_index(i);
            *q = if is_axis { joints.get(index) } else { external.get(index) }?.to_radians();
        }
        q.iter().all(|q| q.is_finite()).then_some(q)
    }

    /// Replaces each of the arm's joints in the datagram, degrees; other external axes are
    /// unchanged.
    pub fn write_joints(
        &self,
        datagram: &mut [u8],
        posture: &Posture,
        each: impl Fn(usize, f64) -> f64,
    ) {
        let mut joints = [0.0; JOINTS_MAX];
        joints.iter_mut().zip(posture.joints.values()).for_each(|(to, from)| *to = *from);
        for i in 0..self.count {
            match self.wire_index(i) {
                (true, index) => {
                    if let Some(joint) = joints.get_mut(index) {
                        *joint = each(i, *joint);
                    }
                }
                (false, _) => {
                    let first = posture.external.values().first().map(|joint| each(i, *joint));
                    posture.external.write(datagram, first.as_slice());
                }
            }
        }
        posture.joints.write(datagram, &joints);
    }
}
