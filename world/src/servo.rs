//! A path under a simple controller: actual motion of motors with friction, and recorded drive quantities.
//!
//! Each joint has a position loop (P, with speed feedforward) around a speed loop (PI), the
//! classical cascade of machine tools and robots; its gains are scaled by the joint's own inertia
//! at the first row. The plant is the model's complete inverse dynamics, inverted. Dry friction
//! holds a joint at rest as long as it can: per step the speeds are those at which each friction is
//! within its bounds and opposed to the motion (a complementarity problem, solved by projected
//! Gauss-Seidel).
//!
//! The same rows give the same bits; the path begins settled; torque and motion are of the same
//! instant. Not modelled: limits of the drives, flexible joints, other tunings.

use crate::curve::Curve;
use crate::drives::delayed;
use crate::dynamics::Dynamics;
use crate::executed_path::ExecutedPath;
use nalgebra::{SMatrix, SVector};
use physics::{Inputs, JOINTS_MAX, Joints, Memories, Model};
use std::f64::consts::TAU;
use thiserror::Error;

/// Bandwidth of the speed loop, rad/s; those of position loop and integrator are a quarter of it.
const SPEED_LOOP: f64 = TAU * 20.0;
const OUTER_LOOP_RATIO: f64 = 0.25;
/// Longest step of the plant, s.
const STEP_S: f64 = 2.5e-4;
/// A speed that only indicates a direction, rad/s or m/s.
const DIRECTION_SPEED: f64 = 1e-12;
const MAX_SWEEPS: usize = 60;
/// Convergence criterion of the friction: change in one sweep, relative to its bound.
const FRICTION_TOLERANCE: f64 = 1e-9;

type Square = SMatrix<f64, JOINTS_MAX, JOINTS_MAX>;
type Column = SVector<f64, JOINTS_MAX>;

/// State of the motors at one row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorState {
    /// Their positions, rad or m.
    pub motor: Joints,
    /// Recorded torques of the drives, Nm or N.
    pub torque: Joints,
}

/// Why a path cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ServoError {
    /// The mass matrix is not positive definite.
    #[error(
        "joint {joint} has no inertia; closed-loop simulation needs a `link` with a mass (and `inertia_kgm2`) \
         or an `inertia` for every joint"
    )]
    Massless {
        /// 1-based: the first joint without inertia, 1 if it is not a single one.
        joint: usize,
    },
}

/// One segment of a path: times strictly increase, `q` is the command.
///
/// # Errors
/// An arm without inertia.
pub fn path(
    model: &Model,
    dynamics: &Dynamics,
    rows: &[Inputs],
) -> Result<Vec<MotorState>, ServoError> {
    let executed = ExecutedPath::of(model, dynamics, rows);
    let Some(first) = executed.inputs.first() else { return Ok(Vec::new()) };
    let times_s: Vec<f64> = rows.iter().map(|row| row.time_s).collect();
    let joint = |i: usize| executed.inputs.iter().map(|row| row.q[i]).collect();
    let commands: Vec<Curve<'_>> =
        (0..model.arm.count()).map(|i| Curve::through(&times_s, joint(i))).collect();
    let mut servo = Servo::settled(model, first, &commands)?;
    let (mut motors, mut torques) = (Vec::new(), Vec::new());
    for (k, row) in executed.inputs.iter().enumerate() {
        servo.update_mass_matrix()?;
        motors.push(servo.inputs.q);
        torques.push(servo.recorded_torques(&servo.commanded_torques(&commands, times_s[k]), row));
        let Some(next_s) = times_s.get(k + 1) else { break };
        let steps = f64::ceil((next_s - times_s[k]) / STEP_S).max(1.0);
        let step_s = (next_s - times_s[k]) / steps;
        for n in 0..steps as usize {
            servo.step(&commands, times_s[k] + n as f64 * step_s, step_s);
        }
    }
    let torques = delayed(model, rows, torques, dynamics.torque_delay_s);
    Ok(motors
        .into_iter()
        .zip(torques)
        .map(|(motor, torque)| MotorState { motor, torque })
        .collect())
}

/// Controller and plant at one instant.
struct Servo<'a> {
    model: &'a Model,
    memories: Memories,
    inputs: Inputs,
    /// Gain from the joints' own inertia at the start, per rad/s or m/s of speed.
    gain: Joints,
    /// Integral of the speed loop, Nm or N.
    integral: Joints,
    /// Torques of the drives in the last step, Nm or N; `None` before the first.
    last_torques: Option<Joints>,
    /// Dry friction of the last step, Nm or N.
    friction: Joints,
    mass: MassMatrix,
}

/// Inertia at one row.
#[derive(Clone, Copy)]
struct MassMatrix {
    inverse: Square,
    diagonal: Joints,
    /// Additional inertia by effects.
    effect_inertia: Joints,
}

impl<'a> Servo<'a> {
    fn settled(
        model: &'a Model,
        first: &Inputs,
        commands: &[Curve<'_>],
    ) -> Result<Self, ServoError> {
        let mut inputs = *first;
        (inputs.q_before, inputs.dt_s) = (inputs.q, 0.0);
        inputs.acceleration = Joints::default();
        for (i, command) in commands.iter().enumerate() {
            inputs.velocity[i] = command.slope(0);
        }
        let mut memories = Memories::default();
        model.settle(&inputs, &mut memories);
        let holding = model.drive(&inputs, &memories);
        let mass = mass_matrix(model, &inputs, &memories)?;
        Ok(Self {
            model,
            memories,
            inputs,
            gain: mass.diagonal.map(|inertia| inertia * SPEED_LOOP),
            integral: std::array::from_fn(|i| holding.acting(i)),
            last_torques: None,
            friction: Joints::default(),
            mass,
        })
    }

    fn update_mass_matrix(&mut self) -> Result<(), ServoError> {
        self.mass = mass_matrix(self.model, &self.inputs, &self.memories)?;
        Ok(())
    }

    /// Deviation of the speeds from the targets of the position loop, for the commands at `time_s`.
    fn speed_errors(&self, commands: &[Curve<'_>], time_s: f64) -> Joints {
        let mut slip = Joints::default();
        for (i, command) in commands.iter().enumerate() {
            let requested = command.rate_at(time_s)
                + OUTER_LOOP_RATIO * SPEED_LOOP * (command.at(time_s) - self.inputs.q[i]);
            slip[i] = requested - self.inputs.velocity[i];
        }
        slip
    }

    fn commanded_torques(&self, commands: &[Curve<'_>], time_s: f64) -> Joints {
        let slip = self.speed_errors(commands, time_s);
        std::array::from_fn(|i| self.integral[i] + self.gain[i] * slip[i])
    }

    /// Recorded torque at a row: drive torques are constant over a step, so the mean of the steps before and after the row is recorded.
    fn recorded_torques(&self, wanted: &Joints, row: &Inputs) -> Joints {
        let now = Inputs { q: self.inputs.q, velocity: self.inputs.velocity, ..*row };
        let drive = self.model.drive(&now, &self.memories);
        let before = self.last_torques.unwrap_or(*wanted);
        std::array::from_fn(|i| drive.recorded_from(i, 0.5 * (before[i] + wanted[i])))
    }

    fn step(&mut self, commands: &[Curve<'_>], time_s: f64, step_s: f64) {
        let (slip, exerted) =
            (self.speed_errors(commands, time_s), self.commanded_torques(commands, time_s));
        for (i, slip) in slip.iter().enumerate() {
            self.integral[i] += OUTER_LOOP_RATIO * SPEED_LOOP * self.gain[i] * slip * step_s;
        }
        self.last_torques = Some(exerted);
        let after = self.speeds_after_step(&exerted, step_s);
        let before = self.inputs;
        let inputs = &mut self.inputs;
        inputs.q_before = before.q;
        (inputs.time_s, inputs.dt_s) = (time_s + step_s, step_s);
        for (i, after) in after.iter().enumerate().take(commands.len()) {
            inputs.q[i] += 0.5 * step_s * (before.velocity[i] + after);
            inputs.velocity[i] = *after;
            inputs.acceleration[i] = (after - before.velocity[i]) / step_s;
            if inputs.q[i] != before.q[i] {
                inputs.direction[i] = (inputs.q[i] - before.q[i]).signum();
            }
        }
        self.model.advance(&self.inputs, &mut self.memories);
    }

    /// Speeds after a step with these drive torques.
    fn speeds_after_step(&mut self, exerted: &Joints, step_s: f64) -> Joints {
        let (free, bound) = self.resistance();
        let inverse = &self.mass.inverse;
        let push = Column::from_fn(|i, _| exerted[i] - free[i] - self.friction[i]);
        let mut speed = Column::from(self.inputs.velocity) + inverse * push * step_s;
        for _ in 0..MAX_SWEEPS {
            let mut is_converged = true;
            for (i, bound) in bound.iter().enumerate().take(self.model.arm.count()) {
                let stopping = self.friction[i] + speed[i] / (step_s * inverse[(i, i)]);
                let friction = stopping.clamp(-bound, *bound);
                let change = friction - self.friction[i];
                speed -= inverse.column(i) * (change * step_s);
                self.friction[i] = friction;
                is_converged &= change.abs() <= FRICTION_TOLERANCE * bound;
            }
            if is_converged {
                break;
            }
        }
        for (i, bound) in bound.iter().enumerate() {
            if self.friction[i].abs() < *bound {
                speed[i] = 0.0;
            }
        }
        speed.into()
    }

    /// Resistance to the drives besides inertia and friction, and the bound of the friction, at the
    /// present speeds.
    fn resistance(&self) -> (Joints, Joints) {
        let moving = self.inputs.velocity.map(|v| if v == 0.0 { DIRECTION_SPEED } else { v });
        let drives_with = |velocity: Joints, acceleration: Joints| {
            let inputs = Inputs { velocity, acceleration, ..self.inputs };
            self.model.drive(&inputs, &self.memories)
        };
        let acceleration = self.inputs.acceleration;
        let (forward, back) =
            (drives_with(moving, acceleration), drives_with(moving.map(|v| -v), acceleration));
        let rigid = drives_with(moving, Joints::default()).rigid;
        let (mut free, mut bound) = (rigid, Joints::default());
        for i in 0..self.model.arm.count() {
            let beside = [&forward, &back].map(|drive| drive.acting(i) - drive.rigid[i]);
            free[i] +=
                0.5 * (beside[0] + beside[1]) - self.mass.effect_inertia[i] * acceleration[i];
            bound[i] = (0.5 * (beside[0] - beside[1]) * moving[i].signum()).max(0.0);
        }
        (free, bound)
    }
}

/// Columns of the mass matrix: additional torques for the acceleration of one joint alone.
fn mass_matrix(
    model: &Model,
    inputs: &Inputs,
    memories: &Memories,
) -> Result<MassMatrix, ServoError> {
    let still = Inputs { velocity: [0.0; JOINTS_MAX], acceleration: [0.0; JOINTS_MAX], ..*inputs };
    let rest = model.drive(&still, memories);
    let (mut matrix, mut effect_inertia) = (Square::identity(), Joints::default());
    let count = model.arm.count();
    for k in 0..count {
        let mut pushed = still;
        pushed.acceleration[k] = 1.0;
        let drive = model.drive(&pushed, memories);
        for i in 0..count {
            matrix[(i, k)] = drive.acting(i) - rest.acting(i);
        }
        effect_inertia[k] = matrix[(k, k)] - (drive.rigid[k] - rest.rigid[k]);
    }
    let diagonal: Joints = std::array::from_fn(|i| matrix[(i, i)]);
    let massless = diagonal[..count].iter().position(|inertia| *inertia <= 0.0);
    match (massless, matrix.cholesky()) {
        (None, Some(factor)) => {
            Ok(MassMatrix { inverse: factor.inverse(), diagonal, effect_inertia })
        }
        (joint, _) => Err(ServoError::Massless { joint: joint.map_or(1, |joint| joint + 1) }),
    }
}

#[cfg(test)]
mod tests;
