//! Writes an MCAP recording.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, WriteOptions, Writer};

use super::cdr::CdrWriter;
use super::clock::Clocks;
use super::records::{CycleRecord, ForceRecord, LogRecord, Message, StatusRecord, VerdictRecord};
use super::{Header, McapRecordingError};
use crate::program;
use physics::JointKind;

/// Size of a chunk, bytes: about half a second at 1 kHz with six joints.
const CHUNK_BYTES: u64 = 256 * 1024;

/// Options of every file.
pub(super) fn options() -> WriteOptions {
    WriteOptions::new()
        .compression(None)
        .chunk_size(Some(CHUNK_BYTES))
        // Each chunk is assembled in memory and written at once: a kill leaves no partial chunk.
        .disable_seeking(true)
        .profile("ros2")
        .library(program::version())
}

/// Writer of an MCAP recording.
pub struct McapWriter {
    path: PathBuf,
    writer: Writer<CountingFile>,
    channels: BTreeMap<&'static str, (u16, u32)>,
    out: CdrWriter,
    bytes: Arc<AtomicU64>,
    clocks: Clocks,
    /// For checking whether the file still has a name.
    handle: File,
}

impl McapWriter {
    /// Creates the file; an existing one is not touched. `now` is read from the clocks just before.
    ///
    /// While it is written the file is locked (`flock`), so that it is not repaired meanwhile.
    ///
    /// # Errors
    /// The file exists, or the system refuses; no file is left then.
    pub fn create(path: &Path, header: &Header, now: Clocks) -> Result<Self, McapRecordingError> {
        let refused =
            |action| move |source| McapRecordingError::Io { action, path: path.to_owned(), source };
        let file = File::create_new(path).map_err(refused("create"))?;
        match file.try_lock() {
            // A file system without locks gives no protection.
            Ok(()) | Err(TryLockError::Error(_)) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(McapRecordingError::InUse { path: path.to_owned() });
            }
        }
        Self::begin(file, path, header, now).inspect_err(|_| {
            // The first error is reported.
            let _ = std::fs::remove_file(path);
        })
    }

    /// Writes everything before the first record.
    fn begin(
        file: File,
        path: &Path,
        header: &Header,
        now: Clocks,
    ) -> Result<Self, McapRecordingError> {
        let write_error = |source| write_error(path, source);
        let handle = file.try_clone().map_err(|why| write_error(why.into()))?;
        let bytes = Arc::new(AtomicU64::new(0));
        let counted = CountingFile::new(file, Arc::clone(&bytes));
        let mut writer = options().create(counted).map_err(write_error)?;
        writer.write_metadata(&metadata(header)).map_err(write_error)?;
        let channels = BTreeMap::new();
        let (path, out) = (path.to_owned(), CdrWriter::default());
        let mut black_box = Self { path, writer, channels, out, bytes, clocks: now, handle };
        black_box.attach_model(header, now.wall_ns)?;
        black_box.write_clocks()?;
        black_box.add::<CycleRecord>()?;
        black_box.add::<ForceRecord>()?;
        black_box.add::<VerdictRecord>()?;
        black_box.add::<StatusRecord>()?;
        black_box.add::<LogRecord>()?;
        black_box.flush()?;
        Ok(black_box)
    }

    /// Attaches the model as a separate file, which any MCAP tool extracts.
    fn attach_model(&mut self, header: &Header, wall_ns: u64) -> Result<(), McapRecordingError> {
        let attachment = Attachment {
            log_time: wall_ns,
            create_time: wall_ns,
            name: format!("model-{}.toml", header.model_epoch),
            media_type: "application/toml".to_owned(),
            data: Cow::Borrowed(header.model.as_bytes()),
        };
        self.writer.attach(&attachment).map_err(|source| write_error(&self.path, source))
    }

    fn write_clocks(&mut self) -> Result<(), McapRecordingError> {
        let Clocks { monotonic_ns, wall_ns } = self.clocks;
        let pairs = [("monotonic_ns", monotonic_ns), ("wall_ns", wall_ns)];
        let pairs = pairs.map(|(key, value)| (key.to_owned(), value.to_string()));
        let metadata = Metadata { name: super::read::CLOCKS.to_owned(), metadata: pairs.into() };
        self.writer.write_metadata(&metadata).map_err(|source| write_error(&self.path, source))
    }

    /// Takes a later reading of the clocks, on which log times are then based.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn set_clocks(&mut self, now: Clocks) -> Result<(), McapRecordingError> {
        if self.clocks.advance(now) { self.write_clocks() } else { Ok(()) }
    }

    /// Whether the file still has a name. Records written to a removed one would be lost.
    #[must_use]
    pub fn is_linked(&self) -> bool {
        self.handle.metadata().is_ok_and(|file| file.nlink() > 0)
    }

    fn add<M: Message>(&mut self) -> Result<(), McapRecordingError> {
        let definition = M::definition();
        let channel = self
            .writer
            .add_schema(M::NAME, "ros2msg", definition.as_bytes())
            .and_then(|schema| self.writer.add_channel(schema, M::TOPIC, "cdr", &BTreeMap::new()))
            .map_err(|source| write_error(&self.path, source))?;
        self.channels.insert(M::TOPIC, (channel, 0));
        Ok(())
    }

    fn put<M: Message>(&mut self, message: &M) -> Result<(), McapRecordingError> {
        let Some((channel_id, sequence)) = self.channels.get_mut(M::TOPIC) else { return Ok(()) };
        self.out.begin();
        message.put(&mut self.out);
        let wall_ns = self.clocks.wall_ns(message.stamp_ns());
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time: wall_ns,
            publish_time: wall_ns,
        };
        *sequence = sequence.wrapping_add(1);
        self.writer
            .write_to_known_channel(&header, self.out.bytes())
            .map_err(|source| write_error(&self.path, source))
    }

    /// Notes that from `t_ns` on (`CLOCK_MONOTONIC`) another model is active: `header` with that model.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn write_model_change(
        &mut self,
        header: &Header,
        t_ns: u64,
    ) -> Result<(), McapRecordingError> {
        let mut change = metadata(header);
        change.name = super::read::MODEL_CHANGE.to_owned();
        change.metadata.insert("t_ns".to_owned(), t_ns.to_string());
        self.writer.write_metadata(&change).map_err(|source| write_error(&self.path, source))?;
        self.attach_model(header, self.clocks.wall_ns(t_ns))
    }

    /// Adds a cycle.
    ///
    /// # Errors
    /// The file cannot be written; this applies to the following methods too.
    pub fn write_cycle(&mut self, record: &CycleRecord) -> Result<(), McapRecordingError> {
        self.put(record)
    }

    /// Adds a force block.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn write_force(&mut self, record: &ForceRecord) -> Result<(), McapRecordingError> {
        self.put(record)
    }

    /// Adds a verdict on vibration.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn write_verdict(&mut self, record: &VerdictRecord) -> Result<(), McapRecordingError> {
        self.put(record)
    }

    /// Adds a state of the daemon.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn write_status(&mut self, record: &StatusRecord) -> Result<(), McapRecordingError> {
        self.put(record)
    }

    /// Adds a line of the log.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn write_log(&mut self, record: &LogRecord) -> Result<(), McapRecordingError> {
        self.put(record)
    }

    /// Ends the chunk: the records are in the file and survive the end of this process.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn flush(&mut self) -> Result<(), McapRecordingError> {
        self.writer.flush().map_err(|source| write_error(&self.path, source))
    }

    /// Bytes in the file so far, without the open chunk.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Where it is written.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives the file another name while it is written.
    ///
    /// # Errors
    /// The system refuses; the name is then unchanged.
    pub fn rename(&mut self, to: &Path) -> Result<(), McapRecordingError> {
        std::fs::rename(&self.path, to).map_err(|source| McapRecordingError::Io {
            action: "rename",
            path: self.path.clone(),
            source,
        })?;
        to.clone_into(&mut self.path);
        Ok(())
    }

    /// Ends the file with its index, synced to the disk.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn finish(mut self) -> Result<(), McapRecordingError> {
        self.writer.finish().map_err(|source| write_error(&self.path, source))?;
        let path = std::mem::take(&mut self.path);
        self.writer.into_inner().file.sync_all().map_err(|source| McapRecordingError::Io {
            action: "sync",
            path,
            source,
        })
    }
}

pub(super) fn write_error(path: &Path, source: mcap::McapError) -> McapRecordingError {
    McapRecordingError::Write { path: path.to_owned(), source: Box::new(source) }
}

fn metadata(header: &Header) -> Metadata {
    let joint = |kind: &JointKind| if *kind == JointKind::Revolute { 'R' } else { 'P' };
    let pairs = [
        ("cell", header.cell.clone()),
        ("version", header.version.clone()),
        ("model_hash", format!("{:016x}", header.model_hash)),
        ("robot", header.robot.clone()),
        ("robot_maker", header.robot_maker.clone()),
        ("robot_type", header.robot_type.clone()),
        ("robot_serial", header.robot_serial.clone()),
        ("model_epoch", header.model_epoch.to_string()),
        ("geometry_hash", format!("{:016x}", header.geometry_hash)),
        ("model", header.model.clone()),
        ("config", header.config.clone()),
        ("joints", header.joints.iter().map(joint).collect()),
        ("status_words", header.status_words.join("\n")),
        ("reason_words", header.reason_words.join("\n")),
    ];
    let metadata = pairs.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    Metadata { name: super::read::METADATA.to_owned(), metadata }
}

/// A file that counts its bytes. After a failed write nothing more is written, so that the content
/// up to that point remains valid.
struct CountingFile {
    file: File,
    bytes: Arc<AtomicU64>,
    /// Everything before the first record, until it is complete: it is written at once, so that a
    /// kill leaves no part of it.
    opening: Option<Vec<u8>>,
    has_failed: bool,
}

impl CountingFile {
    fn new(file: File, bytes: Arc<AtomicU64>) -> Self {
        Self { file, bytes, opening: Some(Vec::new()), has_failed: false }
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.has_failed {
            return Err(io::Error::other("an earlier write failed"));
        }
        match &mut self.opening {
            Some(opening) => opening.write(bytes),
            None => self.file.write(bytes),
        }
    }
}

impl Write for CountingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.put(bytes).inspect_err(|why| {
            self.has_failed |= why.kind() != io::ErrorKind::Interrupted;
        })?;
        self.bytes.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        if let Some(opening) = self.opening.take() {
            self.file.write_all(&opening).inspect_err(|_| self.has_failed = true)?;
        }
        self.file.flush()
    }
}

/// The container only queries its position, which the count provides, because the file does not
/// know it while its opening is buffered.
impl Seek for CountingFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = self.bytes.load(Ordering::Relaxed);
        match to {
            SeekFrom::Current(0) | SeekFrom::End(0) => Ok(position),
            SeekFrom::Start(start) if start == position => Ok(position),
            _ => Err(io::Error::other("a recording can only be written sequentially")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_a_write_that_failed_nothing_more_is_written() {
        let name = format!("trued-box-{}-failed", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, "whole").unwrap();
        // Not for writing: each write fails, as on a full disk.
        let mut counted = CountingFile::new(File::open(&path).unwrap(), Arc::default());
        counted.write_all(b"opening").unwrap();
        assert!(counted.flush().is_err());
        // There is space again.
        counted.file = File::options().append(true).open(&path).unwrap();
        assert!(counted.write_all(b"more").is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        std::fs::remove_file(&path).unwrap();
    }
}
