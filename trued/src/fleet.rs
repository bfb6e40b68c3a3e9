//! Checks of a manifest: usable models and mappings, existing recordings.
//!
//! With an unusable model a batch would reject every recording of that robot for an error that is
//! not the recording's, so this is checked first.

use std::fmt;
use std::path::Path;

use recording::faults::{Fault, Faults};
use recording::files::FileError;
use recording::manifest::Manifest;
use recording::mapping::Mapping;
use recording::model::RobotModel;

use crate::input::Faulty;

/// Faults of a manifest and of the files that it names, a list per file.
#[derive(Debug)]
pub(crate) struct Unusable(pub(crate) Vec<Faults>);

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let texts = self.0.iter().map(|faults| Faulty(faults.clone()).to_string());
        f.write_str(&texts.collect::<Vec<_>>().join("\n"))
    }
}

impl std::error::Error for Unusable {}

/// Faults of the models and mappings of all robots; `name` is the manifest's, `base` its folder.
pub(crate) fn unusable_robots(manifest: &Manifest, base: &Path, name: &str) -> Vec<Faults> {
    let mut all = Vec::new();
    let mut missing = Faults::of(name);
    for robot in &manifest.robots {
        let model = RobotModel::read(&batch::model_of(base, robot)).map(drop);
        let mapping = robot.mapping.as_ref().map(|mapping| Mapping::read(&base.join(mapping)));
        let mapping = mapping.map_or(Ok(()), |read| read.map(drop));
        for (key, expected, read) in [
            ("robot.model", "a model file, or a preset of `trued model presets`", model),
            ("robot.mapping", "a mapping file", mapping),
        ] {
            match read {
                Ok(()) => {}
                Err(FileError::Content(faults)) => all.push(faults),
                Err(error) => {
                    let message = format!("of \"{}\": {error}", robot.name);
                    missing.push(Fault::new(key, message).expected(expected));
                }
            }
        }
    }
    all.extend(some(missing));
    all
}

/// Recordings that do not exist.
pub(crate) fn missing_recordings(manifest: &Manifest, base: &Path, name: &str) -> Option<Faults> {
    let mut missing = Faults::of(name);
    for file in manifest.recordings.iter().flat_map(|recording| &recording.files) {
        if !base.join(file).is_file() {
            let message = format!("\"{file}\" is not there, or is no regular file");
            missing.push(Fault::new("recording.files", message).expected("a recording"));
        }
    }
    some(missing)
}

fn some(faults: Faults) -> Option<Faults> {
    (!faults.is_empty()).then_some(faults)
}
