//! Loads of the joints: gravity, the wrench on the tool, and contributions of effects.
//!
//! `gravity_torque[i] = −∂V/∂q_i` and `wrench_torque[i] = (JᵀW)_i` on the geometry of the given
//! chain, which is the nominal one: the loads of an arm deflected by a milliradian differ by a
//! thousandth. Inertia is included only if speeds and accelerations are given (see
//! [`crate::signals::Inputs`]).

use crate::deviation::Contribution;
use crate::frame::rotation_from_vector;
use crate::inertia::{UnmodelledMass, inertial_loads, is_at_rest};
use crate::lane_pose::LanePose;
use crate::lanes::{JointVectors, Kernel, Lanes, PaddedVec3, Vec3Lanes, run_widest};
use crate::{Arm, Chain, Inputs, JOINTS_MAX, Joints, Motions, Wrench};
use glam::{DMat3, DVec3};

/// Force and moment that everything beyond a joint exerts at the joint's point, base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PivotLoad {
    /// Force, N.
    pub force: DVec3,
    /// Moment about the joint's point, Nm.
    pub moment: DVec3,
}

impl PivotLoad {
    /// The moment about `to`, Nm, of this load at `from`.
    pub fn moment_about(&self, from: DVec3, to: DVec3) -> DVec3 {
        self.moment + (from - to).cross(self.force)
    }
}

/// The loads at one configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loads {
    /// Gravity, base axes, m/s².
    pub gravity: DVec3,
    /// The wrench at the TCP, base axes.
    pub wrench: Wrench,
    /// Mass carried by each joint, kg, and its first moment about the joint's point, kg m.
    masses: Joints,
    first_moments: [PaddedVec3; JOINTS_MAX],
    /// Change of the first moment carried by each joint, kg m per rad or per m of it.
    pub(crate) moment_rates: JointVectors,
    /// Motion of the tool per unit of each joint.
    pub motions: Motions,
    /// `−∂V/∂q_i`, Nm or N, including springs of effects.
    pub gravity_torque: Joints,
    /// `(JᵀW)_i`, Nm or N.
    pub wrench_torque: Joints,
    /// `−(M q̈ + C q̇)_i`, Nm or N; zero for an arm treated as at rest.
    pub inertia_torque: Joints,
    /// Moment of gravity and wrench about the base frame's origin, Nm.
    pub base_moment: DVec3,
    /// Whether the arm is treated as at rest.
    pub(crate) at_rest: bool,
    /// Inertial moment about the base frame's origin, Nm; zero for an arm treated as at rest.
    pub inertia_base_moment: DVec3,
}

/// Changes of the loads by effects.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoadChange {
    /// Whether there are any.
    is_any: bool,
    gravity_turn: DVec3,
    mass: f64,
    first_moment: DVec3,
    joints: Joints,
    sensor_bias: Wrench,
    sensor_scale: Wrench,
    sensor_turn: DVec3,
}

impl LoadChange {
    /// Adds a contribution to the loads; contributions to the geometry are ignored.
    pub fn add(&mut self, contribution: &Contribution) {
        self.is_any = true;
        match *contribution {
            Contribution::JointLoad { joint, load } => self.joints[joint] += load,
            Contribution::GravityTurn { turn } => self.gravity_turn += turn,
            Contribution::Mass { mass, first_moment } => {
                self.mass += mass;
                self.first_moment += first_moment;
            }
            Contribution::Sensor { bias, scale, turn } => {
                self.sensor_bias = self.sensor_bias.plus(&bias);
                self.sensor_scale = self.sensor_scale.plus(&scale);
                self.sensor_turn += turn;
            }
            _ => {}
        }
    }

    /// The actual wrench for the measured one `read`; both about the TCP, base axes.
    fn actual_wrench(&self, read: Wrench, base_from_tool: &DMat3) -> Wrench {
        let untouched = self.sensor_bias == Wrench::ZERO && self.sensor_scale == Wrench::ZERO;
        if untouched && self.sensor_turn == DVec3::ZERO {
            return read;
        }
        let tool_from_base = base_from_tool.transpose();
        let mounting = rotation_from_vector(self.sensor_turn);
        let truth = |read: DVec3, bias: DVec3, scale: DVec3| {
            let reading = tool_from_base * read;
            *base_from_tool * (mounting * ((reading - bias) / (DVec3::ONE + scale)))
        };
        Wrench {
            force: truth(read.force, self.sensor_bias.force, self.sensor_scale.force),
            moment: truth(read.moment, self.sensor_bias.moment, self.sensor_scale.moment),
        }
    }
}

impl Loads {
    /// The loads on `chain` from the arm's own masses and `wrench` at the TCP (base axes).
    pub fn on(arm: &Arm, chain: &Chain, wrench: Wrench) -> Self {
        Self::with_change(arm, chain, wrench, &LoadChange::default())
    }

    /// The same, with the changes by effects; `wrench` is then the measured one.
    pub fn with_change(arm: &Arm, chain: &Chain, wrench: Wrench, change: &LoadChange) -> Self {
        let mut loads = Self::default();
        run_widest(arm.count(), LoadsKernel { loads: &mut loads, arm, chain, wrench, change });
        loads
    }

    /// [`Loads::changed`], written over loads of the same arm.
    #[inline(always)]
    pub(crate) fn compute<S: Lanes>(
        &mut self,
        lanes: S,
        (arm, chain): (&Arm, &Chain),
        wrench: Wrench,
        change: &LoadChange,
    ) {
        (self.wrench, self.gravity) = (wrench, arm.gravity);
        if change.is_any {
            self.wrench = change.actual_wrench(wrench, &chain.base_from_tool.rotation);
            self.gravity = rotated_gravity(arm.gravity, change.gravity_turn);
        }
        let first_moment = self.accumulate_masses(lanes, arm, chain, change);
        self.compute_torques(lanes, arm, chain);
        if change.is_any {
            let joints = self.gravity_torque.iter_mut().zip(&change.joints);
            joints.take(arm.count()).for_each(|(torque, more)| *torque += more);
        }
        let tcp = chain.base_from_tool.origin;
        self.base_moment =
            first_moment.cross(self.gravity) + tcp.cross(self.wrench.force) + self.wrench.moment;
    }

    /// The torque (or force) that deflects joint `i`: gravity, wrench and inertia.
    pub fn torque(&self, i: usize) -> f64 {
        self.gravity_torque[i] + self.wrench_torque[i] + self.inertia_torque[i]
    }

    /// Drive torques that balance these loads: `M q̈ + C q̇ + ∂V/∂q − JᵀW`, Nm or N.
    pub fn drive_torque(&self) -> Joints {
        core::array::from_fn(|i| -self.torque(i))
    }

    /// Load of gravity at the point of joint `i`.
    pub fn gravity_at(&self, i: usize) -> PivotLoad {
        let (mass, first_moment) = (self.masses[i], self.first_moments[i].xyz());
        PivotLoad { force: self.gravity * mass, moment: first_moment.cross(self.gravity) }
    }

    /// Load of the wrench at the point of joint `i` of the chain for which these loads were
    /// computed.
    pub fn wrench_at(&self, i: usize, chain: &Chain) -> PivotLoad {
        let lever = chain.base_from_tool.origin - chain.point(i);
        let moment = self.wrench.moment + lever.cross(self.wrench.force);
        PivotLoad { force: self.wrench.force, moment }
    }

    /// Sets the inertial loads to zero.
    pub(crate) fn clear_inertia(&mut self) {
        self.inertia_torque = [0.0; JOINTS_MAX];
        self.inertia_base_moment = DVec3::ZERO;
        self.at_rest = true;
    }

    /// Adds the inertial loads for the speeds and accelerations of `inputs`.
    #[inline(always)]
    pub(crate) fn compute_inertia(
        &mut self,
        arm: &Arm,
        chain: &Chain,
        inputs: &Inputs,
        change: &LoadChange,
    ) {
        if is_at_rest(&inputs.velocity, &inputs.acceleration) {
            self.clear_inertia();
            return;
        }
        self.at_rest = false;
        let extra = UnmodelledMass { mass: change.mass, first_moment: change.first_moment };
        let moved = inertial_loads(arm, chain, &inputs.velocity, &inputs.acceleration, &extra);
        (self.inertia_torque, self.inertia_base_moment) = (moved.torque, moved.base_moment);
    }

    /// From the tool back to the base: mass and first moment carried by each joint; the total first
    /// moment about the base frame's origin.
    #[inline(always)]
    fn accumulate_masses<S: Lanes>(
        &mut self,
        lanes: S,
        arm: &Arm,
        chain: &Chain,
        change: &LoadChange,
    ) -> DVec3 {
        let flange = LanePose::load(lanes, &chain.bodies[arm.count() - 1]);
        let (mut mass, mut first_moment) = (0.0, lanes.splat(0.0));
        if change.is_any && (change.mass != 0.0 || change.first_moment != DVec3::ZERO) {
            mass = change.mass;
            let flange = chain.body(arm.count() - 1);
            let moved = flange.rotation * change.first_moment + flange.origin * change.mass;
            first_moment = lanes.load_vector(moved);
        }
        if let Some(tool) = &arm.tool.body {
            mass += tool.mass;
            let moment = flange.offset_to(tool.centre) * tool.mass;
            first_moment = lanes.add(first_moment, flange.moment(tool.mass, moment));
        }
        for (i, joint) in arm.joints().iter().enumerate().rev() {
            if let Some(link) = &joint.link {
                mass += link.mass;
                let body = LanePose::load(lanes, &chain.bodies[i]);
                first_moment = lanes.add(first_moment, body.moment(link.mass, arm.moment(i)));
            }
            let point = chain.points[i].four(lanes);
            let about_point = lanes.neg_mul_add(point, lanes.splat(mass), first_moment);
            (self.masses[i], self.first_moments[i]) = (mass, PaddedVec3::put(lanes, about_point));
        }
        lanes.to_vector(first_moment)
    }

    /// Motion of the carried masses and of the tool with each joint, and the torques of gravity and
    /// wrench from these.
    #[inline(always)]
    fn compute_torques<S: Lanes>(&mut self, lanes: S, arm: &Arm, chain: &Chain) {
        self.motions.take(lanes, arm, chain);
        for k in 0..S::PARTS {
            let about_point = Vec3Lanes::gathered(lanes, &self.first_moments, k);
            self.moment_rates.put(self.motions.angular.part(lanes, k).cross(about_point), k);
        }
        for i in arm.slides() {
            self.moment_rates.set(i, chain.axis(i) * self.masses[i]);
        }
        let gravity = Vec3Lanes::same(lanes, self.gravity);
        let force = Vec3Lanes::same(lanes, self.wrench.force);
        let moment = Vec3Lanes::same(lanes, self.wrench.moment);
        for k in 0..S::PARTS {
            let (linear, angular) =
                (self.motions.linear.part(lanes, k), self.motions.angular.part(lanes, k));
            let by_gravity = self.moment_rates.part(lanes, k).dot(gravity);
            lanes.store(by_gravity, &mut self.gravity_torque, k);
            let by_wrench = angular.dot_plus(moment, linear.dot(force));
            lanes.store(by_wrench, &mut self.wrench_torque, k);
        }
    }
}

struct LoadsKernel<'a> {
    loads: &'a mut Loads,
    arm: &'a Arm,
    chain: &'a Chain,
    wrench: Wrench,
    change: &'a LoadChange,
}

impl Kernel for LoadsKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self, lanes: S) {
        self.loads.compute(lanes, (self.arm, self.chain), self.wrench, self.change);
    }
}

fn rotated_gravity(gravity: DVec3, turn: DVec3) -> DVec3 {
    if turn == DVec3::ZERO { gravity } else { rotation_from_vector(turn).transpose() * gravity }
}
