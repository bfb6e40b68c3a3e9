//! Summary of an MCAP recording, without loading it into memory.

use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use mcap::records::{Record as McapRecord, op};

use super::clock::Clocks;
use super::read::{
    CLOCKS, METADATA, MODEL_CHANGE, ModelChange, REPAIRED, clocks, header, model_change,
};
use super::records::Record;
use super::scan::{Damage, scan};
use super::{Header, McapRecordingError};

/// State of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FileState {
    /// Closed, with an index that seeking readers use.
    Closed,
    /// A process is writing it.
    BeingWritten,
    /// Not closed, with the reason; the records before the truncation are complete.
    Cut(String),
    /// Closed, but its index does not point at the chunks: seeking readers fail.
    WrongIndex,
}

/// A channel of the file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ChannelInfo {
    /// Its topic.
    pub topic: String,
    /// Number of its messages.
    pub messages: u64,
    /// Log time of the earliest, ns since 1970.
    pub first_ns: u64,
    /// Log time of the latest, ns since 1970.
    pub last_ns: u64,
}

/// A model of the file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModelInfo {
    /// Time of its activation in the cycle, `CLOCK_MONOTONIC`, ns; 0 for the first one of the file.
    pub since_ns: u64,
    /// The header with that model.
    pub header: Header,
    /// Number of its cycles.
    pub cycles: u64,
}

/// Summary of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Info {
    /// The run as a whole.
    pub header: Header,
    /// Its models, in order of activation.
    pub models: Vec<ModelInfo>,
    /// Cycles of models that the file does not contain.
    pub cycles_of_unknown_models: u64,
    /// Readings of both clocks, which relate monotonic times to wall-clock times.
    pub clocks: Vec<Clocks>,
    /// Its channels, by topic.
    pub channels: Vec<ChannelInfo>,
    /// Its length.
    pub bytes: u64,
    /// State of the file.
    pub end: FileState,
    /// Parts before the end that cannot be read.
    pub damage: Vec<Damage>,
    /// Why it was repaired, if it was.
    pub repaired: Option<String>,
}

/// Reads the summary of a recording.
///
/// # Errors
/// The file cannot be read, or is not an MCAP recording.
pub fn info(path: &Path) -> Result<Info, McapRecordingError> {
    let refused = |source| McapRecordingError::Io { action: "read", path: path.to_owned(), source };
    let file = File::open(path).map_err(refused)?;
    let is_being_written = matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock));
    let info = info_of(path, &file)?;
    Ok(if is_being_written { Info { end: FileState::BeingWritten, ..info } } else { info })
}

/// The same for an open file, even one that is being written.
pub(super) fn info_of(path: &Path, mut file: &File) -> Result<Info, McapRecordingError> {
    let refused = |source| McapRecordingError::Io { action: "read", path: path.to_owned(), source };
    let bytes = file.metadata().map_err(refused)?.len();
    file.rewind().map_err(refused)?;
    let mut tally = Tally::default();
    let name = path.display().to_string();
    let limit = usize::try_from(bytes).unwrap_or(usize::MAX);
    let scanned = scan(&name, BufReader::new(file), limit, &mut |record| {
        tally.take(record);
        Ok(())
    })?;
    if !tally.has_header {
        return Err(McapRecordingError::NotOurs {
            name,
            what: "its metadata record `trued` is missing".to_owned(),
        });
    }
    let end = match scanned.cut {
        Some(cut) => FileState::Cut(cut),
        None if !scanned.has_footer || !is_closed(file).map_err(refused)? => {
            FileState::Cut("no footer: the file was not closed".to_owned())
        }
        None if !tally.index_is_right(file).map_err(refused)? => FileState::WrongIndex,
        None => FileState::Closed,
    };
    let info = tally.into_info(bytes, end);
    Ok(Info { damage: scanned.damage, ..info })
}

/// Whether the file ends with the magic bytes of a closed file.
pub(super) fn is_closed(mut file: &File) -> std::io::Result<bool> {
    let length = mcap::MAGIC.len();
    // A file that consists of the opening magic bytes alone is not closed.
    if file.metadata()?.len() <= length as u64 {
        return Ok(false);
    }
    file.seek(SeekFrom::End(-(length as i64)))?;
    let mut tail = vec![0; length];
    file.read_exact(&mut tail)?;
    Ok(tail == mcap::MAGIC)
}

#[derive(Default)]
struct Tally {
    has_header: bool,
    header: Header,
    changes: Vec<ModelChange>,
    clocks: Vec<Clocks>,
    channels: BTreeMap<u16, ChannelInfo>,
    cycles: BTreeMap<u64, u64>,
    chunks_at: Vec<u64>,
    repaired: Option<String>,
}

impl Tally {
    fn take(&mut self, record: McapRecord<'_>) {
        match record {
            McapRecord::Metadata(metadata) => {
                let pairs = &metadata.metadata;
                match metadata.name.as_str() {
                    METADATA => (self.has_header, self.header) = (true, header(pairs)),
                    MODEL_CHANGE => self.changes.push(model_change(pairs)),
                    CLOCKS => self.clocks.push(clocks(pairs)),
                    REPAIRED => self.repaired = pairs.get("cut").cloned(),
                    _ => {}
                }
            }
            McapRecord::Channel(channel) => {
                let entry = self.channels.entry(channel.id);
                entry.or_insert_with(|| ChannelInfo { topic: channel.topic, ..Default::default() });
            }
            McapRecord::Message { header, data } => {
                let Some(channel) = self.channels.get_mut(&header.channel_id) else { return };
                let first = if channel.messages == 0 { u64::MAX } else { channel.first_ns };
                channel.first_ns = first.min(header.log_time);
                channel.last_ns = channel.last_ns.max(header.log_time);
                channel.messages += 1;
                if let Some(Record::Cycle(cycle)) = Record::decode(&channel.topic, &data) {
                    *self.cycles.entry(cycle.model_epoch).or_default() += 1;
                }
            }
            McapRecord::ChunkIndex(index) => self.chunks_at.push(index.chunk_start_offset),
            _ => {}
        }
    }

    /// Whether there is a chunk at every position of the index.
    fn index_is_right(&self, mut file: &File) -> std::io::Result<bool> {
        let length = file.metadata()?.len();
        for chunk_at in &self.chunks_at {
            let mut opcode = [0];
            if *chunk_at >= length {
                return Ok(false);
            }
            file.seek(SeekFrom::Start(*chunk_at))?;
            file.read_exact(&mut opcode)?;
            if opcode != [op::CHUNK] {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn into_info(mut self, bytes: u64, end: FileState) -> Info {
        let first = ModelChange { t_ns: 0, header: self.header.clone() };
        let models: Vec<_> = std::iter::once(first)
            .chain(self.changes)
            .map(|ModelChange { t_ns, header }| {
                let cycles = self.cycles.remove(&header.model_epoch).unwrap_or(0);
                ModelInfo { since_ns: t_ns, header, cycles }
            })
            .collect();
        let mut channels: Vec<_> = self.channels.into_values().collect();
        channels.sort_by(|one, other| one.topic.cmp(&other.topic));
        Info {
            header: self.header,
            models,
            cycles_of_unknown_models: self.cycles.values().sum(),
            clocks: self.clocks,
            channels,
            bytes,
            end,
            damage: Vec::new(),
            repaired: self.repaired,
        }
    }
}
