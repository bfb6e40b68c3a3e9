//! Checks whether a model may replace the active one.
//!
//! A model of another robot, or one whose limits the arm already exceeds, is not loaded by mistake;
//! a refusal states the difference and the remedy. The check has no side effects.

use crate::position::Positions;
use crate::setup;
use physics::{Arm, JointKind};
use recording::model::RobotModel;

/// Maximum length of the text in an answer to a request, bytes.
pub const MESSAGE_BYTES_MAX: usize = 240;
/// Tolerance of the limits against rounding in conversions of units, rad or m.
const LIMIT_TOLERANCE: f64 = 1e-9;

/// Conditions of a reload request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReloadRequest {
    /// The request explicitly allows another robot.
    pub other_robot: bool,
    /// The cell is in shadow mode: the model cannot move the arm.
    pub in_shadow: bool,
}

/// Why `next` may not replace `active`; `None` if it may.
#[must_use]
pub fn refusal(
    active: &RobotModel,
    next: &RobotModel,
    positions: &Positions,
    request: ReloadRequest,
) -> Option<String> {
    let differences = next.file.identity().differences(&active.file.identity());
    let kinds = [active, next].map(|model| setup::joint_kinds(&model.physics.arm));
    if kinds[0] != kinds[1] {
        // Limits, recording and clients are set up for the joints that the daemon started with.
        return Some(message(
            "another robot",
            &differences,
            "restart the daemon to change the robot",
        ));
    }
    let outside = joints_outside_limits(&active.physics.arm, &next.physics.arm, positions);
    let (what, found, way_out) = if !differences.is_empty() {
        ("another robot", differences, "restart the daemon")
    } else if !outside.is_empty() {
        ("the arm is outside the model's limits", outside, "move the arm inside")
    } else {
        return None;
    };
    let by_name = match (request.other_robot, request.in_shadow) {
        (true, true) => return None,
        (true, false) => "switch to shadow mode first (required by `--other-robot`)",
        (false, _) => "in shadow mode, use `trued reload --other-robot`",
    };
    Some(message(what, &found, &format!("{way_out}, or {by_name}")))
}

/// Joints beyond a limit of `next` that is narrower than that of `active`: a reload that narrows
/// nothing is accepted.
fn joints_outside_limits(active: &Arm, next: &Arm, positions: &Positions) -> Vec<String> {
    let mut found = Vec::new();
    for (source, reading) in positions.newest() {
        if reading.q.len() != next.count() {
            continue;
        }
        let joints = active.joints().iter().zip(next.joints()).zip(&reading.q).zip(1..);
        for (((now, then), q), joint) in joints {
            let (low, high) = then.limits;
            let below = *q < low - LIMIT_TOLERANCE && low > now.limits.0;
            let above = *q > high + LIMIT_TOLERANCE && high < now.limits.1;
            if below || above {
                let (unit, per_si) = match then.kind {
                    JointKind::Revolute => ("deg", 1_f64.to_degrees()),
                    JointKind::Prismatic => ("mm", 1e3),
                };
                let [q, low, high] = [*q, low, high].map(|x| x * per_si);
                found.push(format!(
                    "joint {joint} {source} at {q:.3}, limits {low:.3} to {high:.3} {unit}"
                ));
            }
        }
    }
    found
}

/// Findings and remedy, shortened to the length of an answer; the list of findings is cut, not the
/// remedy.
fn message(what: &str, found: &[String], way_out: &str) -> String {
    let mut found = found.join("; ");
    let room =
        MESSAGE_BYTES_MAX.saturating_sub(what.len() + way_out.len() + "refused: : ; …".len());
    if found.len() > room {
        let end = (0..=room).rev().find(|end| found.is_char_boundary(*end)).unwrap_or(0);
        found.truncate(end);
        found.push('…');
    }
    format!("{what}: {found}; {way_out}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::model::presets::preset;

    const ARMED: ReloadRequest = ReloadRequest { other_robot: false, in_shadow: false };
    const BY_NAME: ReloadRequest = ReloadRequest { other_robot: true, in_shadow: true };

    fn model(name: &str) -> RobotModel {
        preset(name).unwrap().model().unwrap()
    }

    /// The demo robot with other limits of joint 1, degrees.
    fn limited(low: f64, high: f64) -> RobotModel {
        let mut file = model("irb1600-6-145-thesis").file;
        file.joints[0].limits = [low, high];
        RobotModel::of_file("limited", file).unwrap()
    }

    fn commanded(joint_1_deg: f64) -> Positions {
        let positions = Positions::default();
        let mut q = [0.0; 6];
        q[0] = joint_1_deg.to_radians();
        positions.commanded.store(&q, 1);
        positions
    }

    #[test]
    fn another_robot_is_refused_with_what_differs_and_the_way_out() {
        let (abb, kuka) = (model("irb1600-6-145-thesis"), model("kuka-kr240"));
        let message = refusal(&abb, &kuka, &Positions::default(), ARMED).unwrap();
        for part in ["another robot", "KUKA", "ABB", "restart", "--other-robot"] {
            assert!(message.contains(part), "{part}: {message}");
        }
        assert!(message.len() <= MESSAGE_BYTES_MAX, "{message}");
        let armed = ReloadRequest { other_robot: true, ..ARMED };
        let message = refusal(&abb, &kuka, &Positions::default(), armed).unwrap();
        assert!(message.contains("switch to shadow mode first"), "{message}");
        assert_eq!(refusal(&abb, &kuka, &Positions::default(), BY_NAME), None);
    }

    #[test]
    fn the_geometry_distinguishes_robots() {
        let mut file = model("irb1600-6-145").file;
        file.joints[2].point_mm = Some([150.0, 0.0, 1187.0]);
        let other = RobotModel::of_file("other", file).unwrap();
        let message =
            refusal(&model("irb1600-6-145"), &other, &Positions::default(), ARMED).unwrap();
        assert!(message.contains("the axis of joint 3 is displaced by 0.500 mm"), "{message}");
    }

    #[test]
    fn another_calibration_tool_or_serial_that_one_does_not_state_is_the_same_robot() {
        let mut file = model("irb1600-6-145").file;
        file.tool.tcp_mm[0] += 100.0;
        file.robot.serial = Some("1600-00001".to_owned());
        let other = RobotModel::of_file("other", file).unwrap();
        let thesis = model("irb1600-6-145-thesis");
        assert_eq!(refusal(&thesis, &other, &Positions::default(), ARMED), None);
        let mut file = other.file.clone();
        file.robot.serial = Some("1600-00002".to_owned());
        let second = RobotModel::of_file("second", file).unwrap();
        let message = refusal(&other, &second, &Positions::default(), ARMED).unwrap();
        assert!(message.contains("serial \"1600-00002\" instead of \"1600-00001\""), "{message}");
    }

    #[test]
    fn other_joints_are_refused_even_by_name() {
        let message =
            refusal(&model("ur10e"), &model("fr3"), &Positions::default(), BY_NAME).unwrap();
        assert!(
            message.contains("7 joints instead of 6") && message.contains("restart"),
            "{message}"
        );
    }

    #[test]
    fn limits_that_the_arm_is_outside_of_are_refused_and_those_it_is_inside_of_are_not() {
        let (wide, narrow) = (limited(-180.0, 180.0), limited(-30.0, 30.0));
        assert_eq!(refusal(&wide, &narrow, &Positions::default(), ARMED), None);
        assert_eq!(refusal(&wide, &narrow, &commanded(30.0), ARMED), None);
        let message = refusal(&wide, &narrow, &commanded(-30.1), ARMED).unwrap();
        for part in ["joint 1 commanded at -30.100", "-30.000 to 30.000 deg", "move the arm"] {
            assert!(message.contains(part), "{part}: {message}");
        }
        assert_eq!(refusal(&wide, &narrow, &commanded(-30.1), BY_NAME), None);
        let measured = commanded(0.0);
        measured.measured.store(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 2);
        assert!(refusal(&wide, &narrow, &measured, ARMED).unwrap().contains("measured"));
        // The arm is already outside, and the reload narrows nothing.
        assert_eq!(refusal(&narrow, &narrow, &commanded(-40.0), ARMED), None);
        assert_eq!(refusal(&narrow, &wide, &commanded(-40.0), ARMED), None);
    }

    #[test]
    fn the_way_out_is_never_cut_off() {
        let found = vec!["ä".repeat(500)];
        let text = message("another robot", &found, "restart the daemon");
        assert!(
            text.len() <= MESSAGE_BYTES_MAX && text.ends_with("…; restart the daemon"),
            "{text}"
        );
    }
}
