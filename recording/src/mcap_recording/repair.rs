//! Repairs an MCAP recording that was not closed and lacks its index after a kill or a full disk, or
//! that is damaged inside.
//!
//! The file is replaced atomically by a complete one with every readable record, or stays
//! unchanged; a file being written by a process is not touched. Where a chunk of the file is damaged,
//! the original stays beside the new one under another name ([`original_path`]); the part of a chunk
//! that a kill left at the end has no readable message.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

use mcap::Writer;
use mcap::records::{Metadata, Record as McapRecord};

use super::McapRecordingError;
use super::info::{self, FileState};
use super::read::{METADATA, REPAIRED};
use super::scan::{Damage, messages_lost, scan};
use super::write::{options, write_error};
use crate::program;

/// Suffix of the temporary file that replaces the original when the repair is complete.
pub const UNFINISHED: &str = ".repair";
/// In the name of an original that holds more than the repaired file.
const DAMAGED: &str = "damaged";
/// Originals of one name that are kept, at most.
const ORIGINALS_MAX: u32 = 1000;

/// Result of a repair.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Repair {
    /// The file was complete.
    NotNeeded,
    /// The file was repaired.
    Done {
        /// What was wrong with it.
        was: String,
        /// Number of messages.
        messages: u64,
        /// What could not be read.
        loss: Option<Loss>,
    },
}

/// What a repaired file does not hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Loss {
    /// Parts that cannot be read.
    pub damage: Vec<Damage>,
    /// Number of messages that are lost; `None` if it is unknown.
    pub messages: Option<u64>,
    /// Where the original is.
    pub original: PathBuf,
}

/// Whether the file was closed, by its last bytes alone.
///
/// # Errors
/// It cannot be read.
pub fn is_closed(path: &Path) -> Result<bool, McapRecordingError> {
    let refused = |source| McapRecordingError::Io { action: "read", path: path.to_owned(), source };
    let file = File::open(path).map_err(refused)?;
    info::is_closed(&file).map_err(refused)
}

/// Path of an original that is kept beside its repaired file: `run.mcap` becomes `run.damaged.mcap`,
/// the next one `run.damaged-2.mcap`.
#[must_use]
pub fn original_path(path: &Path, count: u32) -> PathBuf {
    let number = if count > 1 { format!("-{count}") } else { String::new() };
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!(".{DAMAGED}{number}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// Repairs a recording: writes all readable records to a new file with an index. If anything is not
/// readable, the original is kept beside it.
///
/// # Errors
/// It is being written by a process, it is not an MCAP recording, or a file cannot be
/// written; it is then unchanged.
pub fn repair(path: &Path) -> Result<Repair, McapRecordingError> {
    let refused =
        |action| move |source| McapRecordingError::Io { action, path: path.to_owned(), source };
    let file = File::open(path).map_err(refused("read"))?;
    if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
        return Err(McapRecordingError::InUse { path: path.to_owned() });
    }
    // This process holds the lock now.
    let info = info::info_of(path, &file)?;
    let damaged = format!("{} could not be read", chunks(info.damage.len()));
    let was = match info.end {
        FileState::Closed | FileState::BeingWritten if info.damage.is_empty() => {
            return Ok(Repair::NotNeeded);
        }
        FileState::Closed | FileState::BeingWritten => damaged,
        FileState::Cut(cut) if info.damage.is_empty() => cut,
        FileState::Cut(cut) => format!("{cut}; {damaged}"),
        FileState::WrongIndex => "its index was invalid".to_owned(),
    };
    let mut unfinished = path.as_os_str().to_owned();
    unfinished.push(UNFINISHED);
    let unfinished = PathBuf::from(unfinished);
    let copied = copy(path, &file, &unfinished, &was).and_then(|copied| {
        let original = if copied.is_complete() { None } else { Some(keep_original(path)?) };
        fs::rename(&unfinished, path).map_err(refused("replace"))?;
        Ok((copied, original))
    });
    let (copied, original) = copied.inspect_err(|_| {
        // The first error is reported.
        let _ = fs::remove_file(&unfinished);
    })?;
    let messages = copied.messages;
    let loss =
        original.map(|original| Loss { messages: copied.lost(), damage: copied.damage, original });
    Ok(Repair::Done { was, messages, loss })
}

fn chunks(count: usize) -> String {
    if count == 1 { "1 damaged chunk".to_owned() } else { format!("{count} damaged chunks") }
}

/// Gives the file a second name, which nothing has yet; returns it.
fn keep_original(path: &Path) -> Result<PathBuf, McapRecordingError> {
    for count in 1..=ORIGINALS_MAX {
        let original = original_path(path, count);
        let kept = fs::hard_link(path, &original).or_else(|why| match why.kind() {
            io::ErrorKind::AlreadyExists => Err(why),
            // A file system without links.
            _ => copy_to_new(path, &original),
        });
        match kept {
            Ok(()) => return Ok(original),
            Err(why) if why.kind() == io::ErrorKind::AlreadyExists => {}
            Err(source) => {
                return Err(McapRecordingError::Io { action: "keep", path: original, source });
            }
        }
    }
    let source = io::ErrorKind::AlreadyExists.into();
    Err(McapRecordingError::Io { action: "keep a copy of", path: path.to_owned(), source })
}

fn copy_to_new(from: &Path, to: &Path) -> io::Result<()> {
    let mut copy = File::create_new(to)?;
    let copied = File::open(from).and_then(|mut file| io::copy(&mut file, &mut copy));
    copied.and_then(|_| copy.sync_all()).inspect_err(|_| {
        // The first error is reported.
        let _ = fs::remove_file(to);
    })
}

/// What was copied, and what was not.
struct Copied {
    messages: u64,
    /// Messages whose topic is not known any more.
    orphans: u64,
    damage: Vec<Damage>,
}

impl Copied {
    fn is_complete(&self) -> bool {
        self.orphans == 0 && self.damage.is_empty()
    }

    /// Number of messages that are lost, if it is known.
    fn lost(&self) -> Option<u64> {
        messages_lost(&self.damage).map(|lost| lost + self.orphans)
    }
}

/// Copies all readable records of `from` to a complete file.
fn copy(name: &Path, from: &File, to: &Path, was: &str) -> Result<Copied, McapRecordingError> {
    let refused = |action, path: &Path| {
        let path = path.to_owned();
        move |source| McapRecordingError::Io { action, path, source }
    };
    let old = from.metadata().map_err(refused("read", name))?;
    let file = File::create(to).map_err(refused("create", to))?;
    file.set_permissions(old.permissions()).map_err(refused("create", to))?;
    let fault = |source| write_error(to, source);
    let mut writer = options().create(BufWriter::new(file)).map_err(fault)?;
    let (mut messages, mut orphans) = (0, 0);
    let mut channels = BTreeSet::new();
    let reader = File::open(name).map_err(refused("read", name)).map(BufReader::new)?;
    let bytes = usize::try_from(old.len()).unwrap_or(usize::MAX);
    let scanned = scan(&name.display().to_string(), reader, bytes, &mut |record| {
        match &record {
            McapRecord::Channel(channel) => drop(channels.insert(channel.id)),
            McapRecord::Message { header, .. } if !channels.contains(&header.channel_id) => {
                orphans += 1;
                return Ok(());
            }
            McapRecord::Message { .. } => messages += 1,
            _ => {}
        }
        let is_header =
            matches!(&record, McapRecord::Metadata(metadata) if metadata.name == METADATA);
        put(&mut writer, record).map_err(fault)?;
        if is_header {
            writer.write_metadata(&mark(was)).map_err(fault)?;
        }
        Ok(())
    })?;
    writer.finish().map_err(fault)?;
    let mut written = writer.into_inner();
    let synced = written.flush().and_then(|()| written.get_ref().sync_all());
    synced.map_err(refused("sync", to))?;
    Ok(Copied { messages, orphans, damage: scanned.damage })
}

fn put<W: Write + std::io::Seek>(
    writer: &mut Writer<W>,
    record: McapRecord<'_>,
) -> mcap::McapResult<()> {
    match record {
        McapRecord::Schema { header, data } => {
            writer.add_schema_with_id(header.id, &header.name, &header.encoding, &data).map(drop)
        }
        McapRecord::Channel(channel) => writer
            .add_channel_with_id(
                channel.id,
                channel.schema_id,
                &channel.topic,
                &channel.message_encoding,
                &channel.metadata,
            )
            .map(drop),
        McapRecord::Message { header, data } => writer.write_to_known_channel(&header, &data),
        McapRecord::Metadata(metadata) if metadata.name == REPAIRED => Ok(()),
        McapRecord::Metadata(metadata) => writer.write_metadata(&metadata),
        McapRecord::Attachment { header, data, .. } => writer.attach(&mcap::Attachment {
            log_time: header.log_time,
            create_time: header.create_time,
            name: header.name,
            media_type: header.media_type,
            data,
        }),
        _ => Ok(()),
    }
}

/// Metadata about the repair.
fn mark(was: &str) -> Metadata {
    let pairs = [("cut", was), ("by", program::version())];
    let pairs = pairs.map(|(key, value)| (key.to_owned(), value.to_owned()));
    Metadata { name: REPAIRED.to_owned(), metadata: pairs.into() }
}
