//! The benchmark's robot with twenty effects: zero, gear and drive train of each joint, tool, base.
//!
//! Kinds and sizes of the effects are those of `cargo xtask peers`. It represents no real robot.

use std::fmt::Write as _;

/// Joints of the robot.
const JOINTS: u32 = 6;
/// The tool and the base.
const TOOL_AND_BASE: &str = "[[effect]]\nkind = \"tool_offset\"\nshift_mm = [0.2, -0.1, 0.3]\nturn_mrad = [0.1, 0.2, -0.3]\n\
                    [[effect]]\nkind = \"base_compliance\"\ncompliance_mrad_per_kNm = 0.1\n";

/// The text of the model, made from the text of a robot without effects.
pub(super) fn model_text(robot: &str) -> String {
    let mut text = format!("{robot}\n{TOOL_AND_BASE}");
    for joint in 1..=JOINTS {
        let n = f64::from(joint - 1);
        let (offset, amplitude, compliance) = (0.6 - 0.2 * n, 0.02 + 0.02 * n, 2.0 + n);
        let (cycles, phase) = (3.0 + 20.0 * n, 0.7 * n);
        // Written to a text: it cannot fail.
        let _ = write!(
            text,
            "[[effect]]\njoint = {joint}\nkind = \"joint_offset\"\noffset_mrad = {offset:?}\n\
             [[effect]]\njoint = {joint}\nkind = \"transmission_error\"\namplitude_mrad = {amplitude:?}\n\
             cycles_per_rev = {cycles:?}\nphase_rad = {phase:?}\n\
             [[effect]]\njoint = {joint}\nkind = \"joint_compliance\"\ncompliance_mrad_per_kNm = {compliance:?}\n"
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::model::RobotModel;
    use recording::model::presets::preset;

    #[test]
    fn the_model_of_the_compute_figure_has_its_twenty_effects() {
        let robot = preset("irb1600-6-145").expect("a preset");
        let model = RobotModel::parse("twenty", &model_text(robot.text)).expect("a sound model");
        assert_eq!((model.physics.effects().len(), model.physics.arm.count()), (20, 6));
        let of = |kind| model.physics.effects().filter(|e| e.spec().kind == kind).count();
        let each = ["joint_offset", "transmission_error", "joint_compliance"].map(of);
        assert_eq!((each, of("tool_offset"), of("base_compliance")), ([6; 3], 1, 1));
    }
}
