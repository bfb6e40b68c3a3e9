//! Inverse dynamics of a rigid arm, and its regressor matrix in the inertial parameters of the bodies.
//!
//! `τ = M q̈ + C q̇ + ∂V/∂q − JᵀW`: minus the loads of [`crate::loads`], whose Newton-Euler recursions are there and in `inertia`.
//! It is linear in ten parameters of each body, so `τ + JᵀW = Σ Y_k p_k`. Source: Atkeson, An and Hollerbach, 1986.
//!
//! Parameters are defined as for a link of the model: base frame, zero configuration; the regressor
//! times the arm's parameters is [`inverse_dynamics`] without a wrench. Which parameters are
//! identifiable is determined in `diagnosis` (by rank).

use crate::inertia::{BodyMotion, body_motions};
use crate::{
    Arm, Body, Chain, Contribution, Inputs, JOINTS_MAX, JointKind, Joints, LoadChange, Loads,
};
use glam::{DMat3, DVec3};

/// Number of inertial parameters of a body.
pub const INERTIAL_PARAMETERS: usize = 10;

/// One row per joint, one column per inertial parameter of one body: Nm (N) per unit of the parameter.
pub type BodyRegressor = [[f64; INERTIAL_PARAMETERS]; JOINTS_MAX];

/// The inertial parameters of a body, in which the drives' torques are linear; bodies on one joint add up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InertialParameters {
    /// Mass, kg.
    pub mass: f64,
    /// `m c`, c the centre of mass at the zero configuration, base frame, kg m.
    pub first_moment: DVec3,
    /// About the base frame's ORIGIN (not the centre of mass), base axes, at the zero configuration, kg m².
    pub inertia: DMat3,
}

impl InertialParameters {
    /// The parameters of a body.
    pub fn of(body: &Body) -> Self {
        let first_moment = body.centre * body.mass;
        let moved = DMat3::from_cols(
            body.centre * first_moment.x,
            body.centre * first_moment.y,
            body.centre * first_moment.z,
        );
        let about_origin = DMat3::from_diagonal(DVec3::splat(body.centre.dot(first_moment)));
        Self { mass: body.mass, first_moment, inertia: body.inertia + about_origin - moved }
    }

    /// In the order of a [`BodyRegressor`]'s columns: mass, first moment (3), `Ixx, Iyy, Izz, Ixy, Ixz, Iyz`.
    pub const fn values(&self) -> [f64; INERTIAL_PARAMETERS] {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = self.inertia;
        let h = self.first_moment;
        [self.mass, h.x, h.y, h.z, x.x, y.y, z.z, x.y, x.z, y.z]
    }
}

/// Drive torques `M q̈ + C q̇ + ∂V/∂q − JᵀW` of the arm's own masses at one sample, Nm or N; zero
/// beyond the arm's joints.
pub fn inverse_dynamics(arm: &Arm, inputs: &Inputs) -> Joints {
    let chain = Chain::nominal(arm, &inputs.q);
    let mut change = LoadChange::default();
    change.add(&Contribution::GravityTurn { turn: inputs.base_tilt });
    let mut loads = Loads::with_change(arm, &chain, inputs.wrench_base, &change);
    loads.compute_inertia(arm, &chain, inputs, &change);
    loads.drive_torque()
}

/// Regressor of the arm in motion at one sample.
#[derive(Clone, Copy, Debug)]
pub struct Regressor<'a> {
    arm: &'a Arm,
    chain: &'a Chain,
    bodies: [BodyMotion; JOINTS_MAX],
    gravity: DVec3,
}

impl<'a> Regressor<'a> {
    /// `chain`: the arm at `inputs.q`; `gravity`: base axes, m/s², as in [`Loads::gravity`].
    pub fn new(arm: &'a Arm, chain: &'a Chain, inputs: &Inputs, gravity: DVec3) -> Self {
        let bodies = body_motions(arm, chain, &inputs.velocity, &inputs.acceleration);
        Self { arm, chain, bodies, gravity }
    }

    /// The regressor of the body that joint `body` (0-based) moves; rows of joints beyond it are
    /// zero. A tool or payload is a body of the last joint.
    pub fn of_body(&self, body: usize) -> BodyRegressor {
        let mut table = [[0.0; INERTIAL_PARAMETERS]; JOINTS_MAX];
        for (column, (force, moment)) in self.wrenches(body).into_iter().enumerate() {
            for (i, joint) in self.arm.joints().iter().enumerate().take(body + 1) {
                let (axis, point) = (self.chain.axis(i), self.chain.point(i));
                table[i][column] = match joint.kind {
                    JointKind::Revolute => axis.dot(moment - point.cross(force)),
                    JointKind::Prismatic => axis.dot(force),
                };
            }
        }
        table
    }

    /// Force, and moment about the base frame's origin, that moves the body, per unit of each parameter.
    fn wrenches(&self, body: usize) -> [(DVec3, DVec3); INERTIAL_PARAMETERS] {
        let (frame, moving) = (&self.chain.body(body), &self.bodies[body]);
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = frame.rotation;
        let fall = moving.acceleration_of(frame.origin) - self.gravity;
        let (spin, spin_rate) = (moving.spin, moving.spin_rate);
        let of_mass = (fall, frame.origin.cross(fall));
        let of_moment = |arm: DVec3| {
            let force = spin_rate.cross(arm) + spin.cross(spin.cross(arm));
            (force, arm.cross(fall) + frame.origin.cross(force))
        };
        let of_inertia = |a: DVec3, b: DVec3| {
            // For `a bᵀ + b aᵀ`.
            let times = |v: DVec3| a * b.dot(v) + b * a.dot(v);
            (DVec3::ZERO, times(spin_rate) + spin.cross(times(spin)))
        };
        let halved = |a: DVec3| {
            let (force, moment) = of_inertia(a, a);
            (force, moment * 0.5)
        };
        [
            of_mass,
            of_moment(x),
            of_moment(y),
            of_moment(z),
            halved(x),
            halved(y),
            halved(z),
            of_inertia(x, y),
            of_inertia(x, z),
            of_inertia(y, z),
        ]
    }
}
