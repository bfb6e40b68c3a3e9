//! Laws of the contributions of each effect to the recorded torques (docs/reference/effects.md, torque domain), and laws outside the catalogue.
//!
//! Outside the catalogue: drag with the cube of the velocity (`SpeedCube`), Coulomb friction that varies with position (`PlaceFriction`), viscous
//! friction that varies with position (`PlaceDamping`), a hose whose torque on one joint depends on another joint (`CrossTorque`), a torque that
//! drifts with time (`Wander`).
//!
//! The recorded torque is `1 + g` times the acting one, delayed. No noise is added here.

use crate::arm::{JOINTS, Joints, Mass};
use crate::laws::slipping;

use super::kinds::{Effect, Kind};
use super::motion::{Motion, State};
use super::rig::{Places, Rig};

/// Temperature at which viscous friction has its nominal value, °C.
const REFERENCE_C: f64 = 20.0;

/// A motion sampled row by row, optionally at earlier instants.
#[derive(Clone, Debug)]
pub struct Ride {
    /// Run and time of each row.
    pub at: Vec<(usize, f64)>,
    /// State of each joint.
    pub states: Vec<[State; JOINTS]>,
    /// Temperature of each joint, °C.
    pub celsius: Vec<Joints>,
    places: Vec<Places>,
    /// Torques of the rig's own masses.
    rigid: Vec<Joints>,
    /// Other torques of a real recording.
    besides: Option<Vec<Joints>>,
}

impl Ride {
    /// The motion at `late_s` before each sampling time.
    #[must_use]
    pub fn of(rig: &Rig, motion: &Motion, late_s: f64) -> Self {
        let (mut at, mut states, mut celsius) = (Vec::new(), Vec::new(), Vec::new());
        for (number, segment) in motion.segments.iter().enumerate() {
            for t_s in &segment.times_s {
                at.push((number, t_s - late_s));
                states.push(segment.at(t_s - late_s));
                celsius.push(std::array::from_fn(|joint| segment.celsius(joint, *t_s)));
            }
        }
        Self::of_states(rig, at, states, celsius)
    }

    /// From states that are given row by row.
    #[must_use]
    pub fn of_states(
        rig: &Rig,
        at: Vec<(usize, f64)>,
        states: Vec<[State; JOINTS]>,
        celsius: Vec<Joints>,
    ) -> Self {
        let places: Vec<Places> = states.iter().map(|states| rig.places(states)).collect();
        let mut ride = Self { at, states, celsius, places, rigid: Vec::new(), besides: None };
        ride.rigid = ride.held(rig, &rig.points);
        ride
    }

    /// Torques required by these masses, row by row.
    #[must_use]
    pub fn held(&self, rig: &Rig, masses: &[Mass]) -> Vec<Joints> {
        let of_row = |places: &Places| {
            let mut torques = [0.0; JOINTS];
            masses.iter().for_each(|mass| rig.hold(places, mass, &mut torques));
            torques
        };
        self.places.iter().map(of_row).collect()
    }

    /// Sets the rigid-body torques and all other torques of a real recording.
    pub fn take_recorded(&mut self, rigid: Vec<Joints>, besides: Vec<Joints>) {
        (self.rigid, self.besides) = (rigid, Some(besides));
    }

    /// Torques `late_s` before each row, interpolated linearly between rows; before the start of a run its first value.
    #[must_use]
    pub fn recorded_late(&self, torques: &[Joints], late_s: f64) -> Vec<Joints> {
        let mut late = Vec::with_capacity(torques.len());
        for run in self.runs() {
            let mut before = run.start;
            for row in run.clone() {
                let wanted = self.at[row].1 - late_s;
                while before + 1 < row && self.at[before + 1].1 <= wanted {
                    before += 1;
                }
                let after = (before + 1).min(run.end - 1);
                let step_s = self.at[after].1 - self.at[before].1;
                let share = if step_s > 0.0 { (wanted - self.at[before].1) / step_s } else { 0.0 };
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
        for (row, (run, _)) in self.at.iter().enumerate() {
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
pub fn recorded(rig: &Rig, motion: &Motion, ride: &Ride, effects: &[Effect]) -> Vec<Joints> {
    let late = sum(effects, Kind::TorqueDelay, 0);
    if late == 0.0 {
        return on(rig, ride, effects);
    }
    on(rig, &Ride::of(rig, motion, late), effects)
}

/// Sum of the first parameters of a kind on a joint.
fn sum(effects: &[Effect], kind: Kind, joint: usize) -> f64 {
    let own = effects.iter().filter(|effect| effect.kind == kind && effect.joint == joint);
    own.map(|effect| effect.numbers[0]).sum()
}

/// Torques at the instants of a ride.
#[must_use]
pub fn on(rig: &Rig, ride: &Ride, effects: &[Effect]) -> Vec<Joints> {
    let mut loads = ride.rigid.clone();
    for effect in effects {
        add_masses(rig, ride, effect, &mut loads);
    }
    let mut torques = loads.clone();
    for (torques, besides) in torques.iter_mut().zip(ride.besides.iter().flatten()) {
        torques.iter_mut().zip(besides).for_each(|(torque, besides)| *torque += besides);
    }
    for effect in effects {
        add_own(rig, ride, effect, effects, &loads, &mut torques);
    }
    for joint in 0..rig.count() {
        let gain = 1.0 + sum(effects, Kind::DriveGain, joint);
        torques.iter_mut().for_each(|torques| torques[joint] *= gain);
    }
    torques
}

/// Adds unknown masses, which load the gears as well.
fn add_masses(rig: &Rig, ride: &Ride, effect: &Effect, loads: &mut [Joints]) {
    let x = &effect.numbers;
    if effect.kind == Kind::Payload {
        let held = ride.held(rig, &[rig.at_flange(x[0], [x[1], x[2], x[3]])]);
        for (loads, held) in loads.iter_mut().zip(held) {
            loads.iter_mut().zip(held).for_each(|(load, held)| *load += held);
        }
    }
}

/// Adds the torque of one effect to its joint (for a first mass moment: also to all preceding joints).
fn add_own(
    rig: &Rig,
    ride: &Ride,
    effect: &Effect,
    all: &[Effect],
    loads: &[Joints],
    torques: &mut [Joints],
) {
    let (i, x) = (effect.joint, effect.numbers.as_slice());
    match effect.kind {
        Kind::TorqueDelay | Kind::DriveGain | Kind::Payload => return,
        Kind::GravityMoment => {
            for (places, torques) in ride.places.iter().zip(torques) {
                rig.hold_moment(places, i, [x[0], x[1], x[2]], torques);
            }
            return;
        }
        Kind::Hysteresis => {
            for run in ride.runs() {
                let way: Vec<f64> = ride.states[run.clone()].iter().map(|s| s[i][0]).collect();
                // The elements lag behind the motor position; as a force they resist it.
                for (row, lag) in run.zip(slipping(&way, x[0], x[1])) {
                    torques[row][i] -= lag;
                }
            }
            return;
        }
        _ => {}
    }
    let viscous = sum(all, Kind::ViscousFriction, i);
    let rest = all.iter().find(|e| e.kind == Kind::Spring && e.joint == i);
    let rest = rest.map_or(0.0, |spring| spring.numbers[1]);
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
                viscous * v * ((-x[0] * (ride.celsius[row][i] - REFERENCE_C)).exp() - 1.0)
            }
            Kind::Inertia => x[0] * a,
            Kind::GravityTorque => x[0] * q.cos() + x[1] * q.sin(),
            Kind::TorqueRipple => x[0] * (cycles(rig, x[1]) * q + x[2]).sin(),
            Kind::Spring => x[0] * (q - x[1]),
            Kind::SpringHardening => x[0] * (q - rest).powi(3),
            Kind::SpeedCube => x[0] * v * v * v,
            Kind::PlaceFriction => x[0] * sign * (place(rig, i, q)).sin(),
            Kind::PlaceDamping => x[0] * v * (place(rig, i, q)).sin(),
            Kind::CrossTorque => {
                let other = effect.other;
                x[0] * (place(rig, other, ride.states[row][other][0])).sin()
            }
            Kind::Wander => {
                let whole = ride.at.last().map_or(1.0, |(_, t_s)| *t_s);
                x[0] * (2.2 * std::f64::consts::TAU * ride.at[row].1 / whole).sin()
            }
            _ => 0.0,
        };
    }
}

/// Radians of phase per radian of a joint, or per metre of a linear axis.
fn cycles(rig: &Rig, given: f64) -> f64 {
    if rig.slides { std::f64::consts::TAU * given } else { given }
}

/// A joint's position as a phase that covers about one turn over its range.
fn place(rig: &Rig, joint: usize, q: f64) -> f64 {
    let room = rig.rooms[joint];
    2.5 * (q - room.home) / room.reach
}
