//! Repairs an MCAP recording that was not closed and lacks its index after a kill or a full disk.
//!
//! The file is replaced atomically by a complete one with every readable record, or stays
//! unchanged; a file being written by a process is not touched.

use std::fs::{self, File, TryLockError};
use std::io::{BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

use mcap::Writer;
use mcap::records::{Metadata, Record as McapRecord};

use super::McapRecordingError;
use super::info::{self, FileState};
use super::read::{METADATA, REPAIRED};
use super::scan::scan;
use super::write::{options, write_error};
use crate::program;

/// Suffix of the temporary file that replaces the original when the repair is complete.
pub const UNFINISHED: &str = ".repair";

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
    },
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

/// Repairs a recording: writes all readable records to a new file with an index.
///
/// # Errors
/// It is being written by a process, it is not an MCAP recording, or the new file cannot be
/// written; it is then unchanged.
pub fn repair(path: &Path) -> Result<Repair, McapRecordingError> {
    let refused =
        |action| move |source| McapRecordingError::Io { action, path: path.to_owned(), source };
    let file = File::open(path).map_err(refused("read"))?;
    if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
        return Err(McapRecordingError::InUse { path: path.to_owned() });
    }
    // This process holds the lock now.
    let was = match info::info_of(path, &file)?.end {
        FileState::Closed | FileState::BeingWritten => return Ok(Repair::NotNeeded),
        FileState::Cut(cut) => cut,
        FileState::WrongIndex => "its index was invalid".to_owned(),
    };
    let mut unfinished = path.as_os_str().to_owned();
    unfinished.push(UNFINISHED);
    let unfinished = PathBuf::from(unfinished);
    let copied = copy(path, &file, &unfinished, &was).and_then(|messages| {
        fs::rename(&unfinished, path).map_err(refused("replace"))?;
        Ok(messages)
    });
    let messages = copied.inspect_err(|_| {
        // The first error is reported.
        let _ = fs::remove_file(&unfinished);
    })?;
    Ok(Repair::Done { was, messages })
}

/// Copies all readable records of `from` to a complete file; returns the number of messages.
fn copy(name: &Path, from: &File, to: &Path, was: &str) -> Result<u64, McapRecordingError> {
    let refused = |action, path: &Path| {
        let path = path.to_owned();
        move |source| McapRecordingError::Io { action, path, source }
    };
    let old = from.metadata().map_err(refused("read", name))?;
    let file = File::create(to).map_err(refused("create", to))?;
    file.set_permissions(old.permissions()).map_err(refused("create", to))?;
    let fault = |source| write_error(to, source);
    let mut writer = options().create(BufWriter::new(file)).map_err(fault)?;
    let mut messages = 0;
    let mut reader = File::open(name).map_err(refused("read", name)).map(BufReader::new)?;
    let bytes = usize::try_from(old.len()).unwrap_or(usize::MAX);
    scan(&name.display().to_string(), &mut reader, bytes, &mut |record| {
        let is_message = matches!(record, McapRecord::Message { .. });
        let is_header =
            matches!(&record, McapRecord::Metadata(metadata) if metadata.name == METADATA);
        put(&mut writer, record).map_err(fault)?;
        messages += u64::from(is_message);
        if is_header {
            writer.write_metadata(&mark(was)).map_err(fault)?;
        }
        Ok(())
    })?;
    writer.finish().map_err(fault)?;
    let mut written = writer.into_inner();
    let synced = written.flush().and_then(|()| written.get_ref().sync_all());
    synced.map_err(refused("sync", to))?;
    Ok(messages)
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
