//! Positions of the joints in EGM messages: six among the robot's axes, a seventh as first external axis.

use trued_client::JOINTS_MAX;

use super::messages::Posture;

/// The arm's joints, as EGM carries them.
#[derive(Debug, Clone, Copy)]
pub struct Order {
    /// How many joints the arm has.
    pub count: usize,
    /// After how many of the robot's axes the seventh stands in the arm; none: there is no seventh.
    pub seventh_after: Option<usize>,
}

impl Order {
    /// Joint `i`: whether it stands among the robot's axes, and where.
    fn place(&self, i: usize) -> (bool, usize) {
        match self.seventh_after {
            Some(after) if i == after => (false, 0),
            Some(after) if i > after => (true, i - 1),
            _ => (true, i),
        }
    }

    /// Joints in the arm's order, rad; none where they are not all there, too many, or no numbers.
    #[must_use]
    pub fn rad(&self, posture: &Posture) -> Option<[f64; JOINTS_MAX]> {
        let (joints, external) = (posture.joints.values(), posture.external.values());
        if joints.len() + usize::from(self.seventh_after.is_some()) != self.count {
            return None;
        }
        let mut q = [0.0; JOINTS_MAX];
        for (i, q) in q.iter_mut().enumerate().take(self.count) {
            let (is_axis, at) = self.place(i);
            *q = if is_axis { joints.get(at) } else { external.get(at) }?.to_radians();
        }
        q.iter().all(|q| q.is_finite()).then_some(q)
    }

    /// Changes each of the arm's joints in the datagram, degrees; external axes that are none of the arm's stay.
    pub fn put(&self, datagram: &mut [u8], posture: &Posture, each: impl Fn(usize, f64) -> f64) {
        let mut joints = [0.0; JOINTS_MAX];
        joints.iter_mut().zip(posture.joints.values()).for_each(|(to, from)| *to = *from);
        for i in 0..self.count {
            match self.place(i) {
                (true, at) => {
                    if let Some(joint) = joints.get_mut(at) {
                        *joint = each(i, *joint);
                    }
                }
                (false, _) => {
                    let first = posture.external.values().first().map(|joint| each(i, *joint));
                    posture.external.put(datagram, first.as_slice());
                }
            }
        }
        posture.joints.put(datagram, &joints);
    }
}
