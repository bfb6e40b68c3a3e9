//! Files: accepted input is complete and written back to the same bits.
//!
//! The content of faults is not checked, as long as they can be displayed.

use recording::cell::CellConfig;
use recording::cut::CutFile;
use recording::faults::Faults;
use recording::files::text_of;
use recording::manifest::Manifest;
use recording::mapping::Mapping;
use recording::mcap_recording;
use recording::model::RobotModel;
use recording::series::{self, FileUnits, Recording, RecordingMetadata, RequiredData};
use recording::urdf::{self, ChainEnds};
use recording::waves::{self, Grid, Options, ResponseFunction};
use std::path::Path;

pub(super) const NAME: &str = "fuzzed";

/// The text of these bytes, as for every reader of a text file.
pub(super) fn text(bytes: &[u8]) -> Option<String> {
    shown(text_of(NAME, bytes.to_vec()))
}

/// What was read; faults are shown, as a person would see them.
pub(super) fn shown<T>(read: Result<T, Faults>) -> Option<T> {
    read.map_err(|faults| {
        assert!(!faults.is_empty(), "refused without a reason");
        (faults.plain(), faults.styled())
    })
    .ok()
}

/// What was accepted, written, and read again.
#[expect(clippy::panic, reason = "a find is shown with what is wrong with it")]
fn again<T>(read: Result<T, Faults>) -> T {
    read.unwrap_or_else(|faults| panic!("what was accepted does not load again:\n{faults}"))
}

pub(super) fn model(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    if let Some(model) = shown(RobotModel::parse(NAME, &text)) {
        written_back(&model);
        let exported = urdf::export(&model);
        // Whatever a URDF can carry of it, ours reads again.
        let _ = shown(urdf::parse(NAME, &exported.text, &ChainEnds::default()));
    }
}

/// An accepted model is written to its file bit for bit.
fn written_back(model: &RobotModel) {
    let written = model.file.to_toml();
    let again = again(RobotModel::parse(NAME, &written));
    assert_eq!(again.file.to_toml(), written, "the same numbers give the same text");
    assert_eq!(again.hash, model.hash);
}

pub(super) fn cell(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let _ = shown(CellConfig::parse(NAME, &text));
}

pub(super) fn cut(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let _ = shown(CutFile::parse(NAME, &text));
}

pub(super) fn manifest(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let _ = shown(Manifest::parse(NAME, &text));
}

pub(super) fn about(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let Some(about) = shown(RecordingMetadata::parse(NAME, &text)) else { return };
    let mut made = Recording::new(vec![0.0]);
    made.metadata = about;
    let written = made.about_toml();
    let again = again(RecordingMetadata::parse(NAME, &written));
    made.metadata = again;
    assert_eq!(made.about_toml(), written, "the same words give the same text");
}

/// A mapping, and behind a form feed the table that it is for.
pub(super) fn mapping(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    let (mapping, table) = text.split_once('\u{c}').unwrap_or((&text, ""));
    let Some(mapping) = shown(Mapping::parse(NAME, mapping)) else { return };
    let read = series::read_text(NAME, table, Some(&mapping), None, RequiredData::Samples);
    if let Some(recording) = shown(read) {
        sound(&recording);
    }
}

pub(super) fn recording(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    for need in [RequiredData::Measurement, RequiredData::Path, RequiredData::Samples] {
        let Some(mut recording) = shown(series::read_text(NAME, &text, None, None, need)) else {
            continue;
        };
        sound(&recording);
        // In the file's own units values may be rounded; in SI they are not.
        recording.units = FileUnits::SI;
        let written = String::from_utf8_lossy(&recording.to_csv()).into_owned();
        let mut again = again(series::read_text(NAME, &written, None, None, need));
        again.units = FileUnits::SI;
        assert_eq!(String::from_utf8_lossy(&again.to_csv()), written, "the same bits");
    }
}

/// What every recording promises.
fn sound(recording: &Recording) {
    let rows = recording.len();
    for pair in recording.t_s.windows(2).zip(recording.segment.windows(2)) {
        let (t_s, segment) = pair;
        assert!(t_s[0].is_finite() && t_s[1].is_finite(), "times are numbers");
        assert!(segment[0] != segment[1] || t_s[0] < t_s[1], "times grow");
    }
    for channel in recording.channels() {
        let column = recording.column(channel).expect("a channel that is listed");
        assert_eq!(column.len(), rows, "{channel:?} is as long as the others");
        assert!(column.iter().all(|value| !value.is_infinite()), "{channel:?} is finite");
    }
}

pub(super) fn black_box(bytes: &[u8]) {
    match mcap_recording::read_bytes(NAME, bytes) {
        Ok(contents) => {
            let conversion = mcap_recording::convert(&contents);
            for run in conversion.runs {
                let _ = run.cycles.to_csv();
            }
            let _ = conversion.forces.map(|forces| forces.to_csv());
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// Instrument files: WAV, UFF and `LabVIEW` are recognised by content, others are tables.
pub(super) fn waves(bytes: &[u8]) {
    let path = Path::new(NAME);
    for rate_hz in [None, Some(1000.0)] {
        let options = Options { rate_hz, ..Options::default() };
        let Some(waves) = shown(waves::parse(path, bytes.to_vec(), &options)) else { continue };
        assert!(!(waves.records.is_empty() && waves.responses.is_empty()), "it holds something");
        for record in &waves.records {
            let (start, step) = match record.grid {
                Grid::Time { start_s, rate_hz } => (start_s, 1.0 / rate_hz),
                Grid::Length { start_mm, step_mm } => (start_mm, step_mm),
            };
            assert!(start.is_finite() && step.is_finite() && step > 0.0, "{:?}", record.grid);
            for wave in &record.channels {
                assert_eq!(wave.values.len(), record.len(), "{}", wave.name);
                assert!(wave.values.iter().all(|x| !x.is_infinite()), "{}", wave.name);
                let _ = wave.quantity();
            }
        }
        let _: Vec<_> = waves.responses.iter().map(ResponseFunction::quantities).collect();
    }
}

pub(super) fn urdf(bytes: &[u8]) {
    let Some(text) = text(bytes) else { return };
    if let Some(import) = shown(urdf::parse(NAME, &text, &ChainEnds::default())) {
        written_back(&import.model);
    }
}
