//! Laws of the contributions of each effect to the recorded torques (docs/reference/effects.md, torque domain), and laws outside the catalogue.
//!
//! Outside the catalogue: drag with the cube of the velocity (`SpeedCube`), Coulomb friction that varies with position (`PlaceFriction`), viscous
//! friction that varies with position (`PlaceDamping`), a hose whose torque on one joint depends on another joint (`CrossTorque`), a torque that
//! drifts with time (`Wander`).
//!
//! The recorded torque is `1 + g` times the acting one, delayed. No noise is added here.

use crate::arm::{JOINTS, Joints, Mass};
use crate::laws::elasto_slip;

use super::kinds::{Effect, Kind};
use super::motion::{JointState, Motion};
use super::rig::{NearbyFrames, Rig};

/// Temperature at which viscous friction has its nominal value, °C.
const REFERENCE_C: f64 = 20.0;

/// A motion sampled row by row, optionally at earlier instants.
#[derive(Clone, Debug)]
pub struct SampledMotion {
    /// Run and time of each row.
    pub times: Vec<(usize, f64)>,
    /// State of each joint.
    pub states: Vec<[JointState; JOINTS]>,
    /// Temperature of each joint, °C.
    pub temperatures_c: Vec<Joints>,
    frames: Vec<NearbyFrames>,
    /// Torques of the rig's own masses.
    rigid_torques: Vec<Joints>,
    /// Other torques of a real recording.
    other_torques: Option<Vec<Joints>>,
}

impl SampledMotion {
    /// The motion at `late_s` before each sampling time.
    #[must_use]
    pub fn from_motion(rig: &Rig, motion: &Motion, late_s: f64) -> Self {
        let (mut segment_times, mut states, mut celsius) = (Vec::new(), Vec::new(), Vec::new());
        for (number, segment) in motion.segments.iter().enumerate() {
            for t_s in &segment.times_s {
                segment_times.push((number, t_s - late_s));
                states.push(segment.at(t_s - late_s));
                celsius.push(std::array::from_fn(|joint| segment.temperature_c(joint, *t_s)));
            }
        }
        Self::from_states(rig, segment_times, states, celsius)
    }

    /// From states that are given row by row.
    #[must_use]
    pub fn from_states(
        rig: &Rig,
        times: Vec<(usize, f64)>,
        states: Vec<[JointState; JOINTS]>,
        temperatures_c: Vec<Joints>,
    ) -> Self {
        let frames: Vec<NearbyFrames> =
            states.iter().map(|states| rig.frames_nearby(states)).collect();
        let mut ride = Self {
            times,
            states,
            temperatures_c,
            frames,
            rigid_torques: Vec::new(),
            other_torques: None,
        };
        ride.rigid_torques = ride.torques_of_masses(rig, &rig.masses);
        ride
    }

    /// Torques required by these masses, row by row.
    #[must_use]
    pub fn torques_of_masses(&self, rig: &Rig, masses: &[Mass]) -> Vec<Joints> {
        let of_row = |places: &NearbyFrames| {
            let mut torques = [0.0; JOINTS];
            masses.iter().for_each(|mass| rig.add_mass_torques(places, mass, &mut torques));
            torques
        };
        self.frames.iter().map(of_row).collect()
    }

    /// Sets the rigid-body torques and all other torques of a real recording.
    pub fn set_recorded(&mut self, rigid_torques: Vec<Joints>, other_torques: Vec<Joints>) {
        (self.rigid_torques, self.other_torques) = (rigid_torques, Some(other_torques));
    }

    /// Torques `late_s` before each row, interpolated linearly between rows; before the start of a run its first value.
    #[must_use]
    pub fn delayed(&self, torques: &[Joints], late_s: f64) -> Vec<Joints> {
        let mut late = Vec::with_capacity(torques.len());
        for run in self.runs() {
            let mut before = run.start;
            for row in run.clone() {
                let wanted = self.times[row].1 - late_s;
                while before + 1 < row && self.times[before + 1].1 <= wanted {
                    before += 1;
                }
                let after = (before + 1).min(run.end - 1);
                let step_s = self.times[after].1 - self.times[before].1;
                let share =
                    if step_s > 0.0 { (wanted - self.times[before].1) / step_s } else { 0.0 };
                let share = share.clamp(0.0, 1.0);
                let between = |i: usize| {
                    torques[before][i] + share * (torques[after][i] - torques[before][i])
                };
                late.push(std::array::from_fn(between));
            }
        }
        late
    }

    /// Row range of each run.
    fn runs(&self) -> Vec<std::ops::Range<usize>> {
        let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
        for (row, (run, _)) in self.times.iter().enumerate() {
            match runs.get_mut(*run) {
                Some(range) => range.end = row + 1,
                None => runs.push(row..row + 1),
            }
        }
        runs
    }
}

/// Recorded drive torques with these effects, row by row, Nm or N; `ride` is the motion without delay.
#[must_use]
pub fn recorded_torques(
    rig: &Rig,
    motion: &Motion,
    ride: &SampledMotion,
    effects: &[Effect],
) -> Vec<Joints> {
    let late = sum_of_kind(effects, Kind::TorqueDelay, 0);
    if late == 0.0 {
        return torques_at(rig, ride, effects);
    }
    torques_at(rig, &SampledMotion::from_motion(rig, motion, late), effects)
}

/// Sum of the first parameters of a kind on a joint.
fn sum_of_kind(effects: &[Effect], kind: Kind, joint: usize) -> f64 {
    let of_kind = effects.iter().filter(|effect| effect.kind == kind && effect.joint == joint);
    of_kind.map(|effect| effect.parameters[0]).sum()
}

/// Torques at the instants of a ride.
#[must_use]
pub fn torques_at(rig: &Rig, ride: &SampledMotion, effects: &[Effect]) -> Vec<Joints> {
    let mut loads = ride.rigid_torques.clone();
    for effect in effects {
        add_masses(rig, ride, effect, &mut loads);
    }
    let mut torques = loads.clone();
    for (torques, besides) in torques.iter_mut().zip(ride.other_torques.iter().flatten()) {
        torques.iter_mut().zip(besides).for_each(|(torque, besides)| *torque += besides);
    }
    for effect in effects {
        add_effect(rig, ride, effect, effects, &loads, &mut torques);
    }
    for joint in 0..rig.count() {
        let gain = 1.0 + sum_of_kind(effects, Kind::DriveGain, joint);
        torques.iter_mut().for_each(|torques| torques[joint] *= gain);
    }
    torques
}

/// Adds unknown masses, which load the gears as well.
fn add_masses(rig: &Rig, ride: &SampledMotion, effect: &Effect, loads: &mut [Joints]) {
    let x = &effect.parameters;
    if effect.kind == Kind::Payload {
        let held = ride.torques_of_masses(rig, &[rig.mass_at_flange(x[0], [x[1], x[2], x[3]])]);
        for (loads, held) in loads.iter_mut().zip(held) {
            loads.iter_mut().zip(held).for_each(|(load, held)| *load += held);
        }
    }
}

/// Adds the torque of one effect to its joint (for a first mass moment: also to all preceding joints).
fn add_effect(
    rig: &Rig,
    ride: &SampledMotion,
    effect: &Effect,
    all: &[Effect],
    loads: &[Joints],
    torques: &mut [Joints],
) {
    let (i, x) = (effect.joint, effect.parameters.as_slice());
    match effect.kind {
        Kind::TorqueDelay | Kind::DriveGain | Kind::Payload => return,
        Kind::GravityMoment => {
            for (places, torques) in ride.frames.iter().zip(torques) {
                rig.add_moment_torques(places, i, [x[0], x[1], x[2]], torques);
            }
            return;
        }
        Kind::Hysteresis => {
            for run in ride.runs() {
                let way: Vec<f64> = ride.states[run.clone()].iter().map(|s| s[i][0]).collect();
                // The elements lag behind the motor position; as a force they resist it.
                for (row, lag) in run.zip(elasto_slip(&way, x[0], x[1])) {
                    torques[row][i] -= lag;
                }
            }
            return;
        }
        _ => {}
    }
    let viscous = sum_of_kind(all, Kind::ViscousFriction, i);
    let rest = all.iter().find(|e| e.kind == Kind::Spring && e.joint == i);
    let rest = rest.map_or(0.0, |spring| spring.parameters[1]);
    for (row, torques) in torques.iter_mut().enumerate() {
        let [q, v, a] = ride.states[row][i];
        let sign = if v == 0.0 { 0.0 } else { v.signum() };
        torques[i] += match effect.kind {
            Kind::CoulombFriction => x[0] * sign,
            Kind::ViscousFriction => x[0] * v,
            Kind::StribeckFriction => x[0] * (-(v / x[1]).powi(2)).exp() * sign,
            Kind::AsymmetryOffset => x[0],
            Kind::AsymmetrySlope => x[0] * v.abs(),
            Kind::AsymmetryBoth => x[0] + x[1] * v.abs(),
            Kind::LoadFriction => x[0] * loads[row][i].abs() * sign,
            Kind::FrictionTemperature => {
                viscous * v * ((-x[0] * (ride.temperatures_c[row][i] - REFERENCE_C)).exp() - 1.0)
            }
            Kind::Inertia => x[0] * a,
            Kind::GravityTorque => x[0] * q.cos() + x[1] * q.sin(),
            Kind::TorqueRipple => x[0] * (phase_per_position(rig, x[1]) * q + x[2]).sin(),
            Kind::Spring => x[0] * (q - x[1]),
            Kind::SpringHardening => x[0] * (q - rest).powi(3),
            Kind::SpeedCube => x[0] * v * v * v,
            Kind::PlaceFriction => x[0] * sign * (range_phase(rig, i, q)).sin(),
            Kind::PlaceDamping => x[0] * v * (range_phase(rig, i, q)).sin(),
            Kind::CrossTorque => {
                let other = effect.other_joint;
                x[0] * (range_phase(rig, other, ride.states[row][other][0])).sin()
            }
            Kind::Wander => {
                let whole = ride.times.last().map_or(1.0, |(_, t_s)| *t_s);
                x[0] * (2.2 * std::f64::consts::TAU * ride.times[row].1 / whole).sin()
            }
            _ => 0.0,
        };
    }
}

/// Radians of phase per radian of a joint, or per metre of a linear axis.
fn phase_per_position(rig: &Rig, given: f64) -> f64 {
    if rig.is_prismatic { std::f64::consts::TAU * given } else { given }
}

/// A joint's position as a phase that covers about one turn over its range.
fn range_phase(rig: &Rig, joint: usize, q: f64) -> f64 {
    let range = rig.ranges[joint];
    2.5 * (q - range.centre) / range.half_range
}
