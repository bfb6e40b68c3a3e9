//! An append-only log of numbered records on disk, under a byte budget: messages that a subscriber missed can be requested later, in order.
//!
//! Files `NUMBER.spool`, named by the number of their first record, each at most an eighth of the budget. A file begins with 16 fixed bytes, the stream (u64, little
//! endian) and the number of its first record (u64); a record is its length (u32), its CRC-32 (u32) and its bytes. Promises: a record is on disk when
//! [`Spool::append`] returns; no number is given twice within a stream; the files never exceed the budget: the oldest file makes room, and
//! [`Spool::first`] is the oldest record left. What is damaged is reported when the spool is opened, and every record that can still be read is kept under its number.
//! Where the newest file is damaged, or ends in an incomplete record, nobody knows which numbers were given: another stream begins then, in a file of its own, with higher
//! numbers. Numbers therefore increase over all files, with gaps where records were lost.

use std::collections::VecDeque;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
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
    /// Bytes that were not written whole, or are damaged.
    pub torn_bytes: u64,
    /// Whether another stream begins because of them.
    pub is_new_stream: bool,
}

/// Records read at once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page {
    /// The stream that all of them belong to.
    pub stream: u64,
    /// Number of the first of them.
    pub from: u64,
    /// The records, in order, without gaps.
    pub records: Vec<Vec<u8>>,
}

/// A record in a file.
#[derive(Debug, Clone, Copy)]
struct Place {
    number: u64,
    /// Where it begins, with its header.
    offset: u64,
    /// Length with its header.
    size: u64,
}

/// One file.
#[derive(Debug)]
struct Segment {
    path: PathBuf,
    stream: u64,
    first: u64,
    /// Its records, by number.
    places: Vec<Place>,
    /// Number after the last one.
    next: u64,
    bytes: u64,
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
        let Read { mut segments, torn_bytes, is_newest_damaged, next } = Read::all(folder)?;
        let is_new_stream = is_newest_damaged && torn_bytes > 0;
        if segments.is_empty() || is_newest_damaged {
            let used = segments.iter().map(|segment| segment.stream).max().unwrap_or(0);
            // A clock that was set back names no stream a second time.
            let stream = new_stream.max(used + 1);
            let mut first = next;
            while segment_path(folder, first).exists() {
                first += 1;
            }
            segments.push_back(create(folder, stream, first)?);
        }
        let stream = segments.back().map_or(new_stream, |segment| segment.stream);
        let path = segments.back().map(|last| last.path.clone()).unwrap_or_default();
        let active = open_to_append(&path)?;
        let folder = folder.to_owned();
        let mut spool = Self { folder, budget_bytes, stream, segments, active, _lock: lock };
        spool.make_room(0)?;
        let records = spool.segments.iter().map(|segment| segment.places.len() as u64).sum();
        Ok((spool, Found { records, torn_bytes, is_new_stream }))
    }

    /// Names the series of numbers; another one begins where the folder was lost, or its newest file was damaged.
    #[must_use]
    pub fn stream(&self) -> u64 {
        self.stream
    }

    /// Number of the oldest record that is kept; [`Spool::next`] where there is none. All older ones fell out.
    #[must_use]
    pub fn first(&self) -> u64 {
        let mut records = self.segments.iter().flat_map(|segment| &segment.places);
        records.next().map_or(self.next(), |oldest| oldest.number)
    }

    /// Number of the next record. The first one has 1.
    #[must_use]
    pub fn next(&self) -> u64 {
        self.segments.back().map_or(1, |last| last.next)
    }

    /// Where a reader goes on that has received everything of `stream` before `number`: at the first record of the next stream where that one ended earlier, at the oldest
    /// record where nothing of it is kept.
    #[must_use]
    pub fn position(&self, stream: u64, number: u64) -> u64 {
        let Some(last) = self.segments.iter().rposition(|segment| segment.stream == stream) else {
            return self.first();
        };
        let after = self.segments.get(last + 1).map(|segment| segment.first);
        after.map_or(number, |after| number.min(after))
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
        last.places.push(Place { number, offset: last.bytes, size });
        last.next = number + 1;
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

    /// The records from number `from` on, or from the next one that is kept, in order, up to the next gap or the end of a stream: at most `bytes_max`, but one at least where
    /// there is one.
    ///
    /// # Errors
    /// See [`SpoolError`].
    pub fn page(&self, from: u64, bytes_max: usize) -> Result<Page, SpoolError> {
        let mut page = Page { stream: self.stream, from: self.next(), records: Vec::new() };
        let mut bytes = 0;
        for segment in self.segments.iter().filter(|segment| segment.next > from) {
            if !page.records.is_empty() && segment.stream != page.stream {
                return Ok(page);
            }
            let file = File::open(&segment.path).map_err(io_error("read", &segment.path))?;
            for place in segment.places.iter().filter(|place| place.number >= from) {
                if page.records.is_empty() {
                    (page.stream, page.from) = (segment.stream, place.number);
                } else if place.number != page.from + page.records.len() as u64 {
                    return Ok(page);
                }
                let mut record = vec![0; (place.size - RECORD_HEADER_BYTES) as usize];
                bytes += record.len();
                if bytes > bytes_max && !page.records.is_empty() {
                    return Ok(page);
                }
                let read = file.read_exact_at(&mut record, place.offset + RECORD_HEADER_BYTES);
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

fn segment_path(folder: &Path, first: u64) -> PathBuf {
    folder.join(format!("{first:020}.spool"))
}

fn create(folder: &Path, stream: u64, first: u64) -> Result<Segment, SpoolError> {
    let path = segment_path(folder, first);
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
    Ok(Segment { path, stream, first, places: Vec::new(), next: first, bytes: HEADER_BYTES })
}

/// What is in the folder.
struct Read {
    segments: VecDeque<Segment>,
    torn_bytes: u64,
    /// Whether the newest file is damaged: which numbers were given is not known.
    is_newest_damaged: bool,
    /// A number above all that are known.
    next: u64,
}

impl Read {
    fn all(folder: &Path) -> Result<Self, SpoolError> {
        let mut all =
            Self { segments: VecDeque::new(), torn_bytes: 0, is_newest_damaged: false, next: 1 };
        let mut scanned = Vec::new();
        for path in files(folder)? {
            match Scanned::read(&path)? {
                Some(file) => {
                    all.is_newest_damaged = file.torn_bytes > 0;
                    scanned.push(file);
                }
                // A file without a header, or one that holds nothing that can be read.
                None => {
                    let length = fs::metadata(&path).map_or(0, |file| file.len());
                    (all.torn_bytes, all.is_newest_damaged) = (all.torn_bytes + length, true);
                    all.next = all.next.max(number_of(&path).unwrap_or(1) + 1);
                    remove(&path)?;
                }
            }
        }
        // A file is made for a record. Without one, it ended before that was written, or lost it.
        if let Some(empty) = scanned.pop_if(|file| file.segment.bytes == HEADER_BYTES) {
            (all.next, all.is_newest_damaged) = (all.next.max(empty.segment.first), true);
            remove(&empty.segment.path)?;
        }
        let mut after = None;
        for file in scanned.into_iter().rev() {
            all.torn_bytes += file.torn_bytes;
            let stream = file.segment.stream;
            let segment = file.numbered(after);
            after = Some((stream, segment.first));
            all.next = all.next.max(segment.next);
            all.segments.push_front(segment);
        }
        Ok(all)
    }
}

/// A file with its records, those behind a damaged length not numbered yet.
struct Scanned {
    segment: Segment,
    /// Records behind a damaged length: their numbers are not known from their order alone.
    unnumbered: Vec<(Place, Option<u64>)>,
    torn_bytes: u64,
}

/// Stream and number that a message states.
#[derive(serde::Deserialize)]
struct Stated {
    stream: u64,
    number: u64,
}

fn stated(bytes: &[u8], place: Place) -> Option<Stated> {
    let record =
        (place.offset + RECORD_HEADER_BYTES) as usize..(place.offset + place.size) as usize;
    serde_json::from_slice(bytes.get(record)?).ok()
}

fn number_of(path: &Path) -> Option<u64> {
    path.file_stem()?.to_str()?.parse().ok()
}

impl Scanned {
    /// Reads the places of all whole records of a file; `None` where there is none that could be placed.
    fn read(path: &Path) -> Result<Option<Self>, SpoolError> {
        let bytes = fs::read(path).map_err(io_error("read", path))?;
        let Some(first) = number_of(path).filter(|_| bytes.len() as u64 >= HEADER_BYTES) else {
            return Ok(None);
        };
        let number_at = |offset: usize| {
            bytes.get(offset..)?.first_chunk().map(|bytes| u64::from_le_bytes(*bytes))
        };
        let header = number_at(16).filter(|_| bytes.starts_with(HEADER));
        let header = header.filter(|_| number_at(24) == Some(first));
        let length = bytes.len() as u64;
        let mut segment = Segment {
            path: path.to_owned(),
            stream: header.unwrap_or(0),
            first,
            places: Vec::new(),
            next: first,
            bytes: length,
        };
        let (mut unnumbered, mut torn_bytes) = (Vec::new(), 0);
        let (mut at, mut is_numbered) = (HEADER_BYTES, true);
        while at < length {
            if let Some(size) = whole_record(&bytes, at) {
                let place = Place { number: segment.next, offset: at, size };
                if is_numbered {
                    segment.places.push(place);
                    segment.next += 1;
                } else {
                    unnumbered.push((place, stated(&bytes, place).map(|stated| stated.number)));
                }
                at += size;
                continue;
            }
            // Its length is right if a whole record, or the end, follows it.
            let behind = stated_size(&bytes, at).map(|size| at + size);
            let is_framed =
                |behind: &u64| *behind == length || whole_record(&bytes, *behind).is_some();
            let next = match behind.filter(is_framed) {
                Some(behind) => {
                    segment.next += u64::from(is_numbered);
                    behind
                }
                None => {
                    is_numbered = false;
                    (at + 1..length).find(|at| is_filled_record(&bytes, *at)).unwrap_or(length)
                }
            };
            torn_bytes += next - at;
            at = next;
        }
        if header.is_none() {
            let mut known = segment.places.iter().chain(unnumbered.iter().map(|(place, _)| place));
            let Some(one) = known.find_map(|place| stated(&bytes, *place)) else { return Ok(None) };
            segment.stream = one.stream;
            torn_bytes += HEADER_BYTES;
        }
        Ok(Some(Self { segment, unnumbered, torn_bytes }))
    }

    /// Gives numbers to the records behind a damaged length: those that they state, or by the first number of the file `after` it, of the same stream.
    fn numbered(self, after: Option<(u64, u64)>) -> Segment {
        let Self { mut segment, unnumbered, .. } = self;
        let after = after.filter(|(stream, _)| *stream == segment.stream).map(|(_, first)| first);
        let count = unnumbered.len() as u64;
        for (k, (place, stated)) in unnumbered.into_iter().enumerate() {
            let by_order = after.and_then(|after| (after + k as u64).checked_sub(count));
            // Neither is taken where it contradicts the order.
            let fits =
                |number: &u64| *number >= segment.next && after.is_none_or(|after| *number < after);
            let Some(number) = stated.or(by_order).filter(fits) else { continue };
            segment.places.push(Place { number, ..place });
            segment.next = number + 1;
        }
        segment
    }
}

/// Length of the record at this place with its header, as it states it, within the file.
fn stated_size(bytes: &[u8], at: u64) -> Option<u64> {
    let length = bytes.get(usize::try_from(at).ok()?..)?.first_chunk()?;
    let size = RECORD_HEADER_BYTES + u64::from(u32::from_le_bytes(*length));
    (at + size <= bytes.len() as u64).then_some(size)
}

/// Size of the record at this place with its header; none where it is not whole.
fn whole_record(bytes: &[u8], at: u64) -> Option<u64> {
    let size = stated_size(bytes, at)?;
    let record = bytes.get(at as usize..(at + size) as usize)?;
    let (header, content) = record.split_at_checked(RECORD_HEADER_BYTES as usize)?;
    let crc = u32::from_le_bytes(*header.get(4..)?.first_chunk()?);
    (crc32fast::hash(content) == crc).then_some(size)
}

/// Whether a whole record with content begins here: zeros alone would be an empty one.
fn is_filled_record(bytes: &[u8], at: u64) -> bool {
    stated_size(bytes, at).is_some_and(|size| size > RECORD_HEADER_BYTES)
        && whole_record(bytes, at).is_some()
}
