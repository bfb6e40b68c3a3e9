//! Loaded arms, for tests of the whole crate.

use crate::{Arm, Body, Chain, Inputs, JOINTS_MAX, Joint, JointKind, Loads, Signals, Tool, Wrench};
use glam::{DMat3, DVec3};

/// A loaded arm: a generic configuration, a load, temperatures.
pub(crate) struct Scene {
    pub(crate) arm: Arm,
    pub(crate) inputs: Inputs,
}

/// A six-joint arm of the IRB 1600's proportions with round masses.
pub(crate) fn scene() -> Scene {
    let joint = |axis: DVec3, x: f64, z: f64, mass: f64| Joint {
        kind: JointKind::Revolute,
        axis,
        point: DVec3::new(x, 0.0, z),
        limits: (-3.0, 3.0),
        max_speed: 3.0,
        link: Some(Body::point_mass(mass, DVec3::new(x + 0.1, 0.02, z + 0.05))),
    };
    let joints = [
        joint(DVec3::Z, 0.0, 0.4865, 60.0),
        joint(DVec3::Y, 0.15, 0.4865, 45.0),
        joint(DVec3::Y, 0.15, 1.1865, 30.0),
        joint(DVec3::X, 0.45, 1.1865, 12.0),
        joint(DVec3::Y, 0.75, 1.1865, 5.0),
        joint(DVec3::X, 0.815, 1.1865, 1.0),
    ];
    let tool = Tool {
        tcp: DVec3::new(1.0, 0.01, 1.25),
        base_from_tool: DMat3::from_cols(-DVec3::Z, DVec3::Y, DVec3::X),
        body: Some(Body::point_mass(6.0, DVec3::new(0.9, 0.0, 1.2))),
    };
    let arm = Arm::new(&joints, tool, crate::arm::GRAVITY).expect("a sound arm");
    let mut q = [0.0; JOINTS_MAX];
    q[..6].copy_from_slice(&[0.4, -0.3, 0.5, 0.7, -0.6, 0.2]);
    let mut inputs = Inputs::at_rest(q);
    inputs.wrench_base =
        Wrench { force: DVec3::new(80.0, -120.0, 60.0), moment: DVec3::new(4.0, -2.0, 3.0) };
    inputs.ambient_celsius = 27.0;
    inputs.spindle_rpm = 28_000.0;
    inputs.time_s = 1800.0;
    Scene { arm, inputs }
}

/// The same with a prismatic second joint.
pub(crate) fn sliding_scene() -> Scene {
    let Scene { arm, mut inputs } = scene();
    let mut joints = [arm.joints()[0]; 6];
    joints.copy_from_slice(arm.joints());
    joints[1].kind = JointKind::Prismatic;
    joints[1].axis = DVec3::new(0.0, 0.6, 0.8);
    inputs.q[1] = 0.25;
    let arm = Arm::new(&joints, arm.tool, arm.gravity).expect("a sound arm");
    Scene { arm, inputs }
}

/// Calls `visit` with the signals of an arm for these inputs.
pub(crate) fn seen<R>(arm: &Arm, inputs: &Inputs, visit: impl FnOnce(&Signals<'_>) -> R) -> R {
    let chain = Chain::nominal(arm, &inputs.q);
    let loads = Loads::on(arm, &chain, inputs.wrench_base);
    visit(&Signals { arm, inputs, chain: &chain, loads: &loads })
}

/// The same for the scene's arm.
pub(crate) fn with_inputs<R>(inputs: &Inputs, visit: impl FnOnce(&Signals<'_>) -> R) -> R {
    seen(&scene().arm, inputs, visit)
}
