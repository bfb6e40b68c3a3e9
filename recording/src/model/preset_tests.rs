//! Presets against published Denavit-Hartenberg figures, by an independent matrix product.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DMat4, DVec3, DVec4};
use physics::{Chain, Inputs, Joints, Memories};

use super::presets::{PRESETS, preset};
use super::{Numbers, RobotModel};

fn rotation_z(angle: f64) -> DMat4 {
    DMat4::from_rotation_z(angle)
}

/// `Rz(theta) Tz(d) Tx(a) Rx(alpha)`; d, a in mm.
fn standard(theta: f64, d: f64, a: f64, alpha: f64) -> DMat4 {
    rotation_z(theta)
        * DMat4::from_translation(DVec3::new(a, 0.0, d) * 1e-3)
        * DMat4::from_rotation_x(alpha)
}

/// `Rx(alpha) Tx(a) Rz(theta) Tz(d)` (Craig); a, d in mm.
fn modified(alpha: f64, a: f64, d: f64, theta: f64) -> DMat4 {
    DMat4::from_rotation_x(alpha)
        * DMat4::from_translation(DVec3::X * a * 1e-3)
        * rotation_z(theta)
        * DMat4::from_translation(DVec3::Z * d * 1e-3)
}

fn irb120(q: &[f64]) -> DMat4 {
    standard(q[0], 290.0, 0.0, -FRAC_PI_2)
        * standard(q[1] - FRAC_PI_2, 0.0, 270.0, 0.0)
        * standard(q[2], 0.0, 70.0, -FRAC_PI_2)
        * standard(q[3], 302.0, 0.0, FRAC_PI_2)
        * standard(q[4], 0.0, 0.0, -FRAC_PI_2)
        * standard(q[5] + PI, 72.0, 0.0, 0.0)
}

fn irb1600(q: &[f64]) -> DMat4 {
    standard(q[0], 486.5, 150.0, -FRAC_PI_2)
        * standard(q[1] - FRAC_PI_2, 0.0, 700.0, 0.0)
        * standard(q[2], 0.0, 0.0, -FRAC_PI_2)
        * standard(q[3], 600.0, 0.0, FRAC_PI_2)
        * standard(q[4], 0.0, 0.0, -FRAC_PI_2)
        * standard(q[5], 65.0, 0.0, 0.0)
}

fn kuka(q: &[f64]) -> DMat4 {
    DMat4::from_rotation_x(PI)
        * standard(q[0], -675.0, 350.0, FRAC_PI_2)
        * standard(q[1], 0.0, 1150.0, 0.0)
        * standard(q[2] + FRAC_PI_2, 0.0, 41.0, -FRAC_PI_2)
        * standard(q[3], -1400.0, 0.0, FRAC_PI_2)
        * standard(q[4], 0.0, 0.0, -FRAC_PI_2)
        * standard(q[5], -240.0, 0.0, PI)
}

fn ur10e(q: &[f64]) -> DMat4 {
    standard(q[0], 180.7, 0.0, FRAC_PI_2)
        * standard(q[1], 0.0, -612.7, 0.0)
        * standard(q[2], 0.0, -571.55, 0.0)
        * standard(q[3], 174.15, 0.0, FRAC_PI_2)
        * standard(q[4], 119.85, 0.0, -FRAC_PI_2)
        * standard(q[5], 116.55, 0.0, 0.0)
}

fn fr3(q: &[f64]) -> DMat4 {
    modified(0.0, 0.0, 333.0, q[0])
        * modified(-FRAC_PI_2, 0.0, 0.0, q[1])
        * modified(FRAC_PI_2, 0.0, 316.0, q[2])
        * modified(FRAC_PI_2, 82.5, 0.0, q[3])
        * modified(-FRAC_PI_2, -82.5, 384.0, q[4])
        * modified(FRAC_PI_2, 0.0, 0.0, q[5])
        * modified(FRAC_PI_2, 88.0, 0.0, q[6])
        * modified(0.0, 0.0, 107.0, 0.0)
}

/// FANUC's published Denavit-Hartenberg parameters; joint 3 is J2 + J3.
fn fanuc(q: &[f64]) -> DMat4 {
    standard(q[0], 670.0, 312.0, -FRAC_PI_2)
        * standard(q[1] - FRAC_PI_2, 0.0, 1075.0, PI)
        * standard(q[2], 0.0, 225.0, -FRAC_PI_2)
        * standard(q[3], -1280.0, 0.0, FRAC_PI_2)
        * standard(q[4], 0.0, 0.0, -FRAC_PI_2)
        * standard(q[5], -235.0, 0.0, PI)
}

/// `side` is 1 for the right arm and -1 for the left; the holder's parameters are d, a, offset.
fn motoman(q: &[f64], side: f64, [d, a, offset]: [f64; 3]) -> DMat4 {
    standard(q[0] - FRAC_PI_2, -263.0, 0.0, side * 15_f64.to_radians())
        * standard(q[1], 1415.9, 150.0, -FRAC_PI_2)
        * standard(q[2] - FRAC_PI_2, 0.0, 614.0, PI)
        * standard(q[3], 0.0, 200.0, -FRAC_PI_2)
        * standard(q[4], -640.0, 0.0, FRAC_PI_2)
        * standard(q[5] - FRAC_PI_2, 0.0, 30.0, FRAC_PI_2)
        * standard(q[6], 200.0, 0.0, 0.0)
        * standard(offset, d, a, 0.0)
}

fn motoman_right(q: &[f64]) -> DMat4 {
    motoman(q, 1.0, [245.0, 45.0, -0.38])
}

fn motoman_left(q: &[f64]) -> DMat4 {
    motoman(q, -1.0, [250.0, 50.0, 0.0])
}

/// Poses spread over the range by the golden ratio: the same on every machine.
fn poses(model: &RobotModel, count: usize) -> Vec<Joints> {
    let joints = model.physics.arm.joints();
    let mut poses = Vec::new();
    for pose in 0..count {
        let mut q = Joints::default();
        for (joint, slot) in joints.iter().zip(&mut q) {
            let step = 0.618_033_988_75 * (poses.len() * 7 + pose + 1) as f64;
            *slot = joint.limits.0
                + (joint.limits.1 - joint.limits.0) * (step * (joint.point.x + 1.3)).fract().abs();
        }
        poses.push(q);
    }
    poses
}

/// A preset and its published forward kinematics.
type Case = (&'static str, fn(&[f64]) -> DMat4);

#[test]
fn every_preset_agrees_with_its_denavit_hartenberg_figures() {
    let cases: [Case; 9] = [
        ("irb120", irb120),
        ("irb1600-6-145", irb1600),
        ("irb1600-6-145-thesis", irb1600),
        ("fanuc-r2000ib", fanuc),
        ("kuka-kr240", kuka),
        ("motoman-right", motoman_right),
        ("motoman-left", motoman_left),
        ("ur10e", ur10e),
        ("fr3", fr3),
    ];
    for (name, published) in cases {
        let model = preset(name).unwrap().model().unwrap();
        for q in poses(&model, 40).into_iter().chain([Joints::default()]) {
            let tool = Chain::nominal(&model.physics.arm, &q).base_from_tool;
            let wanted = published(&q);
            let place = wanted * DVec4::W;
            assert!((tool.origin - place.truncate()).length() < 1e-8, "{name}: {q:?}");
            for axis in [DVec3::X, DVec3::Z] {
                let turned = tool.rotation * axis - (wanted * axis.extend(0.0)).truncate();
                // The rotation of the IRB's tool frame about z is arbitrary: only z is published.
                if axis == DVec3::Z || !name.starts_with("irb") {
                    assert!(turned.length() < 1e-8, "{name} {axis}: {q:?} {turned}");
                }
            }
        }
    }
}

#[test]
fn every_preset_loads_whole_and_says_its_sources() {
    for preset in PRESETS {
        let model = preset.model().unwrap();
        for key in ["geometry", "limits", "masses"] {
            assert!(model.file.meta.contains_key(key), "{}: {key}", preset.name);
        }
        assert!(model.not_compensated.is_empty());
        assert_eq!(RobotModel::parse("again", &model.file.to_toml()).unwrap(), model);
    }
}

#[test]
fn the_thesis_robot_errs_as_published() {
    let model = preset("irb1600-6-145-thesis").unwrap().model().unwrap();
    assert!(model.sigma.iter().flatten().any(|sigma| *sigma > 0.0));
    assert_eq!(model.file.modes.len(), 6);
    let poses = poses(&model, 500);
    let mut memories = Memories::default();
    let mut errors: Vec<f64> = Vec::new();
    for q in &poses {
        let inputs = Inputs { direction: [1.0; 16], ..Inputs::at_rest(*q) };
        model.physics.settle(&inputs, &mut memories);
        let found = model.physics.evaluate(&inputs, &memories);
        errors.push(
            (found.real.base_from_tool.origin - found.nominal.base_from_tool.origin).length() * 1e3,
        );
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    // Nubiola and Bonev 2013, same robot, nominal: 0.981 mm mean.
    assert!((0.5..1.2).contains(&mean), "mean error {mean} mm");
}

#[test]
fn the_thesis_presets_transmission_errors_come_back_with_shafts_that_its_teeth_give() {
    let file = preset("irb1600-6-145-thesis").expect("preset").model().expect("model").file;
    let mut errors = 0;
    for effect in file.effects.iter().filter(|effect| effect.kind == "transmission_error") {
        let parameter = effect.parameters.iter().find(|p| p.key == "cycles_per_rev");
        let Numbers::One(cycles) = parameter.expect("cycles").value else { panic!("one number") };
        let joint = effect.joint.expect("joint") - 1;
        let turns = physics::gears::shafts(&file.joints[joint].gear_teeth).map(|s| s.turns);
        // The last wheel turns with the joint itself.
        let known = turns.chain([1.0]).any(|turns| (cycles / turns - 1.0).abs() < 1e-9);
        assert!(known, "joint {}: {cycles} cycles per revolution", joint + 1);
        errors += 1;
    }
    assert_eq!(errors, 12);
}
