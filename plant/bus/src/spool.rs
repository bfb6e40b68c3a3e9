//! An append-only log of numbered records on disk, under a byte budget: messages that a subscriber missed can be requested later, in order.
//!
//! Files `NUMBER.spool`, named by the number of their first record, each at most an eighth of the budget. A file begins with 16 fixed bytes, the stream (u64, little
//! endian) and the number of its first record (u64); a record is its length (u32), its CRC-32 (u32) and its bytes. Promises: a record is on disk when
//! [`Spool::append`] returns, so that a number never names two records; the files never exceed the budget: the oldest file makes room, and
//! [`Spool::first`] is the oldest record left; an incomplete record is removed and reported when the spool is opened. If a file in between is lost,
//! older records are removed as well, because readers rely on consecutive numbers.

use std::collections::VecDeque;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};

/// How a file begins.
const HEADER: &[u8; 16] = b"trued.spool/1\n\0\0";
const HEADER_BYTES: u64 = 32;
const RECORD_HEADER_BYTES: u64 = 8;
/// Files that share the budget; one file is removed at a time.
const FILES: u64 = 8;
/// Smallest budget: a summary of 16 joints has 6 kB.
pub const BUDGET_BYTES_MIN: u64 = 1 << 20;

/// Why records cannot be kept.
#[derive(Debug, thiserror::Error)]
pub enum SpoolError {
    /// The budget is too small.
    #[error("the spool's budget is {0} bytes; expected at least {BUDGET_BYTES_MIN}")]
    Budget(u64),
    /// Another process uses the folder.
    #[error("{}: another trued-plant uses this folder; use a separate folder for each cell", .0.display())]
    Taken(PathBuf),
    /// The system refuses.
    #[error("{}: cannot {what}: {why}; check free disk space and the owner of the folder", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried.
        what: &'static str,
        /// What the system said.
        why: io::Error,
    },
    /// A record is too large.
    #[error("a record has {bytes} bytes; expected at most {most} (an eighth of the budget)")]
    TooLarge {
        /// Its size.
        bytes: usize,
        /// What fits.
        most: u64,
    },
}

/// What was found in the folder when it was opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Found {
    /// Records that can be read.
    pub records: u64,
    /// Bytes removed because they were not written whole, or were damaged.
    pub torn_bytes: u64,
}

/// Records read at once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page {
    /// Number of the first of them.
    pub from: u64,
    /// The records, in order.
    pub records: Vec<Vec<u8>>,
}

/// One file.
#[derive(Debug)]
struct Segment {
    path: PathBuf,
    first: u64,
    /// Where each record begins.
    offsets: Vec<u64>,
    bytes: u64,
}

impl Segment {
    fn next(&self) -> u64 {
        self.first + self.offsets.len() as u64
    }
}

/// The log.
#[derive(Debug)]
pub struct Spool {
    folder: PathBuf,
    budget_bytes: u64,
    stream: u64,
    segments: VecDeque<Segment>,
    /// The newest segment, open for appending.
    active: File,
    /// Held while the spool is in use.
    _lock: File,
}

fn io_error<'a>(what: &'static str, path: &'a Path) -> impl FnOnce(io::Error) -> SpoolError + 'a {
    move |why| SpoolError::Io { path: path.to_owned(), what, why }
}

impl Spool {
    /// Opens the folder, or makes it. `new_stream` names the stream if nothing is in it: a number that was not used before, for example the time.
    ///
    /// # Errors
    /// See [`SpoolError`].
    pub fn open(
        folder: &Path,
        budget_bytes: u64,
        new_stream: u64,
    ) -> Result<(Self, Found), SpoolError> {
        if budget_bytes < BUDGET_BYTES_MIN {
            return Err(SpoolError::Budget(budget_bytes));
        }
        fs::create_dir_all(folder).map_err(io_error("create the folder", folder))?;
        let lock_path = folder.join("lock");
        let lock = File::create(&lock_path).map_err(io_error("write", &lock_path))?;
        lock.try_lock().map_err(|_| SpoolError::Taken(folder.to_owned()))?;
        let mut torn_bytes = 0;
        let (mut stream, mut segments) = (new_stream, VecDeque::<Segment>::new());
        for path in files(folder)? {
            let read = scan(&path, &mut torn_bytes)?;
            let Some((its_stream, segment)) = read else { continue };
            let fits = segments.back().is_none_or(|last| last.next() == segment.first);
            if !fits || (!segments.is_empty() && its_stream != stream) {
                for older in segments.drain(..) {
                    torn_bytes += older.bytes;
                    remove(&older.path)?;
                }
            }
            stream = its_stream;
            segments.push_back(segment);
        }
        if segments.is_empty() {
            segments.push_back(create(folder, new_stream, 1)?);
            stream = new_stream;
        }
        let records = segments.iter().map(|segment| segment.offsets.len() as u64).sum();
        let path = segments.back().map(|last| last.path.clone()).unwrap_or_default();
        let active = open_to_append(&path)?;
        let folder = folder.to_owned();
        let spool = Self { folder, budget_bytes, stream, segments, active, _lock: lock };
        Ok((spool, Found { records, torn_bytes }))
    }

    /// Names the series of numbers; another one begins where the folder was lost.
    #[must_use]
    pub fn stream(&self) -> u64 {
        self.stream
    }

    /// Number of the oldest record that is kept; [`Spool::next`] where there is none. All older ones fell out.
    #[must_use]
    pub fn first(&self) -> u64 {
        self.segments.front().map_or(1, |segment| segment.first)
    }

    /// Number of the next record. The first one has 1.
    #[must_use]
    pub fn next(&self) -> u64 {
        self.segments.back().map_or(1, Segment::next)
    }

    /// Size of all files, bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.segments.iter().map(|segment| segment.bytes).sum()
    }

    fn segment_bytes(&self) -> u64 {
        self.budget_bytes / FILES
    }

    /// Keeps a record, and returns its number.
    ///
    /// # Errors
    /// See [`SpoolError`]; then the record is not kept.
    pub fn append(&mut self, record: &[u8]) -> Result<u64, SpoolError> {
        let size = RECORD_HEADER_BYTES + record.len() as u64;
        let most = self.segment_bytes() - HEADER_BYTES - RECORD_HEADER_BYTES;
        let too_large = || SpoolError::TooLarge { bytes: record.len(), most };
        let length = u32::try_from(record.len()).ok().filter(|_| record.len() as u64 <= most);
        let length = length.ok_or_else(too_large)?;
        if self.segments.back().is_none_or(|last| last.bytes + size > self.segment_bytes()) {
            self.make_room(HEADER_BYTES + size)?;
            let segment = create(&self.folder, self.stream, self.next())?;
            self.active = open_to_append(&segment.path)?;
            self.segments.push_back(segment);
        } else {
            self.make_room(size)?;
        }
        let mut framed = Vec::with_capacity(size as usize);
        framed.extend_from_slice(&length.to_le_bytes());
        framed.extend_from_slice(&crc32fast::hash(record).to_le_bytes());
        framed.extend_from_slice(record);
        let number = self.next();
        let Some(last) = self.segments.back_mut() else { return Err(too_large()) };
        let written = self.active.write_all(&framed).and_then(|()| self.active.sync_data());
        if let Err(why) = written {
            // What was written in part would stand before the next record.
            let _ = self.active.set_len(last.bytes);
            return Err(io_error("write", &last.path)(why));
        }
        last.offsets.push(last.bytes);
        last.bytes += size;
        Ok(number)
    }

    /// The oldest files go until `size` more bytes are within the budget.
    fn make_room(&mut self, size: u64) -> Result<(), SpoolError> {
        while self.bytes() + size > self.budget_bytes && self.segments.len() > 1 {
            if let Some(oldest) = self.segments.pop_front() {
                remove(&oldest.path)?;
            }
        }
        Ok(())
    }

    /// The records from number `from` on, or from the oldest one that is kept, in order: at most `bytes_max`, but one at least where there is one.
    ///
    /// # Errors
    /// See [`SpoolError`].
    pub fn page(&self, from: u64, bytes_max: usize) -> Result<Page, SpoolError> {
        let from = from.clamp(self.first(), self.next());
        let mut page = Page { from, records: Vec::new() };
        let mut bytes = 0;
        for segment in self.segments.iter().filter(|segment| segment.next() > from) {
            let file = File::open(&segment.path).map_err(io_error("read", &segment.path))?;
            let skipped = from.saturating_sub(segment.first) as usize;
            for (k, offset) in segment.offsets.iter().enumerate().skip(skipped) {
                let end = segment.offsets.get(k + 1).copied().unwrap_or(segment.bytes);
                let mut record = vec![0; (end - offset - RECORD_HEADER_BYTES) as usize];
                bytes += record.len();
                if bytes > bytes_max && !page.records.is_empty() {
                    return Ok(page);
                }
                let read = file.read_exact_at(&mut record, offset + RECORD_HEADER_BYTES);
                read.map_err(io_error("read", &segment.path))?;
                page.records.push(record);
            }
        }
        Ok(page)
    }
}

/// The files of the folder by the number of their first record.
fn files(folder: &Path) -> Result<Vec<PathBuf>, SpoolError> {
    let entries = fs::read_dir(folder).map_err(io_error("read", folder))?;
    let paths = entries.flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> =
        paths.filter(|path| path.extension().is_some_and(|end| end == "spool")).collect();
    files.sort();
    Ok(files)
}

fn remove(path: &Path) -> Result<(), SpoolError> {
    fs::remove_file(path).map_err(io_error("remove", path))
}

fn open_to_append(path: &Path) -> Result<File, SpoolError> {
    OpenOptions::new().append(true).open(path).map_err(io_error("write", path))
}

fn create(folder: &Path, stream: u64, first: u64) -> Result<Segment, SpoolError> {
    let path = folder.join(format!("{first:020}.spool"));
    let mut bytes = HEADER.to_vec();
    bytes.extend_from_slice(&stream.to_le_bytes());
    bytes.extend_from_slice(&first.to_le_bytes());
    let written = File::create(&path).and_then(|mut file| {
        file.write_all(&bytes)?;
        file.sync_data()?;
        // The name is to survive a loss of power as well.
        File::open(folder)?.sync_all()
    });
    written.map_err(io_error("write", &path))?;
    Ok(Segment { path, first, offsets: Vec::new(), bytes: HEADER_BYTES })
}

/// Reads the stream and the places of all whole records of a file, and cuts off what follows them. A file without a whole header is removed.
fn scan(path: &Path, torn_bytes: &mut u64) -> Result<Option<(u64, Segment)>, SpoolError> {
    let error = |why| io_error("read", path)(why);
    let mut file = OpenOptions::new().read(true).write(true).open(path).map_err(error)?;
    let length = file.metadata().map_err(error)?.len();
    let mut header = [0; HEADER_BYTES as usize];
    let is_whole = length >= HEADER_BYTES && file.read_exact(&mut header).is_ok();
    let number_at =
        |offset: usize| header.get(offset..offset + 8).and_then(|bytes| bytes.try_into().ok());
    let numbers = number_at(16).map(u64::from_le_bytes).zip(number_at(24).map(u64::from_le_bytes));
    let named = path.file_stem().and_then(|stem| stem.to_str()?.parse().ok());
    let valid = numbers
        .filter(|numbers| is_whole && header.starts_with(HEADER) && Some(numbers.1) == named);
    let Some((stream, first)) = valid else {
        *torn_bytes += length;
        remove(path)?;
        return Ok(None);
    };
    let mut segment =
        Segment { path: path.to_owned(), first, offsets: Vec::new(), bytes: HEADER_BYTES };
    file.seek(SeekFrom::Start(HEADER_BYTES)).map_err(error)?;
    let mut reader = io::BufReader::new(&file);
    while let Some(size) = whole_record(&mut reader, length - segment.bytes) {
        segment.offsets.push(segment.bytes);
        segment.bytes += size;
    }
    if segment.bytes < length {
        *torn_bytes += length - segment.bytes;
        file.set_len(segment.bytes).map_err(error)?;
    }
    Ok(Some((stream, segment)))
}

/// Size of the next record with its header; none where it is not whole within the `left` bytes.
fn whole_record(reader: &mut impl io::Read, left: u64) -> Option<u64> {
    let (mut length, mut crc) = ([0; 4], [0; 4]);
    reader.read_exact(&mut length).ok()?;
    reader.read_exact(&mut crc).ok()?;
    let length = u64::from(u32::from_le_bytes(length));
    let size = RECORD_HEADER_BYTES + length;
    if size > left {
        return None;
    }
    let mut record = vec![0; length as usize];
    reader.read_exact(&mut record).ok()?;
    (crc32fast::hash(&record) == u32::from_le_bytes(crc)).then_some(size)
}
