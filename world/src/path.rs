//! Target position of the tool as a function of time: straight strokes joined by arcs, each from rest to rest.
//!
//! Position and direction are continuous along a stroke; speed, acceleration and jerk along it are
//! limited. An arc of radius r adds a centripetal acceleration of `v²/r`, as a step at its start.
//! Joint positions are computed in [`crate::joint_path`].

use crate::profile::{Limits, Profile};
use glam::{DMat3, DVec3};
use libm::{acos, sincos, sqrt, tan};
use physics::Frame;
use physics::frame::{rotation_about, rotation_from_vector};
use thiserror::Error;

/// The end of a straight line, and its cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Where the line ends, base frame, m.
    pub to_base: DVec3,
    /// The cut (0-based) along the line; `None` in air.
    pub cut: Option<usize>,
}

/// Target of the tool at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// Tool coordinates to base coordinates; its origin is the TCP.
    pub base_from_tool: Frame,
    /// Unit vector of the motion, base frame; at rest the previous one.
    pub direction_base: DVec3,
    /// Speed along the path, m/s.
    pub feed_m_s: f64,
    /// The present cut (0-based); `None` in air.
    pub cut: Option<usize>,
}

/// Why a path is not valid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum PathError {
    /// A stroke (0-based) has a feed, length or limit that is not finite and above zero.
    #[error("stroke {stroke}: feed, lengths and limits must be finite and above zero")]
    Numbers {
        /// 0-based stroke.
        stroke: usize,
    },
    /// A stroke turns back by more than 170° at an inner waypoint; end the stroke there.
    #[error("stroke {stroke} turns back at waypoint {waypoint}: end the stroke there instead")]
    TurnsBack {
        /// 0-based stroke.
        stroke: usize,
        /// 0-based waypoint.
        waypoint: usize,
    },
}

/// A path of the tool at constant orientation.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolPath {
    rotation: DMat3,
    position_base: DVec3,
    strokes: Vec<Stroke>,
}

#[derive(Clone, Debug, PartialEq)]
struct Stroke {
    pieces: Vec<Piece>,
    profile: Profile,
}

/// A line (`curvature` zero) or an arc that bends from `along` towards the unit vector `inward`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    from: DVec3,
    along: DVec3,
    inward: DVec3,
    curvature: f64,
    length: f64,
    cut: Option<usize>,
}

/// Rotation of a tool whose z axis points along the unit vector `direction_base`, by the shortest
/// rotation from `base_from_tool` (as at the zero configuration), which determines the rotation
/// about that axis.
pub fn tool_along(direction_base: DVec3, base_from_tool: DMat3) -> DMat3 {
    let z = base_from_tool.z_axis;
    let across = z.cross(direction_base);
    let sine = sqrt(across.length_squared());
    if sine < 1e-9 {
        let half_turn = rotation_about(base_from_tool.y_axis, core::f64::consts::PI);
        return if z.dot(direction_base) > 0.0 {
            base_from_tool
        } else {
            half_turn * base_from_tool
        };
    }
    let angle = libm::atan2(sine, z.dot(direction_base));
    rotation_from_vector(across * (angle / sine)) * base_from_tool
}

impl ToolPath {
    /// A path that starts at `start_base` (m) with the orientation `base_from_tool`.
    pub const fn new(start_base: DVec3, base_from_tool: DMat3) -> Self {
        Self { rotation: base_from_tool, position_base: start_base, strokes: Vec::new() }
    }

    /// Adds a stroke from the end of the path, through `waypoints`, from rest to rest at
    /// `feed_m_s`; corners are rounded with arcs of `blend_m` radius, smaller if a line is too
    /// short.
    ///
    /// # Errors
    /// Values that are not valid, or a corner that reverses the direction.
    pub fn stroke(
        &mut self,
        waypoints: &[Waypoint],
        feed_m_s: f64,
        blend_m: f64,
        limits: Limits,
    ) -> Result<(), PathError> {
        let stroke = self.strokes.len();
        let pieces = rounded(self.position_base, waypoints, blend_m, stroke)?;
        let length: f64 = pieces.iter().map(|piece| piece.length).sum();
        let numbers = [feed_m_s, blend_m, length, limits.acceleration_m_s2, limits.jerk_m_s3];
        let Some(last) = waypoints.last() else { return Err(PathError::Numbers { stroke }) };
        if !numbers.iter().all(|x| x.is_finite() && *x > 0.0) {
            return Err(PathError::Numbers { stroke });
        }
        self.strokes.push(Stroke { pieces, profile: Profile::new(length, feed_m_s, limits) });
        self.position_base = last.to_base;
        Ok(())
    }

    /// Its duration, s.
    pub fn duration_s(&self) -> f64 {
        self.strokes.iter().map(|stroke| stroke.profile.duration_s()).sum()
    }

    /// The target at `t_s`; at rest before the start and after the end.
    pub fn at(&self, t_s: f64) -> PathPoint {
        let mut t = t_s;
        let last = self.strokes.len().saturating_sub(1);
        for (i, stroke) in self.strokes.iter().enumerate() {
            if t < stroke.profile.duration_s() || i == last {
                return stroke.at(t, self.rotation);
            }
            t -= stroke.profile.duration_s();
        }
        self.point(self.position_base, DVec3::X, 0.0, None)
    }

    fn point(&self, origin: DVec3, along: DVec3, feed: f64, cut: Option<usize>) -> PathPoint {
        let base_from_tool = Frame::new(self.rotation, origin);
        PathPoint { base_from_tool, direction_base: along, feed_m_s: feed, cut }
    }
}

impl Stroke {
    fn at(&self, t: f64, rotation: DMat3) -> PathPoint {
        let motion = self.profile.at(t);
        let mut s = motion.distance_m;
        let mut pieces = self.pieces.iter().peekable();
        let mut reached = (DVec3::ZERO, DVec3::X, None);
        while let Some(piece) = pieces.next() {
            if s < piece.length || pieces.peek().is_none() {
                let (position, along) = piece.at(s.min(piece.length));
                reached = (position, along, piece.cut);
                break;
            }
            s -= piece.length;
        }
        PathPoint {
            base_from_tool: Frame::new(rotation, reached.0),
            direction_base: reached.1,
            feed_m_s: motion.speed_m_s,
            cut: reached.2,
        }
    }
}

impl Piece {
    fn at(&self, s: f64) -> (DVec3, DVec3) {
        if self.curvature == 0.0 {
            return (self.from + self.along * s, self.along);
        }
        let (sin, cos) = sincos(s * self.curvature);
        let radius = 1.0 / self.curvature;
        let position = self.from + (self.along * sin + self.inward * (1.0 - cos)) * radius;
        (position, self.along * cos + self.inward * sin)
    }
}

/// Lines between the waypoints, with each corner replaced by an arc; an arc belongs to the line
/// after it.
fn rounded(
    start: DVec3,
    waypoints: &[Waypoint],
    blend: f64,
    stroke: usize,
) -> Result<Vec<Piece>, PathError> {
    let mut pieces: Vec<Piece> = Vec::with_capacity(2 * waypoints.len());
    let mut from = start;
    for (i, waypoint) in waypoints.iter().enumerate() {
        let line = line(from, waypoint, stroke)?;
        pieces.push(line);
        if let Some(next) = waypoints.get(i + 1) {
            let ahead = self::line(waypoint.to_base, next, stroke)?;
            let turn = acos(line.along.dot(ahead.along).clamp(-1.0, 1.0));
            if turn > 170_f64.to_radians() {
                return Err(PathError::TurnsBack { stroke, waypoint: i });
            }
            from = waypoint.to_base;
            if turn > 1e-9 {
                from = round_corner(&mut pieces, &ahead, turn, blend);
            }
        }
    }
    Ok(pieces)
}

/// Shortens the last line and adds the arc after it; returns the end of the arc.
fn round_corner(pieces: &mut Vec<Piece>, ahead: &Piece, turn: f64, blend: f64) -> DVec3 {
    let Some(line) = pieces.last_mut() else { return ahead.from };
    let tangent = (blend * tan(0.5 * turn)).min(0.49 * line.length).min(0.49 * ahead.length);
    let radius = tangent / tan(0.5 * turn);
    line.length -= tangent;
    let across = ahead.along - line.along * ahead.along.dot(line.along);
    let arc = Piece {
        from: line.from + line.along * line.length,
        along: line.along,
        inward: across / sqrt(across.length_squared()),
        curvature: 1.0 / radius,
        length: radius * turn,
        cut: ahead.cut,
    };
    pieces.push(arc);
    ahead.from + ahead.along * tangent
}

fn line(from: DVec3, to: &Waypoint, stroke: usize) -> Result<Piece, PathError> {
    let way = to.to_base - from;
    let length = sqrt(way.length_squared());
    if !(length.is_finite() && length > 0.0) {
        return Err(PathError::Numbers { stroke });
    }
    let along = way / length;
    Ok(Piece { from, along, inward: DVec3::ZERO, curvature: 0.0, length, cut: to.cut })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner() -> ToolPath {
        let mut path = ToolPath::new(DVec3::ZERO, DMat3::IDENTITY);
        let to = |x, y, cut| Waypoint { to_base: DVec3::new(x, y, 0.0), cut };
        let waypoints = [to(0.0, 0.01, Some(0)), to(0.02, 0.01, Some(1))];
        path.stroke(&waypoints, 0.01, 0.002, Limits::default()).expect("a sound stroke");
        path
    }

    #[test]
    fn a_blended_corner_keeps_speed_and_bounds_acceleration() {
        let path = corner();
        let (dt, feed) = (1e-3, 0.01);
        let position_at = |t: f64| path.at(t).base_from_tool.origin;
        let bound = Limits::default().acceleration_m_s2 + feed * feed / 0.002;
        let mut t = dt;
        while t < path.duration_s() {
            let speed = ((position_at(t + dt) - position_at(t - dt)) / (2.0 * dt)).length();
            let acceleration = ((position_at(t + dt) - 2.0 * position_at(t) + position_at(t - dt))
                / (dt * dt))
                .length();
            assert!(speed <= feed * (1.0 + 1e-9), "{speed} at {t}");
            assert!(acceleration <= bound * (1.0 + 1e-3), "{acceleration} at {t}");
            assert!((speed - path.at(t).feed_m_s).abs() < 1e-5);
            t += dt;
        }
        assert!((position_at(path.duration_s()) - DVec3::new(0.02, 0.01, 0.0)).length() < 1e-15);
    }

    #[test]
    fn the_cut_changes_at_the_corner_and_the_direction_with_it() {
        let path = corner();
        let (early, late) = (path.at(0.4), path.at(path.duration_s() - 0.4));
        assert_eq!((early.cut, late.cut), (Some(0), Some(1)));
        assert!((early.direction_base - DVec3::Y).length() < 1e-12);
        assert!((late.direction_base - DVec3::X).length() < 1e-12);
    }

    #[test]
    fn a_stroke_that_turns_back_is_refused() {
        let mut path = ToolPath::new(DVec3::ZERO, DMat3::IDENTITY);
        let to = |x| Waypoint { to_base: DVec3::new(x, 0.0, 0.0), cut: None };
        let refused = path.stroke(&[to(1.0), to(0.5)], 0.01, 0.001, Limits::default());
        assert_eq!(refused, Err(PathError::TurnsBack { stroke: 0, waypoint: 0 }));
    }

    #[test]
    fn a_tool_turned_along_a_direction_points_there() {
        let forward = DMat3::from_cols(-DVec3::Z, DVec3::Y, DVec3::X);
        for direction in [-DVec3::Z, DVec3::Y, -DVec3::X, DVec3::X, DVec3::new(0.6, 0.0, -0.8)] {
            let rotation = tool_along(direction, forward);
            assert!((rotation.z_axis - direction).length() < 1e-14);
            assert!((rotation.determinant() - 1.0).abs() < 1e-14);
        }
    }
}
