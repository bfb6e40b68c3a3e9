//! Single-joint analysis: the axis of rotation of a joint (thesis 3.1 to 3.2.7). Its errors at equal steps are in [`crate::joint_error`].
//!
//! While one joint sweeps, the gravity deflection of the preceding joints varies and moves its axis, which appears as a shift in an axis from raw
//! tracks (thesis 3.2.4, 3.2.6). [`Sag`] contains the deflection removed by a gravity compliance model, and [`JointAxis`] the
//! resulting change.
//!
//! Promises: without noise and with known deflection, the axis is that of the unloaded arm, to rounding. Never: a global fit: the axes before the
//! one that moves are taken from the model that is passed in.

use crate::circle::{Axis, CircleError, axis, smallest_turn};
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
    /// What was commanded, and from which side (`direction`).
    pub inputs: Inputs,
    /// Where each target is, m, base frame; `None` where it was not seen. A station known to a milliradian is enough to bring readings there.
    pub targets: Vec<Option<DVec3>>,
}

/// A sweep of one joint, the others standing.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// 0-based.
    pub joint: usize,
    /// In the order in which they were measured.
    pub steps: Vec<Step>,
}

/// What of the sag that changes along a sweep is taken out of the tracks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sag {
    /// Nothing.
    AsMeasured,
    /// That of the base and of the joints before the one that moves: the thesis' correction.
    Carriers,
    /// That of all joints but the one that moves: those after it yield too, since the sweep turns gravity about them.
    #[default]
    AllOthers,
}

/// A joint's axis as its sweep shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct JointAxis {
    /// 0-based.
    pub joint: usize,
    /// Base frame, where the sweep holds the joints before this one.
    pub axis: Axis,
    /// The targets that were seen often enough to count, in the order of the axis' circles.
    pub targets: Vec<usize>,
    /// What was taken out.
    pub sag: Sag,
    /// The furthest that taking it out moved a target, m.
    pub moved_by_sag_m: f64,
    /// The turn that taking it out gave the axis, rad.
    pub turned_by_sag: DVec3,
    /// The shift that taking it out gave the axis at its middle, across it, m.
    pub shifted_by_sag: DVec3,
}

/// An axis against the controller's, at the zero configuration: start values for `axis_tilt` and `axis_shift`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisError {
    /// About `n1` and `n2` of the nominal axis, at its pivot, rad.
    pub tilt_rad: [f64; 2],
    /// Across the axis at the pivot, base frame, m.
    pub shift_m: DVec3,
    /// Standard uncertainty of the tilt by the noise of the points, rad.
    pub sigma_tilt_rad: [f64; 2],
    /// Standard uncertainty of the shift along `n1` and `n2` of the nominal axis, m.
    pub sigma_shift_m: [f64; 2],
}

/// Why a sweep cannot be used. Joints are 1-based here, as in files.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SweepError {
    /// There is no such joint, or it slides.
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
        /// By how much, rad.
        by_rad: f64,
    },
    /// The tracks give no axis.
    #[error("the sweep of joint {joint}: {fault}")]
    Tracks {
        /// 1-based.
        joint: usize,
        /// What is wrong with them.
        fault: CircleError,
    },
}

/// The angle from `a` to `b` about the unit axis `e`, rad, signed; what lies along the axis does not count. Thesis 3.5, in the form that keeps small angles.
#[must_use]
pub fn angle_about(e: DVec3, a: DVec3, b: DVec3) -> f64 {
    libm::atan2(e.dot(a.cross(b)), a.dot(b) - a.dot(e) * b.dot(e))
}

impl Sweep {
    /// The joint's axis, with `sag` taken out by the effects of `model` that answer to gravity. `noise_m` as in [`axis`].
    ///
    /// # Errors
    /// A sweep that does not fit the arm, moves other joints, or whose tracks determine no axis.
    pub fn axis(
        &self,
        model: &Model,
        sag: Sag,
        noise_m: Option<f64>,
    ) -> Result<JointAxis, SweepError> {
        let joint = self.joint + 1;
        self.check(&model.arm)?;
        let first = self.steps.first().map_or([0.0; physics::JOINTS_MAX], |step| step.inputs.q);
        let towards = Chain::nominal(&model.arm, &first).axis(self.joint);
        let fit = |tracks: &[Vec<DVec3>]| {
            axis(tracks, towards, noise_m).map_err(|fault| SweepError::Tracks { joint, fault })
        };
        let (_, as_measured) = self.tracks(model, Sag::AsMeasured);
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

    /// Targets seen at three steps or more, each with its track.
    fn tracks(&self, model: &Model, sag: Sag) -> (Vec<usize>, Vec<Vec<DVec3>>) {
        let count = self.steps.iter().map(|step| step.targets.len()).max().unwrap_or(0);
        let mut tracks = vec![Vec::new(); count];
        for step in &self.steps {
            for (track, point) in tracks.iter_mut().zip(self.without_sag(step, model, sag)) {
                track.extend(point);
            }
        }
        tracks.into_iter().enumerate().filter(|(_, track)| track.len() >= 3).unzip()
    }

    /// A step's targets where they would be without the sag that is taken out.
    pub(crate) fn without_sag(&self, step: &Step, model: &Model, sag: Sag) -> Vec<Option<DVec3>> {
        if sag == Sag::AsMeasured {
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
    /// The axis against the controller's at the zero configuration, the joints before it taken as the controller has them. `q` is where the sweep held these.
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
        // Where the axis pierces the plane across the nominal one: an `axis_shift` has no part along it.
        let ahead = nominal.axis.dot(nominal.point - point) / nominal.axis.dot(direction);
        let shift_m = point + direction * ahead - nominal.point;
        // How tilt and shift go with each of the four numbers that the covariance is of.
        let (m1, m2) = normals(self.axis.direction);
        let lever = to_zero.inverse().point(nominal.point) - self.axis.point;
        let generators =
            [(m1, DVec3::ZERO), (m2, DVec3::ZERO), (DVec3::ZERO, m1), (DVec3::ZERO, m2)];
        let with = generators.map(|(turn, shift)| {
            let turned = to_zero.rotation * turn;
            let moved = to_zero.rotation * (turn.cross(lever) + shift);
            [turned.dot(n1), turned.dot(n2), moved.dot(n1), moved.dot(n2)]
        });
        let sigma = |of: usize| -> f64 {
            let rows = self.axis.covariance.iter().zip(&with);
            let product =
                |row: &[f64; 4]| -> f64 { row.iter().zip(&with).map(|(c, w)| c * w[of]).sum() };
            rows.map(|(row, w)| w[of] * product(row)).sum::<f64>().sqrt()
        };
        Some(AxisError {
            tilt_rad: [turn.dot(n1), turn.dot(n2)],
            shift_m,
            sigma_tilt_rad: [sigma(0), sigma(1)],
            sigma_shift_m: [sigma(2), sigma(3)],
        })
    }
}

/// What gravity adds to the arm, and what of it stays once `sag` is taken out. The joint's own sag is in both, or else that of the joints after it would be
/// taken out in the wrong place. A wrench does not count.
fn sag_with_and_without(model: &Model, inputs: &Inputs, joint: usize, sag: Sag) -> [Deviation; 2] {
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
                at < joint || (sag == Sag::AllOthers && at != joint)
            }
            Contribution::LinkTurn { link, .. } => link <= joint || sag == Sag::AllOthers,
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

/// How a body that carries two targets turned, as far as two targets show it (thesis 3.6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TiltSeen {
    /// Rotation vector, rad; it has no part along [`TiltSeen::blind`].
    pub turn: DVec3,
    /// Standard uncertainty of the turn about each axis across the line, rad.
    pub sigma_rad: f64,
    /// Unit vector of the line through both targets: a turn about it moves neither, so it is not seen. A third target beside the line shows it.
    pub blind: DVec3,
}

/// The tilt of a base (or link) from where two targets on it were before and after, m; `noise_m` is the standard deviation of one coordinate.
/// `None` where the targets coincide.
#[must_use]
pub fn tilt_of_two_targets(
    before: [DVec3; 2],
    after: [DVec3; 2],
    noise_m: f64,
) -> Option<TiltSeen> {
    let (a, b) = (before[1] - before[0], after[1] - after[0]);
    let blind = a.try_normalize().filter(|_| b.is_finite() && b != DVec3::ZERO)?;
    Some(TiltSeen { turn: smallest_turn(a, b), sigma_rad: 2.0 * noise_m / a.length(), blind })
}

#[cfg(test)]
mod tests;
