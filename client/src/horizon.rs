//! The horizon: upcoming setpoints, as a message to the daemon.

use shm_schema::{Horizon, JOINTS_MAX};

use crate::{InvalidTarget, SendError};

/// Largest number of setpoints in a horizon; see [`Client::set_horizon`](crate::Client::set_horizon).
pub const HORIZON_POINTS_MAX: usize = Horizon::POINTS_MAX;

/// Copies the points, of `joints` numbers each, and returns their number, at most [`HORIZON_POINTS_MAX`]. On an error nothing is changed.
pub(crate) fn fill(
    horizon: &mut Horizon,
    points: &[f64],
    joints: usize,
) -> Result<usize, SendError> {
    if joints == 0 || joints > JOINTS_MAX {
        return Err(InvalidTarget::Joints(joints).into());
    }
    if !points.len().is_multiple_of(joints) {
        let (what, expected) = ("the number of values in a horizon", "a multiple of the joints");
        return Err(SendError::Invalid { what, value: points.len(), expected });
    }
    let count = (points.len() / joints).min(HORIZON_POINTS_MAX);
    let sent = &points[..count * joints];
    if let Some(place) = sent.iter().position(|q| !q.is_finite()) {
        let (point, joint) = (place / joints + 1, place % joints + 1);
        return Err(SendError::HorizonNotFinite { point, joint });
    }
    for (to, from) in horizon.points.iter_mut().zip(sent.chunks_exact(joints)) {
        to[..joints].copy_from_slice(from);
        to[joints..].fill(0.0);
    }
    horizon.count = count as u32;
    Ok(count)
}
