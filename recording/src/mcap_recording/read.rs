//! Reads an MCAP recording, complete or truncated.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::Path;

use mcap::records::Record as McapRecord;

use super::clock::Clocks;
use super::records::{CycleRecord, Record};
use super::scan::{Damage, ScanResult, scan};
use super::{Header, McapRecordingError};
use physics::JointKind;

/// Name of the metadata record with the header.
pub(super) const METADATA: &str = "trued";
/// Name of the metadata records with models that replaced that of the header.
pub(super) const MODEL_CHANGE: &str = "trued.model_change";
/// Name of the metadata records with the relation of wall-clock and monotonic time.
pub(super) const CLOCKS: &str = "trued.clocks";
/// Name of the metadata record of a repaired file.
pub(super) const REPAIRED: &str = "trued.repaired";

/// A change of the active model.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModelChange {
    /// Time from which the cycle used it, `CLOCK_MONOTONIC`, ns.
    pub t_ns: u64,
    /// The header with that model.
    pub header: Header,
}

/// Contents of a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Contents {
    /// The run as a whole.
    pub header: Header,
    /// The models that were loaded while the file was written, oldest first.
    pub model_changes: Vec<ModelChange>,
    /// Readings of both clocks, which relate monotonic times to wall-clock times: at the beginning,
    /// and whenever the wall clock was set.
    pub clocks: Vec<Clocks>,
    /// The records in the order in which they were written.
    pub records: Vec<Record>,
    /// Why the file is truncated, if it is; the records before are complete.
    pub cut: Option<String>,
    /// Parts before the end that cannot be read.
    pub damage: Vec<Damage>,
    /// Number of messages of other topics, or of a form unknown to this version.
    pub unknown: usize,
}

impl Contents {
    /// The header with the model of this cycle; `None` if the file does not contain it.
    #[must_use]
    pub fn model_of(&self, cycle: &CycleRecord) -> Option<&Header> {
        let changed = self.model_changes.iter().rev();
        if cycle.model_epoch != 0 {
            let mut known = changed.map(|change| &change.header).chain([&self.header]);
            return known.find(|header| header.model_epoch == cycle.model_epoch);
        }
        // Files of versions without it: the last change before the cycle.
        let mut before = changed.filter(|change| change.t_ns <= cycle.received_ns);
        Some(before.next().map_or(&self.header, |change| &change.header))
    }
}

/// Reads a recording. Besides the result only the current record is in memory.
///
/// # Errors
/// The file cannot be read, or is not an MCAP recording. A truncated or damaged one is read as far as
/// possible.
pub fn read(path: &Path) -> Result<Contents, McapRecordingError> {
    let refused = |source| McapRecordingError::Io { action: "read", path: path.to_owned(), source };
    let file = File::open(path).map_err(refused)?;
    let metadata = file.metadata().map_err(refused)?;
    let name = path.display().to_string();
    if !metadata.is_file() {
        // The length of a pipe is unknown.
        let mut bytes = Vec::new();
        (&file).read_to_end(&mut bytes).map_err(refused)?;
        return read_bytes(&name, &bytes);
    }
    let bytes = usize::try_from(metadata.len()).unwrap_or(usize::MAX);
    read_from(&name, BufReader::new(file), bytes)
}

/// Reads a recording from memory.
///
/// # Errors
/// The bytes are not an MCAP recording of the daemon.
pub fn read_bytes(name: &str, bytes: &[u8]) -> Result<Contents, McapRecordingError> {
    read_from(name, Cursor::new(bytes), bytes.len())
}

/// Reads a recording from a source of `bytes` bytes.
fn read_from(
    name: &str,
    source: impl Read + Seek,
    bytes: usize,
) -> Result<Contents, McapRecordingError> {
    let mut gathered = ContentsBuilder::default();
    let scanned = scan(name, source, bytes, &mut |record| {
        gathered.take(record);
        Ok(())
    })?;
    let ScanResult { cut, has_footer, damage, .. } = scanned;
    gathered.contents.damage = damage;
    let ends = "no footer: the file was not closed".to_owned();
    gathered.contents.cut = cut.or_else(|| (!has_footer).then_some(ends));
    if gathered.has_header {
        return Ok(gathered.contents);
    }
    Err(McapRecordingError::NotOurs {
        name: name.to_owned(),
        what: "its metadata record `trued` is missing".to_owned(),
    })
}

#[derive(Default)]
struct ContentsBuilder {
    contents: Contents,
    has_header: bool,
    topics: BTreeMap<u16, String>,
}

impl ContentsBuilder {
    fn take(&mut self, record: McapRecord<'_>) {
        match record {
            McapRecord::Metadata(metadata) if metadata.name == METADATA => {
                self.has_header = true;
                self.contents.header = header(&metadata.metadata);
            }
            McapRecord::Metadata(metadata) if metadata.name == MODEL_CHANGE => {
                self.contents.model_changes.push(model_change(&metadata.metadata));
            }
            McapRecord::Metadata(metadata) if metadata.name == CLOCKS => {
                self.contents.clocks.push(clocks(&metadata.metadata));
            }
            McapRecord::Channel(channel) => {
                self.topics.insert(channel.id, channel.topic);
            }
            McapRecord::Message { header, data } => {
                let topic = self.topics.get(&header.channel_id);
                match topic.and_then(|topic| Record::decode(topic, &data)) {
                    Some(record) => self.contents.records.push(record),
                    None => self.contents.unknown += 1,
                }
            }
            _ => {}
        }
    }
}

/// A change of the model from its metadata.
pub(super) fn model_change(pairs: &BTreeMap<String, String>) -> ModelChange {
    ModelChange { t_ns: number(pairs, "t_ns"), header: header(pairs) }
}

/// A reading of both clocks from its metadata.
pub(super) fn clocks(pairs: &BTreeMap<String, String>) -> Clocks {
    Clocks { monotonic_ns: number(pairs, "monotonic_ns"), wall_ns: number(pairs, "wall_ns") }
}

/// An integer; 0 if it is not stated.
fn number(pairs: &BTreeMap<String, String>, key: &str) -> u64 {
    pairs.get(key).and_then(|text| text.parse().ok()).unwrap_or(0)
}

/// The header from its metadata.
pub(super) fn header(pairs: &BTreeMap<String, String>) -> Header {
    let text = |key: &str| pairs.get(key).cloned().unwrap_or_default();
    let joint =
        |letter: char| if letter == 'P' { JointKind::Prismatic } else { JointKind::Revolute };
    let lines = |key: &str| match pairs.get(key).map(String::as_str) {
        None | Some("") => Vec::new(),
        Some(lines) => lines.split('\n').map(str::to_owned).collect(),
    };
    let hash = |key: &str| u64::from_str_radix(&text(key), 16).unwrap_or(0);
    Header {
        cell: text("cell"),
        version: text("version"),
        model_hash: hash("model_hash"),
        robot: text("robot"),
        robot_maker: text("robot_maker"),
        robot_type: text("robot_type"),
        robot_serial: text("robot_serial"),
        model_epoch: number(pairs, "model_epoch"),
        geometry_hash: hash("geometry_hash"),
        model: text("model"),
        config: text("config"),
        joints: text("joints").chars().map(joint).collect(),
        status_words: lines("status_words"),
        reason_words: lines("reason_words"),
    }
}
