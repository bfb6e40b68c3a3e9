//! The columns of `trued.recording/1`: their names, units and order.
//!
//! Format: docs/reference/recording.md. Joints and targets count from 0 here and from 1 in names.

use physics::JointKind;

use crate::unit::{Quantity, Unit};

/// At most this many joints.
pub const JOINTS_MAX: usize = 16;
/// At most this many targets (reflectors).
pub const TARGETS_MAX: usize = 32;

/// At most this many distances, planes or spheres.
pub const GAUGES_MAX: usize = 32;

/// One column of samples besides time and segment. The order is the order in written files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Channel {
    /// Commanded joint position `q`, rad or m.
    Command(usize),
    /// Joint position measured on the motor side `qa`, rad or m.
    Motor(usize),
    /// Joint position measured on the link side `ql`, rad or m.
    Link(usize),
    /// Sign of the joint's last motion `d`: -1, 0, 1.
    Direction(usize),
    /// Measured TCP position, m, measuring frame; 0, 1, 2 for x, y, z.
    Position(usize),
    /// Position of a target (first number), m, measuring frame.
    Target(usize, usize),
    /// Measured orientation as a unit quaternion; 0 to 3 for w, x, y, z.
    Orientation(usize),
    /// Wrench on the tool at the TCP; 0 to 2 forces in N, 3 to 5 moments in N m.
    Wrench(usize),
    /// Torque (force) of the drive, referred to the joint, N m or N.
    Torque(usize),
    /// Motor current, A.
    Current(usize),
    /// Ambient temperature, °C.
    Ambient,
    /// Joint temperature, °C.
    JointTemperature(usize),
    /// Spindle speed, revolutions per minute.
    Spindle,
    /// Feed, m/s.
    Feed,
    /// Tachometer: one pulse per revolution, no unit.
    Tacho,
    /// Acceleration, m/s².
    Acceleration(usize),
    /// Distance of a point of the tool from a fixed point, m.
    Distance(usize),
    /// The plane that the probe touches, numbered from 1; 0 for none.
    TouchPlane,
    /// The sphere that the probe touches, numbered from 1; 0 for none.
    TouchSphere,
    /// Tilt of the base relative to gravity: rotation about base x (0) and y (1), rad.
    BaseTilt(usize),
    /// Set-up of the measuring instrument: rows with the same number share a measuring frame.
    Station,
}

/// The units of positions in a file; a recording is written in the units in which it was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileUnits {
    /// Joint angles in degrees (otherwise radians).
    pub degrees: bool,
    /// Lengths in millimetres (otherwise metres).
    pub millimetres: bool,
}

impl FileUnits {
    /// Radians and metres: written files read back to the same bits.
    pub const SI: Self = Self { degrees: false, millimetres: false };
    /// Degrees and millimetres; values without an exact decimal representation are read back within
    /// one unit in the last place.
    pub const WORKSHOP: Self = Self { degrees: true, millimetres: true };
}

/// What a column name of a file means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Column {
    Time,
    Segment,
    Channel(Channel, Option<Unit>),
    Unknown,
}

const AXES: [&str; 3] = ["x", "y", "z"];
const WRENCH: [&str; 6] = ["fx", "fy", "fz", "mx", "my", "mz"];
const QUATERNION: [&str; 4] = ["ow", "ox", "oy", "oz"];
const ACCELERATION: [&str; 3] = ["ax", "ay", "az"];

impl Channel {
    /// The joint that the column is about, from 0.
    #[must_use]
    pub fn joint(self) -> Option<usize> {
        match self {
            Self::Command(joint)
            | Self::Motor(joint)
            | Self::Link(joint)
            | Self::Direction(joint)
            | Self::Torque(joint)
            | Self::Current(joint)
            | Self::JointTemperature(joint) => Some(joint),
            _ => None,
        }
    }

    /// The name without its unit: `q1`, `target2_x`, `fx`.
    #[must_use]
    pub fn base(self) -> String {
        match self {
            Self::Command(joint) => format!("q{}", joint + 1),
            Self::Motor(joint) => format!("qa{}", joint + 1),
            Self::Link(joint) => format!("ql{}", joint + 1),
            Self::Direction(joint) => format!("d{}", joint + 1),
            Self::Torque(joint) => format!("tau{}", joint + 1),
            Self::Current(joint) => format!("i{}", joint + 1),
            Self::JointTemperature(joint) => format!("temp{}", joint + 1),
            Self::Position(axis) => AXES[axis.min(2)].to_owned(),
            Self::Target(target, axis) => format!("target{}_{}", target + 1, AXES[axis.min(2)]),
            Self::Orientation(part) => QUATERNION[part.min(3)].to_owned(),
            Self::Wrench(part) => WRENCH[part.min(5)].to_owned(),
            Self::Acceleration(axis) => ACCELERATION[axis.min(2)].to_owned(),
            Self::Ambient => "temp".to_owned(),
            Self::Spindle => "spindle".to_owned(),
            Self::Feed => "feed".to_owned(),
            Self::Tacho => "tacho".to_owned(),
            Self::Distance(at) => format!("distance{}", at + 1),
            Self::TouchPlane => "touch_plane".to_owned(),
            Self::TouchSphere => "touch_sphere".to_owned(),
            Self::BaseTilt(axis) => format!("tilt_{}", AXES[axis.min(1)]),
            Self::Station => "station".to_owned(),
        }
    }

    /// The units that its name may carry; none for columns without one.
    #[must_use]
    pub fn units(self) -> &'static [&'static str] {
        match self {
            Self::Command(_) | Self::Motor(_) | Self::Link(_) => &["deg", "rad", "mm", "m"],
            Self::Position(_) | Self::Target(..) | Self::Distance(_) => &["mm", "m"],
            Self::BaseTilt(_) => &["mrad", "rad", "deg"],
            Self::Torque(_) => &["Nm", "N"],
            Self::Wrench(0..3) => &["N"],
            Self::Wrench(_) => &["Nm"],
            Self::Current(_) => &["A"],
            Self::Ambient | Self::JointTemperature(_) => &["C"],
            Self::Spindle => &["rpm"],
            Self::Feed => &["mm_s"],
            Self::Acceleration(_) => &["m_s2"],
            Self::Direction(_)
            | Self::Orientation(_)
            | Self::Tacho
            | Self::TouchPlane
            | Self::TouchSphere
            | Self::Station => &[],
        }
    }

    /// The unit of this column in a file that is written in these units.
    #[must_use]
    pub fn unit_in(self, units: FileUnits, kind: JointKind) -> Option<Unit> {
        let length = if units.millimetres { "mm" } else { "m" };
        let name = match (self, kind) {
            (Self::Command(_) | Self::Motor(_) | Self::Link(_), JointKind::Revolute) => {
                if units.degrees { "deg" } else { "rad" }
            }
            (Self::Command(_) | Self::Motor(_) | Self::Link(_), JointKind::Prismatic) => length,
            (Self::Position(_) | Self::Target(..) | Self::Distance(_), _) => length,
            (Self::Torque(_), JointKind::Prismatic) => "N",
            (Self::BaseTilt(_), _) => "rad",
            _ => self.units().first()?,
        };
        Unit::from_name(name)
    }

    /// The quantity and the suffix of a name whose suffix is not a unit of the quantity (`q1_grad`,
    /// `x_status`).
    pub(crate) fn misnamed(name: &str) -> Option<(Self, &str)> {
        if Column::named(name) != Ok(Column::Unknown) {
            return None;
        }
        let mut underscores = name.rmatch_indices('_');
        underscores.find_map(|(underscore, _)| {
            let channel = Self::with_base(name.get(..underscore)?)?;
            let suffix = name.get(underscore + 1..).filter(|suffix| !suffix.is_empty())?;
            (!channel.units().is_empty()).then_some((channel, suffix))
        })
    }

    /// The whole name of this column in a file.
    #[must_use]
    pub fn name(self, unit: Option<Unit>) -> String {
        match unit {
            Some(unit) => format!("{}_{}", self.base(), unit.name),
            None => self.base(),
        }
    }

    fn with_base(base: &str) -> Option<Self> {
        let index_in = |list: &[&str]| list.iter().position(|name| *name == base);
        if let Some(axis) = index_in(&AXES) {
            return Some(Self::Position(axis));
        }
        if let Some(part) = index_in(&WRENCH) {
            return Some(Self::Wrench(part));
        }
        if let Some(part) = index_in(&QUATERNION) {
            return Some(Self::Orientation(part));
        }
        if let Some(axis) = index_in(&ACCELERATION) {
            return Some(Self::Acceleration(axis));
        }
        match base {
            "temp" => Some(Self::Ambient),
            "spindle" => Some(Self::Spindle),
            "feed" => Some(Self::Feed),
            "tacho" => Some(Self::Tacho),
            "touch_plane" => Some(Self::TouchPlane),
            "touch_sphere" => Some(Self::TouchSphere),
            "station" => Some(Self::Station),
            "tilt_x" => Some(Self::BaseTilt(0)),
            "tilt_y" => Some(Self::BaseTilt(1)),
            _ => Self::numbered(base),
        }
    }

    fn numbered(base: &str) -> Option<Self> {
        if let Some(rest) = base.strip_prefix("target") {
            let (number, axis) = rest.split_once('_')?;
            let axis = AXES.iter().position(|name| *name == axis)?;
            return Some(Self::Target(index(number, TARGETS_MAX)?, axis));
        }
        if let Some(number) = base.strip_prefix("distance") {
            return index(number, GAUGES_MAX).map(Self::Distance);
        }
        let digits = base.find(|c: char| c.is_ascii_digit())?;
        let (letters, number) = base.split_at(digits);
        let joint = index(number, JOINTS_MAX)?;
        match letters {
            "q" => Some(Self::Command(joint)),
            "qa" => Some(Self::Motor(joint)),
            "ql" => Some(Self::Link(joint)),
            "d" => Some(Self::Direction(joint)),
            "tau" => Some(Self::Torque(joint)),
            "i" => Some(Self::Current(joint)),
            "temp" => Some(Self::JointTemperature(joint)),
            _ => None,
        }
    }
}

/// A number counted from 1, as an index below `limit`.
fn index(number: &str, limit: usize) -> Option<usize> {
    let plain = !number.starts_with('0') && number.bytes().all(|b| b.is_ascii_digit());
    let index = number.parse::<usize>().ok()?.checked_sub(1)?;
    (plain && index < limit).then_some(index)
}

impl Column {
    /// The meaning of a column name. `Err` with the expectation if the name is known and its unit
    /// does not fit. For an unknown suffix see [`Channel::misnamed`].
    pub(crate) fn named(name: &str) -> Result<Self, String> {
        match name {
            "t_s" => return Ok(Self::Time),
            "segment" => return Ok(Self::Segment),
            _ => {}
        }
        if let Some(channel) = Channel::with_base(name) {
            return match channel.units() {
                [] => Ok(Self::Channel(channel, None)),
                units => Err(expected_names(channel, units)),
            };
        }
        let (base, unit) = Unit::split(name);
        let Some(unit) = unit else { return Ok(Self::Unknown) };
        if base == "t" {
            return Err("`t_s`: time in seconds".to_owned());
        }
        let Some(channel) = Channel::with_base(base) else { return Ok(Self::Unknown) };
        if channel.units().contains(&unit.name) {
            Ok(Self::Channel(channel, Some(unit)))
        } else {
            Err(expected_names(channel, channel.units()))
        }
    }
}

/// The names that a quantity may have: `q1_deg` or `q1_rad`.
pub(super) fn expected_names(channel: Channel, units: &[&str]) -> String {
    let base = channel.base();
    if units.is_empty() {
        return format!("`{base}`, without a unit");
    }
    let names: Vec<String> = units.iter().map(|unit| format!("`{base}_{unit}`")).collect();
    names.join(" or ")
}

/// The kind of joint implied by the unit of its column.
pub(crate) fn joint_kind_of(channel: Channel, unit: Option<Unit>) -> Option<JointKind> {
    channel.joint()?;
    match unit?.quantity {
        Quantity::Angle | Quantity::Moment => Some(JointKind::Revolute),
        Quantity::Length | Quantity::Force => Some(JointKind::Prismatic),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_that_is_written_is_read_back() {
        let all = [
            Channel::Command(0),
            Channel::Motor(15),
            Channel::Link(2),
            Channel::Direction(3),
            Channel::Position(2),
            Channel::Target(1, 0),
            Channel::Orientation(0),
            Channel::Wrench(0),
            Channel::Wrench(5),
            Channel::Torque(4),
            Channel::Current(5),
            Channel::Ambient,
            Channel::JointTemperature(0),
            Channel::Spindle,
            Channel::Feed,
            Channel::Tacho,
            Channel::Acceleration(1),
            Channel::Distance(2),
            Channel::TouchPlane,
            Channel::TouchSphere,
            Channel::BaseTilt(1),
            Channel::Station,
        ];
        for channel in all {
            for units in [FileUnits::SI, FileUnits::WORKSHOP] {
                for kind in [JointKind::Revolute, JointKind::Prismatic] {
                    let unit = channel.unit_in(units, kind);
                    let name = channel.name(unit);
                    assert_eq!(Column::named(&name), Ok(Column::Channel(channel, unit)), "{name}");
                }
            }
        }
    }

    #[test]
    fn a_quantity_is_recognised_before_any_suffix_that_is_no_unit_of_ours() {
        let found =
            |name| Channel::misnamed(name).map(|(channel, suffix)| (channel.base(), suffix));
        for (name, base, suffix) in [
            ("q1_grad", "q1", "grad"),
            ("ql12_rads", "ql12", "rads"),
            ("target2_x_inch", "target2_x", "inch"),
            ("tilt_x_arc_min", "tilt_x", "arc_min"),
            ("fx_lbf", "fx", "lbf"),
            ("x_status", "x", "status"),
        ] {
            assert_eq!(found(name), Some((base.to_owned(), suffix)), "{name}");
        }
        for other in ["q1_deg", "fx_kN", "q1", "q0_grad", "status", "d1_left", "x_", "q1grad", "_x"]
        {
            assert_eq!(found(other), None, "{other}");
        }
    }

    #[test]
    fn a_wrong_unit_is_reported_and_a_foreign_name_is_unknown() {
        assert_eq!(Column::named("fx_Nm"), Err("`fx_N`".to_owned()));
        assert_eq!(Column::named("x"), Err("`x_mm` or `x_m`".to_owned()));
        assert_eq!(Column::named("d1_deg"), Err("`d1`, without a unit".to_owned()));
        assert!(Column::named("t_ms").is_err());
        for foreign in ["c1_deg", "status", "q0_deg", "q17_deg", "dq1", "q01_rad", "target1", ""] {
            assert_eq!(Column::named(foreign), Ok(Column::Unknown), "{foreign}");
        }
    }
}
