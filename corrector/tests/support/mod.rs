//! Arms and models for the tests of this crate: published dimensions, errors of the size that
//! calibrations find.
#![allow(dead_code, reason = "every test file uses its own part of this")]

use corrector::{Command, Corrector, CycleInputs, Outcome, Settings};
use envelope::Limits;
use glam::{DMat3, DVec3};
use physics::arm::GRAVITY;
use physics::{
    AnyEffect, Arm, Body, JOINTS_MAX, Joint, JointKind, Joints, Model, ParameterValues, Tool,
    Wrench,
};

pub(crate) const DT_NS: u64 = 1_000_000;

pub(crate) fn envelope() -> Limits {
    Limits::new(8e-3, 0.1, 20.0).expect("positive")
}

fn joint(axis: DVec3, point: [f64; 3], limits_deg: (f64, f64), mass: f64) -> Joint {
    let point = DVec3::from_array(point);
    Joint {
        kind: JointKind::Revolute,
        axis,
        point,
        limits: (limits_deg.0.to_radians(), limits_deg.1.to_radians()),
        max_speed: 2.6,
        link: Some(Body::point_mass(mass, point + DVec3::new(0.1, 0.02, 0.1))),
    }
}

fn spindle(tcp: [f64; 3]) -> Tool {
    let tcp = DVec3::from_array(tcp);
    let base_from_tool = DMat3::from_cols(-DVec3::Z, DVec3::Y, DVec3::X);
    let body = Some(Body::point_mass(5.0, tcp - DVec3::new(0.08, 0.0, 0.0)));
    Tool { tcp, base_from_tool, body }
}

/// ABB IRB 1600-6/1.45 with a spindle: geometry as in ros-industrial/abb, masses round.
pub(crate) fn six() -> Arm {
    let joints = [
        joint(DVec3::Z, [0.0, 0.0, 0.4865], (-180.0, 180.0), 65.0),
        joint(DVec3::Y, [0.15, 0.0, 0.4865], (-90.0, 120.0), 45.0),
        joint(DVec3::Y, [0.15, 0.0, 1.1865], (-245.0, 65.0), 40.0),
        joint(DVec3::X, [0.45, 0.0, 1.1865], (-200.0, 200.0), 20.0),
        joint(DVec3::Y, [0.75, 0.0, 1.1865], (-115.0, 115.0), 5.0),
        joint(DVec3::X, [0.815, 0.0, 1.1865], (-400.0, 400.0), 1.0),
    ];
    Arm::new(&joints, spindle([0.965, 0.03, 1.2365]), GRAVITY).expect("sound")
}

/// The first `n` joints of the six with the tool on the last of them.
pub(crate) fn first(n: usize) -> Arm {
    let six = six();
    Arm::new(&six.joints()[..n], six.tool, GRAVITY).expect("sound")
}

/// A redundant arm of seven revolute joints with a reach of 0.9 m.
pub(crate) fn seven() -> Arm {
    let limits = (-165.0, 165.0);
    let joints = [
        joint(DVec3::Z, [0.0, 0.0, 0.333], limits, 3.0),
        joint(DVec3::Y, [0.0, 0.0, 0.333], limits, 3.0),
        joint(DVec3::Z, [0.0, 0.0, 0.649], limits, 3.0),
        joint(-DVec3::Y, [0.0825, 0.0, 0.649], limits, 2.0),
        joint(DVec3::Z, [0.0, 0.0, 1.033], limits, 2.0),
        joint(-DVec3::Y, [0.0, 0.0, 1.033], limits, 1.0),
        joint(-DVec3::Z, [0.088, 0.0, 1.033], limits, 0.5),
    ];
    Arm::new(&joints, spindle([0.088, 0.0, 0.826]), GRAVITY).expect("sound")
}

/// A portal of three slides with a wrist of three.
pub(crate) fn portal() -> Arm {
    let mut joints: Vec<Joint> = six().joints().to_vec();
    for (i, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
        joints[i].kind = JointKind::Prismatic;
        joints[i].axis = axis;
        joints[i].limits = (-1.0, 1.0);
    }
    Arm::new(&joints, spindle([0.965, 0.03, 1.2365]), GRAVITY).expect("sound")
}

pub(crate) fn effect(
    arm: &Arm,
    kind: &str,
    joint: Option<usize>,
    given: &[(&str, &[f64])],
) -> AnyEffect {
    AnyEffect::build(kind, arm, joint, ParameterValues(given)).expect("a sound effect")
}

/// The errors of one joint, SI.
pub(crate) struct JointErrors {
    pub(crate) offset: f64,
    pub(crate) ratio: f64,
    pub(crate) amplitude: f64,
    pub(crate) cycles: f64,
    pub(crate) phase: f64,
    pub(crate) width: f64,
    pub(crate) compliance: f64,
}

/// Errors of a different size for each joint.
pub(crate) fn errors_of(joint: usize) -> JointErrors {
    let n = joint as f64;
    JointErrors {
        offset: 6e-4 - 2e-4 * n,
        ratio: 2e-4 - 5e-5 * n,
        amplitude: 2e-5 + 2e-5 * n,
        cycles: 3.0 + 20.0 * n,
        phase: 0.7 * n,
        width: 1e-4 + 3e-5 * n,
        compliance: 2e-6 + 1e-6 * n,
    }
}

pub(crate) const TOOL_SHIFT: [f64; 3] = [2e-4, -1e-4, 3e-4];
pub(crate) const TOOL_TURN: [f64; 3] = [1e-4, 2e-4, -3e-4];
pub(crate) const BASE_COMPLIANCE: f64 = 1e-7;

/// Every kind of error that acts on a joint, and errors of the tool and the base.
pub(crate) fn erring(arm: Arm) -> Model {
    let mut model = Model::nominal(arm);
    let mut push = |kind: &str, joint: Option<usize>, given: &[(&str, &[f64])]| {
        model.push(effect(&arm, kind, joint, given)).expect("room");
    };
    for i in 0..arm.count() {
        let (e, joint) = (errors_of(i), Some(i));
        push("joint_offset", joint, &[("offset", &[e.offset])]);
        push("joint_ratio", joint, &[("ratio", &[e.ratio])]);
        let wave: &[(&str, &[f64])] =
            &[("amplitude", &[e.amplitude]), ("cycles", &[e.cycles]), ("phase", &[e.phase])];
        push("transmission_error", joint, wave);
        push("backlash", joint, &[("width", &[e.width])]);
        push("joint_compliance", joint, &[("compliance", &[e.compliance])]);
    }
    push("tool_offset", None, &[("shift", &TOOL_SHIFT), ("turn", &TOOL_TURN)]);
    push("base_compliance", None, &[("compliance", &[BASE_COMPLIANCE])]);
    model
}

/// Zero, gear and drive train of each joint, the tool and the base: twenty effects.
pub(crate) fn twenty() -> Model {
    let kinds = [
        "joint_offset",
        "transmission_error",
        "joint_compliance",
        "tool_offset",
        "base_compliance",
    ];
    let all = erring(six());
    let wanted = all.effects().filter(|effect| kinds.contains(&effect.spec().kind));
    Model::new(six(), &wanted.copied().collect::<Vec<_>>()).expect("sound")
}

/// A pose in the middle of the six joints' ranges, rad.
pub(crate) fn pose() -> Joints {
    let mut q = [0.0; JOINTS_MAX];
    q[..6].copy_from_slice(&[0.3, -0.4, 0.5, 0.7, -0.6, 0.4]);
    q
}

/// A smooth motion of six joints.
pub(crate) fn smooth(t_s: f64) -> [f64; 6] {
    let wave = |rad_s: f64, phase: f64| 0.4 * (rad_s * t_s + phase).sin();
    let mut q: [f64; 6] = std::array::from_fn(|i| wave(0.3 + 0.1 * i as f64, i as f64));
    q[4] += 0.9;
    q
}

/// The wrench of a cut, at the TCP.
pub(crate) fn load() -> Wrench {
    Wrench { force: DVec3::new(50.0, -20.0, 30.0), moment: DVec3::new(1.0, -2.0, 0.5) }
}

/// Runs cycles one after the other and keeps their time.
pub(crate) struct Run {
    pub(crate) corrector: Corrector,
    pub(crate) model: Model,
    pub(crate) world: CycleInputs,
    pub(crate) cycles: u64,
}

impl Run {
    pub(crate) fn new(model: Model, settings: Settings) -> Self {
        Self {
            corrector: Corrector::new(settings),
            model,
            world: CycleInputs::default(),
            cycles: 0,
        }
    }

    pub(crate) fn cycle(&mut self, q: &[f64]) -> Outcome {
        self.cycles += 1;
        let t_ns = self.cycles * DT_NS;
        self.give(&Command::new(self.cycles, t_ns, q), t_ns)
    }

    pub(crate) fn give(&mut self, command: &Command, now_ns: u64) -> Outcome {
        let wanted = self.corrector.correct(&self.model, command, &self.world, now_ns);
        let outcome = self.corrector.limit(&self.model, &wanted);
        self.corrector.prepare(&self.model);
        outcome
    }
}
