//! Arms for the tests of this crate: published dimensions, round masses.

use glam::{DMat3, DVec3};
use physics::arm::GRAVITY;
use physics::{AnyEffect, Arm, Body, Joint, JointKind, ParameterValues, Tool};

fn joint(axis: DVec3, point: [f64; 3], limits_deg: (f64, f64), mass: f64) -> Joint {
    let point = DVec3::from_array(point);
    Joint {
        kind: JointKind::Revolute,
        axis,
        point,
        limits: (limits_deg.0.to_radians(), limits_deg.1.to_radians()),
        max_speed: 2.6,
        link: Some(Body::point_mass(mass, point + DVec3::new(0.1, 0.0, 0.1))),
    }
}

/// ABB IRB 1600-6/1.45 with a spindle 0.15 m long: geometry and limits as in ros-industrial/abb.
pub(crate) fn irb1600() -> Arm {
    let joints = [
        joint(DVec3::Z, [0.0, 0.0, 0.4865], (-180.0, 180.0), 65.0),
        joint(DVec3::Y, [0.15, 0.0, 0.4865], (-90.0, 120.0), 45.0),
        joint(DVec3::Y, [0.15, 0.0, 1.1865], (-245.0, 65.0), 40.0),
        joint(DVec3::X, [0.45, 0.0, 1.1865], (-200.0, 200.0), 20.0),
        joint(DVec3::Y, [0.75, 0.0, 1.1865], (-115.0, 115.0), 5.0),
        joint(DVec3::X, [0.815, 0.0, 1.1865], (-400.0, 400.0), 1.0),
    ];
    Arm::new(&joints, tool(DVec3::new(0.965, 0.0, 1.1865)), GRAVITY).expect("a sound arm")
}

/// A redundant arm of seven revolute joints with a reach of 0.9 m.
pub(crate) fn seven_joints() -> Arm {
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
    let down = DMat3::from_cols(DVec3::X, -DVec3::Y, -DVec3::Z);
    let tool = Tool { tcp: DVec3::new(0.088, 0.0, 0.826), base_from_tool: down, body: None };
    Arm::new(&joints, tool, GRAVITY).expect("a sound arm")
}

/// A horizontal slide along x that carries `mass` kg.
pub(crate) fn slide(mass: f64) -> Arm {
    let along = joint(DVec3::X, [0.0; 3], (-180.0, 180.0), mass);
    let tool = Tool { tcp: DVec3::Z * 0.1, base_from_tool: DMat3::IDENTITY, body: None };
    let joints = [Joint { kind: JointKind::Prismatic, ..along }];
    Arm::new(&joints, tool, GRAVITY).expect("a sound slide")
}

fn tool(tcp: DVec3) -> Tool {
    let forward = DMat3::from_cols(-DVec3::Z, DVec3::Y, DVec3::X);
    let body = Some(Body::point_mass(5.0, DVec3::new(0.9, 0.0, 1.1865)));
    Tool { tcp, base_from_tool: forward, body }
}

/// An effect on a joint (0-based) with one value, SI.
pub(crate) fn effect(arm: &Arm, kind: &str, joint: usize, stem: &str, value: f64) -> AnyEffect {
    AnyEffect::build(kind, arm, Some(joint), ParameterValues(&[(stem, &[value])]))
        .expect("a sound effect")
}
