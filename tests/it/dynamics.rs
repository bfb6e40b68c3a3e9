//! Rigid-body dynamics compared with Pinocchio.
//!
//! Needs `python3` with `venv`, and the package registry for Pinocchio; otherwise the test is
//! SKIPPED.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use glam::{DMat3, DVec3};
use physics::dynamics::inverse_dynamics;
use physics::{Arm, Body, Inputs, JOINTS_MAX, Joint, JointKind, Tool, Wrench};
use serde_json::json;
use tests::clients::skipped;
use tests::python::environment;
use tests::rng::TestRng;

const CASES: usize = 200;

fn vector(rng: &mut TestRng, size: f64) -> DVec3 {
    DVec3::from_array([0; 3].map(|_| size * (2.0 * rng.uniform() - 1.0)))
}

fn body(rng: &mut TestRng) -> Body {
    let turn = DMat3::from_euler(glam::EulerRot::XYZ, rng.uniform(), rng.uniform(), rng.uniform());
    let mass = 0.5 + 20.0 * rng.uniform();
    let [x, y, z] = [0; 3].map(|_| mass * (0.02 + 0.3 * rng.uniform()).powi(2));
    let principal = DMat3::from_diagonal(DVec3::new(y + z, x + z, x + y));
    Body { mass, centre: vector(rng, 0.8), inertia: turn * principal * turn.transpose() }
}

fn arm(rng: &mut TestRng) -> Arm {
    let joint = |chance: &mut TestRng| Joint {
        kind: [JointKind::Revolute, JointKind::Prismatic][usize::from(chance.below(3) == 0)],
        axis: (vector(chance, 1.0) + DVec3::splat(1e-3)).normalize(),
        point: vector(chance, 0.7),
        limits: (-9.0, 9.0),
        max_speed: 9.0,
        link: Some(body(chance)),
    };
    let count = 1 + rng.below(JOINTS_MAX as u64);
    let joints: Vec<Joint> = (0..count).map(|_| joint(rng)).collect();
    let tool =
        Tool { tcp: vector(rng, 1.0), base_from_tool: DMat3::IDENTITY, body: Some(body(rng)) };
    Arm::new(&joints, tool, vector(rng, 10.0)).unwrap()
}

fn motion(rng: &mut TestRng) -> Inputs {
    let mut inputs = Inputs::at_rest([0.0; JOINTS_MAX]);
    for i in 0..JOINTS_MAX {
        let [q, v, a] = vector(rng, 2.0).to_array();
        (inputs.q[i], inputs.velocity[i], inputs.acceleration[i]) = (q, v, a);
    }
    inputs.wrench_base = Wrench { force: vector(rng, 200.0), moment: vector(rng, 30.0) };
    inputs
}

/// The arm in Pinocchio's terms.
fn description(arm: &Arm, inputs: &Inputs) -> serde_json::Value {
    let of_body = |body: &Body| {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = body.inertia;
        let inertia = [x.x, y.y, z.z, x.y, x.z, y.z];
        json!({"mass": body.mass, "centre": body.centre.to_array(), "inertia": inertia})
    };
    let joint = |(i, joint): (usize, &Joint)| {
        let mut description = of_body(&joint.link.unwrap());
        description["name"] = json!(format!("joint {i}"));
        description["slides"] = json!(joint.kind == JointKind::Prismatic);
        description["axis"] = json!(joint.axis.to_array());
        description["point"] = json!(joint.point.to_array());
        description
    };
    let count = arm.count();
    json!({
        "gravity": arm.gravity.to_array(),
        "joints": arm.joints().iter().enumerate().map(joint).collect::<Vec<_>>(),
        "tool": of_body(&arm.tool.body.unwrap()),
        "tcp": arm.tool.tcp.to_array(),
        "q": inputs.q[..count], "velocity": inputs.velocity[..count], "acceleration": inputs.acceleration[..count],
        "force": inputs.wrench_base.force.to_array(), "moment": inputs.wrench_base.moment.to_array(),
    })
}

#[test]
fn drive_torques_equal_pinocchios() {
    let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let python = match environment(&scratch.join("pinocchio"), &["pin>=3,<5"]) {
        Ok(python) => python,
        Err(why) => return skipped(scratch, "rigid-body dynamics against Pinocchio", &why),
    };
    let mut chance = TestRng::new(8);
    let cases: Vec<(Arm, Inputs)> =
        (0..CASES).map(|_| (arm(&mut chance), motion(&mut chance))).collect();
    let mut text = String::new();
    cases.iter().for_each(|(arm, inputs)| writeln!(text, "{}", description(arm, inputs)).unwrap());
    let script = tests::clients::root().join("tests/it/dynamics/torques.py").into_os_string();
    let mut peer = Command::new(python)
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = peer.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    let output = peer.wait_with_output().unwrap();
    assert!(output.status.success());
    writer.join().unwrap().unwrap();
    let output = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.lines().count(), CASES);
    let mut most = 0.0_f64;
    for ((arm, inputs), line) in cases.iter().zip(output.lines()) {
        let wanted: Vec<f64> = serde_json::from_str(line).unwrap();
        let found = &inverse_dynamics(arm, inputs)[..arm.count()];
        let size = wanted.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        for (found, wanted) in found.iter().zip(&wanted) {
            most = most.max((found - wanted).abs() / size);
            assert!((found - wanted).abs() < 1e-10 * size, "{found} not {wanted}: {arm:?}");
        }
    }
    println!("largest difference, of the largest torque of its arm: {most:.1e}");
}
