//! The manifest of a batch, `trued.manifest/1`: recordings of many robots to be diagnosed, with models and settings.
//!
//! Format: docs/reference/batch.md. In a valid [`Manifest`] every recording has a robot, and no
//! file appears twice for one robot; all errors of a file are reported. All settings that affect a
//! result are here, so that the shards of a batch use the same ones. The recordings are separate
//! files.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::faults::{Fault, Faults, nearest};
use crate::files::{FileError, read_text};
use crate::series::instant_us;
use crate::toml_reader::{Document, POSITIVE, Table};

/// Name of the format.
pub const SCHEMA: &str = "trued.manifest/1";

/// Recordings of a fleet.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    /// Seed of the random number generators, the same for each recording.
    pub seed: u64,
    /// Torque and motion are compared below this frequency, Hz; none: as a single diagnosis chooses it.
    pub band_hz: Option<f64>,
    /// The robots, in the order of the file.
    pub robots: Vec<Robot>,
    /// The recordings, in the order of the file.
    pub recordings: Vec<RecordingEntry>,
}

/// One `[[robot]]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Robot {
    /// Its name in the plant.
    pub name: String,
    /// The manufacturer's serial number, if known.
    pub serial: Option<String>,
    /// Its model: a file, or the name of a preset; a relative path counts from the manifest's folder.
    pub model: PathBuf,
    /// Mapping for tables of other programs; relative paths as for the model.
    pub mapping: Option<PathBuf>,
}

/// One `[[recording]]`: files that are diagnosed together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingEntry {
    /// Its robot, as an index into [`Manifest::robots`].
    pub robot: usize,
    /// The files as the manifest names them; a relative path counts from its folder.
    pub files: Vec<String>,
    /// When it was recorded, µs since 1970 in UTC, where that is stated.
    pub recorded_at_us: Option<i64>,
}

impl Manifest {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or all its faults.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let name = path.display().to_string();
        let manifest = Self::parse(&name, &read_text(path)?)?;
        let faults = manifest.same_files(path.parent().unwrap_or(Path::new("")), &name);
        if faults.is_empty() { Ok(manifest) } else { Err(faults.into()) }
    }

    /// Files of one robot that are one file under two names (`a.csv`, `./a.csv`, a link): diagnosed twice, they would count twice.
    fn same_files(&self, base: &Path, name: &str) -> Faults {
        let mut faults = Faults::new(name);
        let mut known: BTreeMap<(usize, PathBuf), &str> = BTreeMap::new();
        for recording in &self.recordings {
            for file in &recording.files {
                // A file that does not exist is reported elsewhere.
                let Ok(place) = base.join(file).canonicalize() else { continue };
                if let Some(other) = known.insert((recording.robot, place), file) {
                    let message = format!("\"{file}\" is the same file as \"{other}\"");
                    let fault = Fault::new("recording.files", message);
                    faults.push(fault.expected("each file once per robot"));
                }
            }
        }
        faults
    }

    /// Reads a text.
    ///
    /// # Errors
    /// All faults of the text.
    pub fn parse(name: &str, text: &str) -> Result<Self, Faults> {
        let document = Document::parse(name, text)?;
        let manifest = manifest(&document.root());
        document.finish(manifest)
    }
}

fn manifest(root: &Table<'_, '_>) -> Option<Manifest> {
    root.require("schema", "schema = \"trued.manifest/1\"");
    root.require("robot", "tables headed [[robot]], one for each robot");
    root.require("recording", "tables headed [[recording]], one for each diagnosis");
    root.choice("schema", &[(SCHEMA, ())]);
    let seed = root.whole("seed", 0..i64::MAX);
    let band_hz = root.number("band_Hz", POSITIVE);
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    let mut robots: Vec<Option<Robot>> = Vec::new();
    for (place, table) in root.tables("robot").iter().enumerate() {
        if let Some(name) = filled(table, "name")
            && places.insert(name, place).is_some()
        {
            table.fault(
                "name",
                format!("is \"{name}\", which is used already"),
                "a unique name for each robot",
            );
        }
        robots.push(robot(table));
    }
    let mut known_files = BTreeSet::new();
    let entries: Vec<Option<RecordingEntry>> = root
        .tables("recording")
        .iter()
        .map(|table| entry(table, &places, &mut known_files))
        .collect();
    root.close();
    Some(Manifest {
        seed: seed.map_or(Some(0), |seed| u64::try_from(seed).ok())?,
        band_hz,
        robots: robots.into_iter().collect::<Option<_>>()?,
        recordings: entries.into_iter().collect::<Option<_>>()?,
    })
}

/// A text that is not empty.
fn filled<'d>(table: &Table<'d, '_>, key: &str) -> Option<&'d str> {
    let text = table.text(key)?;
    if text.is_empty() {
        table.fault(key, "is empty", "at least one character");
        return None;
    }
    Some(text)
}

fn robot(table: &Table<'_, '_>) -> Option<Robot> {
    table.require("name", "the robot's name in the plant");
    table.require("model", "a model file, or a preset of `trued model presets`");
    let name = table.text("name").filter(|name| !name.is_empty()).map(str::to_owned);
    let model = filled(table, "model").map(PathBuf::from);
    let serial = filled(table, "serial").map(str::to_owned);
    let mapping = filled(table, "mapping").map(PathBuf::from);
    table.close();
    Some(Robot { name: name?, serial, model: model?, mapping })
}

fn entry(
    table: &Table<'_, '_>,
    robots: &BTreeMap<&str, usize>,
    known_files: &mut BTreeSet<(usize, String)>,
) -> Option<RecordingEntry> {
    table.require("robot", "the name of a [[robot]]");
    table.require("files", "a list of files, such as [\"2026-03-01.csv\"]");
    let robot = filled(table, "robot").and_then(|name| {
        let place = robots.get(name).copied();
        if place.is_none() {
            let nearest_name = nearest(name, robots.keys().copied());
            let meant = nearest_name
                .map(|nearest_name| format!(" (did you mean \"{nearest_name}\"?)"))
                .unwrap_or_default();
            table.fault(
                "robot",
                format!("is \"{name}\""),
                format!("the name of a [[robot]]{meant}"),
            );
        }
        place
    });
    let files: Option<Vec<String>> =
        table.texts("files").map(|all| all.into_iter().map(str::to_owned).collect());
    if files.as_ref().is_some_and(|files| files.is_empty() || files.iter().any(String::is_empty)) {
        table.fault("files", "is empty or contains an empty name", "one or more file names");
    }
    for file in files.iter().flatten() {
        if let Some(robot) = robot
            && !known_files.insert((robot, file.clone()))
        {
            table.fault("files", format!("contains \"{file}\" twice"), "each file once per robot");
        }
    }
    let recorded_at_us = table.text("recorded_at").and_then(|text| {
        let time = instant_us(text);
        if time.is_none() {
            let expected = "a time with time zone, such as \"2026-03-01T06:30:00Z\"";
            table.fault("recorded_at", format!("is \"{text}\""), expected);
        }
        time
    });
    table.close();
    Some(RecordingEntry { robot: robot?, files: files?, recorded_at_us })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: &str = r#"
schema = "trued.manifest/1"
seed = 7
[[robot]]
name = "R07"
model = "irb1600-6-145"
[[robot]]
name = "R08"
serial = "145-0815"
model = "r08.toml"
mapping = "plant.mapping.toml"
[[recording]]
robot = "R08"
files = ["a.csv", "b.csv"]
recorded_at = "1970-01-02T01:00:00.5+01:00"
[[recording]]
robot = "R07"
files = ["a.csv"]
"#;

    #[test]
    fn a_manifest_gives_each_recording_its_robot_and_time() {
        let manifest = Manifest::parse("m.toml", SHORT).unwrap();
        assert_eq!((manifest.seed, manifest.band_hz), (7, None));
        let [first, second] = manifest.recordings.as_slice() else { panic!("{manifest:?}") };
        assert_eq!(manifest.robots[first.robot].serial.as_deref(), Some("145-0815"));
        assert_eq!(first.recorded_at_us, Some(86_400_500_000));
        assert_eq!((second.robot, second.recorded_at_us), (0, None));
    }

    #[test]
    fn every_fault_is_reported_at_once_with_the_nearest_name() {
        let text = SHORT
            .replace("robot = \"R08\"", "robot = \"R8\"")
            .replace(
                "robot = \"R07\"\nfiles = [\"a.csv\"]",
                "robot = \"R07\"\nfiles = [\"a.csv\", \"a.csv\"]",
            )
            .replace(".5+01:00", "")
            .replace("serial", "seriall")
            .replace("seed = 7", "band_Hz = 0");
        let faults = Manifest::parse("m.toml", &text).unwrap_err();
        for message in [
            "did you mean \"R08\"",
            "contains \"a.csv\" twice",
            "a time with time zone",
            "did you mean `serial`?",
            "`band_Hz`: is 0",
        ] {
            faults.assert_say(message);
        }
    }

    #[test]
    fn a_time_without_quotes_is_refused_with_the_remedy() {
        let quoted = "\"1970-01-02T01:00:00.5+01:00\"";
        let unquoted = SHORT.replace(quoted, quoted.trim_matches('"'));
        Manifest::parse("m.toml", &unquoted).unwrap_err().assert_say("a string, in quotes");
    }

    #[test]
    fn two_robots_of_one_name_and_a_list_without_recordings_are_refused() {
        let twice = SHORT.replace("name = \"R08\"", "name = \"R07\"");
        Manifest::parse("m.toml", &twice)
            .unwrap_err()
            .assert_say("is \"R07\", which is used already");
        let none = SHORT.split("[[recording]]").next().unwrap();
        Manifest::parse("m.toml", none).unwrap_err().assert_say("`recording`: is missing");
    }

    #[test]
    fn one_file_under_two_names_is_found_and_that_of_another_robot_is_not() {
        let dir = std::env::temp_dir().join(format!("trued-manifest-{}", std::process::id()));
        std::fs::create_dir_all(dir.join("sub")).unwrap();
        std::fs::write(dir.join("a.csv"), "t_s\n").unwrap();
        let write = |other: &str| {
            let recording =
                |file: &str| format!("[[recording]]\nrobot = \"R07\"\nfiles = [\"{file}\"]\n");
            let head = SHORT.split("[[recording]]").next().unwrap();
            let text = format!("{head}{}{}", recording("a.csv"), recording(other));
            std::fs::write(dir.join("m.toml"), text).unwrap();
            Manifest::read(&dir.join("m.toml"))
        };
        for other in ["./a.csv", "sub/../a.csv", ".//a.csv"] {
            let why = write(other).unwrap_err().to_string();
            assert!(why.contains(&format!("\"{other}\" is the same file as \"a.csv\"")), "{why}");
        }
        std::fs::write(dir.join("b.csv"), "t_s\n").unwrap();
        assert!(write("b.csv").is_ok());
        std::fs::remove_dir_all(&dir).unwrap();
    }
}
