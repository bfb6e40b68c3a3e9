//! Rigid-body load of the motors: a linear axis, a pendulum or an arm of point masses, and its joint torques.
//!
//! `τᵢ = Σ m (p̈ − g) · ∂p/∂qᵢ`, with the acceleration p̈ of a point from its positions slightly before and after on the parabola of the joint
//! motion. The torque of a point is proportional to its mass.

use crate::arm::{Arm, JOINTS, Joints, Mass};
use crate::chance::Chance;
use crate::space::{
    ONE, T4, V3, add, column, cross, dot, inverse, mul, norm, origin, point, rotate, shift, sub,
    times, turn, turn_z,
};

use super::motion::{Room, State};

/// Half width of the second difference of a point's positions, s.
const H_S: f64 = 5e-4;

/// A robot, or a rig with one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Its chain; the joint of a linear axis moves along z instead of about it.
    pub arm: Arm,
    /// Whether the only joint is prismatic.
    pub slides: bool,
    /// Its point masses.
    pub points: Vec<Mass>,
    /// Whether the model states them.
    pub told: bool,
    /// Range of each joint.
    pub rooms: Vec<Room>,
}

/// Frames after each joint's motion: slightly before, now, slightly after.
#[derive(Clone, Debug)]
pub struct Places([Vec<T4>; 3]);

impl Rig {
    /// A linear axis along x, or inclined.
    pub fn slide(told: bool, chance: &mut Chance) -> Self {
        let lean = if chance.happens(0.3) { chance.between(0.2, 1.57) } else { 0.0 };
        // z of the joint's frame points along x, inclined about y.
        let along = turn([0.0, std::f64::consts::FRAC_PI_2 - lean, 0.0]);
        let kg = chance.log_between(5.0, 150.0);
        let at = [0.05, 0.0, 0.02];
        let points = vec![Mass { joint: 0, kg, at, tool: false }];
        let reach = chance.between(0.1, 0.3);
        let fastest = chance.between(0.2, 0.8);
        Self {
            arm: plain("slide", vec![along, shift([0.0, 0.0, 0.1])]),
            slides: true,
            points,
            told,
            rooms: vec![Room { home: 0.0, reach, fastest }],
        }
    }

    /// A pendulum about a horizontal axis.
    pub fn pendulum(told: bool, chance: &mut Chance) -> Self {
        let level = turn([-std::f64::consts::FRAC_PI_2, 0.0, 0.0]);
        let kg = chance.log_between(1.0, 20.0);
        let far = chance.between(0.1, 0.5);
        let body = Mass { joint: 0, kg, at: [0.2 * far, far, 0.01], tool: false };
        let reach = chance.between(0.6, 1.5);
        let fastest = chance.between(1.5, 5.0);
        Self {
            arm: plain("pendulum", vec![level, shift([0.0, far, 0.0])]),
            slides: false,
            points: spread(&[body]),
            told,
            rooms: vec![Room { home: 0.0, reach, fastest }],
        }
    }

    /// An arm with three to six axes.
    pub fn arm(told: bool, chance: &mut Chance) -> Self {
        let number = [0, 1, 2, 2, 4, 5, 5][chance.pick(7)];
        let tool = mul(&shift([0.02, 0.03, 0.12]), &turn([0.2, -0.1, 0.4]));
        let kg = chance.between(0.5, 4.0);
        let mut arm = Arm::family(number, chance.between(0.9, 1.15), &tool, kg, true);
        let points = spread(&std::mem::take(&mut arm.masses));
        let fastest = chance.between(1.2, 2.5);
        let room = |i: usize| Room { home: arm.home[i], reach: arm.reach[i].min(1.6), fastest };
        let rooms = (0..arm.count()).map(room).collect();
        Self { arm, slides: false, points, told, rooms }
    }

    /// A chain of axes through points, base axes at the zero configuration, m, without masses. All joints are revolute; a single joint may be
    /// prismatic.
    #[must_use]
    pub fn of_axes(axes: &[(V3, V3)], slides: bool, tcp: V3, gravity: V3) -> Self {
        let mut links = Vec::with_capacity(axes.len() + 1);
        let mut before = ONE;
        for (axis, at) in axes {
            let frame = mul(&shift(*at), &with_z(*axis));
            links.push(mul(&inverse(&before), &frame));
            before = frame;
        }
        links.push(mul(&inverse(&before), &shift(tcp)));
        let mut arm = plain("a recorded robot", links);
        arm.gravity = gravity;
        let rooms = vec![Room { home: 0.0, reach: 1.0, fastest: 1.0 }; axes.len()];
        Self { arm, slides, points: Vec::new(), told: false, rooms }
    }

    /// Number of joints.
    #[must_use]
    pub fn count(&self) -> usize {
        self.arm.count()
    }

    /// Frames after each joint's motion, at `q`.
    #[must_use]
    pub fn frames(&self, q: &Joints) -> Vec<T4> {
        let mut carried = ONE;
        let moved = |(link, q): (&T4, &f64)| {
            let motion = if self.slides { shift([0.0, 0.0, *q]) } else { turn_z(*q) };
            carried = mul(&mul(&carried, link), &motion);
            carried
        };
        self.arm.links.iter().take(self.count()).zip(q).map(moved).collect()
    }

    /// Frames on the parabola of a state.
    #[must_use]
    pub fn places(&self, states: &[State; JOINTS]) -> Places {
        let at = |h: f64| states.map(|[q, v, a]| q + h * v + 0.5 * h * h * a);
        Places([-H_S, 0.0, H_S].map(|h| self.frames(&at(h))))
    }

    /// Adds the joint torques required by a point mass, Nm or N.
    pub fn hold(&self, places: &Places, mass: &Mass, torques: &mut Joints) {
        let [before, now, after] =
            places.0.each_ref().map(|frames| point(&frames[mass.joint], mass.at));
        let bent = sub(add(before, after), times(now, 2.0));
        let force = times(sub(times(bent, 1.0 / (H_S * H_S)), self.arm.gravity), mass.kg);
        for (i, frame) in places.0[1].iter().enumerate().take(mass.joint + 1) {
            let axis = column(frame, 2);
            torques[i] += if self.slides {
                dot(axis, force)
            } else {
                dot(cross(axis, sub(now, origin(frame))), force)
            };
        }
    }

    /// Adds the joint torques, up to `joint`, against the weight of a first mass moment fixed to that joint's body, base axes at the zero
    /// configuration, kg m.
    pub fn hold_moment(&self, places: &Places, joint: usize, moment: V3, torques: &mut Joints) {
        let own = self.arm.into_joint(joint, moment);
        let weight = cross(rotate(&places.0[1][joint], own), self.arm.gravity);
        for (i, frame) in places.0[1].iter().enumerate().take(joint + 1) {
            torques[i] -= dot(column(frame, 2), weight);
        }
    }

    /// A point mass at the last joint, given in base axes at the zero configuration.
    #[must_use]
    pub fn at_flange(&self, kg: f64, at: V3) -> Mass {
        let joint = self.count() - 1;
        let zero = self.frames(&[0.0; JOINTS])[joint];
        Mass { joint, kg, at: point(&inverse(&zero), at), tool: true }
    }

    /// The tool centre point at the zero configuration, m.
    #[must_use]
    pub fn tcp(&self) -> V3 {
        origin(&self.arm.tool(&[0.0; JOINTS]))
    }

    /// A body's mass (kg), centre of mass (m, base axes at the zero configuration) and inertia about it (xx, yy, zz, xy, xz, yz; kg m²).
    #[must_use]
    pub fn body(&self, joint: usize, tool: bool) -> Option<(f64, V3, [f64; 6])> {
        let zero = self.frames(&[0.0; JOINTS])[joint];
        let own = self.points.iter().filter(|m| m.joint == joint && m.tool == tool);
        let own: Vec<(f64, V3)> = own.map(|m| (m.kg, point(&zero, m.at))).collect();
        let kg: f64 = own.iter().map(|(kg, _)| kg).sum();
        if kg == 0.0 {
            return None;
        }
        let centre = own.iter().fold([0.0; 3], |sum, (m, p)| add(sum, times(*p, m / kg)));
        let mut inertia = [0.0; 6];
        for (m, p) in &own {
            let [x, y, z] = sub(*p, centre);
            let parts = [y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z];
            inertia.iter_mut().zip(parts).for_each(|(sum, part)| *sum += m * part);
        }
        Some((kg, centre, inertia))
    }

    /// Ten points of one kilogram each on a joint's body: their torques span those of any rigid body there.
    #[must_use]
    pub fn probes(joint: usize) -> [Mass; 10] {
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
        spots.map(|at| Mass { joint, kg: 1.0, at, tool: false })
    }
}

/// A rotation that maps z to a unit vector.
fn with_z(axis: V3) -> T4 {
    let about = cross([0.0, 0.0, 1.0], axis);
    let sine = norm(about);
    if sine < 1e-12 {
        let half = if axis[2] > 0.0 { 0.0 } else { std::f64::consts::PI };
        return turn([half, 0.0, 0.0]);
    }
    turn(times(about, sine.atan2(axis[2]) / sine))
}

fn plain(name: &str, links: Vec<T4>) -> Arm {
    Arm {
        name: name.to_owned(),
        links,
        masses: Vec::new(),
        gravity: [0.0, 0.0, -9.806_65],
        home: [0.0; JOINTS],
        reach: [0.0; JOINTS],
    }
}

/// Replaces each link's mass by three points with the same centre; a tool stays one point.
fn spread(masses: &[Mass]) -> Vec<Mass> {
    let three = |mass: &Mass| {
        let size = 0.06 + 0.25 * norm(mass.at).min(0.4);
        let aside = [[size, 0.3 * size, 0.0], [-0.4 * size, 0.5 * size, 0.6 * size]];
        let third = times(add(aside[0], aside[1]), -1.0);
        let all = if mass.tool { vec![[0.0; 3]] } else { vec![aside[0], aside[1], third] };
        let kg = mass.kg / all.len() as f64;
        all.into_iter().map(|by| Mass { kg, at: add(mass.at, by), ..*mass }).collect::<Vec<_>>()
    };
    masses.iter().flat_map(three).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(q: f64, v: f64, a: f64) -> [State; JOINTS] {
        let mut states = [[0.0; 3]; JOINTS];
        states[0] = [q, v, a];
        states
    }

    #[test]
    fn a_pendulum_holds_its_weight_and_turns_its_inertia() {
        let mut rig = Rig::pendulum(true, &mut Chance::new(1, 0));
        rig.points = vec![Mass { joint: 0, kg: 2.0, at: [0.0, 0.3, 0.0], tool: false }];
        let mut torques = [0.0; JOINTS];
        let places = rig.places(&state(0.5, 1.7, -3.0));
        rig.hold(&places, &rig.points[0].clone(), &mut torques);
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
        let rig = Rig::of_axes(&axes, false, [0.6, 0.0, 0.2], [0.0, 0.0, -9.8]);
        for ((axis, at), frame) in axes.iter().zip(rig.frames(&[0.0; JOINTS])) {
            assert!(norm(sub(column(&frame, 2), *axis)) < 1e-12);
            assert!(norm(sub(origin(&frame), *at)) < 1e-12);
        }
        assert!(norm(sub(rig.tcp(), [0.6, 0.0, 0.2])) < 1e-12);
    }

    #[test]
    fn an_arms_work_is_what_its_energy_gains() {
        let rig = Rig::arm(true, &mut Chance::new(8, 0));
        let states = |t: f64| -> [State; JOINTS] {
            std::array::from_fn(|i| {
                let (rate, phase) = (1.1 + 0.3 * i as f64, i as f64);
                let (s, c) = (rate * t + phase).sin_cos();
                [0.5 * s, 0.5 * rate * c, -0.5 * rate * rate * s]
            })
        };
        let energy = |t: f64| {
            let h = 1e-5;
            let at = |t: f64| rig.frames(&states(t).map(|state| state[0]));
            let (before, now, after) = (at(t - h), at(t), at(t + h));
            let of = |m: &Mass| {
                let p = |frames: &[T4]| point(&frames[m.joint], m.at);
                let v = times(sub(p(&after), p(&before)), 0.5 / h);
                m.kg * (0.5 * dot(v, v) - dot(rig.arm.gravity, p(&now)))
            };
            rig.points.iter().map(of).sum::<f64>()
        };
        for k in 0..20 {
            let t = 0.3 * f64::from(k);
            let (places, now) = (rig.places(&states(t)), states(t));
            let mut torques = [0.0; JOINTS];
            rig.points.iter().for_each(|m| rig.hold(&places, m, &mut torques));
            let power: f64 = (0..rig.count()).map(|i| torques[i] * now[i][1]).sum();
            let gained = (energy(t + 1e-3) - energy(t - 1e-3)) / 2e-3;
            assert!((power - gained).abs() < 2e-3 * (1.0 + power.abs()), "{power} {gained}");
        }
    }
}
