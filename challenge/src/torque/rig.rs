//! Rigid-body load of the motors: a linear axis, a pendulum or an arm of point masses, and its joint torques.
//!
//! `τᵢ = Σ m (p̈ − g) · ∂p/∂qᵢ`, with the acceleration p̈ of a point from its positions slightly before and after on the parabola of the joint
//! motion. The torque of a point is proportional to its mass.

use crate::arm::{Arm, JOINTS, Joints, Mass};
use crate::rng::Rng;
use crate::transform::{
    IDENTITY, Transform, Vector3, add, column, cross, dot, inverse, mul, norm, origin, rotate,
    rotation, rotation_z, scaled, sub, transform_point, translation,
};

use super::motion::{JointRange, JointState};

/// Half width of the second difference of a point's positions, s.
const H_S: f64 = 5e-4;

/// A robot, or a rig with one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Its chain; the joint of a linear axis moves along z instead of about it.
    pub arm: Arm,
    /// Whether the only joint is prismatic.
    pub is_prismatic: bool,
    /// Its point masses.
    pub masses: Vec<Mass>,
    /// Whether the model states them.
    pub masses_stated: bool,
    /// Range of each joint.
    pub ranges: Vec<JointRange>,
}

/// Frames after each joint's motion: slightly before, now, slightly after.
#[derive(Clone, Debug)]
pub struct NearbyFrames([Vec<Transform>; 3]);

impl Rig {
    /// A linear axis along x, or inclined.
    pub fn linear_axis(stated: bool, rng: &mut Rng) -> Self {
        let lean = if rng.bernoulli(0.3) { rng.uniform_between(0.2, 1.57) } else { 0.0 };
        // z of the joint's frame points along x, inclined about y.
        let along = rotation([0.0, std::f64::consts::FRAC_PI_2 - lean, 0.0]);
        let kg = rng.log_uniform_between(5.0, 150.0);
        let position = [0.05, 0.0, 0.02];
        let masses = vec![Mass { joint: 0, kg, position, tool: false }];
        let half_range = rng.uniform_between(0.1, 0.3);
        let max_speed = rng.uniform_between(0.2, 0.8);
        Self {
            arm: arm_without_masses("slide", vec![along, translation([0.0, 0.0, 0.1])]),
            is_prismatic: true,
            masses,
            masses_stated: stated,
            ranges: vec![JointRange { centre: 0.0, half_range, max_speed }],
        }
    }

    /// A pendulum about a horizontal axis.
    pub fn pendulum(stated: bool, rng: &mut Rng) -> Self {
        let level = rotation([-std::f64::consts::FRAC_PI_2, 0.0, 0.0]);
        let kg = rng.log_uniform_between(1.0, 20.0);
        let distance_m = rng.uniform_between(0.1, 0.5);
        let body =
            Mass { joint: 0, kg, position: [0.2 * distance_m, distance_m, 0.01], tool: false };
        let half_range = rng.uniform_between(0.6, 1.5);
        let max_speed = rng.uniform_between(1.5, 5.0);
        Self {
            arm: arm_without_masses("pendulum", vec![level, translation([0.0, distance_m, 0.0])]),
            is_prismatic: false,
            masses: spread_masses(&[body]),
            masses_stated: stated,
            ranges: vec![JointRange { centre: 0.0, half_range, max_speed }],
        }
    }

    /// An arm with three to six axes.
    pub fn arm(stated: bool, rng: &mut Rng) -> Self {
        let number = [0, 1, 2, 2, 4, 5, 5][rng.uniform_index(7)];
        let tool = mul(&translation([0.02, 0.03, 0.12]), &rotation([0.2, -0.1, 0.4]));
        let kg = rng.uniform_between(0.5, 4.0);
        let mut arm = Arm::from_table(number, rng.uniform_between(0.9, 1.15), &tool, kg, true);
        let masses = spread_masses(&std::mem::take(&mut arm.masses));
        let max_speed = rng.uniform_between(1.2, 2.5);
        let range = |i: usize| JointRange {
            centre: arm.home[i],
            half_range: arm.half_range[i].min(1.6),
            max_speed,
        };
        let ranges = (0..arm.joint_count()).map(range).collect();
        Self { arm, is_prismatic: false, masses, masses_stated: stated, ranges }
    }

    /// A chain of axes through points, base axes at the zero configuration, m, without masses. All joints are revolute; a single joint may be
    /// prismatic.
    #[must_use]
    pub fn from_axes(
        axes: &[(Vector3, Vector3)],
        is_prismatic: bool,
        tcp: Vector3,
        gravity: Vector3,
    ) -> Self {
        let mut links = Vec::with_capacity(axes.len() + 1);
        let mut before = IDENTITY;
        for (axis, point) in axes {
            let frame = mul(&translation(*point), &rotation_to_z(*axis));
            links.push(mul(&inverse(&before), &frame));
            before = frame;
        }
        links.push(mul(&inverse(&before), &translation(tcp)));
        let mut arm = arm_without_masses("a recorded robot", links);
        arm.gravity = gravity;
        let ranges = vec![JointRange { centre: 0.0, half_range: 1.0, max_speed: 1.0 }; axes.len()];
        Self { arm, is_prismatic, masses: Vec::new(), masses_stated: false, ranges }
    }

    /// Number of joints.
    #[must_use]
    pub fn count(&self) -> usize {
        self.arm.joint_count()
    }

    /// Frames after each joint's motion, at `q`.
    #[must_use]
    pub fn frames(&self, q: &Joints) -> Vec<Transform> {
        let mut carried = IDENTITY;
        let moved = |(link, q): (&Transform, &f64)| {
            let motion =
                if self.is_prismatic { translation([0.0, 0.0, *q]) } else { rotation_z(*q) };
            carried = mul(&mul(&carried, link), &motion);
            carried
        };
        self.arm.links.iter().take(self.count()).zip(q).map(moved).collect()
    }

    /// Frames on the parabola of a state.
    #[must_use]
    pub fn frames_nearby(&self, states: &[JointState; JOINTS]) -> NearbyFrames {
        let positions_at = |h: f64| states.map(|[q, v, a]| q + h * v + 0.5 * h * h * a);
        NearbyFrames([-H_S, 0.0, H_S].map(|h| self.frames(&positions_at(h))))
    }

    /// Adds the joint torques required by a point mass, Nm or N.
    pub fn add_mass_torques(&self, places: &NearbyFrames, mass: &Mass, torques: &mut Joints) {
        let [before, now, after] =
            places.0.each_ref().map(|frames| transform_point(&frames[mass.joint], mass.position));
        let bent = sub(add(before, after), scaled(now, 2.0));
        let force = scaled(sub(scaled(bent, 1.0 / (H_S * H_S)), self.arm.gravity), mass.kg);
        for (i, frame) in places.0[1].iter().enumerate().take(mass.joint + 1) {
            let axis = column(frame, 2);
            torques[i] += if self.is_prismatic {
                dot(axis, force)
            } else {
                dot(cross(axis, sub(now, origin(frame))), force)
            };
        }
    }

    /// Adds the joint torques, up to `joint`, against the weight of a first mass moment fixed to that joint's body, base axes at the zero
    /// configuration, kg m.
    pub fn add_moment_torques(
        &self,
        places: &NearbyFrames,
        joint: usize,
        moment: Vector3,
        torques: &mut Joints,
    ) {
        let in_joint = self.arm.joint_from_base(joint, moment);
        let weight = cross(rotate(&places.0[1][joint], in_joint), self.arm.gravity);
        for (i, frame) in places.0[1].iter().enumerate().take(joint + 1) {
            torques[i] -= dot(column(frame, 2), weight);
        }
    }

    /// A point mass at the last joint, given in base axes at the zero configuration.
    #[must_use]
    pub fn mass_at_flange(&self, kg: f64, point: Vector3) -> Mass {
        let joint = self.count() - 1;
        let zero = self.frames(&[0.0; JOINTS])[joint];
        Mass { joint, kg, position: transform_point(&inverse(&zero), point), tool: true }
    }

    /// The tool centre point at the zero configuration, m.
    #[must_use]
    pub fn tcp(&self) -> Vector3 {
        origin(&self.arm.tool_pose(&[0.0; JOINTS]))
    }

    /// A body's mass (kg), centre of mass (m, base axes at the zero configuration) and inertia about it (xx, yy, zz, xy, xz, yz; kg m²).
    #[must_use]
    pub fn body(&self, joint: usize, tool: bool) -> Option<(f64, Vector3, [f64; 6])> {
        let zero = self.frames(&[0.0; JOINTS])[joint];
        let bodies = self.masses.iter().filter(|m| m.joint == joint && m.tool == tool);
        let bodies: Vec<(f64, Vector3)> =
            bodies.map(|m| (m.kg, transform_point(&zero, m.position))).collect();
        let kg: f64 = bodies.iter().map(|(kg, _)| kg).sum();
        if kg == 0.0 {
            return None;
        }
        let centre = bodies.iter().fold([0.0; 3], |sum, (m, p)| add(sum, scaled(*p, m / kg)));
        let mut inertia = [0.0; 6];
        for (m, p) in &bodies {
            let [x, y, z] = sub(*p, centre);
            let parts = [y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z];
            inertia.iter_mut().zip(parts).for_each(|(sum, part)| *sum += m * part);
        }
        Some((kg, centre, inertia))
    }

    /// Ten points of one kilogram each on a joint's body: their torques span those of any rigid body there.
    #[must_use]
    pub fn unit_masses(joint: usize) -> [Mass; 10] {
        let e = |k: usize, by: f64| {
            let mut v = [0.0; 3];
            v[k] = by;
            v
        };
        let spots = [
            [0.0; 3],
            e(0, 0.5),
            e(1, 0.5),
            e(2, 0.5),
            e(0, -0.5),
            e(1, -0.5),
            e(2, -0.5),
            [0.5, 0.5, 0.0],
            [0.5, 0.0, 0.5],
            [0.0, 0.5, 0.5],
        ];
        spots.map(|position| Mass { joint, kg: 1.0, position, tool: false })
    }
}

/// A rotation that maps z to a unit vector.
fn rotation_to_z(axis: Vector3) -> Transform {
    let about = cross([0.0, 0.0, 1.0], axis);
    let sine = norm(about);
    if sine < 1e-12 {
        let half = if axis[2] > 0.0 { 0.0 } else { std::f64::consts::PI };
        return rotation([half, 0.0, 0.0]);
    }
    rotation(scaled(about, sine.atan2(axis[2]) / sine))
}

fn arm_without_masses(name: &str, links: Vec<Transform>) -> Arm {
    Arm {
        name: name.to_owned(),
        links,
        masses: Vec::new(),
        gravity: [0.0, 0.0, -9.806_65],
        home: [0.0; JOINTS],
        half_range: [0.0; JOINTS],
    }
}

/// Replaces each link's mass by three points with the same centre; a tool stays one point.
fn spread_masses(masses: &[Mass]) -> Vec<Mass> {
    let three = |mass: &Mass| {
        let size = 0.06 + 0.25 * norm(mass.position).min(0.4);
        let aside = [[size, 0.3 * size, 0.0], [-0.4 * size, 0.5 * size, 0.6 * size]];
        let third = scaled(add(aside[0], aside[1]), -1.0);
        let all = if mass.tool { vec![[0.0; 3]] } else { vec![aside[0], aside[1], third] };
        let kg = mass.kg / all.len() as f64;
        all.into_iter()
            .map(|by| Mass { kg, position: add(mass.position, by), ..*mass })
            .collect::<Vec<_>>()
    };
    masses.iter().flat_map(three).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(q: f64, v: f64, a: f64) -> [JointState; JOINTS] {
        let mut states = [[0.0; 3]; JOINTS];
        states[0] = [q, v, a];
        states
    }

    #[test]
    fn a_pendulum_holds_its_weight_and_turns_its_inertia() {
        let mut rig = Rig::pendulum(true, &mut Rng::new(1, 0));
        rig.masses = vec![Mass { joint: 0, kg: 2.0, position: [0.0, 0.3, 0.0], tool: false }];
        let mut torques = [0.0; JOINTS];
        let places = rig.frames_nearby(&state(0.5, 1.7, -3.0));
        rig.add_mass_torques(&places, &rig.masses[0].clone(), &mut torques);
        // It hangs down at zero: gravity requires m g l sin q in addition to m l² a; constant velocity requires nothing.
        let expected = 2.0 * 9.806_65 * 0.3 * 0.5_f64.sin() - 2.0 * 0.09 * 3.0;
        assert!((torques[0] - expected).abs() < 1e-5, "{} not {expected}", torques[0]);
    }

    #[test]
    fn a_chain_of_axes_stands_where_it_was_said_to() {
        let axes = [
            ([0.0, 0.0, 1.0], [0.0; 3]),
            ([0.0, -1.0, 0.0], [0.1, 0.0, 0.4]),
            ([0.0, 0.0, -1.0], [0.5, 0.1, 0.3]),
        ];
        let rig = Rig::from_axes(&axes, false, [0.6, 0.0, 0.2], [0.0, 0.0, -9.8]);
        for ((axis, point), frame) in axes.iter().zip(rig.frames(&[0.0; JOINTS])) {
            assert!(norm(sub(column(&frame, 2), *axis)) < 1e-12);
            assert!(norm(sub(origin(&frame), *point)) < 1e-12);
        }
        assert!(norm(sub(rig.tcp(), [0.6, 0.0, 0.2])) < 1e-12);
    }

    #[test]
    fn an_arms_work_is_what_its_energy_gains() {
        let rig = Rig::arm(true, &mut Rng::new(8, 0));
        let states = |t: f64| -> [JointState; JOINTS] {
            std::array::from_fn(|i| {
                let (rate, phase) = (1.1 + 0.3 * i as f64, i as f64);
                let (s, c) = (rate * t + phase).sin_cos();
                [0.5 * s, 0.5 * rate * c, -0.5 * rate * rate * s]
            })
        };
        let energy = |t: f64| {
            let h = 1e-5;
            let frames_at = |t: f64| rig.frames(&states(t).map(|state| state[0]));
            let (before, now, after) = (frames_at(t - h), frames_at(t), frames_at(t + h));
            let kinetic = |m: &Mass| {
                let p = |frames: &[Transform]| transform_point(&frames[m.joint], m.position);
                let v = scaled(sub(p(&after), p(&before)), 0.5 / h);
                m.kg * (0.5 * dot(v, v) - dot(rig.arm.gravity, p(&now)))
            };
            rig.masses.iter().map(kinetic).sum::<f64>()
        };
        for k in 0..20 {
            let t = 0.3 * f64::from(k);
            let (places, now) = (rig.frames_nearby(&states(t)), states(t));
            let mut torques = [0.0; JOINTS];
            rig.masses.iter().for_each(|m| rig.add_mass_torques(&places, m, &mut torques));
            let power: f64 = (0..rig.count()).map(|i| torques[i] * now[i][1]).sum();
            let gained = (energy(t + 1e-3) - energy(t - 1e-3)) / 2e-3;
            assert!((power - gained).abs() < 2e-3 * (1.0 + power.abs()), "{power} {gained}");
        }
    }
}
