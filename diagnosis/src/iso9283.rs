//! Pose accuracy and repeatability according to ISO 9283.
//!
//! Source: ISO 9283:1998, pose and distance characteristics; its symbols in brackets. `l̄` and `S_l` are mean and standard deviation (divisor n − 1)
//! of the attained positions' distances from their barycentre. Orientations are rotation vectors relative to the commanded orientation, in the
//! measuring axes: for small rotations these are the standard's angles a, b, c about x, y, z.
//!
//! Units: m and rad. No frame is fitted, which would hide errors of accuracy. Test conditions of the standard (30 visits, five poses of a cube, the
//! rated load) are the responsibility of the caller.

use glam::{DQuat, DVec3};
use thiserror::Error;

/// A commanded or attained pose; all poses in one frame (measuring frame transformed to the base).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Position, m.
    pub position_m: DVec3,
    /// Unit quaternion from tool axes to the axes of the frame; `None` if only points were measured.
    pub orientation: Option<DQuat>,
}

/// Accuracy and repeatability at one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseFigures {
    /// Visits, n.
    pub visits: usize,
    /// Positioning accuracy (`AP_P`), m: from the command to the barycentre.
    pub accuracy_m: f64,
    /// Its components (`AP_x`, `AP_y`, `AP_z`), m: barycentre minus command.
    pub accuracy_xyz_m: DVec3,
    /// Orientation accuracy (`AP_a`, `AP_b`, `AP_c`), rad: mean minus command.
    pub accuracy_abc_rad: Option<DVec3>,
    /// Positioning repeatability (`RP_l = l̄ + 3 S_l`), m.
    pub repeatability_m: f64,
    /// Mean distance from the barycentre (`l̄`), m.
    pub mean_distance_m: f64,
    /// Standard deviation of that distance (`S_l`), m.
    pub distance_deviation_m: f64,
    /// Orientation repeatability (`RP_a`, `RP_b`, `RP_c` = ±3 S), rad.
    pub repeatability_abc_rad: Option<DVec3>,
}

/// How accuracy and repeatability change while the robot warms up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Largest change of the positioning accuracy against the first cycle (`dAP_P`), m.
    pub accuracy_m: f64,
    /// Largest change of the orientation accuracy (`dAP_a`, `dAP_b`, `dAP_c`), rad.
    pub accuracy_abc_rad: Option<DVec3>,
    /// Largest change of the repeatability (`dRP_P`), m.
    pub repeatability_m: f64,
    /// Largest distance of a later barycentre from the first, m. Not part of the standard: a barycentre that moves around the command keeps its
    /// accuracy although it drifts.
    pub travel_m: f64,
}

/// Accuracy and repeatability of the distance between two poses. Orientation figures refer to the difference of the two orientations, in the axes of
/// the first commanded pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceFigures {
    /// Pairs of visits, n.
    pub visits: usize,
    /// Distance accuracy (`AD_P`), m: mean minus command.
    pub accuracy_m: f64,
    /// Its components (`AD_x`, `AD_y`, `AD_z`), m, of the distance along each axis.
    pub accuracy_xyz_m: DVec3,
    /// Accuracy of the orientation difference (`AD_a`, `AD_b`, `AD_c`), rad.
    pub accuracy_abc_rad: Option<DVec3>,
    /// Distance repeatability (`RD` = ±3 S), m.
    pub repeatability_m: f64,
    /// Its components (`RD_x`, `RD_y`, `RD_z`), m.
    pub repeatability_xyz_m: DVec3,
    /// Repeatability of the orientation difference (`RD_a`, `RD_b`, `RD_c`), rad.
    pub repeatability_abc_rad: Option<DVec3>,
}

/// Why no figures can be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum IsoError {
    /// Nothing to evaluate.
    #[error("no pose was measured at two or more visits: nothing to evaluate")]
    NoVisits,
    /// Too few visits for a standard deviation.
    #[error("a pose was visited {0} times: a standard deviation needs 2, the standard requires 30")]
    Visits(usize),
    /// Too few groups to compare.
    #[error("there are {0} groups of visits: a comparison needs 2")]
    Groups(usize),
    /// A value is not finite.
    #[error(
        "visit {visit} (from 1) has a position or orientation that is not finite: leave it out"
    )]
    NotFinite {
        /// 1-based; 0 is the command.
        visit: usize,
    },
    /// A quaternion is not of unit length.
    #[error(
        "visit {visit} (from 1; 0 is the command) has a quaternion off unit length by more than 1e-3"
    )]
    NoRotation {
        /// 1-based; 0 is the command.
        visit: usize,
    },
}

impl Placement {
    /// A point without orientation.
    #[must_use]
    pub const fn point(position_m: DVec3) -> Self {
        Self { position_m, orientation: None }
    }

    fn check(&self, visit: usize) -> Result<(), IsoError> {
        let turn = self.orientation.unwrap_or(DQuat::IDENTITY);
        if !self.position_m.is_finite() || !turn.is_finite() {
            return Err(IsoError::NotFinite { visit });
        }
        if (turn.length() - 1.0).abs() > 1e-3 {
            Err(IsoError::NoRotation { visit })
        } else {
            Ok(())
        }
    }

    /// Rotation vector from `reference` to this orientation, in the measuring axes, rad; `None` if either is unknown.
    fn angles_from(&self, reference: &Self) -> Option<DVec3> {
        let turn = (self.orientation? * reference.orientation?.inverse()).normalize();
        let shorter = if turn.w < 0.0 { -turn } else { turn };
        Some(shorter.to_scaled_axis())
    }
}

/// Figures of one pose that was visited repeatedly, always from the same direction.
///
/// # Errors
/// Fewer than two visits, or values that are not finite.
pub fn pose_figures(command: &Placement, attained: &[Placement]) -> Result<PoseFigures, IsoError> {
    check(command, attained)?;
    let barycentre = mean(attained.iter().map(|visit| visit.position_m));
    let distances: Vec<f64> =
        attained.iter().map(|visit| visit.position_m.distance(barycentre)).collect();
    let (mean_distance_m, distance_deviation_m) = spread(&distances);
    let angles = angles(command, attained);
    let accuracy_xyz_m = barycentre - command.position_m;
    Ok(PoseFigures {
        visits: attained.len(),
        accuracy_m: accuracy_xyz_m.length(),
        accuracy_xyz_m,
        accuracy_abc_rad: angles.as_ref().map(|angles| mean(angles.iter().copied())),
        repeatability_m: mean_distance_m + 3.0 * distance_deviation_m,
        mean_distance_m,
        distance_deviation_m,
        repeatability_abc_rad: angles.map(|angles| three_deviations(&angles)),
    })
}

/// Drift at one pose; one group of visits per measuring cycle, in the order of time.
///
/// # Errors
/// Fewer than two cycles, fewer than two visits in one, or values that are not finite.
pub fn drift(command: &Placement, cycles: &[&[Placement]]) -> Result<Drift, IsoError> {
    let figures = cycle_figures(command, cycles)?;
    let first = figures[0];
    let start = Drift {
        accuracy_m: 0.0,
        accuracy_abc_rad: first.accuracy_abc_rad.map(|_| DVec3::ZERO),
        repeatability_m: 0.0,
        travel_m: 0.0,
    };
    Ok(figures[1..].iter().fold(start, |most, now| Drift {
        accuracy_m: most.accuracy_m.max((now.accuracy_m - first.accuracy_m).abs()),
        accuracy_abc_rad: larger_change(
            most.accuracy_abc_rad,
            first.accuracy_abc_rad,
            now.accuracy_abc_rad,
        ),
        repeatability_m: most
            .repeatability_m
            .max((now.repeatability_m - first.repeatability_m).abs()),
        travel_m: most.travel_m.max(now.accuracy_xyz_m.distance(first.accuracy_xyz_m)),
    }))
}

/// Figures of the distance between two poses that were visited alternately.
///
/// # Errors
/// Fewer than two pairs of visits, or values that are not finite.
pub fn distance_figures(
    command: [Placement; 2],
    attained: &[[Placement; 2]],
) -> Result<DistanceFigures, IsoError> {
    for end in 0..2 {
        let visits: Vec<Placement> = attained.iter().map(|pair| pair[end]).collect();
        check(&command[end], &visits)?;
    }
    let along = |[one, other]: &[Placement; 2]| (one.position_m - other.position_m).abs();
    let about = |[one, other]: &[Placement; 2]| {
        let [one, other] = [one, other].map(|end| end.angles_from(&command[0]));
        Some((one? - other?).abs())
    };
    let distances: Vec<f64> =
        attained.iter().map(|[one, other]| one.position_m.distance(other.position_m)).collect();
    let (mean_distance_m, deviation) = spread(&distances);
    let parts: Vec<DVec3> = attained.iter().map(along).collect();
    let turns: Option<Vec<DVec3>> = attained.iter().map(about).collect();
    let mean_turn = turns.as_ref().map(|turns| mean(turns.iter().copied()));
    Ok(DistanceFigures {
        visits: attained.len(),
        accuracy_m: mean_distance_m - command[0].position_m.distance(command[1].position_m),
        accuracy_xyz_m: mean(parts.iter().copied()) - along(&command),
        accuracy_abc_rad: mean_turn.zip(about(&command)).map(|(found, wanted)| found - wanted),
        repeatability_m: 3.0 * deviation,
        repeatability_xyz_m: three_deviations(&parts),
        repeatability_abc_rad: turns.map(|turns| three_deviations(&turns)),
    })
}

/// Figures of each group; there must be at least two groups.
fn cycle_figures(
    command: &Placement,
    groups: &[&[Placement]],
) -> Result<Vec<PoseFigures>, IsoError> {
    if groups.len() < 2 {
        return Err(IsoError::Groups(groups.len()));
    }
    groups.iter().map(|group| pose_figures(command, group)).collect()
}

fn check(command: &Placement, attained: &[Placement]) -> Result<(), IsoError> {
    if attained.len() < 2 {
        return Err(IsoError::Visits(attained.len()));
    }
    command.check(0)?;
    attained.iter().enumerate().try_for_each(|(index, visit)| visit.check(index + 1))
}

/// Rotation vectors of the visits relative to the command; `None` if an orientation is missing.
fn angles(command: &Placement, attained: &[Placement]) -> Option<Vec<DVec3>> {
    attained.iter().map(|visit| visit.angles_from(command)).collect()
}

/// Elementwise maximum of `so_far` and the absolute difference of two vectors.
fn larger_change(so_far: Option<DVec3>, one: Option<DVec3>, other: Option<DVec3>) -> Option<DVec3> {
    Some(so_far?.max((one? - other?).abs()))
}

fn mean(vectors: impl ExactSizeIterator<Item = DVec3>) -> DVec3 {
    let count = vectors.len() as f64;
    vectors.sum::<DVec3>() / count
}

/// Mean and standard deviation (divisor n − 1).
fn spread(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    (mean, (squares / (count - 1.0)).sqrt())
}

/// Three standard deviations, per axis.
fn three_deviations(vectors: &[DVec3]) -> DVec3 {
    let axis =
        |part: fn(&DVec3) -> f64| 3.0 * spread(&vectors.iter().map(part).collect::<Vec<_>>()).1;
    DVec3::new(axis(|v| v.x), axis(|v| v.y), axis(|v| v.z))
}

#[cfg(test)]
mod tests;
