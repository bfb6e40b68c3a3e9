//! Lists of poses as programs for the robot's own controller, with a pause at each for the measurement.
//!
//! A [`ProgramRequest`] is the request; a [`Program`] has been checked against the model (limits, joints,
//! axes of the controller) and is written as ABB RAPID, as KUKA KRL, and as the recording for the
//! measurements. All three contain the same values, rounded once. A program never exceeds the joint
//! limits. Collisions are not checked: run a program slowly first.

mod axes;
mod krl;
mod rapid;
#[cfg(test)]
mod tests;

pub use axes::Axis;
pub use krl::{Krl, KrlFiles};
pub use rapid::Rapid;

use physics::JointKind;

use crate::faults::{Fault, Faults};
use crate::model::{JointEntry, ModelFile};
use crate::series::{
    Channel, DirectionSource as DirectionFrom, FileUnits, Recording, RecordingKind,
    RecordingMetadata,
};
use crate::unit::Unit;

/// Decimals of degrees and millimetres: controllers use single precision.
const DECIMALS: usize = 5;
/// The longest name that KRL accepts; RAPID accepts 32.
const NAME_MAX: usize = 24;
/// The smallest distance of an approach, degrees or mm: far above the resolution of the file.
const AWAY_MIN: f64 = 1e-3;
/// The longest pause at a pose, s.
const PAUSE_S_MAX: f64 = 3600.0;

/// Poses and motions of a program.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgramRequest {
    /// Name of the program: a letter, then letters, digits, `_`; at most 24.
    pub name: String,
    /// Position at which the program begins and ends, rad or m.
    pub home: Vec<f64>,
    /// The poses to measure, in their order, rad or m.
    pub poses: Vec<Vec<f64>>,
    /// How the robot approaches each pose.
    pub approach: Approach,
    /// Pause at each pose, s.
    pub pause_s: f64,
    /// The controller's axis of each joint. Empty: joint `i` is the robot's axis `i`, if there are
    /// at most six joints, all revolute.
    pub axes: Vec<Axis>,
}

/// Approach to a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Approach {
    /// Directly from the previous pose.
    Direct,
    /// Twice: all joints from below, then all from above, so that lost motion becomes visible.
    BothWays {
        /// Approach distance of revolute joints, rad, above 0.
        turn_rad: f64,
        /// Approach distance of prismatic joints, m, above 0.
        slide_m: f64,
    },
}

/// A stop for a measurement. Positions in degrees, or mm for prismatic joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// The pose, from 1.
    pub pose: usize,
    /// Position before the pose, so that it is approached from the requested side.
    pub via: Option<Vec<f64>>,
    /// Position of the stop.
    pub at: Vec<f64>,
    /// Sign of each joint's last motion: −1, 0 (unknown), 1.
    pub direction: Vec<i8>,
}

/// A program whose positions are within the model's limits.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    name: String,
    robot: String,
    kinds: Vec<JointKind>,
    axes: Vec<Axis>,
    home: Vec<f64>,
    stops: Vec<Stop>,
    pause_s: f64,
}

impl Program {
    /// Checks a tour against the robot's model.
    ///
    /// # Errors
    /// All reasons against it: each pose and joint beyond a limit, counts, names, axes.
    pub fn new(tour: &ProgramRequest, model: &ModelFile) -> Result<Self, Faults> {
        let mut faults = Faults::new(&tour.name);
        check_name(&mut faults, "name", &tour.name, NAME_MAX);
        if !(0.0..=PAUSE_S_MAX).contains(&tour.pause_s) {
            let fault = Fault::new("pause", format!("is {} s", tour.pause_s));
            faults.push(fault.expected(format!("0 to {PAUSE_S_MAX} s")));
        }
        if tour.poses.is_empty() {
            faults.push(Fault::new("poses", "there are none").help("give at least one"));
        }
        let joints = &model.joints;
        let away = away(&mut faults, tour.approach, joints);
        let axes = axes::of_joints(&mut faults, &tour.axes, joints);
        let home = position(&mut faults, "home", joints, &tour.home, 0.0, &[]);
        let mut stops = Vec::new();
        for (index, pose) in tour.poses.iter().enumerate() {
            let name = format!("pose {}", index + 1);
            let sides: &[f64] = if away.is_empty() { &[0.0] } else { &[-1.0, 1.0] };
            let rest = position(&mut faults, &name, joints, pose, 0.0, &[]);
            for side in sides {
                let whence = if *side < 0.0 { "from below" } else { "from above" };
                let from = || format!("{name}, coming {whence}");
                let via = (*side != 0.0 && !rest.is_empty())
                    .then(|| position(&mut faults, &from(), joints, pose, *side, &away));
                stops.push(Stop { pose: index + 1, via, at: rest.clone(), direction: Vec::new() });
            }
        }
        let kinds = joints.iter().map(|joint| joint.kind).collect();
        let (name, robot) = (tour.name.clone(), model.name.clone());
        let mut program = Self { name, robot, kinds, axes, home, stops, pause_s: tour.pause_s };
        if !faults.is_empty() {
            return faults.into_result(None);
        }
        program.set_directions();
        Ok(program)
    }

    /// The stops, in their order.
    #[must_use]
    pub fn stops(&self) -> &[Stop] {
        &self.stops
    }

    /// The list of joint positions as a recording of poses, one row per stop, with empty `columns`
    /// for the measurements. Its times are row numbers.
    #[must_use]
    pub fn recording(&self, columns: &[Channel]) -> Recording {
        let rows = self.stops.len();
        let mut recording = Recording::new((0..rows).map(|row| row as f64).collect());
        recording.units = FileUnits::WORKSHOP;
        recording.metadata = RecordingMetadata {
            kind: RecordingKind::Poses,
            approach: DirectionFrom::Columns,
            ..RecordingMetadata::default()
        };
        for (joint, kind) in self.kinds.iter().enumerate() {
            recording.set_joint_kind(joint, *kind);
            let position =
                |stop: &Stop| unit(*kind).map_or(f64::NAN, |unit| unit.to_si(stop.at[joint]));
            recording.set(Channel::Command(joint), self.stops.iter().map(position).collect());
            let direction = |stop: &Stop| f64::from(stop.direction[joint]);
            recording.set(Channel::Direction(joint), self.stops.iter().map(direction).collect());
        }
        for column in columns {
            recording.set(*column, vec![f64::NAN; rows]);
        }
        recording
    }

    /// Each joint's last motion at each stop; a joint that did not move keeps its previous
    /// direction.
    fn set_directions(&mut self) {
        let mut before = self.home.clone();
        let mut direction = vec![0_i8; before.len()];
        for stop in &mut self.stops {
            for next in stop.via.iter().chain([&stop.at]) {
                for (sign, (from, to)) in direction.iter_mut().zip(before.iter().zip(next)) {
                    *sign = match to.total_cmp(from) {
                        std::cmp::Ordering::Less => -1,
                        std::cmp::Ordering::Equal => *sign,
                        std::cmp::Ordering::Greater => 1,
                    };
                }
                before.clone_from(next);
            }
            stop.direction.clone_from(&direction);
        }
    }

    /// The text of a program's first comment.
    fn heading(&self) -> String {
        let robot = plain(&self.robot);
        format!(
            "stops: {}; robot: {robot}; made by trued, to be tried slowly first",
            self.stops.len()
        )
    }

    /// A sentence about a stop, for a comment.
    fn description(&self, index: usize, stop: &Stop) -> String {
        let way = match &stop.via {
            None => "",
            Some(_) if stop.direction.first() == Some(&1) => ", all joints from below",
            Some(_) => ", all joints from above",
        };
        format!("stop {} of {}: pose {}{way}", index + 1, self.stops.len(), stop.pose)
    }
}

/// Approach distance of each joint, in file units; empty for [`Approach::Direct`].
fn away(faults: &mut Faults, approach: Approach, joints: &[JointEntry]) -> Vec<f64> {
    let Approach::BothWays { turn_rad, slide_m } = approach else { return Vec::new() };
    let size = |joint: &JointEntry| match joint.kind {
        JointKind::Revolute => in_file(turn_rad, joint.kind),
        JointKind::Prismatic => in_file(slide_m, joint.kind),
    };
    let sizes: Vec<f64> = joints.iter().map(size).collect();
    let Some(joint) = sizes.iter().position(|size| !(*size >= AWAY_MIN && size.is_finite())) else {
        return sizes;
    };
    let fault = Fault::new("approach", format!("joint {} begins {} away", joint + 1, sizes[joint]));
    faults.push(fault.expected(format!("a distance of {AWAY_MIN} deg (mm) or more")));
    Vec::new()
}

/// A position `side` times `away` from `q`, in file units, rounded within the limits; empty where it cannot be.
fn position(
    faults: &mut Faults,
    name: &str,
    joints: &[JointEntry],
    q: &[f64],
    side: f64,
    away: &[f64],
) -> Vec<f64> {
    if q.len() != joints.len() {
        let fault = Fault::new(name, format!("has {} joint positions", q.len()));
        faults.push(fault.expected(format!("{}, as the model has joints", joints.len())));
        return Vec::new();
    }
    let mut position = Vec::new();
    for (i, (joint, q)) in joints.iter().zip(q).enumerate() {
        let value = in_file(*q, joint.kind) + side * away.get(i).copied().unwrap_or(0.0);
        let [low, high] = joint.limits;
        if value >= low && value <= high {
            position.push(rounded(value, low, high));
            continue;
        }
        faults.push_with(|| {
            let unit = unit(joint.kind).map_or("", |unit| unit.name);
            let fault = Fault::new(name, format!("joint {} is at {value} {unit}", i + 1));
            let help = if side == 0.0 {
                "leave the pose out, or move it"
            } else {
                "come from nearer, or move the pose"
            };
            fault.expected(format!("{low} to {high} {unit}, the model's limits")).help(help)
        });
    }
    if position.len() == joints.len() { position } else { Vec::new() }
}

/// Rounds to the decimals of a program, within the limits.
fn rounded(value: f64, low: f64, high: f64) -> f64 {
    let digits = 10.0_f64.powi(DECIMALS as i32);
    let rounded = (value * digits).round();
    let rounded = if rounded / digits > high { rounded - 1.0 } else { rounded };
    let rounded = if rounded / digits < low { rounded + 1.0 } else { rounded };
    // No minus before a zero.
    rounded / digits + 0.0
}

fn unit(kind: JointKind) -> Option<Unit> {
    Unit::from_name(match kind {
        JointKind::Revolute => "deg",
        JointKind::Prismatic => "mm",
    })
}

fn in_file(si: f64, kind: JointKind) -> f64 {
    unit(kind).map_or(f64::NAN, |unit| unit.from_si(si))
}

/// A number as text, without exponent and trailing zeros.
fn figure(value: f64) -> String {
    let text = format!("{value:.DECIMALS$}");
    let short = text.trim_end_matches('0');
    if short.ends_with('.') { format!("{short}0") } else { short.to_owned() }
}

/// Checks that a name is valid for a controller.
fn check_name(faults: &mut Faults, key: &str, name: &str, length_max: usize) {
    let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let begins = name.starts_with(|c: char| c.is_ascii_alphabetic());
    if !plain || !begins || name.len() > length_max {
        let fault = Fault::new(key, format!("is \"{name}\", which no controller takes"));
        faults.push(
            fault.expected(format!("a letter, then letters, digits or _: at most {length_max}")),
        );
    }
}

/// A text for a comment: one line of plain characters.
fn plain(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_graphic() || c == ' ' { c } else { '?' }).collect()
}
