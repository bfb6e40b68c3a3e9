//! The limit over spindle speed and over the direction of feed, and the nearest speed at which a depth is stable.

use super::{Limit, Lobes, Stability, StabilityError};
use std::f64::consts::TAU;

/// Relative accuracy of the nearest stable speed.
const SPEED_TOLERANCE: f64 = 1e-3;

/// The limits at a spindle speed; `None` where they are above the largest depth of the chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Spindle speed, rev/min.
    pub spindle_rpm: f64,
    /// By the zeroth order.
    pub zeroth_order: Option<Limit>,
    /// By semi-discretisation.
    pub limit: Option<Limit>,
}

/// The limits with the feed turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turned {
    /// The angle, rad, counterclockwise seen from above.
    pub angle_rad: f64,
    /// By semi-discretisation; `None` where it is above the largest depth.
    pub limit: Option<Limit>,
    /// Limit of mode coupling without regeneration; `None` likewise.
    pub mode_coupling: Option<Limit>,
}

impl Point {
    /// Whether a depth is below the limit by semi-discretisation.
    #[must_use]
    pub fn holds(&self, depth_m: f64) -> bool {
        self.limit.is_none_or(|limit| depth_m < limit.depth_m)
    }
}

/// The limits at `count` spindle speeds, evenly from the first to the last, up to a depth.
///
/// # Errors
/// [`StabilityError::TooSlow`] at the first speed.
pub fn chart(
    stability: &Stability,
    from_to_rpm: [f64; 2],
    points: usize,
    depth_max_m: f64,
) -> Result<Vec<Point>, StabilityError> {
    let lobes = stability.lobes(depth_max_m);
    let [from, to] = from_to_rpm;
    let step = (to - from) / points.saturating_sub(1).max(1) as f64;
    let at = |k: usize| point(stability, &lobes, from + k as f64 * step, depth_max_m);
    (0..points).map(at).collect()
}

fn point(
    stability: &Stability,
    lobes: &Lobes,
    spindle_rpm: f64,
    depth_max_m: f64,
) -> Result<Point, StabilityError> {
    let limit = stability.limit(spindle_rpm, depth_max_m)?;
    Ok(Point { spindle_rpm, zeroth_order: lobes.limit(spindle_rpm), limit })
}

/// The spindle speed nearest to a given one at which a depth (below the chart's largest) is below
/// the limit, within a chart; `None` if there is none.
///
/// # Errors
/// [`StabilityError::TooSlow`].
pub fn nearest_speed_rpm(
    stability: &Stability,
    chart: &[Point],
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
    let far = |point: &&Point| (point.spindle_rpm - spindle_rpm).abs();
    let stable = chart.iter().filter(|point| point.holds(depth_m));
    let Some(found) = stable.min_by(|a, b| far(a).total_cmp(&far(b))) else { return Ok(None) };
    // Between it and its unstable neighbour towards the given speed, or that speed itself.
    let towards = |rpm: &f64| (rpm - found.spindle_rpm) * (spindle_rpm - found.spindle_rpm) > 0.0;
    let others = chart.iter().map(|point| point.spindle_rpm).chain([spindle_rpm]).filter(towards);
    let near = |rpm: &f64| (rpm - found.spindle_rpm).abs();
    let neighbour = others.min_by(|a, b| near(a).total_cmp(&near(b))).unwrap_or(spindle_rpm);
    let (mut stable, mut unstable) = (found.spindle_rpm, neighbour);
    while (stable - unstable).abs() > SPEED_TOLERANCE * stable {
        let middle = 0.5 * (stable + unstable);
        if holds(middle)? { stable = middle } else { unstable = middle }
    }
    Ok(Some(stable))
}

/// The limits at a spindle speed with the feed rotated by `count` equal angles over a whole turn,
/// starting at 0.
///
/// # Errors
/// [`StabilityError::TooSlow`].
pub fn turned(
    stability: &Stability,
    spindle_rpm: f64,
    angles: usize,
    depth_max_m: f64,
) -> Result<Vec<Turned>, StabilityError> {
    let at = |k: usize| {
        let angle_rad = TAU * k as f64 / angles as f64;
        let turned = stability.turned(angle_rad);
        let limit = turned.limit(spindle_rpm, depth_max_m)?;
        Ok(Turned { angle_rad, limit, mode_coupling: turned.lobes(depth_max_m).mode_coupling() })
    };
    (0..angles).map(at).collect()
}
