//! Identity of the robot that a model describes: manufacturer's data and nominal geometry.
//!
//! Two models of one robot have the same geometry hash, whatever their effects, tool, limits,
//! masses, names, comments and number formatting; adding, removing, rotating or displacing a joint,
//! or changing its kind, changes the hash.

use std::fmt;

use physics::JointKind;

use super::{JointEntry, ModelFile};
use crate::files::content_hash;
use crate::toml_reader::Table;

/// Longest name in `[robot]`, bytes: the space in the daemon's status.
pub const ROBOT_NAME_BYTES_MAX: usize = 64;

/// Grid on which geometry counts as the same: 1 µm for points, 1e-6 for the components of a unit vector. Nominal dimensions are published to
/// 0.01 mm at best, so that two robots differ by far more; the rounding of a text or of a unit differs by far less.
const GRID: f64 = 1e-6;
/// Where in a grid cell the cells' borders lie. Not one half: round decimals must not lie on a border, where noise in the last bit would decide.
const ROUNDING: f64 = 0.623_456_7;
/// Geometric differences that are named; more are counted.
const NAMED_MAX: usize = 2;

/// `[robot]`: the manufacturer's data of the robot. All of it is optional.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RobotEntry {
    /// The maker, as `ABB`.
    pub maker: Option<String>,
    /// The type, as `IRB 1600-6/1.45`.
    pub kind: Option<String>,
    /// Serial number of this robot.
    pub serial: Option<String>,
}

impl RobotEntry {
    /// Keys in the file with their values, in the file's order.
    #[must_use]
    pub fn entries(&self) -> [(&'static str, Option<&str>); 3] {
        [
            ("maker", self.maker.as_deref()),
            ("type", self.kind.as_deref()),
            ("serial", self.serial.as_deref()),
        ]
    }

    pub(super) fn read(table: &Table<'_, '_>) -> Self {
        let name = |key: &str| {
            let name = table.text(key)?.trim();
            let printable = !name.is_empty() && !name.chars().any(char::is_control);
            if !printable || name.len() > ROBOT_NAME_BYTES_MAX {
                let expected = format!("1 to {ROBOT_NAME_BYTES_MAX} bytes of printable text");
                table.fault(key, format!("is {name:?}"), expected);
                return None;
            }
            Some(name.to_owned())
        };
        let entry = Self { maker: name("maker"), kind: name("type"), serial: name("serial") };
        table.close();
        entry
    }
}

/// As `ABB IRB 1600-6/1.45, serial 1600-00001`.
impl fmt::Display for RobotEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = [self.maker.as_deref(), self.kind.as_deref()];
        let named: Vec<&str> = named.into_iter().flatten().collect();
        let name = if named.is_empty() { "unnamed robot".to_owned() } else { named.join(" ") };
        f.write_str(&name)?;
        self.serial.iter().try_for_each(|serial| write!(f, ", serial {serial}"))
    }
}

/// The robot of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// The manufacturer's data.
    pub robot: RobotEntry,
    axes: Vec<Axis>,
}

/// A joint's axis as a line on the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Axis {
    kind: JointKind,
    direction: [i64; 3],
    /// The point of the axis that is closest to the origin of the base frame; zero for a prismatic joint, whose axis is a direction.
    point: [i64; 3],
}

impl Axis {
    fn of(joint: &JointEntry) -> Self {
        let length = dot(joint.axis, joint.axis).sqrt();
        let direction = joint.axis.map(|x| x / length);
        let point_m = match (joint.kind, joint.point_mm) {
            (JointKind::Revolute, Some(point_mm)) => {
                let point_m = point_mm.map(|x| x * 1e-3);
                let along = dot(point_m, direction);
                [0, 1, 2].map(|i| point_m[i] - along * direction[i])
            }
            _ => [0.0; 3],
        };
        Self { kind: joint.kind, direction: direction.map(on_grid), point: point_m.map(on_grid) }
    }

    /// How it differs from the axis of the same joint in another model.
    fn difference(&self, other: &Self) -> Option<String> {
        if self.kind != other.kind {
            return Some(format!(
                "is {} instead of {}",
                kind_name(self.kind),
                kind_name(other.kind)
            ));
        }
        if self.direction != other.direction {
            let [a, b] = [self.direction, other.direction].map(off_grid);
            let cross = [0, 1, 2].map(|i| {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                a[j] * b[k] - a[k] * b[j]
            });
            let turned_deg = dot(cross, cross).sqrt().atan2(dot(a, b)).to_degrees();
            return Some(format!("is rotated by {turned_deg:.4} deg"));
        }
        let [a, b] = [self.point, other.point].map(off_grid);
        let apart = [0, 1, 2].map(|i| a[i] - b[i]);
        let apart_mm = dot(apart, apart).sqrt() * 1e3;
        (self.point != other.point).then(|| format!("is displaced by {apart_mm:.3} mm"))
    }
}

impl Identity {
    /// Hash of the nominal geometry: in order from the base, each joint's kind and the line of its
    /// axis (direction with its sense, and for a revolute joint the position of the line) in the
    /// base frame at the zero configuration, on a grid of 1 µm and 1e-6.
    #[must_use]
    pub fn geometry_hash(&self) -> u64 {
        let mut bytes = b"trued.geometry/1".to_vec();
        for axis in &self.axes {
            bytes.push(if axis.kind == JointKind::Revolute { b'R' } else { b'P' });
            for number in axis.direction.iter().chain(&axis.point) {
                bytes.extend(number.to_le_bytes());
            }
        }
        content_hash(&bytes)
    }

    /// The hash as it is shown.
    #[must_use]
    pub fn geometry(&self) -> String {
        format!("{:016x}", self.geometry_hash())
    }

    /// Differences from `other` that indicate another robot, one phrase for each; empty for the
    /// same robot. Names that one of them does not state are ignored.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let mut found = Vec::new();
        for ((key, this), (_, that)) in self.robot.entries().into_iter().zip(other.robot.entries())
        {
            if let (Some(this), Some(that)) = (this, that)
                && !is_same_name(this, that)
            {
                found.push(format!("{key} \"{this}\" instead of \"{that}\""));
            }
        }
        let (this, that) = (self.axes.len(), other.axes.len());
        if this != that {
            found.push(format!("{this} joints instead of {that}"));
            return found;
        }
        let axes = self.axes.iter().zip(&other.axes).zip(1..);
        let differ = |((a, b), joint): ((&Axis, &Axis), u32)| {
            a.difference(b).map(|difference| format!("the axis of joint {joint} {difference}"))
        };
        let mut geometry: Vec<String> = axes.filter_map(differ).collect();
        let more = geometry.len().saturating_sub(NAMED_MAX);
        geometry.truncate(NAMED_MAX);
        if more > 0 {
            geometry.push(format!("{more} other axes differ"));
        }
        found.extend(geometry);
        found
    }
}

/// As `ABB IRB 1600-6/1.45, geometry 0123456789abcdef`.
impl fmt::Display for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, geometry {}", self.robot, self.geometry())
    }
}

impl ModelFile {
    /// Which robot the model describes.
    #[must_use]
    pub fn identity(&self) -> Identity {
        Identity { robot: self.robot.clone(), axes: self.joints.iter().map(Axis::of).collect() }
    }
}

/// Compares names without case and spacing.
fn is_same_name(a: &str, b: &str) -> bool {
    let normalised = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    normalised(a).to_lowercase() == normalised(b).to_lowercase()
}

fn kind_name(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Revolute => "revolute",
        JointKind::Prismatic => "prismatic",
    }
}

fn on_grid(x: f64) -> i64 {
    (x / GRID + ROUNDING).floor() as i64
}

fn off_grid(numbers: [i64; 3]) -> [f64; 3] {
    numbers.map(|n| n as f64 * GRID)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::RobotModel;
    use crate::model::presets::{PRESETS, preset};

    fn model(name: &str) -> ModelFile {
        preset(name).unwrap().model().unwrap().file
    }

    #[test]
    fn the_geometry_hash_does_not_see_effects_tool_limits_masses_or_names() {
        let nominal = model("irb1600-6-145").identity();
        let thesis = model("irb1600-6-145-thesis");
        assert!(!thesis.effects.is_empty());
        assert_eq!(thesis.identity().geometry_hash(), nominal.geometry_hash());
        let mut other = thesis;
        other.tool.tcp_mm[0] += 250.0;
        other.tool.base_from_tool = None;
        other.gravity_m_s2 = [0.0, 0.0, 9.80665];
        other.joints[1].limits = [-10.0, 10.0];
        other.joints[1].max_speed = None;
        other.joints[1].link = None;
        other.joints[1].name = "shoulder".to_owned();
        assert_eq!(other.identity().geometry_hash(), nominal.geometry_hash());
        assert_eq!(other.identity().differences(&nominal), Vec::<String>::new());
    }

    #[test]
    fn any_point_on_an_axis_any_formatting_and_the_last_bits_give_the_same_hash() {
        let nominal = model("irb1600-6-145");
        let mut same = nominal.clone();
        for joint in &mut same.joints {
            let point = joint.point_mm.unwrap();
            joint.point_mm = Some([0, 1, 2].map(|i| point[i] + 123.456 * joint.axis[i]));
            joint.axis = joint.axis.map(|x| x * (1.0 + 4e-7));
        }
        assert_eq!(same.identity().geometry_hash(), nominal.identity().geometry_hash());
        let text = nominal.to_toml().replace("486.5", "4.86500e+2");
        let read = RobotModel::parse("formatted.toml", &text).unwrap();
        assert_eq!(read.file.identity(), nominal.identity());
        // At half a grid cell rounding to the nearest may go either way.
        let mut half = nominal.clone();
        half.joints[1].point_mm = Some([150.0005, 0.0, 486.5]);
        let mut noisy = nominal;
        noisy.joints[1].point_mm = Some([150.0005 - 1e-12, 0.0, 486.5]);
        assert_eq!(half.identity().geometry_hash(), noisy.identity().geometry_hash());
    }

    #[test]
    fn a_joint_that_is_turned_displaced_removed_or_of_another_kind_is_named() {
        let nominal = model("irb1600-6-145");
        let named = |change: &dyn Fn(&mut ModelFile)| {
            let mut changed = nominal.clone();
            change(&mut changed);
            let (this, that) = (changed.identity(), nominal.identity());
            assert_ne!(this.geometry_hash(), that.geometry_hash());
            this.differences(&that)
        };
        let moved = named(&|file| file.joints[2].point_mm = Some([150.0, 0.0, 1187.0]));
        assert_eq!(moved, ["the axis of joint 3 is displaced by 0.500 mm"]);
        let turned = named(&|file| file.joints[3].axis = [-1.0, 0.0, 0.0]);
        assert_eq!(turned, ["the axis of joint 4 is rotated by 180.0000 deg"]);
        let sliding = named(&|file| file.joints[0].kind = JointKind::Prismatic);
        assert_eq!(sliding, ["the axis of joint 1 is prismatic instead of revolute"]);
        assert_eq!(named(&|file| drop(file.joints.pop())), ["5 joints instead of 6"]);
    }

    #[test]
    fn names_differ_only_where_both_state_them() {
        let mut this = model("ur10e").identity();
        let mut that = this.clone();
        that.robot.serial = Some("20215501234".to_owned());
        this.robot.serial = None;
        assert_eq!(this.differences(&that), Vec::<String>::new());
        this.robot.serial = Some("20215509999".to_owned());
        let differences = this.differences(&that);
        assert_eq!(differences, ["serial \"20215509999\" instead of \"20215501234\""]);
        this.robot =
            RobotEntry { maker: Some("universal  ROBOTS".to_owned()), ..that.robot.clone() };
        assert_eq!(this.differences(&that), Vec::<String>::new());
    }

    #[test]
    fn every_preset_states_maker_and_type_and_no_two_robots_share_a_geometry() {
        let mut identities: Vec<(Identity, &str)> = Vec::new();
        for preset in PRESETS {
            let identity = model(preset.name).identity();
            assert!(identity.robot.maker.is_some() && identity.robot.kind.is_some());
            for (other, name) in &identities {
                let same = identity.geometry_hash() == other.geometry_hash();
                assert_eq!(same, identity.robot == other.robot, "{} and {name}", preset.name);
            }
            identities.push((identity, preset.name));
        }
    }

    #[test]
    fn the_names_of_a_robot_read_back_and_what_cannot_be_a_name_is_refused() {
        let mut file = model("ur10e");
        file.robot.serial = Some("20215501234".to_owned());
        let read = RobotModel::parse("written.toml", &file.to_toml()).unwrap().file;
        assert_eq!(read, file);
        let shown = read.identity().to_string();
        assert!(shown.starts_with("Universal Robots UR10e, serial 20215501234, geometry "));
        let refused = |line: &str| {
            let text = format!("{}\n[robot]\n{line}\n", nameless().to_toml());
            RobotModel::parse("refused.toml", &text).unwrap_err().to_string()
        };
        for line in ["maker = \"\"", "type = \"a\\nb\"", "serial = 5", "model = \"IRB\""] {
            let message = refused(line);
            assert!(message.contains("robot."), "{line}: {message}");
        }
        assert!(refused(&format!("type = \"{}\"", "x".repeat(65))).contains("1 to 64 bytes"));
    }

    fn nameless() -> ModelFile {
        ModelFile { robot: RobotEntry::default(), ..model("ur10e") }
    }
}
