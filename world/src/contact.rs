//! A simulated contact: an elastic surface, and a robot with lag that is pressed onto it.
//!
//! `F = k · max(0, depth)` along the normal, without friction. k: stiffness, N/m; 0.1 to 10 N/µm
//! are 1e5 to 1e7. The robot is compliant too, so force and position depend on each other: `F = k ·
//! depth(tcp(F))`, solved on the true model.
//!
//! The surface is passive: it never pulls and returns the energy stored; quasi-static at each
//! sample. Cutting and the arm's inertia are not modelled: the only dynamics are the servos' delay
//! and lag.

use crate::robot::{Robot, Servo};
use glam::DVec3;
use physics::{Frame, Joints, Model, Wrench};

/// A flat, elastic surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// A point of the surface, base frame, m.
    pub point_base: DVec3,
    /// Unit vector out of the surface, base frame.
    pub normal_base: DVec3,
    /// Stiffness, N/m, 0 or above.
    pub stiffness_n_m: f64,
}

impl Contact {
    /// Force of the surface on a tool with TCP at `tcp_base` (m).
    pub fn force(&self, tcp_base: DVec3) -> DVec3 {
        self.normal_base * (self.stiffness_n_m * self.depth(tcp_base).max(0.0))
    }

    /// Penetration of a point (base frame, m) into the surface, m; negative outside.
    pub fn depth(&self, tcp_base: DVec3) -> f64 {
        (self.point_base - tcp_base).dot(self.normal_base)
    }

    /// The force at which surface and compliant tool are in equilibrium; `tcp_under` gives the TCP
    /// under a force (base axes, N). Secant steps: exact for a linear compliance.
    pub fn equilibrium_force(&self, tcp_under: impl Fn(DVec3) -> DVec3) -> DVec3 {
        let excess = |force: f64| {
            force - self.stiffness_n_m * self.depth(tcp_under(self.normal_base * force))
        };
        let (mut low, mut excess_low) = (0.0, excess(0.0));
        if excess_low >= 0.0 {
            return DVec3::ZERO;
        }
        let mut high = -excess_low;
        for _ in 0..20 {
            let excess_high = excess(high);
            let slope = (excess_high - excess_low) / (high - low);
            if !(slope.is_finite() && slope > 0.0) || excess_high.abs() <= 1e-12 * high.abs() {
                break;
            }
            (low, excess_low, high) = (high, excess_high, high - excess_high / slope);
        }
        self.normal_base * high
    }
}

/// A robot pressed onto a surface.
#[derive(Clone, Debug)]
pub struct RobotInContact {
    /// The surface.
    pub contact: Contact,
    robot: Robot,
    wrench: Wrench,
}

/// State after one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactState {
    /// Pose of the tool, base frame.
    pub base_from_tool: Frame,
    /// Force of the surface on the tool, base axes.
    pub wrench_base: Wrench,
}

impl RobotInContact {
    /// A robot at rest at `q` (rad or m) whose servos lag by 20 ms, one sample every `dt_s`.
    pub fn lagging_20_ms(model: &Model, contact: Contact, q: Joints, dt_s: f64) -> Self {
        Self::new(model, contact, q, Servo { dt_s, delay_samples: 0, lag_s: 0.02 })
    }

    /// A robot at rest at `q` (rad or m) with these servos.
    pub fn new(model: &Model, contact: Contact, q: Joints, servo: Servo) -> Self {
        Self { contact, robot: Robot::at_rest(model, servo, q, f64::NAN), wrench: Wrench::ZERO }
    }

    /// Advances by one sample with a new target (rad or m), in equilibrium with the surface.
    pub fn step(&mut self, target: &Joints) -> ContactState {
        self.robot.follow(target, self.wrench);
        let under = |force| Wrench { force, moment: DVec3::ZERO };
        let force = self
            .contact
            .equilibrium_force(|force| self.robot.base_from_tool_under(under(force)).origin);
        self.wrench = under(force);
        let base_from_tool = self.robot.base_from_tool_under(self.wrench);
        ContactState { base_from_tool, wrench_base: self.wrench }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ik;
    use crate::path::tool_along;
    use crate::test_arm::{effect, irb1600};

    fn soft_arm() -> Model {
        let arm = irb1600();
        let compliant = |joint, c| effect(&arm, "load_compliance", joint, "compliance", c);
        let effects = [compliant(0, 3e-6), compliant(1, 2.2e-6), compliant(2, 1.1e-5)];
        Model::new(arm, &effects).expect("room")
    }

    fn pose(model: &Model, z: f64) -> Joints {
        let rotation = tool_along(-DVec3::Z, model.arm.tool.base_from_tool);
        let wanted = Frame::new(rotation, DVec3::new(0.8, 0.0, z));
        ik::start_pose(&model.arm, &wanted).expect("within reach")
    }

    #[test]
    fn force_and_place_hold_at_once_from_soft_to_hard() {
        let model = soft_arm();
        let q = pose(&model, 0.4);
        let free = Robot::at_rest(&model, Servo::ideal(1e-3), q, 20.0).base_from_tool().origin;
        for stiffness_n_m in [1e5, 1e6, 1e7] {
            let point_base = free + DVec3::Z * 50e-6;
            let contact = Contact { point_base, normal_base: DVec3::Z, stiffness_n_m };
            let tick = RobotInContact::new(&model, contact, q, Servo::ideal(1e-3)).step(&q);
            let force = tick.wrench_base.force;
            assert!((contact.force(tick.base_from_tool.origin) - force).length() < 1e-6);
            assert!(force.z > 0.0 && force.z < stiffness_n_m * 50e-6, "the arm gives way");
        }
    }

    #[test]
    fn off_the_surface_nothing_pulls() {
        let model = soft_arm();
        let q = pose(&model, 0.4);
        let contact = Contact {
            point_base: DVec3::new(0.8, 0.0, 0.39),
            normal_base: DVec3::Z,
            stiffness_n_m: 1e7,
        };
        let tick = RobotInContact::lagging_20_ms(&model, contact, q, 1e-3).step(&q);
        assert_eq!(tick.wrench_base, Wrench::ZERO);
    }

    #[test]
    fn without_a_corrector_the_force_settles_with_the_servos_lag() {
        let model = soft_arm();
        let (above, below) = (pose(&model, 0.4), pose(&model, 0.3998));
        let contact = Contact {
            point_base: DVec3::new(0.8, 0.0, 0.4),
            normal_base: DVec3::Z,
            stiffness_n_m: 1e6,
        };
        let mut robot = RobotInContact::lagging_20_ms(&model, contact, above, 1e-3);
        let forces: Vec<f64> = (0..400).map(|_| robot.step(&below).wrench_base.force.z).collect();
        assert!(forces.windows(2).all(|two| two[1] >= two[0] - 1e-9), "it grows and stays");
        let share = forces[19] / forces[399];
        assert!((share - (1.0 - libm::exp(-1.0))).abs() < 0.02, "{share} after one time constant");
    }
}
