//! Stability charts: the limit over spindle speed and over feed direction, and the nearest speed at
//! which a depth is stable.

use super::{Limit, Lobes, Stability, StabilityError};
use std::f64::consts::TAU;

/// Relative accuracy of the nearest stable speed.
const SPEED_TOLERANCE: f64 = 1e-3;

/// The limits at a spindle speed; `None`: above the largest depth of the chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLimits {
    /// Spindle speed, rev/min.
    pub spindle_rpm: f64,
    /// By the zeroth-order solution.
    pub zeroth_order: Option<Limit>,
    /// By semi-discretisation.
    pub limit: Option<Limit>,
}

/// The limits for a rotated feed direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedDirectionLimits {
    /// The angle, rad, counterclockwise seen from above.
    pub angle_rad: f64,
    /// By semi-discretisation; `None` where it is above the largest depth.
    pub limit: Option<Limit>,
    /// Limit of mode coupling without regeneration; `None` likewise.
    pub mode_coupling: Option<Limit>,
}

impl SpeedLimits {
    /// Whether a depth is below the limit by semi-discretisation.
    #[must_use]
    pub fn is_stable_at(&self, depth_m: f64) -> bool {
        self.limit.is_none_or(|limit| depth_m < limit.depth_m)
    }
}

/// The limits at `points` equally spaced spindle speeds, up to a depth.
///
/// # Errors
/// [`StabilityError::TooSlow`] at the first speed.
pub fn limits_by_speed(
    stability: &Stability,
    from_to_rpm: [f64; 2],
    points: usize,
    depth_max_m: f64,
) -> Result<Vec<SpeedLimits>, StabilityError> {
    let lobes = stability.lobes(depth_max_m);
    let [from, to] = from_to_rpm;
    let step = (to - from) / points.saturating_sub(1).max(1) as f64;
    let limits_of = |k: usize| point(stability, &lobes, from + k as f64 * step, depth_max_m);
    (0..points).map(limits_of).collect()
}

fn point(
    stability: &Stability,
    lobes: &Lobes,
    spindle_rpm: f64,
    depth_max_m: f64,
) -> Result<SpeedLimits, StabilityError> {
    let limit = stability.limit(spindle_rpm, depth_max_m)?;
    Ok(SpeedLimits { spindle_rpm, zeroth_order: lobes.limit(spindle_rpm), limit })
}

/// The spindle speed nearest to a given one, within a chart, at which a depth (below the chart's
/// largest) is below the limit; `None` if there is none.
///
/// # Errors
/// [`StabilityError::TooSlow`].
pub fn nearest_speed_rpm(
    stability: &Stability,
    chart: &[SpeedLimits],
    spindle_rpm: f64,
    depth_m: f64,
    depth_max_m: f64,
) -> Result<Option<f64>, StabilityError> {
    let holds = |rpm: f64| -> Result<bool, StabilityError> {
        let limit = stability.limit(rpm, depth_max_m)?;
        Ok(limit.is_none_or(|limit| depth_m < limit.depth_m))
    };
    if holds(spindle_rpm)? {
        return Ok(Some(spindle_rpm));
    }
    let distance = |point: &&SpeedLimits| (point.spindle_rpm - spindle_rpm).abs();
    let stable = chart.iter().filter(|point| point.is_stable_at(depth_m));
    let Some(found) = stable.min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
        return Ok(None);
    };
    // Bisection between this speed and its unstable neighbour towards the given speed, or the given
    // speed itself.
    let towards = |rpm: &f64| (rpm - found.spindle_rpm) * (spindle_rpm - found.spindle_rpm) > 0.0;
    let others = chart.iter().map(|point| point.spindle_rpm).chain([spindle_rpm]).filter(towards);
    let distance = |rpm: &f64| (rpm - found.spindle_rpm).abs();
    let neighbour =
        others.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(spindle_rpm);
    let (mut stable, mut unstable) = (found.spindle_rpm, neighbour);
    while (stable - unstable).abs() > SPEED_TOLERANCE * stable {
        let middle = 0.5 * (stable + unstable);
        if holds(middle)? { stable = middle } else { unstable = middle }
    }
    Ok(Some(stable))
}

/// The limits at a spindle speed for `angles` feed directions, equally spaced over a whole
/// revolution, starting at 0.
///
/// # Errors
/// [`StabilityError::TooSlow`].
pub fn limits_by_feed_direction(
    stability: &Stability,
    spindle_rpm: f64,
    angles: usize,
    depth_max_m: f64,
) -> Result<Vec<FeedDirectionLimits>, StabilityError> {
    let limits_of = |k: usize| {
        let angle_rad = TAU * k as f64 / angles as f64;
        let turned = stability.with_feed_rotated(angle_rad);
        let limit = turned.limit(spindle_rpm, depth_max_m)?;
        Ok(FeedDirectionLimits {
            angle_rad,
            limit,
            mode_coupling: turned.lobes(depth_max_m).mode_coupling(),
        })
    };
    (0..angles).map(limits_of).collect()
}
