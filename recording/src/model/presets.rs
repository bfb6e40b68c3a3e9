//! The shipped models: published geometry, with the source of every value in `[meta]`.
//!
//! Each loads, and its forward kinematics agree with the published Denavit-Hartenberg parameters
//! (verified by tests). Estimated masses are marked in `[meta]`.

use std::path::{Path, PathBuf};

/// One preset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preset {
    /// Name on the command line.
    pub name: &'static str,
    /// The model as TOML.
    pub text: &'static str,
}

macro_rules! presets {
    ($($name:literal),+ $(,)?) => {
        /// All presets.
        pub const PRESETS: &[Preset] = &[$(Preset {
            name: $name,
            text: include_str!(concat!("../../../deploy/presets/", $name, ".toml")),
        }),+];
    };
}

presets![
    "irb120",
    "irb1600-6-145",
    "irb1600-6-145-thesis",
    "fanuc-r2000ib",
    "kuka-kr240",
    "motoman-right",
    "motoman-left",
    "ur10e",
    "fr3",
];

/// The preset with this name.
#[must_use]
pub fn preset(name: &str) -> Option<Preset> {
    PRESETS.iter().copied().find(|preset| preset.name == name)
}

/// The preset that a path names, where a model may be a file or a preset.
#[must_use]
pub fn by_path(path: &Path) -> Option<Preset> {
    path.to_str().and_then(preset)
}

/// The model that a file names: relative to the file's folder, or a preset.
#[must_use]
pub fn resolve_model_path(file: &Path, name: &Path) -> PathBuf {
    let beside = file.parent().unwrap_or(Path::new("")).join(name);
    if by_path(name).is_some() && !beside.exists() { name.to_owned() } else { beside }
}

impl Preset {
    /// The model.
    ///
    /// # Errors
    /// Does not occur: tests load every preset.
    pub fn model(&self) -> Result<super::RobotModel, crate::faults::Faults> {
        super::RobotModel::parse(self.name, self.text)
    }
}
