//! Laws of the hidden effects, formulated independently: contacts, elastic-slip elements, two thermal nodes, series with sidebands.
//!
//! Laws outside the catalogue, δθ of joint i, p another joint's position: `CableDrag` a v sin q; `VaryingDelay` −Δ v sin p;
//! `SpeedCube` c v³; `CrossJoint` A sin 2p; `VaryingPlay` backlash whose gap follows sin q.
//!
//! Zero parameters give zero deviation. No noise is added here.

use crate::arm::JOINTS;
use crate::deviation::{BASE, Deviation, TOOL};
use crate::kinds::{Effect, Kind};
use crate::motion_and_loads::{FineMotion, Loads, loads};
use crate::scene::Scene;
use crate::transform::{Vector3, add, scaled};

/// Number of elasto-slip elements of a hysteresis.
const SLIP_ELEMENTS: usize = 40;
/// Relative amplitude of each sideband of a gear error.
const SIDEBAND: f64 = 0.01;
/// Ratio of the time constants of surface and core.
const SURFACE_LAG_FRACTION: f64 = 0.03;

/// A scene with the motor motion and the loads on the arm.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Segments of a path; empty for poses.
    pub fine_motion: Vec<FineMotion>,
    /// One per row.
    pub loads: Vec<Loads>,
}

impl<'a> Run<'a> {
    /// The scene with motor motion and loads under these effects.
    #[must_use]
    pub fn new(scene: &'a Scene, effects: &[Effect]) -> Self {
        let fine_motion = FineMotion::from_scene(scene, effects);
        let loads = loads(scene, &fine_motion, effects);
        Self { scene, fine_motion, loads }
    }

    /// Motor positions at each row, rad.
    #[must_use]
    pub fn motor_positions(&self) -> Vec<[f64; JOINTS]> {
        let mut q: Vec<_> = self.scene.rows.iter().map(|row| row.q).collect();
        for fine in &self.fine_motion {
            for (row, k) in fine.row_index.iter().enumerate() {
                q[fine.first_row + row] = fine.motors(*k);
            }
        }
        q
    }

    /// Deviations by the effects, row by row; effects on motors and loads alone add none here.
    #[must_use]
    pub fn deviations(&self, effects: &[Effect]) -> Vec<Deviation> {
        let mut deviations = vec![Deviation::default(); self.scene.rows.len()];
        let motors = self.motor_positions();
        for effect in merge_backlash(effects) {
            self.add(&effect, &motors, &mut deviations);
        }
        deviations
    }

    fn add(&self, effect: &Effect, motors: &[[f64; JOINTS]], deviations: &mut [Deviation]) {
        let (i, x) = (effect.joint, &effect.parameters);
        let mut angle = |signal: Vec<f64>| {
            deviations
                .iter_mut()
                .zip(signal)
                .for_each(|(deviation, by)| *deviation.component_mut(i, 0) += by);
        };
        let of_motor = |law: &dyn Fn(f64) -> f64| motors.iter().map(|q| law(q[i])).collect();
        let of_load = |law: &dyn Fn(&Loads) -> f64| self.loads.iter().map(law).collect();
        match effect.kind {
            Kind::JointOffset => angle(vec![x[0]; motors.len()]),
            Kind::JointRatio => angle(of_motor(&|q| x[0] * q)),
            Kind::JointCoupling => {
                angle(motors.iter().map(|q| x[0] * q[effect.other_joint]).collect());
            }
            Kind::TransmissionError => angle(of_motor(&|q| transmission_error(x, q))),
            Kind::LostMotion => angle(of_load(&|load| 0.5 * x[0] * (load.torque(i) / x[1]).tanh())),
            Kind::GravityCompliance => angle(of_load(&|load| x[0] * load.gravity[i])),
            Kind::LoadCompliance => angle(of_load(&|load| x[0] * load.wrench[i])),
            Kind::JointCompliance => angle(of_load(&|load| x[0] * load.torque(i))),
            Kind::StiffnessHardening => angle(of_load(&|load| -x[0] * load.torque(i).powi(3))),
            Kind::ThermalZero | Kind::ThermalZeroLag | Kind::ThermalZeroWarmUp => {
                angle(self.thermal_response(effect));
            }
            Kind::CrossJoint => {
                angle(motors.iter().map(|q| x[0] * (2.0 * q[effect.other_joint]).sin()).collect());
            }
            Kind::Backlash
            | Kind::Hysteresis
            | Kind::FlexibleMode
            | Kind::ReversalSpike
            | Kind::CableDrag
            | Kind::VaryingDelay
            | Kind::SpeedCube
            | Kind::VaryingPlay => angle(self.history_dependent(effect)),
            Kind::ThermalGrowth | Kind::ThermalGrowthLag | Kind::ThermalGrowthWarmUp => {
                let grown = self.thermal_response(effect);
                deviations
                    .iter_mut()
                    .zip(grown)
                    .for_each(|(deviation, by)| *deviation.component_mut(i, 8) += by);
            }
            Kind::SpindleGrowth | Kind::SpindleGrowthSpeed => {
                let grown = self.thermal_response(effect);
                deviations
                    .iter_mut()
                    .zip(grown)
                    .for_each(|(deviation, by)| deviation.0[TOOL + 2] += by);
            }
            _ => self.add_geometry(effect, motors, deviations),
        }
    }

    /// Adds effects between joints, at the base or the tool; effects on motors and loads alone are skipped.
    fn add_geometry(
        &self,
        effect: &Effect,
        motors: &[[f64; JOINTS]],
        deviations: &mut [Deviation],
    ) {
        let (i, x, arm) = (effect.joint, &effect.parameters, &self.scene.arm);
        match effect.kind {
            Kind::AxisTilt | Kind::AxisWobble => {
                let [n1, n2] = arm.normals(i);
                for (bend, q) in deviations.iter_mut().zip(motors) {
                    let [t1, t2] = if effect.kind == Kind::AxisTilt {
                        [x[0], x[1]]
                    } else {
                        [x[0] * (x[4] * q[i] + x[2]).sin(), x[1] * (x[4] * q[i] + x[3]).sin()]
                    };
                    bend.add_rotation(i, 1, add(scaled(n1, t1), scaled(n2, t2)));
                }
            }
            Kind::AxisShift => {
                let local = arm.joint_from_base(i, three(x));
                for deviation in deviations {
                    (0..3).for_each(|k| *deviation.component_mut(i, 5 + k) += local[k]);
                }
            }
            Kind::BearingCompliance => {
                for (bend, load) in deviations.iter_mut().zip(&self.loads) {
                    bend.add_rotation(i, 3, scaled(load.moment[i], x[0]));
                }
            }
            Kind::BaseCompliance => {
                for (bend, load) in deviations.iter_mut().zip(&self.loads) {
                    (0..2).for_each(|k| bend.0[BASE + k] += x[0] * load.base_moment[k]);
                }
            }
            Kind::ToolCompliance => {
                for (bend, load) in deviations.iter_mut().zip(&self.loads) {
                    (0..3).for_each(|k| bend.0[TOOL + k] += x[k] * load.force_tool[k]);
                }
            }
            Kind::ToolOffset => {
                for deviation in deviations {
                    (0..3).for_each(|k| deviation.0[TOOL + k] += x[k]);
                }
            }
            _ => {}
        }
    }

    /// Effects that depend on the history of the motor position.
    fn history_dependent(&self, effect: &Effect) -> Vec<f64> {
        let scene = self.scene;
        if scene.is_settled() {
            let rows = scene.rows.iter();
            return rows
                .map(|row| settled_error(effect, row.approach[effect.joint], row.q[effect.joint]))
                .collect();
        }
        let mut all = Vec::with_capacity(scene.rows.len());
        for (fine, segment) in self.fine_motion.iter().zip(&scene.segments) {
            let start = segment.backlash_position[effect.joint];
            all.extend(match effect.kind {
                Kind::Backlash => at_rows(
                    fine,
                    &backlash_contact(&fine.q[effect.joint], start, |_| effect.parameters[0]),
                ),
                Kind::VaryingPlay => {
                    let gap = |q: f64| effect.parameters[0].abs() * (0.5 + 0.5 * q.sin());
                    at_rows(fine, &backlash_contact(&fine.q[effect.joint], start, gap))
                }
                Kind::Hysteresis => {
                    let [height, distance] = [effect.parameters[0], effect.parameters[1]];
                    at_rows(fine, &elasto_slip(&fine.q[effect.joint], height, distance))
                }
                Kind::FlexibleMode => at_rows(fine, &modal_response(fine, effect)),
                Kind::ReversalSpike => reversal_spike(fine, effect),
                _ => fine.row_index.iter().map(|k| speed_dependent(effect, fine, *k)).collect(),
            });
        }
        all
    }

    /// Thermal response at each row, times its amplitude.
    fn thermal_response(&self, effect: &Effect) -> Vec<f64> {
        let x = &effect.parameters;
        let (scene, i) = (self.scene, effect.joint);
        let has_joint_temperature = scene.recorded.joint_temperatures
            && !matches!(effect.kind, Kind::SpindleGrowth | Kind::SpindleGrowthSpeed);
        let cause = |row: &crate::scene::Row| match effect.kind {
            Kind::SpindleGrowthSpeed => row.rpm,
            _ if has_joint_temperature => row.joint_c[i] - 20.0,
            _ => row.ambient_c - 20.0,
        };
        let lag_s = match effect.kind {
            Kind::ThermalGrowthLag | Kind::ThermalZeroLag => x[1],
            Kind::ThermalGrowthWarmUp | Kind::ThermalZeroWarmUp => {
                let start = scene.rows[0].t_s;
                return scene
                    .rows
                    .iter()
                    .map(|row| x[0] * (1.0 - (-(row.t_s - start) / x[1]).exp()))
                    .collect();
            }
            _ => return scene.rows.iter().map(|row| x[0] * cause(row)).collect(),
        };
        // Two nodes: air heats the surface, the surface heats the core.
        let mut nodes: Option<(f64, f64)> = None;
        let mut before = (0, 0.0);
        let mut all = Vec::with_capacity(scene.rows.len());
        for row in &scene.rows {
            let u = cause(row);
            let (mut surface, mut core) =
                nodes.filter(|_| before.0 == row.segment).unwrap_or((u, u));
            let steps = 16.0;
            let h = (row.t_s - before.1).max(0.0) / steps;
            for _ in 0..steps as usize {
                surface = u + (surface - u) * (-h / (SURFACE_LAG_FRACTION * lag_s)).exp();
                core = surface + (core - surface) * (-h / lag_s).exp();
            }
            (nodes, before) = (Some((surface, core)), (row.segment, row.t_s));
            all.push(x[0] * core);
        }
        all
    }
}

fn three(x: &[f64]) -> Vector3 {
    [x[0], x[1], x[2]]
}

/// Transmission error of a gear mesh with the sidebands of its carrier.
fn transmission_error(x: &[f64], q: f64) -> f64 {
    let line = |n: f64, share: f64, phase: f64| share * x[0] * (n * q + x[2] + phase).sin();
    line(x[1], 1.0, 0.0)
        + line(x[1] + 1.0, SIDEBAND, 0.9)
        + line((x[1] - 1.0).max(0.5), SIDEBAND, -1.7)
}

/// Error of a settled pose after a long move in direction `d`.
fn settled_error(effect: &Effect, d: f64, q: f64) -> f64 {
    let gap = match effect.kind {
        Kind::VaryingPlay => effect.parameters[0].abs() * (0.5 + 0.5 * q.sin()),
        Kind::Backlash | Kind::Hysteresis => effect.parameters[0],
        _ => 0.0,
    };
    // The motor pushes the link ahead of it: the link lags by half the gap.
    -0.5 * gap * d
}

/// Combines the gaps of a joint into one: they are in series, and the link moves once all are crossed.
fn merge_backlash(effects: &[Effect]) -> Vec<Effect> {
    let mut all: Vec<Effect> = Vec::with_capacity(effects.len());
    for effect in effects {
        let is_gap = |other: &&mut Effect| {
            effect.kind == Kind::Backlash
                && other.kind == effect.kind
                && other.joint == effect.joint
        };
        match all.iter_mut().find(is_gap) {
            Some(gap) => gap.parameters[0] += effect.parameters[0],
            None => all.push(effect.clone()),
        }
    }
    all
}

/// Link position minus motor position for a link between two faces of the motor side, held by friction unless a face pushes it.
fn backlash_contact(motor: &[f64], start: f64, gap: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut link = motor[0] + 0.5 * start * gap(motor[0]);
    let follow = |m: &f64| {
        let half = 0.5 * gap(*m);
        let (behind, before) = (m - half, m + half);
        if link < behind {
            link = behind;
        }
        if link > before {
            link = before;
        }
        link - m
    };
    motor.iter().map(follow).collect()
}

/// Elasto-slip elements of equal strength; their yield distances are distributed so that the sum builds up exponentially.
pub(crate) fn elasto_slip(motor: &[f64], height: f64, distance: f64) -> Vec<f64> {
    // After a reversal by x, an element slips at twice its yield distance y: for a response 1 − e^(−x/s), twice the yield distances must have the
    // density x e^(−x/s).
    let yields: Vec<f64> = (0..SLIP_ELEMENTS)
        .map(|k| 0.5 * distance * gamma2((k as f64 + 0.5) / SLIP_ELEMENTS as f64))
        .collect();
    let share = height / SLIP_ELEMENTS as f64;
    let mut stretched = vec![0.0; SLIP_ELEMENTS];
    let mut before = motor[0];
    let follow = |m: &f64| {
        let moved = m - before;
        before = *m;
        let mut sum = 0.0;
        for (x, limit) in stretched.iter_mut().zip(&yields) {
            *x = (*x + moved).clamp(-limit, *limit);
            sum += *x / limit;
        }
        -0.5 * share * sum
    };
    motor.iter().map(follow).collect()
}

/// Quantile of the distribution with density x e^(−x).
fn gamma2(share: f64) -> f64 {
    let (mut low, mut high) = (0.0_f64, 40.0_f64);
    for _ in 0..60 {
        let x = 0.5 * (low + high);
        if 1.0 - (1.0 + x) * (-x).exp() < share {
            low = x;
        } else {
            high = x;
        }
    }
    0.5 * (low + high)
}

/// A spring-mass oscillator excited by the joint's acceleration, integrated by Runge-Kutta.
fn modal_response(fine: &FineMotion, effect: &Effect) -> Vec<f64> {
    let (share, omega, damping) =
        (effect.parameters[0], std::f64::consts::TAU * effect.parameters[1], effect.parameters[2]);
    let pull = |k: usize| share * fine.rates(effect.joint, k).1;
    let (mut x, mut v) = (0.0, 0.0);
    let mut all = vec![0.0];
    for k in 1..fine.t_s.len() {
        let h = fine.t_s[k] - fine.t_s[k - 1];
        let (from, to) = (pull(k - 1), pull(k));
        let slope = |x: f64, v: f64, part: f64| {
            (v, -2.0 * damping * omega * v - omega * omega * x - (from + (to - from) * part))
        };
        let a = slope(x, v, 0.0);
        let b = slope(x + 0.5 * h * a.0, v + 0.5 * h * a.1, 0.5);
        let c = slope(x + 0.5 * h * b.0, v + 0.5 * h * b.1, 0.5);
        let d = slope(x + h * c.0, v + h * c.1, 1.0);
        x += h / 6.0 * (a.0 + 2.0 * b.0 + 2.0 * c.0 + d.0);
        v += h / 6.0 * (a.1 + 2.0 * b.1 + 2.0 * c.1 + d.1);
        all.push(x);
    }
    all
}

/// A servo with a transient error after each reversal; reversals are detected at the rows.
fn reversal_spike(fine: &FineMotion, effect: &Effect) -> Vec<f64> {
    let q = &fine.q[effect.joint];
    let (mut sign, mut turned_s) = (0.0, None);
    let mut all = vec![0.0];
    for pair in fine.row_index.windows(2) {
        let moved = q[pair[1]] - q[pair[0]];
        if moved != 0.0 && moved.signum() != sign {
            if sign != 0.0 {
                turned_s = Some(fine.t_s[pair[0]]);
            }
            sign = moved.signum();
        }
        let since = |turned: f64| (-(fine.t_s[pair[1]] - turned) / effect.parameters[1]).exp();
        all.push(turned_s.map_or(0.0, |turned| -effect.parameters[0] * sign * since(turned)));
    }
    all
}

fn speed_dependent(effect: &Effect, fine: &FineMotion, k: usize) -> f64 {
    let (v, _) = fine.rates(effect.joint, k);
    let size = effect.parameters[0];
    match effect.kind {
        Kind::CableDrag => size * v * fine.q[effect.joint][k].sin(),
        Kind::VaryingDelay => -size * v * fine.q[effect.other_joint][k].sin(),
        Kind::SpeedCube => size * v * v * v,
        _ => 0.0,
    }
}

fn at_rows(fine: &FineMotion, signal: &[f64]) -> Vec<f64> {
    fine.row_index.iter().map(|k| signal[*k]).collect()
}

#[cfg(test)]
mod tests;
