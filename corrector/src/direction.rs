//! Direction of the last motion of each joint, with a deadband against encoder noise.
//!
//! Invariant: a reversal is detected only after the command has moved by the deadband against the
//! last motion. It gives directions, no speed.

use physics::{JOINTS_MAX, Joints};

/// The turning points of all joints.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Directions {
    signs: Joints,
    /// The furthest position reached in the present direction.
    furthest: Joints,
}

impl Directions {
    /// No joint has moved yet.
    pub(crate) fn starting_at(q: &Joints) -> Self {
        Self { signs: [0.0; JOINTS_MAX], furthest: *q }
    }

    /// Takes a new position; `dead_band` in rad or m.
    pub(crate) fn update(&mut self, q: &Joints, dead_band: f64) {
        for ((sign, furthest), q) in self.signs.iter_mut().zip(&mut self.furthest).zip(q) {
            let moved = q - *furthest;
            if moved * *sign > 0.0 {
                *furthest = *q;
            } else if moved.abs() > dead_band {
                *sign = moved.signum();
                *furthest = *q;
            }
        }
    }

    /// −1, 0 (not moved yet) or 1 per joint.
    pub(crate) fn signs(&self) -> &Joints {
        &self.signs
    }
}
