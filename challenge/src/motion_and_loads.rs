//! Actual motion of the motors, and the loads on the arm.
//!
//! Motion: a fine grid between the rows, with the delay and lag of the hidden effects. Loads: forces on point masses, computed from their positions:
//! weight, and −m times the second time difference of the positions.
//!
//! Loads are computed on the nominal arm; an arm at rest has no inertial load.

use crate::arm::{Arm, JOINTS, Joints, Mass};
use crate::kinds::{Effect, Kind};
use crate::scene::{Scene, Segment};
use crate::transform::{
    Vector3, add, column, cross, dot, inverse, mul, origin, rotate, rotate_inverse, rotation,
    rotation_z, scaled, sub, transform_point,
};

/// Longest step of the fine grid, s.
const MAX_STEP_S: f64 = 2.5e-3;

/// One segment on a fine grid.
#[derive(Clone, Debug)]
pub struct FineMotion {
    /// Index of its first row among all rows.
    pub first_row: usize,
    /// Grid index of each of its rows.
    pub row_index: Vec<usize>,
    /// Grid times, s.
    pub t_s: Vec<f64>,
    /// Motor positions by joint, rad.
    pub q: Vec<Vec<f64>>,
}

impl FineMotion {
    /// All segments of a path, with delay and lag.
    #[must_use]
    pub fn from_scene(scene: &Scene, effects: &[Effect]) -> Vec<Self> {
        let mut first_row = 0;
        let of_segment = |segment: &Segment| {
            let (t_s, row_index) = fine_grid(&segment.times_s);
            let late: f64 = sum_of_kind(effects, Kind::TimeDelay, None);
            let joints = 0..scene.arm.joint_count();
            let motor = |i: usize| {
                let delayed: Vec<f64> =
                    t_s.iter().map(|t| segment.commanded_position(i, t - late)).collect();
                let lag = sum_of_kind(effects, Kind::ServoLag, Some(i));
                if lag > 0.0 { first_order_lag(&t_s, &delayed, lag) } else { delayed }
            };
            let q = joints.map(motor).collect();
            let fine = Self { first_row, row_index, t_s, q };
            first_row += segment.times_s.len();
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

fn sum_of_kind(effects: &[Effect], kind: Kind, joint: Option<usize>) -> f64 {
    let recorded = effects.iter().filter(|e| e.kind == kind && joint.is_none_or(|i| e.joint == i));
    recorded.map(|effect| effect.parameters[0]).sum()
}

fn fine_grid(rows_s: &[f64]) -> (Vec<f64>, Vec<usize>) {
    let (mut t_s, mut row_indices) = (vec![rows_s[0]], vec![0]);
    for pair in rows_s.windows(2) {
        let parts = ((pair[1] - pair[0]) / MAX_STEP_S).ceil().max(1.0);
        for part in 1..=parts as usize {
            t_s.push(pair[0] + (pair[1] - pair[0]) * part as f64 / parts);
        }
        row_indices.push(t_s.len() - 1);
    }
    (t_s, row_indices)
}

/// First-order lag, exact for an input that is linear between grid points.
fn first_order_lag(t_s: &[f64], delayed: &[f64], lag_s: f64) -> Vec<f64> {
    let mut y = delayed[0];
    let mut lagged = vec![y];
    for (t, u) in t_s.windows(2).zip(delayed.windows(2)) {
        let h = t[1] - t[0];
        let slope = (u[1] - u[0]) / h;
        y = u[1] - slope * lag_s + (y - u[0] + slope * lag_s) * (-h / lag_s).exp();
        lagged.push(y);
    }
    lagged
}

/// Loads at one row.
#[derive(Clone, Debug, Default)]
pub struct Loads {
    /// Torque of weight (and springs) on each joint, Nm.
    pub gravity: Joints,
    /// Torque of the wrench on each joint, Nm.
    pub wrench: Joints,
    /// Torque of the arm's own acceleration on each joint, Nm.
    pub inertia: Joints,
    /// Moment of weight and wrench about each pivot, in the joint's frame before its motion, Nm.
    pub moment: [Vector3; JOINTS],
    /// Moment of weight and wrench about the base's origin, Nm.
    pub base_moment: Vector3,
    /// Force on the tool, tool axes, N.
    pub force_tool: Vector3,
}

impl Loads {
    /// Total torque that deflects joint `i`, Nm.
    #[must_use]
    pub fn torque(&self, i: usize) -> f64 {
        self.gravity[i] + self.wrench[i] + self.inertia[i]
    }
}

/// Loads of all rows, including the changes by effects.
#[must_use]
pub fn loads(scene: &Scene, fine: &[FineMotion], effects: &[Effect]) -> Vec<Loads> {
    let masses = masses_with_payload(&scene.arm, effects);
    let gravity =
        effects.iter().filter(|e| e.kind == Kind::GravityTilt).fold(scene.arm.gravity, |g, e| {
            rotate_inverse(&rotation([e.parameters[0], e.parameters[1], 0.0]), g)
        });
    let mut all = Vec::with_capacity(scene.rows.len());
    for row in &scene.rows {
        let (force, moment) = actual_wrench(row.wrench, effects);
        all.push(static_loads(&scene.arm, &masses, gravity, &row.q, (force, moment)));
    }
    for fine in fine {
        for (row, k) in fine.row_index.iter().enumerate() {
            let q = fine.motors(*k);
            let index = fine.first_row + row;
            let (force, moment) = actual_wrench(scene.rows[index].wrench, effects);
            all[index] = static_loads(&scene.arm, &masses, gravity, &q, (force, moment));
            all[index].inertia = inertial_torques(&scene.arm, &masses, fine, *k);
        }
    }
    for spring in effects.iter().filter(|e| e.kind == Kind::Counterbalance) {
        let [k, free, a, l, angle] = std::array::from_fn(|n| spring.parameters[n]);
        for (load, row) in all.iter_mut().zip(&scene.rows) {
            // The spring's force acts along the line between its two pivots, with a lever arm about the joint.
            let angle = angle + row.q[spring.joint];
            let (end, anchor) = ([l * angle.cos(), l * angle.sin(), 0.0], [-a, 0.0, 0.0]);
            let line = sub(anchor, end);
            let length = dot(line, line).sqrt();
            let pull = scaled(line, k * (length - free) / length);
            load.gravity[spring.joint] += cross(end, pull)[2];
        }
    }
    all
}

fn masses_with_payload(arm: &Arm, effects: &[Effect]) -> Vec<Mass> {
    let mut masses = arm.masses.clone();
    let last = arm.joint_count() - 1;
    let zero = arm.frames(&[0.0; JOINTS])[last];
    for load in effects.iter().filter(|e| e.kind == Kind::Payload) {
        let position = transform_point(
            &inverse(&zero),
            [load.parameters[1], load.parameters[2], load.parameters[3]],
        );
        masses.push(Mass { joint: last, kg: load.parameters[0], position, tool: true });
    }
    masses
}

/// True force and moment for the values measured by the sensor; tool axes.
fn actual_wrench(read: [f64; 6], effects: &[Effect]) -> (Vector3, Vector3) {
    let mut parts = read;
    for bias in effects.iter().filter(|e| e.kind == Kind::WrenchBias) {
        parts.iter_mut().zip(&bias.parameters).for_each(|(x, b)| *x -= b);
    }
    for scale in effects.iter().filter(|e| e.kind == Kind::WrenchScale) {
        parts.iter_mut().zip(&scale.parameters).for_each(|(x, s)| *x /= 1.0 + s);
    }
    let (mut force, mut moment) = ([parts[0], parts[1], parts[2]], [parts[3], parts[4], parts[5]]);
    for mounting in effects.iter().filter(|e| e.kind == Kind::WrenchMisalignment) {
        let turned =
            rotation([mounting.parameters[0], mounting.parameters[1], mounting.parameters[2]]);
        (force, moment) = (rotate(&turned, force), rotate(&turned, moment));
    }
    (force, moment)
}

fn static_loads(
    arm: &Arm,
    masses: &[Mass],
    gravity: Vector3,
    q: &Joints,
    (force, moment): (Vector3, Vector3),
) -> Loads {
    let frames = arm.frames(q);
    let n = arm.joint_count();
    let tool = &frames[n];
    let (force_base, moment_base) = (rotate(tool, force), rotate(tool, moment));
    let mut load = Loads { force_tool: force, ..Loads::default() };
    let mut weights = Vec::with_capacity(masses.len());
    for mass in masses {
        let position =
            transform_point(&mul(&frames[mass.joint], &rotation_z(q[mass.joint])), mass.position);
        weights.push((mass.joint, position, scaled(gravity, mass.kg)));
        load.base_moment = add(load.base_moment, cross(position, scaled(gravity, mass.kg)));
    }
    load.base_moment = add(load.base_moment, add(moment_base, cross(origin(tool), force_base)));
    for (i, frame) in frames.iter().enumerate().take(n) {
        let (axis, o) = (column(frame, 2), origin(frame));
        let carried = weights.iter().filter(|(joint, ..)| *joint >= i);
        let weight =
            carried.fold([0.0; 3], |sum, (_, position, w)| add(sum, cross(sub(*position, o), *w)));
        let pushed = add(moment_base, cross(sub(origin(tool), o), force_base));
        load.gravity[i] = dot(axis, weight);
        load.wrench[i] = dot(axis, pushed);
        load.moment[i] = rotate_inverse(frame, add(weight, pushed));
    }
    load
}

/// Inertial forces −m a of all masses, as joint torques.
fn inertial_torques(arm: &Arm, masses: &[Mass], fine: &FineMotion, k: usize) -> Joints {
    let mut torques = [0.0; JOINTS];
    if masses.is_empty() || fine.t_s.len() < 3 {
        return torques;
    }
    let k = k.clamp(1, fine.t_s.len() - 2);
    let places = |k: usize| {
        let q = fine.motors(k);
        let frames = arm.frames(&q);
        let position = |mass: &Mass| {
            transform_point(&mul(&frames[mass.joint], &rotation_z(q[mass.joint])), mass.position)
        };
        (masses.iter().map(position).collect::<Vec<Vector3>>(), frames)
    };
    let ((before, _), (now, frames), (after, _)) = (places(k - 1), places(k), places(k + 1));
    let (a, b) = (fine.t_s[k] - fine.t_s[k - 1], fine.t_s[k + 1] - fine.t_s[k]);
    for (m, mass) in masses.iter().enumerate() {
        let (left, right) =
            (scaled(sub(now[m], before[m]), 1.0 / a), scaled(sub(after[m], now[m]), 1.0 / b));
        let pull = scaled(sub(right, left), -2.0 * mass.kg / (a + b));
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
    use crate::rng::Rng;
    use crate::scene::{Excitation, RecordedInputs};

    #[test]
    fn the_work_of_weight_is_what_height_gives() {
        let mut rng = Rng::new(4, 0);
        let arm = Arm::random(&mut rng, true);
        let scene =
            Scene::random_poses(arm, RecordedInputs::default(), 20, Excitation::Full, &mut rng);
        let energy = |q: &Joints| {
            let frames = scene.arm.frames(q);
            let height = |m: &Mass| {
                transform_point(&mul(&frames[m.joint], &rotation_z(q[m.joint])), m.position)[2]
            };
            scene.arm.masses.iter().map(|m| 9.806_65 * m.kg * height(m)).sum::<f64>()
        };
        for (load, row) in loads(&scene, &[], &[]).iter().zip(&scene.rows) {
            for i in 0..scene.arm.joint_count() {
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
        let delayed: Vec<f64> = t.iter().map(|t| 0.7 * t).collect();
        let lagged = first_order_lag(&t, &delayed, 0.05);
        assert!((0.7 * t[1999] - lagged[1999] - 0.035).abs() < 1e-9);
    }
}
