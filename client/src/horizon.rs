//! Setpoints that are known ahead of time, as a message to the daemon.

use shm_schema::{Horizon, JOINTS_MAX};

use crate::{NotATarget, NotSent};

/// Most setpoints of one horizon; see [`Client::set_horizon`](crate::Client::set_horizon).
pub const HORIZON_POINTS_MAX: usize = Horizon::POINTS_MAX;

/// Fills in the points, of `joints` numbers each, and returns how many there are: at most [`HORIZON_POINTS_MAX`]. On an error nothing is changed.
pub(crate) fn fill(horizon: &mut Horizon, points: &[f64], joints: usize) -> Result<usize, NotSent> {
    if joints == 0 || joints > JOINTS_MAX {
        return Err(NotATarget::Joints(joints).into());
    }
    if !points.len().is_multiple_of(joints) {
        let (what, expected) = ("the number of values in a horizon", "a multiple of the joints");
        return Err(NotSent::Invalid { what, value: points.len(), expected });
    }
    let count = (points.len() / joints).min(HORIZON_POINTS_MAX);
    let sent = &points[..count * joints];
    if let Some(place) = sent.iter().position(|q| !q.is_finite()) {
        let (point, joint) = (place / joints + 1, place % joints + 1);
        return Err(NotSent::HorizonNotFinite { point, joint });
    }
    for (to, from) in horizon.points.iter_mut().zip(sent.chunks_exact(joints)) {
        to[..joints].copy_from_slice(from);
        to[joints..].fill(0.0);
    }
    horizon.count = count as u32;
    Ok(count)
}
