//! Actual motion of the motors, and the loads on the arm.
//!
//! Motion: a fine grid between the rows, with the delay and lag of the hidden effects. Loads: forces on point masses, computed from their positions:
//! weight, and −m times the second time difference of the positions.
//!
//! Loads are computed on the nominal arm; an arm at rest has no inertial load.

use crate::arm::{Arm, JOINTS, Joints, Mass};
use crate::kinds::{Effect, Kind};
use crate::scene::{Scene, Segment};
use crate::space::{
    V3, add, column, cross, dot, inverse, mul, origin, point, rotate, rotate_back, sub, times,
    turn, turn_z,
};

/// Longest step of the fine grid, s.
const FINE_S: f64 = 2.5e-3;

/// One segment on a fine grid.
#[derive(Clone, Debug)]
pub struct Fine {
    /// Index of its first row among all rows.
    pub first: usize,
    /// Grid index of each of its rows.
    pub at: Vec<usize>,
    /// Grid times, s.
    pub t_s: Vec<f64>,
    /// Motor positions by joint, rad.
    pub q: Vec<Vec<f64>>,
}

impl Fine {
    /// All segments of a path, with delay and lag.
    #[must_use]
    pub fn of(scene: &Scene, effects: &[Effect]) -> Vec<Self> {
        let mut first = 0;
        let of_segment = |segment: &Segment| {
            let (t_s, at) = grid(&segment.times_s);
            let late: f64 = sum(effects, Kind::TimeDelay, None);
            let joints = 0..scene.arm.count();
            let motor = |i: usize| {
                let heard: Vec<f64> = t_s.iter().map(|t| segment.command(i, t - late)).collect();
                let lag = sum(effects, Kind::ServoLag, Some(i));
                if lag > 0.0 { lagging(&t_s, &heard, lag) } else { heard }
            };
            let q = joints.map(motor).collect();
            let fine = Self { first, at, t_s, q };
            first += segment.times_s.len();
            fine
        };
        scene.segments.iter().map(of_segment).collect()
    }

    /// Velocity and acceleration of a joint at grid point `k`, from three neighbouring points.
    #[must_use]
    pub fn rates(&self, joint: usize, k: usize) -> (f64, f64) {
        let k = k.clamp(1, self.t_s.len() - 2);
        let (a, b) = (self.t_s[k] - self.t_s[k - 1], self.t_s[k + 1] - self.t_s[k]);
        let q = &self.q[joint];
        let (left, right) = ((q[k] - q[k - 1]) / a, (q[k + 1] - q[k]) / b);
        ((left * b + right * a) / (a + b), 2.0 * (right - left) / (a + b))
    }

    /// Motor positions at grid point `k`, rad.
    #[must_use]
    pub fn motors(&self, k: usize) -> Joints {
        let mut q = [0.0; JOINTS];
        q.iter_mut().zip(&self.q).for_each(|(slot, q)| *slot = q[k]);
        q
    }
}

fn sum(effects: &[Effect], kind: Kind, joint: Option<usize>) -> f64 {
    let there = effects.iter().filter(|e| e.kind == kind && joint.is_none_or(|i| e.joint == i));
    there.map(|effect| effect.numbers[0]).sum()
}

fn grid(rows_s: &[f64]) -> (Vec<f64>, Vec<usize>) {
    let (mut t_s, mut at) = (vec![rows_s[0]], vec![0]);
    for pair in rows_s.windows(2) {
        let parts = ((pair[1] - pair[0]) / FINE_S).ceil().max(1.0);
        for part in 1..=parts as usize {
            t_s.push(pair[0] + (pair[1] - pair[0]) * part as f64 / parts);
        }
        at.push(t_s.len() - 1);
    }
    (t_s, at)
}

/// First-order lag, exact for an input that is linear between grid points.
fn lagging(t_s: &[f64], heard: &[f64], lag_s: f64) -> Vec<f64> {
    let mut y = heard[0];
    let mut seen = vec![y];
    for (t, u) in t_s.windows(2).zip(heard.windows(2)) {
        let h = t[1] - t[0];
        let slope = (u[1] - u[0]) / h;
        y = u[1] - slope * lag_s + (y - u[0] + slope * lag_s) * (-h / lag_s).exp();
        seen.push(y);
    }
    seen
}

/// Loads at one row.
#[derive(Clone, Debug, Default)]
pub struct Load {
    /// Torque of weight (and springs) on each joint, Nm.
    pub gravity: Joints,
    /// Torque of the wrench on each joint, Nm.
    pub wrench: Joints,
    /// Torque of the arm's own acceleration on each joint, Nm.
    pub inertia: Joints,
    /// Moment of weight and wrench about each pivot, in the joint's frame before its motion, Nm.
    pub moment: [V3; JOINTS],
    /// Moment of weight and wrench about the base's origin, Nm.
    pub base: V3,
    /// Force on the tool, tool axes, N.
    pub force_tool: V3,
}

impl Load {
    /// Total torque that deflects joint `i`, Nm.
    #[must_use]
    pub fn torque(&self, i: usize) -> f64 {
        self.gravity[i] + self.wrench[i] + self.inertia[i]
    }
}

/// Loads of all rows, including the changes by effects.
#[must_use]
pub fn loads(scene: &Scene, fine: &[Fine], effects: &[Effect]) -> Vec<Load> {
    let masses = masses(&scene.arm, effects);
    let gravity = effects
        .iter()
        .filter(|e| e.kind == Kind::GravityTilt)
        .fold(scene.arm.gravity, |g, e| rotate_back(&turn([e.numbers[0], e.numbers[1], 0.0]), g));
    let mut all = Vec::with_capacity(scene.rows.len());
    for row in &scene.rows {
        let (force, moment) = truth(row.wrench, effects);
        all.push(still(&scene.arm, &masses, gravity, &row.q, (force, moment)));
    }
    for fine in fine {
        for (row, k) in fine.at.iter().enumerate() {
            let q = fine.motors(*k);
            let at = fine.first + row;
            let (force, moment) = truth(scene.rows[at].wrench, effects);
            all[at] = still(&scene.arm, &masses, gravity, &q, (force, moment));
            all[at].inertia = reaction(&scene.arm, &masses, fine, *k);
        }
    }
    for spring in effects.iter().filter(|e| e.kind == Kind::Counterbalance) {
        let [k, free, a, l, angle] = std::array::from_fn(|n| spring.numbers[n]);
        for (load, row) in all.iter_mut().zip(&scene.rows) {
            // The spring's force acts along the line between its two pivots, with a lever arm about the joint.
            let angle = angle + row.q[spring.joint];
            let (end, anchor) = ([l * angle.cos(), l * angle.sin(), 0.0], [-a, 0.0, 0.0]);
            let line = sub(anchor, end);
            let length = dot(line, line).sqrt();
            let pull = times(line, k * (length - free) / length);
            load.gravity[spring.joint] += cross(end, pull)[2];
        }
    }
    all
}

fn masses(arm: &Arm, effects: &[Effect]) -> Vec<Mass> {
    let mut masses = arm.masses.clone();
    let last = arm.count() - 1;
    let zero = arm.frames(&[0.0; JOINTS])[last];
    for load in effects.iter().filter(|e| e.kind == Kind::Payload) {
        let at = point(&inverse(&zero), [load.numbers[1], load.numbers[2], load.numbers[3]]);
        masses.push(Mass { joint: last, kg: load.numbers[0], at, tool: true });
    }
    masses
}

/// True force and moment for the values measured by the sensor; tool axes.
fn truth(read: [f64; 6], effects: &[Effect]) -> (V3, V3) {
    let mut parts = read;
    for bias in effects.iter().filter(|e| e.kind == Kind::WrenchBias) {
        parts.iter_mut().zip(&bias.numbers).for_each(|(x, b)| *x -= b);
    }
    for scale in effects.iter().filter(|e| e.kind == Kind::WrenchScale) {
        parts.iter_mut().zip(&scale.numbers).for_each(|(x, s)| *x /= 1.0 + s);
    }
    let (mut force, mut moment) = ([parts[0], parts[1], parts[2]], [parts[3], parts[4], parts[5]]);
    for mounting in effects.iter().filter(|e| e.kind == Kind::WrenchMisalignment) {
        let turned = turn([mounting.numbers[0], mounting.numbers[1], mounting.numbers[2]]);
        (force, moment) = (rotate(&turned, force), rotate(&turned, moment));
    }
    (force, moment)
}

fn still(arm: &Arm, masses: &[Mass], gravity: V3, q: &Joints, (force, moment): (V3, V3)) -> Load {
    let frames = arm.frames(q);
    let n = arm.count();
    let tool = &frames[n];
    let (force_base, moment_base) = (rotate(tool, force), rotate(tool, moment));
    let mut load = Load { force_tool: force, ..Load::default() };
    let mut weights = Vec::with_capacity(masses.len());
    for mass in masses {
        let at = point(&mul(&frames[mass.joint], &turn_z(q[mass.joint])), mass.at);
        weights.push((mass.joint, at, times(gravity, mass.kg)));
        load.base = add(load.base, cross(at, times(gravity, mass.kg)));
    }
    load.base = add(load.base, add(moment_base, cross(origin(tool), force_base)));
    for (i, frame) in frames.iter().enumerate().take(n) {
        let (axis, o) = (column(frame, 2), origin(frame));
        let carried = weights.iter().filter(|(joint, ..)| *joint >= i);
        let weight = carried.fold([0.0; 3], |sum, (_, at, w)| add(sum, cross(sub(*at, o), *w)));
        let pushed = add(moment_base, cross(sub(origin(tool), o), force_base));
        load.gravity[i] = dot(axis, weight);
        load.wrench[i] = dot(axis, pushed);
        load.moment[i] = rotate_back(frame, add(weight, pushed));
    }
    load
}

/// Inertial forces −m a of all masses, as joint torques.
fn reaction(arm: &Arm, masses: &[Mass], fine: &Fine, k: usize) -> Joints {
    let mut torques = [0.0; JOINTS];
    if masses.is_empty() || fine.t_s.len() < 3 {
        return torques;
    }
    let k = k.clamp(1, fine.t_s.len() - 2);
    let places = |k: usize| {
        let q = fine.motors(k);
        let frames = arm.frames(&q);
        let at = |mass: &Mass| point(&mul(&frames[mass.joint], &turn_z(q[mass.joint])), mass.at);
        (masses.iter().map(at).collect::<Vec<V3>>(), frames)
    };
    let ((before, _), (now, frames), (after, _)) = (places(k - 1), places(k), places(k + 1));
    let (a, b) = (fine.t_s[k] - fine.t_s[k - 1], fine.t_s[k + 1] - fine.t_s[k]);
    for (m, mass) in masses.iter().enumerate() {
        let (left, right) =
            (times(sub(now[m], before[m]), 1.0 / a), times(sub(after[m], now[m]), 1.0 / b));
        let pull = times(sub(right, left), -2.0 * mass.kg / (a + b));
        for (i, torque) in torques.iter_mut().enumerate().take(mass.joint + 1) {
            let lever = sub(now[m], origin(&frames[i]));
            *torque += dot(column(&frames[i], 2), cross(lever, pull));
        }
    }
    torques
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;
    use crate::scene::{Has, Richness};

    #[test]
    fn the_work_of_weight_is_what_height_gives() {
        let mut chance = Chance::new(4, 0);
        let arm = Arm::draw(&mut chance, true);
        let scene = Scene::poses(arm, Has::default(), 20, Richness::Full, &mut chance);
        let energy = |q: &Joints| {
            let frames = scene.arm.frames(q);
            let height = |m: &Mass| point(&mul(&frames[m.joint], &turn_z(q[m.joint])), m.at)[2];
            scene.arm.masses.iter().map(|m| 9.806_65 * m.kg * height(m)).sum::<f64>()
        };
        for (load, row) in loads(&scene, &[], &[]).iter().zip(&scene.rows) {
            for i in 0..scene.arm.count() {
                let h = 1e-5;
                let (mut up, mut down) = (row.q, row.q);
                up[i] += h;
                down[i] -= h;
                let slope = (energy(&up) - energy(&down)) / (2.0 * h);
                assert!((load.gravity[i] + slope).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_lagging_motor_trails_an_even_motion_by_speed_times_lag() {
        let t: Vec<f64> = (0..2000).map(|k| f64::from(k) * 1e-3).collect();
        let heard: Vec<f64> = t.iter().map(|t| 0.7 * t).collect();
        let seen = lagging(&t, &heard, 0.05);
        assert!((0.7 * t[1999] - seen[1999] - 0.035).abs() < 1e-9);
    }
}
