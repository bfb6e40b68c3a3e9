//! Assignment of the model's joints to the controller's axes.
//!
//! Controllers have up to six robot axes and up to six external ones (ABB `robax` and `extax`, KUKA
//! `A1` … and `E1` …). With prismatic joints, or more than six joints, the caller must state the
//! axes.

use std::fmt;
use std::str::FromStr;

use physics::JointKind;

use crate::faults::{Fault, Faults};
use crate::model::JointEntry;

/// Largest number of robot axes, and of external axes, of a controller.
pub(super) const AXES: usize = 6;

/// An axis of a controller, from 1; written `A1` … `A6`, `E1` … `E6`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Axis {
    /// One of the robot itself.
    Robot(usize),
    /// An external one: a track, a turntable, the seventh axis of an arm.
    External(usize),
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Robot(number) => write!(f, "A{number}"),
            Self::External(number) => write!(f, "E{number}"),
        }
    }
}

/// The text is not the name of an axis.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown controller axis `{0}`, expected A1 to A6 (robot) or E1 to E6 (external)")]
pub struct UnknownAxis(String);

impl FromStr for Axis {
    type Err = UnknownAxis;

    fn from_str(name: &str) -> Result<Self, UnknownAxis> {
        let all = (1..=AXES).flat_map(|number| [Self::Robot(number), Self::External(number)]);
        let mut named = all.filter(|axis| axis.to_string().eq_ignore_ascii_case(name.trim()));
        named.next().ok_or_else(|| UnknownAxis(name.to_owned()))
    }
}

/// The axis of each joint, as stated or by default.
pub(super) fn of_joints(faults: &mut Faults, stated: &[Axis], joints: &[JointEntry]) -> Vec<Axis> {
    if stated.is_empty() {
        return plain(faults, joints);
    }
    if stated.len() != joints.len() {
        let fault = Fault::new("axes", format!("are {}", stated.len()));
        faults.push(
            fault.expected(format!("one axis for each of the model's {} joints", joints.len())),
        );
    }
    for (index, axis) in stated.iter().enumerate() {
        let (Axis::Robot(number) | Axis::External(number)) = axis;
        if !(1..=AXES).contains(number) {
            faults
                .push(Fault::new("axes", format!("include {axis}")).expected("A1 to A6, E1 to E6"));
        } else if stated[..index].contains(axis) {
            faults.push(
                Fault::new("axes", format!("include {axis} twice")).expected("each axis once"),
            );
        }
    }
    stated.to_vec()
}

fn plain(faults: &mut Faults, joints: &[JointEntry]) -> Vec<Axis> {
    let help = "state the axis of each joint, such as E1,A1,A2,A3,A4,A5,A6 for a robot on a track";
    if let Some(joint) = joints.iter().position(|joint| joint.kind == JointKind::Prismatic) {
        let message = format!(
            "are not given, and joint {} is linear: it could be a robot axis or an external axis",
            joint + 1
        );
        faults.push(Fault::new("axes", message).help(help));
    } else if joints.len() > AXES {
        let message =
            format!("are not given, and the model has {} joints instead of six", joints.len());
        faults.push(Fault::new("axes", message).help(help));
    }
    (1..=joints.len()).map(Axis::Robot).collect()
}
