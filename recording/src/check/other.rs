//! Files that are neither TOML nor tables, checked by the reader of the command that uses them: URDF, waveforms of instruments.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::{Findings, pluralise};
use crate::faults::{Fault, Faults};
use crate::files::FileError;
use crate::urdf::{self, ChainEnds};
use crate::waves::{self, Grid, Options, Waves};

/// The format of a file is recognised from this many bytes at its start.
const HEAD_BYTES: u64 = 4096;

/// The findings in a file to which no mapping applies: a URDF, WAV, a universal file. A `LabVIEW` measurement is text, which a mapping may describe as a
/// table; so is any other file.
///
/// # Errors
/// The file cannot be read.
pub(super) fn of_own_format(path: &Path) -> Result<Option<Findings>, FileError> {
    let head = head(path)?;
    let is_robot = String::from_utf8_lossy(&head).contains("<robot");
    let waves = waves::instrument_format(path, &head);
    let is_own = is_robot || waves.is_some_and(|format| format != waves::LABVIEW);
    if is_own { file(path) } else { Ok(None) }
}

fn head(path: &Path) -> Result<Vec<u8>, FileError> {
    let mut head = Vec::new();
    // The first bytes of a pipe would be gone: it is taken for a table.
    if path.exists() && !path.is_file() && !path.is_dir() {
        return Ok(head);
    }
    File::open(path)
        .and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head))
        .map_err(FileError::io("read", path))?;
    Ok(head)
}

/// The findings in such a file; `None` for a table.
///
/// # Errors
/// The file cannot be read.
pub(super) fn file(path: &Path) -> Result<Option<Findings>, FileError> {
    let head = head(path)?;
    let mut findings = Findings::default();
    if let Some(kind) = waves::instrument_format(path, &head) {
        findings.kind = kind;
        let read = waves::read(path, &Options::default());
        findings.take(read, Findings::describe_waves)?;
        return Ok(Some(findings));
    }
    let start = String::from_utf8_lossy(&head);
    let start = start.trim_start_matches('\u{feff}').trim_start();
    if start.starts_with('<') && !start.to_ascii_lowercase().starts_with("<!doctype html") {
        findings.kind = "URDF";
        findings.take(urdf::read(path, &ChainEnds::default()), |findings, import| {
            let joints = pluralise(import.model.file.joints.len(), "joint");
            findings.summary = format!(
                "`{}`, {joints}, {} to {}",
                import.model.file.name, import.base, import.tip
            );
            findings.notes = import.notes;
            findings
                .notes
                .push("used by `trued model import`, which makes a model of it".to_owned());
        })?;
        return Ok(Some(findings));
    }
    if start.starts_with(['{', '<']) {
        let what = if start.starts_with('{') { "JSON" } else { "HTML" };
        findings.kind = "file";
        let mut faults = Faults::new(path.display().to_string());
        let fault = Fault::new("", format!("is {what}, which is not an input of trued"));
        faults.push(fault.expected(
            "a TOML, a recording (CSV, Parquet), a URDF, or waveforms (WAV, UFF 58, .lvm)",
        ));
        findings.faults.push(faults);
        return Ok(Some(findings));
    }
    Ok(None)
}

impl Findings {
    fn describe_waves(&mut self, waves: Waves) {
        let mut parts = Vec::new();
        for record in &waves.records {
            let channels: Vec<String> = record
                .channels
                .iter()
                .map(|wave| format!("{} ({})", wave.name, wave.unit))
                .collect();
            let grid = match record.grid {
                Grid::Time { rate_hz, .. } => format!("at {rate_hz} Hz"),
                Grid::Length { step_mm, .. } => format!("every {step_mm} mm"),
            };
            let samples = pluralise(record.len(), "sample");
            parts.push(format!("{samples} {grid} of {}", channels.join(", ")));
        }
        if !waves.responses.is_empty() {
            parts.push(pluralise(waves.responses.len(), "response function"));
        }
        self.summary = parts.join("; ");
        self.notes = waves.notes;
        let users = if waves.records.is_empty() {
            "`trued tap`"
        } else {
            "`trued spectrum` and `trued tap`"
        };
        self.notes.push(format!("used by {users}"));
    }
}

#[cfg(test)]
mod tests {
    use crate::check::{Findings, validate_file};
    use crate::faults::Faults;

    fn findings(name: &str, content: &[u8]) -> Findings {
        let folder =
            std::env::temp_dir().join(format!("trued-check-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join(name);
        std::fs::write(&path, content).unwrap();
        let findings = validate_file(&path, None, None).unwrap();
        std::fs::remove_dir_all(folder).unwrap();
        findings
    }

    fn wav() -> Vec<u8> {
        let samples: Vec<u8> = (0..800_i16).flat_map(|k| (k * 20).to_le_bytes()).collect();
        let mut bytes = b"RIFF".to_vec();
        bytes.extend((36 + samples.len() as u32).to_le_bytes());
        bytes.extend(b"WAVEfmt \x10\0\0\0\x01\0\x01\0");
        bytes.extend(8000_u32.to_le_bytes());
        bytes.extend(16_000_u32.to_le_bytes());
        bytes.extend(b"\x02\0\x10\0data");
        bytes.extend((samples.len() as u32).to_le_bytes());
        bytes.extend(samples);
        bytes
    }

    #[test]
    fn a_file_of_another_format_is_checked_by_the_reader_of_its_command() {
        let sound = findings("hit.wav", &wav());
        assert_eq!((sound.kind, sound.faults.len()), ("WAV", 0), "{:?}", sound.faults);
        assert!(sound.summary.starts_with("800 samples at 8000 Hz of "), "{}", sound.summary);
        assert!(
            sound.notes.iter().any(|note| note.contains("`trued spectrum`")),
            "{:?}",
            sound.notes
        );
        let urdf = "<?xml version=\"1.0\"?>\n<robot name=\"one\"><link name=\"a\"/><link name=\"b\"/>\
            <joint name=\"j\" type=\"revolute\"><parent link=\"a\"/><child link=\"b\"/><axis xyz=\"0 0 1\"/>\
            <limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint></robot>";
        let robot = findings("one.urdf", urdf.as_bytes());
        assert_eq!((robot.kind, robot.faults.len()), ("URDF", 0), "{:?}", robot.faults);
        assert!(robot.summary.contains("1 joint, a to b"), "{}", robot.summary);
        assert!(
            robot.notes.iter().any(|note| note.contains("`trued model import`")),
            "{:?}",
            robot.notes
        );
    }

    #[test]
    fn a_fault_in_such_a_file_is_told_as_one_of_its_format() {
        for (name, content, kind) in [
            ("cut.wav", &wav()[..30], "WAV"),
            ("shape.unv", b"    -1\n   151\nmodel\n    -1\n", "universal file (UFF)"),
            ("a.urdf", b"<robot name=\"a\"><link", "URDF"),
            ("a.xml", b"<sdf/>", "URDF"),
            ("diagnosis.json", b"{ \"schema\": \"trued.diagnosis/1\" }", "file"),
            ("measured.mat", b"MATLAB 5.0 MAT-file", "waveforms"),
        ] {
            let found = findings(name, content);
            assert_eq!(found.kind, kind, "{name}");
            let messages = found.faults.iter().map(Faults::plain).collect::<String>();
            assert!(!messages.is_empty() && !messages.contains("t_s"), "{name}: {messages}");
        }
    }
}
