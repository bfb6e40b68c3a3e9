//! Validation of a manifest: usable models and mappings, existing recordings.
//!
//! With an unusable model a batch would reject every recording of that robot for an error that is
//! not the recording's, so this is checked first.

use std::path::Path;

use recording::check::{Findings, pluralise};
use recording::faults::{Fault, Faults};
use recording::files::FileError;
use recording::manifest::Manifest;
use recording::mapping::Mapping;
use recording::model::RobotModel;

/// Checks a manifest and the files that it names.
///
/// ```
/// use std::path::Path;
///
/// assert!(batch::check::manifest(Path::new("missing.toml")).is_err());
/// ```
///
/// # Errors
/// The manifest cannot be read. Faults in it are among the findings.
pub fn manifest(path: &Path) -> Result<Findings, FileError> {
    let name = path.display().to_string();
    let mut findings = Findings { kind: "manifest", ..Findings::default() };
    findings.take(Manifest::read(path), |findings, manifest| {
        let base = path.parent().unwrap_or(Path::new(""));
        findings.faults.extend(unusable_robots(&manifest, base, &name));
        findings.faults.extend(missing_recordings(&manifest, base, &name));
        let recordings = pluralise(manifest.recordings.len(), "recording");
        let robots = pluralise(manifest.robots.len(), "robot");
        findings.summary = format!("{recordings} of {robots}");
    })?;
    Ok(findings)
}

/// Faults of the models and mappings of all robots; `name` is the manifest's, `base` its folder.
#[must_use]
pub fn unusable_robots(manifest: &Manifest, base: &Path, name: &str) -> Vec<Faults> {
    let mut all = Vec::new();
    let mut missing = Faults::new(name);
    for robot in &manifest.robots {
        let model = RobotModel::read(&crate::robot_model_path(base, robot)).map(drop);
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
                    let message = format!("robot \"{}\": {error}", robot.name);
                    missing.push(Fault::new(key, message).expected(expected));
                }
            }
        }
    }
    all.extend(some(missing));
    all
}

/// Recordings that do not exist.
fn missing_recordings(manifest: &Manifest, base: &Path, name: &str) -> Option<Faults> {
    let mut missing = Faults::new(name);
    for file in manifest.recordings.iter().flat_map(|recording| &recording.files) {
        if !base.join(file).is_file() {
            let message = format!("\"{file}\" does not exist or is not a regular file");
            missing.push(Fault::new("recording.files", message).expected("a recording"));
        }
    }
    some(missing)
}

fn some(faults: Faults) -> Option<Faults> {
    (!faults.is_empty()).then_some(faults)
}
