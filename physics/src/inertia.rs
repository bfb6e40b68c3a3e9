//! Inertial loads `−(M q̈ + C q̇)` by the recursive Newton–Euler equations.
//!
//! Zero speeds and accelerations give zero loads; masses are those of the gravity loads, including
//! the unmodelled payload. Gravity is computed separately.
//!
//! Outward: `ω' = ω + e q̇`, `α' = α + e q̈ + ω × e q̇`, `a' = a + α × r + ω × (ω × r)`, `r` from point to point; a prismatic joint adds
//! `e q̈ + 2 ω × e q̇`. Inward: the reactions `−m a` and `−(I α + ω × I ω)` of all that a joint carries. Source: Luh, Walker
//! and Paul, 1980; Featherstone, Rigid Body Dynamics Algorithms, chapter 5.

use crate::loads::PivotLoad;
use crate::{Arm, Chain, JOINTS_MAX, JointKind, Joints};
use glam::{DMat3, DVec3};

/// A mass that the arm does not list: mass, kg, and first moment `m c` at the zero configuration, base frame, kg m.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct UnmodelledMass {
    pub(crate) mass: f64,
    pub(crate) first_moment: DVec3,
}

/// Inertial loads by the arm's own motion.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct InertialLoads {
    /// `−(M q̈ + C q̇)_i`, Nm or N.
    pub(crate) torque: Joints,
    /// Moment about the base frame's origin, Nm.
    pub(crate) base_moment: DVec3,
}

/// Motion of a body.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BodyMotion {
    pub(crate) spin: DVec3,
    pub(crate) spin_rate: DVec3,
    /// Acceleration of `point`, m/s².
    acceleration: DVec3,
    point: DVec3,
}

impl BodyMotion {
    /// Acceleration of a point of the body, given at its present position, m/s².
    pub(crate) fn acceleration_of(&self, point: DVec3) -> DVec3 {
        let lever = point - self.point;
        self.acceleration + self.spin_rate.cross(lever) + self.spin.cross(self.spin.cross(lever))
    }
}

/// The reaction of all masses on `chain`, moving at `velocity` and `acceleration` (rad or m per s and s²).
#[inline(always)]
pub(crate) fn inertial_loads(
    arm: &Arm,
    chain: &Chain,
    velocity: &Joints,
    acceleration: &Joints,
    extra: &UnmodelledMass,
) -> InertialLoads {
    let count = arm.count();
    if is_at_rest(velocity, acceleration) {
        return InertialLoads::default();
    }
    let bodies = body_motions(arm, chain, velocity, acceleration);
    // Force, and moment about the base frame's origin, of all bodies from here to the tool.
    let (mut force, mut moment) = (DVec3::ZERO, DVec3::ZERO);
    let mut torque = [0.0; JOINTS_MAX];
    for i in (0..count).rev() {
        let mut take = |mass: f64, centre: DVec3, inertia: DMat3| {
            let (body, turned) = (&bodies[i], &chain.body(i).rotation);
            let pull = -mass * body.acceleration_of(centre);
            // In the body's own axes, so that the tensor need not be rotated.
            let into_body = turned.transpose();
            let (spin, spin_rate) = (into_body * body.spin, into_body * body.spin_rate);
            let twist = turned * (inertia * spin_rate + spin.cross(inertia * spin));
            force += pull;
            moment += centre.cross(pull) - twist;
        };
        if i + 1 == count {
            if let Some(tool) = &arm.tool.body {
                take(tool.mass, chain.body(i).point(tool.centre), tool.inertia);
            }
            if extra.mass != 0.0 {
                let centre = extra.first_moment / extra.mass;
                take(extra.mass, chain.body(i).point(centre), DMat3::ZERO);
            }
        }
        let joint = &arm.joints()[i];
        if let Some(link) = &joint.link {
            take(link.mass, chain.body(i).point(link.centre), link.inertia);
        }
        let about_point = PivotLoad { force, moment }.moment_about(DVec3::ZERO, chain.point(i));
        torque[i] = match joint.kind {
            JointKind::Revolute => chain.axis(i).dot(about_point),
            JointKind::Prismatic => chain.axis(i).dot(force),
        };
    }
    InertialLoads { torque, base_moment: moment }
}

/// Whether all joints are at rest: then there are no inertial loads.
#[inline(always)]
pub(crate) fn is_at_rest(velocity: &Joints, acceleration: &Joints) -> bool {
    // Branch-free test for values other than zero of either sign.
    let both = velocity.iter().zip(acceleration);
    both.fold(0, |any, (v, a)| any | (v.to_bits() << 1) | (a.to_bits() << 1)) == 0
}

/// Motion of each body of the arm.
#[inline(always)]
pub(crate) fn body_motions(
    arm: &Arm,
    chain: &Chain,
    velocity: &Joints,
    acceleration: &Joints,
) -> [BodyMotion; JOINTS_MAX] {
    let mut all = [BodyMotion::default(); JOINTS_MAX];
    let mut body = BodyMotion::default();
    for (i, joint) in arm.joints().iter().enumerate() {
        let (axis, point) = (chain.axis(i), chain.point(i));
        let (rate, push) = (axis * velocity[i], axis * acceleration[i]);
        let carried = body.acceleration_of(point);
        body = match joint.kind {
            JointKind::Revolute => BodyMotion {
                spin: body.spin + rate,
                spin_rate: body.spin_rate + push + body.spin.cross(rate),
                acceleration: carried,
                point,
            },
            JointKind::Prismatic => {
                // The point of a prismatic joint moves with its body: `chain.points` is its
                // position before that motion.
                let slid = chain.body(i).point(joint.point);
                BodyMotion {
                    acceleration: body.acceleration_of(slid) + push + 2.0 * body.spin.cross(rate),
                    point: slid,
                    ..body
                }
            }
        };
        all[i] = body;
    }
    all
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::arm::GRAVITY;
    use crate::effects::conformance::{scene, sliding_scene};
    use crate::{Body, Joint, Tool};

    fn pendulum() -> Arm {
        let joint = Joint {
            kind: JointKind::Revolute,
            axis: DVec3::Y,
            point: DVec3::ZERO,
            limits: (-3.0, 3.0),
            max_speed: 2.0,
            link: Some(Body::point_mass(3.0, DVec3::X * 2.0)),
        };
        let tool = Tool { tcp: DVec3::X * 2.0, base_from_tool: DMat3::IDENTITY, body: None };
        Arm::new(&[joint], tool, GRAVITY).expect("sound")
    }

    #[test]
    fn a_pendulum_resists_with_its_moment_of_inertia_and_no_speed_brakes_it() {
        let arm = pendulum();
        let chain = Chain::nominal(&arm, &[0.4; JOINTS_MAX]);
        let loads = inertial_loads(
            &arm,
            &chain,
            &[1.7; JOINTS_MAX],
            &[0.5; JOINTS_MAX],
            &UnmodelledMass::default(),
        );
        assert!((loads.torque[0] + 3.0 * 4.0 * 0.5).abs() < 1e-12);
        let extra = UnmodelledMass { mass: 1.0, first_moment: DVec3::X };
        let loaded = inertial_loads(&arm, &chain, &[0.0; JOINTS_MAX], &[0.5; JOINTS_MAX], &extra);
        assert!((loaded.torque[0] + (12.0 + 1.0) * 0.5).abs() < 1e-12);
    }

    /// Kinetic energy by differences of positions: no speed of a body is computed here.
    pub(crate) fn energy(arm: &Arm, q: &Joints, velocity: &Joints) -> f64 {
        let h = 1e-5;
        let chain_at = |sign: f64| {
            let moved = std::array::from_fn(|i| q[i] + sign * h * velocity[i]);
            Chain::nominal(arm, &moved)
        };
        let (before, after, now) = (chain_at(-1.0), chain_at(1.0), Chain::nominal(arm, q));
        arm.bodies()
            .map(|(i, body)| {
                let place = |chain: &Chain| chain.body(i).point(body.centre);
                let speed = (place(&after) - place(&before)) / (2.0 * h);
                let spin = (after.body(i).rotation - before.body(i).rotation)
                    * (0.5 / h)
                    * now.body(i).rotation.transpose();
                let spin = DVec3::new(spin.y_axis.z, spin.z_axis.x, spin.x_axis.y);
                let turned = now.body(i).rotation;
                let inertia = turned * body.inertia * turned.transpose();
                0.5 * body.mass * speed.length_squared() + 0.5 * spin.dot(inertia * spin)
            })
            .sum()
    }

    #[test]
    fn the_power_of_the_reaction_is_what_kinetic_energy_loses() {
        for scene in [scene(), sliding_scene()] {
            let arm = scene.arm;
            let q = scene.inputs.q;
            let v: Joints = std::array::from_fn(|i| 0.3 + 0.2 * (i as f64).sin());
            let a: Joints = std::array::from_fn(|i| 0.7 - 0.4 * (i as f64).cos());
            let loads =
                inertial_loads(&arm, &Chain::nominal(&arm, &q), &v, &a, &UnmodelledMass::default());
            let power: f64 = (0..arm.count()).map(|i| loads.torque[i] * v[i]).sum();
            let h = 1e-3;
            let later = |s: f64| {
                let q = std::array::from_fn(|i| q[i] + s * v[i] + 0.5 * s * s * a[i]);
                let v = std::array::from_fn(|i| v[i] + s * a[i]);
                energy(&arm, &q, &v)
            };
            let gained = (later(h) - later(-h)) / (2.0 * h);
            assert!((power + gained).abs() < 1e-4 * gained.abs().max(1.0), "{power} {gained}");
        }
    }

    #[test]
    fn a_mass_that_the_base_accelerates_pulls_the_base_back() {
        let arm = pendulum();
        let chain = Chain::nominal(&arm, &[0.0; JOINTS_MAX]);
        let loads = inertial_loads(
            &arm,
            &chain,
            &[0.0; JOINTS_MAX],
            &[0.5; JOINTS_MAX],
            &UnmodelledMass::default(),
        );
        assert!((loads.base_moment - DVec3::new(0.0, -6.0, 0.0)).length() < 1e-12);
    }
}
