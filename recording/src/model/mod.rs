//! The model of a robot, `trued.model/1`: the document in the units of its file, and its physical meaning.
//!
//! Format: docs/reference/model.md. A valid [`RobotModel`] is complete and usable; otherwise all
//! errors are reported. The document keeps every number as in the file, so that it is written back
//! bit for bit; comments are not kept. [`physics`] uses SI.

mod build;
#[cfg(test)]
mod drive_tests;
mod effects;
mod gears;
mod identity;
mod kinds;
mod modes;
#[cfg(test)]
mod preset_tests;
pub mod presets;
pub(crate) mod read;
#[cfg(test)]
mod tests;
mod write;

use std::io::ErrorKind;
use std::path::Path;

pub use build::SiParameter;
pub use identity::{Identity, ROBOT_NAME_BYTES_MAX, RobotEntry};
#[cfg(feature = "schema")]
pub(crate) use kinds::Kind as EffectKind;
pub use modes::ModeChange;
use physics::JointKind;

use crate::faults::{Fault, Faults};
use crate::files::{FileError, content_hash, read_text, write_atomic};

/// Name of the format.
pub(crate) const SCHEMA: &str = "trued.model/1";

/// A model as in its file, in the units of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelFile {
    /// Name of the model.
    pub name: String,
    /// `[robot]`: the manufacturer's data of the robot.
    pub robot: RobotEntry,
    /// `[meta]`: free information for people.
    pub meta: toml::Table,
    /// Gravity, m/s², base frame.
    pub gravity_m_s2: [f64; 3],
    /// Joints, base to flange.
    pub joints: Vec<JointEntry>,
    /// The tool.
    pub tool: ToolEntry,
    /// Known natural frequencies.
    pub modes: Vec<ModeEntry>,
    /// The effects, in the order of the file.
    pub effects: Vec<EffectEntry>,
}

/// One `[[joint]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct JointEntry {
    /// Name; may be empty.
    pub name: String,
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Unit vector of the axis, base frame, zero configuration.
    pub axis: [f64; 3],
    /// A point on the axis, mm; a prismatic joint may have none.
    pub point_mm: Option<[f64; 3]>,
    /// Least and largest position, degrees (mm for a prismatic joint).
    pub limits: [f64; 2],
    /// Largest speed, degrees/s (mm/s), if known.
    pub max_speed: Option<f64>,
    /// Teeth of each gear stage, driver and driven, motor side first.
    pub gear_teeth: Vec<[u32; 2]>,
    /// The body that this joint moves.
    pub link: Option<BodyEntry>,
}

/// A body, zero configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyEntry {
    /// Mass, kg; zero counts as unknown.
    pub mass_kg: f64,
    /// Centre of mass, mm, base frame.
    pub com_mm: [f64; 3],
    /// `Ixx, Iyy, Izz, Ixy, Ixz, Iyz` about the centre of mass, base axes; none: a point mass.
    pub inertia_kgm2: Option<[f64; 6]>,
}

/// `[tool]`.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolEntry {
    /// Tool centre point, mm, base frame, zero configuration.
    pub tcp_mm: [f64; 3],
    /// Rows of the rotation from tool to base axes, where not the identity.
    pub base_from_tool: Option<[[f64; 3]; 3]>,
    /// The tool's own body.
    pub body: Option<BodyEntry>,
}

/// One `[[mode]]`: a natural frequency, for the vibration monitor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModeEntry {
    /// Hz, above zero.
    pub frequency_hz: f64,
    /// Share of critical damping.
    pub damping_ratio: Option<f64>,
    /// Direction, base frame.
    pub direction: Option<[f64; 3]>,
}

/// One `[[effect]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectEntry {
    /// A name of docs/reference/effects.md.
    pub kind: String,
    /// Joint, from 1; none for effects of the whole robot.
    pub joint: Option<usize>,
    /// Channel that a delay applies to.
    pub channel: Option<String>,
    /// Keys as in the file, with their numbers in the unit of the key.
    pub parameters: Vec<Parameter>,
}

impl EffectEntry {
    /// Its name for people, as `servo_lag of joint 2`.
    #[must_use]
    pub fn title(&self) -> String {
        match self.joint {
            Some(joint) => format!("{} of joint {joint}", self.kind),
            None => self.kind.clone(),
        }
    }
}

/// One parameter of an effect, in the unit of its key.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Key in the file, unit suffix included.
    pub key: String,
    /// One number, or a list.
    pub value: Numbers,
    /// Standard uncertainty, of the same shape, if stated.
    pub sigma: Option<Numbers>,
}

/// A number or a list of numbers.
#[derive(Debug, Clone, PartialEq)]
pub enum Numbers {
    /// One number.
    One(f64),
    /// A list.
    List(Vec<f64>),
}

impl Numbers {
    /// The numbers, one or many.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        match self {
            Self::One(number) => std::slice::from_ref(number),
            Self::List(list) => list,
        }
    }

    /// The same shape with each number changed.
    #[must_use]
    pub fn map(&self, change: impl Fn(f64) -> f64) -> Self {
        match self {
            Self::One(number) => Self::One(change(*number)),
            Self::List(list) => Self::List(list.iter().map(|number| change(*number)).collect()),
        }
    }
}

/// A usable model: its document, its physics, and the effects that are not compensated.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotModel {
    /// The document.
    pub file: ModelFile,
    /// The model in SI, with the effects that are compensated.
    pub physics: physics::Model,
    /// For each effect of `physics`: its index in `file.effects`.
    pub entry_of: Vec<usize>,
    /// For each effect of `physics`: the standard uncertainty of each of its values, SI; 0 where
    /// none is stated.
    pub sigma: Vec<Vec<f64>>,
    /// Indices in `file.effects` of the effects that are loaded and not compensated: delays, lags,
    /// modes, torque, force, and those that this version does not model.
    pub not_compensated: Vec<usize>,
    /// The effects on drive torques among these: not in `physics`, because they do not move the
    /// tool.
    pub drives: Vec<physics::AnyEffect>,
    /// For each of `drives`: as `sigma`.
    pub drives_sigma: Vec<Vec<f64>>,
    /// The effects on the cutting force, or on its measurement, among these.
    pub cutting: Vec<physics::AnyEffect>,
    /// For each of `cutting`: as `sigma`.
    pub cutting_sigma: Vec<Vec<f64>>,
    /// Hash of the document as it is written: the same for the same numbers, independent of
    /// comments.
    pub hash: u64,
}

impl RobotModel {
    /// Reads a model file; where there is no such file, the preset of that name.
    ///
    /// # Errors
    /// The file cannot be read, or all its faults.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let missing = |error: &FileError| matches!(error, FileError::Io { source, .. } if source.kind() == ErrorKind::NotFound);
        let text = match (read_text(path), presets::by_path(path)) {
            (Err(error), Some(preset)) if missing(&error) => preset.text.to_owned(),
            (text, _) => text?,
        };
        Ok(Self::parse(&path.display().to_string(), &text)?)
    }

    /// Reads a model from a text; `name` identifies it in error messages.
    ///
    /// # Errors
    /// All faults of the text.
    pub fn parse(name: &str, text: &str) -> Result<Self, Faults> {
        let read::Parsed { file, effect_places } = read::parse(name, text)?;
        build::build(file).map_err(|found| {
            let mut faults = Faults::new(name);
            for (entry, fault) in found {
                let location = entry.and_then(|entry| effect_places.get(entry).cloned());
                faults.push(Fault { location, ..fault });
            }
            faults
        })
    }

    /// Builds the model of a document.
    ///
    /// # Errors
    /// Why a document made in code is not usable; one that was read is usable.
    pub fn of_file(name: &str, file: ModelFile) -> Result<Self, Faults> {
        build::build(file).map_err(|found| {
            let mut faults = Faults::new(name);
            found.into_iter().for_each(|(_, fault)| faults.push(fault));
            faults
        })
    }

    /// The model with effects on drive torques: for [`physics::Model::drive`], not for a
    /// correction.
    ///
    /// # Errors
    /// Too many effects.
    pub fn with_drives(&self) -> Result<physics::Model, physics::ModelError> {
        self.with(&self.drives)
    }

    /// The model with effects on cutting forces: for [`physics::Model::cut_force`], not for a
    /// correction.
    ///
    /// # Errors
    /// Too many effects.
    pub fn with_cutting(&self) -> Result<physics::Model, physics::ModelError> {
        self.with(&self.cutting)
    }

    fn with(&self, more: &[physics::AnyEffect]) -> Result<physics::Model, physics::ModelError> {
        let mut model = self.physics;
        more.iter().try_for_each(|effect| model.push(*effect))?;
        Ok(model)
    }

    /// Names of the effects that are not compensated, as `servo_lag of joint 2`.
    #[must_use]
    pub fn not_compensated_names(&self) -> Vec<String> {
        let entries = self.not_compensated.iter().filter_map(|index| self.file.effects.get(*index));
        entries.map(EffectEntry::title).collect()
    }
}

impl ModelFile {
    /// Writes the model atomically.
    ///
    /// # Errors
    /// The file cannot be written; then it is unchanged.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        write_atomic(path, self.to_toml().as_bytes())
    }

    /// Hash of the document as it is written.
    #[must_use]
    pub fn hash(&self) -> u64 {
        content_hash(self.to_toml().as_bytes())
    }
}
