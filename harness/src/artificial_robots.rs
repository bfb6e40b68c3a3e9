//! Models with any number of joints and effects, for measurements of computing time.
//!
//! A robot's solve takes as many steps with many effects as with few, and with few joints as with
//! many: the gear errors are so large that one step never suffices, and the added effects are small
//! compared with them. The robots are artificial.

use std::fmt::Write as _;

/// Axes of the joints, base to flange, repeated.
const AXES: [[f64; 3]; 6] = [
    [0.0, 0.0, 1.0],
    [0.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [1.0, 0.0, 0.0],
];
/// Vector between two joints, mm.
const LINK_MM: [f64; 3] = [120.0, 30.0, 180.0];
/// Gear ratio error of each joint: every correction then moves along the path, and its limits apply
/// at every joint.
const RATIO: f64 = 2e-3;
/// Added effects, one after the other, joint by joint.
const ADDED: [&str; 4] = [
    "kind = \"transmission_error\"\namplitude_mrad = 0.002\ncycles_per_rev = 13.0\nphase_rad = 0.7",
    "kind = \"joint_compliance\"\ncompliance_mrad_per_kNm = 0.01",
    "kind = \"joint_ratio\"\nratio = 1e-6",
    "kind = \"backlash\"\nwidth_mrad = 0.002",
];

/// A robot with gear ratio errors and `effects` further effects.
pub(crate) fn robot_model(joints: usize, effects: usize) -> String {
    let point = |link: usize, share: f64| LINK_MM.map(|mm| mm * (link as f64 + share));
    let mut text = format!(
        "schema = \"trued.model/1\"\nname = \"{joints} joints, {effects} effects more\"\n\
         [tool]\ntcp_mm = {:?}\nmass_kg = 2.0\ncom_mm = {:?}\n",
        point(joints, 0.0),
        point(joints, -0.2)
    );
    for joint in 0..joints {
        let (axis, point, centre) =
            (AXES[joint % AXES.len()], point(joint, 0.0), point(joint, 0.5));
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "[[joint]]\nname = \"{0}\"\nkind = \"revolute\"\naxis = {axis:?}\npoint_mm = {point:?}\n\
             limits_deg = [-170.0, 170.0]\nmax_speed_deg_s = 180.0\n\
             link = {{ mass_kg = 5.0, com_mm = {centre:?} }}\n\
             [[effect]]\nkind = \"joint_ratio\"\njoint = {0}\nratio = {RATIO:?}\n",
            joint + 1
        );
    }
    for effect in 0..effects {
        let (joint, kind) = (effect % joints + 1, ADDED[effect / joints % ADDED.len()]);
        let _ = write!(text, "[[effect]]\njoint = {joint}\n{kind}\n");
    }
    text
}
