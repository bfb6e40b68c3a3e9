//! Drive torques and their recorded values: rigid-body dynamics and contributions of effects.
//!
//! The recorded value is `(1 + g) (τ + Σ)`, with τ of [`crate::dynamics`] including effects on the loads, and Σ of friction, springs and
//! ripple. Viscous friction is kept separately in the sum because it depends on temperature; springs provide their rest position, from which
//! hardening is computed.
//!
//! Invariants: [`Model::drive`] of a model without effects is
//! [`crate::dynamics::inverse_dynamics`]; effects add up in any order; [`Model::drive_slopes`] are
//! its derivatives by the effects' values. Delays need a path and are computed in `world`; the
//! correction does not depend on drive torques.

use crate::deviation::Contribution;
use crate::loads::{LoadChange, Loads};
use crate::spec::ActsOn;
use crate::{
    AnyEffect, Arm, Chain, Inputs, JOINTS_MAX, JointKind, Joints, Memories, Model, Signals,
};
use glam::DVec3;

/// Half of a step of a load effect's derivative, in units of that derivative: loads are nearly linear in it.
const STEP: f64 = 1e-4;

/// Contribution of an effect to a drive's torque. Torques are Nm, forces N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriveTerm {
    /// A torque of the joint's own drive.
    Torque(f64),
    /// A torque of viscous friction.
    Viscous(f64),
    /// Relative increase of the joint's viscous friction.
    ViscousShare(f64),
    /// A spring.
    Spring {
        /// Its torque at this position.
        torque: f64,
        /// Its rest position, rad or m.
        rest: f64,
    },
    /// Torque per cube of the deflection from the rest position of the joint's spring, Nm/rad³ or
    /// N/m³.
    SpringCubic(f64),
    /// A moment held by this joint's drive and those of all previous joints, base axes, Nm.
    Carried(DVec3),
    /// Relative excess of the recorded torque over the actual one.
    Recorded(f64),
}

impl DriveTerm {
    /// This term times a number.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        match self {
            Self::Torque(x) => Self::Torque(x * factor),
            Self::Viscous(x) => Self::Viscous(x * factor),
            Self::ViscousShare(x) => Self::ViscousShare(x * factor),
            Self::Spring { torque, rest } => {
                Self::Spring { torque: torque * factor, rest: rest * factor }
            }
            Self::SpringCubic(x) => Self::SpringCubic(x * factor),
            Self::Carried(x) => Self::Carried(x * factor),
            Self::Recorded(x) => Self::Recorded(x * factor),
        }
    }

    /// The difference of two terms of one kind; for terms of different kinds, this term.
    #[must_use]
    pub fn minus(self, other: Self) -> Self {
        match (self, other) {
            (Self::Torque(a), Self::Torque(b)) => Self::Torque(a - b),
            (Self::Viscous(a), Self::Viscous(b)) => Self::Viscous(a - b),
            (Self::ViscousShare(a), Self::ViscousShare(b)) => Self::ViscousShare(a - b),
            (Self::Spring { torque, rest }, Self::Spring { torque: t, rest: r }) => {
                Self::Spring { torque: torque - t, rest: rest - r }
            }
            (Self::SpringCubic(a), Self::SpringCubic(b)) => Self::SpringCubic(a - b),
            (Self::Carried(a), Self::Carried(b)) => Self::Carried(a - b),
            (Self::Recorded(a), Self::Recorded(b)) => Self::Recorded(a - b),
            (one, _) => one,
        }
    }
}

/// Drive torques at one sample. Zero beyond the arm's joints.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveTorques {
    /// Rigid-body torque, `M q̈ + C q̇ + ∂V/∂q − JᵀW`, Nm or N.
    pub rigid: Joints,
    /// Friction, springs and ripple, without viscous friction and hardening, Nm or N.
    plain: Joints,
    viscous: Joints,
    viscous_share: Joints,
    /// Rest positions of the springs, rad or m.
    rest: Joints,
    cubic: Joints,
    gain: Joints,
    /// Joint positions, rad or m.
    positions: Joints,
}

impl DriveTorques {
    fn of(signals: &Signals<'_>) -> Self {
        let rigid = signals.loads.drive_torque();
        Self { rigid, positions: signals.inputs.q, ..Self::default() }
    }

    fn add(&mut self, arm: &Arm, chain: &Chain, contribution: &Contribution) {
        let Contribution::DriveTorque { joint: i, term } = *contribution else { return };
        match term {
            DriveTerm::Torque(torque) => self.plain[i] += torque,
            DriveTerm::Viscous(torque) => self.viscous[i] += torque,
            DriveTerm::ViscousShare(share) => self.viscous_share[i] += share,
            DriveTerm::Spring { torque, rest } => {
                self.plain[i] += torque;
                self.rest[i] += rest;
            }
            DriveTerm::SpringCubic(cubic) => self.cubic[i] += cubic,
            DriveTerm::Carried(moment) => {
                for (k, torque) in holding_torques(arm, chain, i, moment) {
                    self.plain[k] += torque;
                }
            }
            DriveTerm::Recorded(gain) => self.gain[i] += gain,
        }
    }

    /// Actual torque of joint `i`, Nm or N.
    pub fn acting(&self, i: usize) -> f64 {
        let viscous = self.viscous[i] * (1.0 + self.viscous_share[i]);
        let stretch = self.positions[i] - self.rest[i];
        self.rigid[i] + self.plain[i] + viscous + self.cubic[i] * stretch * stretch * stretch
    }

    /// Recorded torque of joint `i`, Nm or N.
    pub fn recorded(&self, i: usize) -> f64 {
        self.recorded_from(i, self.acting(i))
    }

    /// Recorded torque of joint `i` for this actual one, Nm or N.
    pub fn recorded_from(&self, i: usize, acting: f64) -> f64 {
        (1.0 + self.gain[i]) * acting
    }

    /// Change of the recorded torques by a change of a drive effect's contribution.
    fn changed(&self, arm: &Arm, chain: &Chain, change: &Contribution) -> Joints {
        let mut all = [0.0; JOINTS_MAX];
        let Contribution::DriveTorque { joint: i, term } = *change else { return all };
        let gain = 1.0 + self.gain[i];
        let stretch = self.positions[i] - self.rest[i];
        all[i] = match term {
            DriveTerm::Torque(torque) => gain * torque,
            DriveTerm::Viscous(torque) => gain * torque * (1.0 + self.viscous_share[i]),
            DriveTerm::ViscousShare(share) => gain * self.viscous[i] * share,
            DriveTerm::Spring { torque, rest } => {
                gain * (torque - 3.0 * self.cubic[i] * stretch * stretch * rest)
            }
            DriveTerm::SpringCubic(cubic) => gain * cubic * stretch * stretch * stretch,
            DriveTerm::Recorded(gain) => gain * self.acting(i),
            DriveTerm::Carried(moment) => {
                for (k, torque) in holding_torques(arm, chain, i, moment) {
                    all[k] = (1.0 + self.gain[k]) * torque;
                }
                return all;
            }
        };
        all
    }
}

/// Torques of the drives up to that of joint `last` against a moment, base axes; a prismatic joint
/// needs none.
fn holding_torques<'a>(
    arm: &'a Arm,
    chain: &'a Chain,
    last: usize,
    moment: DVec3,
) -> impl Iterator<Item = (usize, f64)> + 'a {
    let turning = |(_, joint): &(usize, &crate::Joint)| joint.kind == JointKind::Revolute;
    let joints = arm.joints().iter().enumerate().take(last + 1).filter(turning);
    joints.map(move |(k, _)| (k, chain.axis(k).dot(moment)))
}

impl Model {
    /// Drive torques at one sample with these memories, which are not changed.
    pub fn drive(&self, inputs: &Inputs, memories: &Memories) -> DriveTorques {
        self.with_signals(inputs, memories, |signals, _| self.drive_of(signals, memories))
    }

    /// Calls `visit` with each place in `wanted` and the derivative of the recorded torques by that
    /// value, Nm or N per SI; `wanted` names places in [`Model::effects`] and values of these. For
    /// effects that move the tool the derivative is zero.
    pub fn drive_slopes(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        wanted: &[(usize, usize)],
        mut visit: impl FnMut(usize, &Joints),
    ) {
        self.with_signals(inputs, memories, |signals, change| {
            let drive = self.drive_of(signals, memories);
            for (place, &(index, value)) in wanted.iter().enumerate() {
                let both = self.effects().zip(memories.iter()).nth(index);
                let Some((effect, memory)) = both else { continue };
                let slope = effect.derivative(value, signals, memory);
                let slopes = if effect.spec().acts_on == ActsOn::Loads {
                    self.by_loads(signals, memories, change, &slope)
                } else {
                    drive.changed(&self.arm, signals.chain, &slope)
                };
                visit(place, &slopes);
            }
        });
    }

    fn with_signals<R>(
        &self,
        inputs: &Inputs,
        memories: &Memories,
        visit: impl FnOnce(&Signals<'_>, &LoadChange) -> R,
    ) -> R {
        let chain = Chain::nominal(&self.arm, &inputs.q);
        let (mut loads, mut change) = (Loads::default(), LoadChange::default());
        self.load(inputs, &chain, memories, &mut change, &mut loads);
        visit(&Signals { arm: &self.arm, inputs, chain: &chain, loads: &loads }, &change)
    }

    fn drive_of(&self, signals: &Signals<'_>, memories: &Memories) -> DriveTorques {
        let mut drive = DriveTorques::of(signals);
        for (effect, memory) in self.effects().zip(memories.iter()) {
            if is_of_drives(effect) {
                drive.add(&self.arm, signals.chain, &effect.predict(signals, memory));
            }
        }
        drive
    }

    /// Central difference in the loads, which also affects load friction.
    fn by_loads(
        &self,
        signals: &Signals<'_>,
        memories: &Memories,
        change: &LoadChange,
        slope: &Contribution,
    ) -> Joints {
        let torques_at = |step: f64| {
            let mut change = *change;
            change.add(&slope.times(step));
            let Signals { arm, inputs, chain, .. } = *signals;
            let mut loads = Loads::with_change(arm, chain, inputs.wrench_base, &change);
            loads.compute_inertia(arm, chain, inputs, &change);
            self.drive_of(&Signals { loads: &loads, ..*signals }, memories)
        };
        let (more, less) = (torques_at(STEP), torques_at(-STEP));
        core::array::from_fn(|i| (more.recorded(i) - less.recorded(i)) / (2.0 * STEP))
    }
}

fn is_of_drives(effect: &AnyEffect) -> bool {
    effect.spec().acts_on == ActsOn::DriveTorque
}
