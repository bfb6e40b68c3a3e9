//! Single-joint analysis: the axis of rotation of a joint (thesis 3.1 to 3.2.7). Its errors at equal steps are in [`crate::joint_error`].
//!
//! While one joint sweeps, the gravity deflection of the preceding joints varies and moves its axis, which appears as a shift in an axis from raw
//! tracks (thesis 3.2.4, 3.2.6). [`SagCorrection`] contains the deflection removed by a gravity compliance model, and [`JointAxis`] the
//! resulting change.
//!
//! Without noise and with known deflection, the result is the axis of the unloaded arm, to rounding. This is not a global fit: the preceding axes are
//! taken from the given model.

use crate::circle_point::{Axis, CircleError, axis, smallest_turn};
use glam::DVec3;
use physics::deviation::{Contribution, Deviation};
use physics::frame::normals;
use physics::{Arm, Chain, Inputs, JointKind, Memories, Model};
use thiserror::Error;

/// Steps whose commanded positions differ by no more than this are the same step, rad.
pub(crate) const SAME_STEP_RAD: f64 = 1e-5;

/// One settled step of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Inputs of the model, with the direction of approach (`direction`).
    pub inputs: Inputs,
    /// Measured target positions, m, base frame; `None` if a target was not measured. A station known to a milliradian is accurate enough for the
    /// transformation.
    pub targets: Vec<Option<DVec3>>,
}

/// A sweep of one joint, with the others at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// 0-based.
    pub joint: usize,
    /// In the order of measurement.
    pub steps: Vec<Step>,
}

/// The varying gravity deflection that is removed from the tracks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SagCorrection {
    /// Nothing.
    AsMeasured,
    /// That of the base and of the joints before the moving one: the thesis' correction.
    Carriers,
    /// That of all joints but the moving one: those after it deflect too, since the sweep changes the direction of gravity relative to them.
    #[default]
    AllOthers,
}

/// A joint's axis, estimated from its sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct JointAxis {
    /// 0-based.
    pub joint: usize,
    /// Axis in the base frame, at the configuration at which the preceding joints were held.
    pub axis: Axis,
    /// Targets with at least three measurements, in the order of the axis' circles.
    pub targets: Vec<usize>,
    /// The deflection that was removed.
    pub sag: SagCorrection,
    /// Largest displacement of a target by this correction, m.
    pub moved_by_sag_m: f64,
    /// Rotation of the axis by this correction, rad.
    pub turned_by_sag: DVec3,
    /// Shift of the axis by this correction at its point, perpendicular to the axis, m.
    pub shifted_by_sag: DVec3,
}

/// Deviation of an axis from the nominal one, at the zero configuration: initial values for `axis_tilt` and `axis_shift`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisError {
    /// About `n1` and `n2` of the nominal axis, at its pivot, rad.
    pub tilt_rad: [f64; 2],
    /// Perpendicular to the axis at the pivot, base frame, m.
    pub shift_m: DVec3,
    /// Standard uncertainty of the tilt due to the noise of the points, rad.
    pub sigma_tilt_rad: [f64; 2],
    /// Standard uncertainty of the shift along `n1` and `n2` of the nominal axis, m.
    pub sigma_shift_m: [f64; 2],
}

/// Why a sweep cannot be used. Joints are 1-based here, as in files.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SweepError {
    /// There is no such joint, or it is prismatic.
    #[error(
        "joint {joint} is not a revolute joint of this arm; sweeps determine only axes of revolute joints"
    )]
    NotRevolute {
        /// 1-based.
        joint: usize,
    },
    /// Another joint moved too.
    #[error(
        "the sweep of joint {joint}: joint {other} moved too, by {by_rad:.1e} rad; keep the other joints at rest"
    )]
    OtherMoved {
        /// 1-based.
        joint: usize,
        /// 1-based.
        other: usize,
        /// Displacement of that joint, rad.
        by_rad: f64,
    },
    /// The tracks do not determine an axis.
    #[error("the sweep of joint {joint}: {fault}")]
    Tracks {
        /// 1-based.
        joint: usize,
        /// The reason.
        fault: CircleError,
    },
}

/// Signed angle from `a` to `b` about the unit axis `e`, rad; components along the axis are ignored. Thesis 3.5, in a form that is accurate for small
/// angles.
#[must_use]
pub fn angle_about(e: DVec3, a: DVec3, b: DVec3) -> f64 {
    libm::atan2(e.dot(a.cross(b)), a.dot(b) - a.dot(e) * b.dot(e))
}

impl Sweep {
    /// The joint's axis, after removal of `sag` by the gravity-dependent effects of `model`. `noise_m` as in [`axis`].
    ///
    /// # Errors
    /// A sweep that does not match the arm, moves other joints, or whose tracks determine no axis.
    pub fn axis(
        &self,
        model: &Model,
        sag: SagCorrection,
        noise_m: Option<f64>,
    ) -> Result<JointAxis, SweepError> {
        let joint = self.joint + 1;
        self.check(&model.arm)?;
        let first = self.steps.first().map_or([0.0; physics::JOINTS_MAX], |step| step.inputs.q);
        let towards = Chain::nominal(&model.arm, &first).axis(self.joint);
        let fit = |tracks: &[Vec<DVec3>]| {
            axis(tracks, towards, noise_m).map_err(|fault| SweepError::Tracks { joint, fault })
        };
        let (_, as_measured) = self.tracks(model, SagCorrection::AsMeasured);
        let (targets, tracks) = self.tracks(model, sag);
        let (raw, axis) = (fit(&as_measured)?, fit(&tracks)?);
        let both = as_measured.iter().flatten().zip(tracks.iter().flatten());
        let moved_by_sag_m = both.map(|(raw, moved)| raw.distance(*moved)).fold(0.0, f64::max);
        let turned_by_sag = smallest_turn(raw.direction, axis.direction);
        let shifted_by_sag = axis.point - raw.nearest(axis.point);
        Ok(JointAxis {
            joint: self.joint,
            axis,
            targets,
            sag,
            moved_by_sag_m,
            turned_by_sag,
            shifted_by_sag,
        })
    }

    fn check(&self, arm: &Arm) -> Result<(), SweepError> {
        let joint = self.joint + 1;
        match arm.joints().get(self.joint) {
            Some(moving) if moving.kind == JointKind::Revolute => {}
            _ => return Err(SweepError::NotRevolute { joint }),
        }
        let Some(first) = self.steps.first() else { return Ok(()) };
        for step in &self.steps {
            for other in (0..arm.count()).filter(|other| *other != self.joint) {
                let by_rad = (step.inputs.q[other] - first.inputs.q[other]).abs();
                if by_rad > SAME_STEP_RAD || by_rad.is_nan() {
                    return Err(SweepError::OtherMoved { joint, other: other + 1, by_rad });
                }
            }
        }
        Ok(())
    }

    /// Targets with at least three measurements, each with its track.
    fn tracks(&self, model: &Model, sag: SagCorrection) -> (Vec<usize>, Vec<Vec<DVec3>>) {
        let count = self.steps.iter().map(|step| step.targets.len()).max().unwrap_or(0);
        let mut tracks = vec![Vec::new(); count];
        for step in &self.steps {
            for (track, point) in tracks.iter_mut().zip(self.without_sag(step, model, sag)) {
                track.extend(point);
            }
        }
        tracks.into_iter().enumerate().filter(|(_, track)| track.len() >= 3).unzip()
    }

    /// Target positions of a step without the deflection that is removed.
    pub(crate) fn without_sag(
        &self,
        step: &Step,
        model: &Model,
        sag: SagCorrection,
    ) -> Vec<Option<DVec3>> {
        if sag == SagCorrection::AsMeasured {
            return step.targets.clone();
        }
        let last = model.arm.count() - 1;
        let [sagged, unsagged] = sag_with_and_without(model, &step.inputs, self.joint, sag)
            .map(|deviation| Chain::real(&model.arm, &step.inputs.q, &deviation).body(last));
        let back = unsagged.after(&sagged.inverse());
        step.targets.iter().map(|point| Some(back.point((*point)?))).collect()
    }
}

impl JointAxis {
    /// Deviation of the axis from the nominal one at the zero configuration, with the preceding joints as in the nominal model. `q` is the
    /// configuration at which these were held.
    #[must_use]
    pub fn error(&self, arm: &Arm, q: &physics::Joints) -> Option<AxisError> {
        let nominal = arm.joints().get(self.joint)?;
        let mut held = *q;
        held[self.joint] = 0.0;
        let to_zero = Chain::nominal(arm, &held).body(self.joint).inverse();
        let direction = to_zero.rotation * self.axis.direction;
        let point = to_zero.point(self.axis.point);
        let (n1, n2) = normals(nominal.axis);
        let turn = smallest_turn(nominal.axis, direction);
        // Intersection of the axis with the plane perpendicular to the nominal one: an `axis_shift` has no component along it.
        let ahead = nominal.axis.dot(nominal.point - point) / nominal.axis.dot(direction);
        let shift_m = point + direction * ahead - nominal.point;
        // Derivatives of tilt and shift by each of the four parameters of the covariance.
        let (m1, m2) = normals(self.axis.direction);
        let lever = to_zero.inverse().point(nominal.point) - self.axis.point;
        let generators =
            [(m1, DVec3::ZERO), (m2, DVec3::ZERO), (DVec3::ZERO, m1), (DVec3::ZERO, m2)];
        let with = generators.map(|(turn, shift)| {
            let turned = to_zero.rotation * turn;
            let moved = to_zero.rotation * (turn.cross(lever) + shift);
            [turned.dot(n1), turned.dot(n2), moved.dot(n1), moved.dot(n2)]
        });
        let sigma = |component: usize| -> f64 {
            let rows = self.axis.covariance.iter().zip(&with);
            let product = |row: &[f64; 4]| -> f64 {
                row.iter().zip(&with).map(|(c, w)| c * w[component]).sum()
            };
            rows.map(|(row, w)| w[component] * product(row)).sum::<f64>().sqrt()
        };
        Some(AxisError {
            tilt_rad: [turn.dot(n1), turn.dot(n2)],
            shift_m,
            sigma_tilt_rad: [sigma(0), sigma(1)],
            sigma_shift_m: [sigma(2), sigma(3)],
        })
    }
}

/// Deviation due to gravity, and what remains of it after removal of `sag`. The joint's own deflection is in both; otherwise that of later joints
/// would be removed about a wrong axis. External wrenches are not included.
fn sag_with_and_without(
    model: &Model,
    inputs: &Inputs,
    joint: usize,
    sag: SagCorrection,
) -> [Deviation; 2] {
    let unloaded = Inputs { wrench_base: physics::Wrench::ZERO, ..*inputs };
    let kinds: Vec<&str> = model.effects().map(|effect| effect.spec().kind).collect();
    let [mut with, mut without] = [Deviation::default(); 2];
    model.contributions(&unloaded, &Memories::default(), |index, contribution| {
        if !answers_to_gravity(kinds[index]) {
            return;
        }
        with.add(contribution);
        let goes = match *contribution {
            Contribution::Joint { joint: at, .. } => {
                at < joint || (sag == SagCorrection::AllOthers && at != joint)
            }
            Contribution::LinkTurn { link, .. } => link <= joint || sag == SagCorrection::AllOthers,
            _ => true,
        };
        if !goes {
            without.add(contribution);
        }
    });
    [with, without]
}

fn answers_to_gravity(kind: &str) -> bool {
    [
        "gravity_compliance",
        "gravity_sag",
        "joint_compliance",
        "stiffness_hardening",
        "bearing_compliance",
        "base_compliance",
    ]
    .contains(&kind)
}

/// Rotation of a body that carries two targets, as far as they determine it (thesis 3.6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedTilt {
    /// Rotation vector, rad, without component along [`ObservedTilt::unobservable_axis`].
    pub turn: DVec3,
    /// Standard uncertainty of the rotation about each axis perpendicular to the line, rad.
    pub sigma_rad: f64,
    /// Unit vector of the line through both targets: a rotation about it is not observable. A third target off the line would determine it.
    pub unobservable_axis: DVec3,
}

/// Tilt of a base (or link) from the positions of two targets on it before and after, m; `noise_m` is the standard deviation of one coordinate.
/// `None` if the targets coincide.
#[must_use]
pub fn tilt_of_two_targets(
    before: [DVec3; 2],
    after: [DVec3; 2],
    noise_m: f64,
) -> Option<ObservedTilt> {
    let (a, b) = (before[1] - before[0], after[1] - after[0]);
    let unobservable_axis = a.try_normalize().filter(|_| b.is_finite() && b != DVec3::ZERO)?;
    Some(ObservedTilt {
        turn: smallest_turn(a, b),
        sigma_rad: 2.0 * noise_m / a.length(),
        unobservable_axis,
    })
}

#[cfg(test)]
mod tests;
