//! Writing a black box.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use mcap::records::{MessageHeader, Metadata};
use mcap::{WriteOptions, Writer};

use super::cdr::Out;
use super::records::{CycleRecord, ForceRecord, LogRecord, Message, StatusRecord, VerdictRecord};
use super::{BlackBoxError, Header};
use physics::JointKind;

/// Bytes of a chunk: at 1 kHz of six joints about half a second.
const CHUNK_BYTES: u64 = 256 * 1024;

/// A black box that is being written.
pub struct BlackBox {
    path: PathBuf,
    writer: Writer<Counted>,
    channels: BTreeMap<&'static str, (u16, u32)>,
    out: Out,
    bytes: Arc<AtomicU64>,
}

impl BlackBox {
    /// Creates the file; one that stands there already is not touched.
    ///
    /// # Errors
    /// The file exists, or the system refuses; no file is left then.
    pub fn create(path: &Path, header: &Header) -> Result<Self, BlackBoxError> {
        let file = File::create_new(path).map_err(|source| BlackBoxError::Io {
            action: "create",
            path: path.to_owned(),
            source,
        })?;
        Self::begin(file, path, header).inspect_err(|_| {
            // The first error is the one to tell.
            let _ = std::fs::remove_file(path);
        })
    }

    /// Writes what stands before the first record.
    fn begin(file: File, path: &Path, header: &Header) -> Result<Self, BlackBoxError> {
        let options = WriteOptions::new()
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            // The chunk is put together in memory and written in one go: a kill leaves no half of it.
            .disable_seeking(true)
            .profile("ros2")
            .library(concat!("trued ", env!("CARGO_PKG_VERSION")));
        let write_error = |source| write_error(path, source);
        let bytes = Arc::new(AtomicU64::new(0));
        let counted = Counted { file, bytes: Arc::clone(&bytes), opening: Some(Vec::new()) };
        let mut writer = options.create(counted).map_err(write_error)?;
        writer.write_metadata(&metadata(header)).map_err(write_error)?;
        let channels = BTreeMap::new();
        let mut black_box =
            Self { path: path.to_owned(), writer, channels, out: Out::default(), bytes };
        black_box.add::<CycleRecord>()?;
        black_box.add::<ForceRecord>()?;
        black_box.add::<VerdictRecord>()?;
        black_box.add::<StatusRecord>()?;
        black_box.add::<LogRecord>()?;
        black_box.flush()?;
        Ok(black_box)
    }

    fn add<M: Message>(&mut self) -> Result<(), BlackBoxError> {
        let definition = M::definition();
        let channel = self
            .writer
            .add_schema(M::NAME, "ros2msg", definition.as_bytes())
            .and_then(|schema| self.writer.add_channel(schema, M::TOPIC, "cdr", &BTreeMap::new()))
            .map_err(|source| write_error(&self.path, source))?;
        self.channels.insert(M::TOPIC, (channel, 0));
        Ok(())
    }

    fn put<M: Message>(&mut self, message: &M) -> Result<(), BlackBoxError> {
        let Some((channel_id, sequence)) = self.channels.get_mut(M::TOPIC) else { return Ok(()) };
        self.out.begin();
        message.put(&mut self.out);
        let t_ns = message.t_ns();
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time: t_ns,
            publish_time: t_ns,
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
    pub fn write_model_change(&mut self, header: &Header, t_ns: u64) -> Result<(), BlackBoxError> {
        let mut change = metadata(header);
        change.name = super::read::MODEL_CHANGE.to_owned();
        change.metadata.insert("t_ns".to_owned(), t_ns.to_string());
        self.writer.write_metadata(&change).map_err(|source| write_error(&self.path, source))
    }

    /// Adds a cycle.
    ///
    /// # Errors
    /// The file cannot be written further; the same holds for the others below.
    pub fn write_cycle(&mut self, record: &CycleRecord) -> Result<(), BlackBoxError> {
        self.put(record)
    }

    /// Adds a force block.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn write_force(&mut self, record: &ForceRecord) -> Result<(), BlackBoxError> {
        self.put(record)
    }

    /// Adds a verdict on vibration.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn write_verdict(&mut self, record: &VerdictRecord) -> Result<(), BlackBoxError> {
        self.put(record)
    }

    /// Adds a state of the daemon.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn write_status(&mut self, record: &StatusRecord) -> Result<(), BlackBoxError> {
        self.put(record)
    }

    /// Adds a line of the log.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn write_log(&mut self, record: &LogRecord) -> Result<(), BlackBoxError> {
        self.put(record)
    }

    /// Ends the chunk: what was added is in the file, and safe from the death of this process.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn flush(&mut self) -> Result<(), BlackBoxError> {
        self.writer.flush().map_err(|source| write_error(&self.path, source))
    }

    /// Bytes in the file so far, the open chunk not counted.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Where it is written.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Ends the file with its index, synced to the disk.
    ///
    /// # Errors
    /// See [`Self::write_cycle`].
    pub fn finish(mut self) -> Result<(), BlackBoxError> {
        self.writer.finish().map_err(|source| write_error(&self.path, source))?;
        let path = std::mem::take(&mut self.path);
        self.writer.into_inner().file.sync_all().map_err(|source| BlackBoxError::Io {
            action: "sync",
            path,
            source,
        })
    }
}

fn write_error(path: &Path, source: mcap::McapError) -> BlackBoxError {
    BlackBoxError::Write { path: path.to_owned(), source: Box::new(source) }
}

fn metadata(header: &Header) -> Metadata {
    let joint = |kind: &JointKind| if *kind == JointKind::Revolute { 'R' } else { 'P' };
    let pairs = [
        ("cell", header.cell.clone()),
        ("version", header.version.clone()),
        ("model_hash", format!("{:016x}", header.model_hash)),
        ("robot", header.robot.clone()),
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

/// A file that counts what goes into it.
struct Counted {
    file: File,
    bytes: Arc<AtomicU64>,
    /// What stands before the first record, until it is whole: it is written in one go, so that a kill leaves no half of it.
    opening: Option<Vec<u8>>,
}

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = match &mut self.opening {
            Some(opening) => opening.write(bytes)?,
            None => self.file.write(bytes)?,
        };
        self.bytes.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        if let Some(opening) = self.opening.take() {
            self.file.write_all(&opening)?;
        }
        self.file.flush()
    }
}

impl Seek for Counted {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}
