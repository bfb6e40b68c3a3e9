//! Iterates over the records of an MCAP recording: complete, truncated, or damaged inside.
//!
//! Chunk by chunk: a chunk whose checksum or structure is wrong is skipped and listed as
//! [`Damage`], with the number of its messages where its message index tells it. Where the length of
//! a record is wrong, the next chunk is searched by its structure (two lengths that agree). Damage
//! outside of chunks that leaves a record readable is not detected: such records have no checksum.
//!
//! No input causes a panic; memory is limited to the current record.

use std::fmt;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::parse_record;
use mcap::records::{Record as McapRecord, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::McapRecordingError;
use super::clock::Utc;

/// Bytes of an attachment record before its strings (two times) and after its data (checksum).
const ATTACHMENT_TIMES: usize = 16;
const ATTACHMENT_CRC: usize = 4;
/// Bytes of a record before its data: its type and its length.
const RECORD_HEAD: usize = 9;
/// Bytes of a chunk record before its records, without compression.
const CHUNK_HEAD: usize = 40;
/// Bytes of an entry of a message index: time and offset of one message.
const INDEX_ENTRY: usize = 16;
/// Bytes of a footer: two offsets and a checksum.
const FOOTER: usize = 20;
/// Bytes that are searched at once for the next chunk.
const SEARCH_BYTES: usize = 64 * 1024;

/// A part of a recording that cannot be read; what follows it was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// Where it begins in the file, bytes.
    pub at_byte: u64,
    /// Its length, bytes.
    pub bytes: u64,
    /// What is wrong.
    pub why: String,
    /// Number of messages in it; `None` if no message index tells it.
    pub messages: Option<u64>,
    /// Log times of its first and last message, ns since 1970, as the chunk states them.
    pub between_ns: Option<(u64, u64)>,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { at_byte, bytes, why, messages, between_ns } = self;
        write!(f, "chunk at byte {at_byte} ({bytes} bytes")?;
        if let Some((first, last)) = between_ns {
            write!(f, ", {} to {}", Utc(*first), Utc(*last))?;
        }
        write!(f, "): {why}; ")?;
        match messages {
            Some(1) => f.write_str("1 message lost"),
            Some(count) => write!(f, "{count} messages lost"),
            None => f.write_str("an unknown number of messages lost"),
        }
    }
}

/// Number of messages in damaged parts; `None` if it is unknown for one of them.
#[must_use]
pub fn messages_lost(damage: &[Damage]) -> Option<u64> {
    damage.iter().map(|part| part.messages).sum()
}

/// Result of a scan.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct ScanResult {
    /// Why the scan ended early, if the file is truncated or nothing readable follows.
    pub(super) cut: Option<String>,
    /// Whether a footer was found.
    pub(super) has_footer: bool,
    /// Parts that were skipped.
    pub(super) damage: Vec<Damage>,
}

type Take<'t> = &'t mut dyn FnMut(McapRecord<'_>) -> Result<(), McapRecordingError>;

/// Passes every relevant record from a source of `bytes` bytes to `take`, whose error ends the
/// scan.
///
/// # Errors
/// The source cannot be read, is not an MCAP file, or has compressed chunks.
pub(super) fn scan(
    name: &str,
    source: impl Read + Seek,
    bytes: usize,
    take: Take<'_>,
) -> Result<ScanResult, McapRecordingError> {
    let mut scan = Scan {
        name,
        source,
        bytes: bytes as u64,
        take,
        body: Vec::new(),
        before: Before::Other(0),
        trusted: 0,
        has_definitions: false,
        result: ScanResult::default(),
    };
    let magic = scan.read_at(0, mcap::MAGIC.len() as u64)?;
    if !magic || scan.body != mcap::MAGIC {
        let what = "is not an MCAP file (magic bytes missing)".to_owned();
        return Err(McapRecordingError::NotOurs { name: name.to_owned(), what });
    }
    let mut at = mcap::MAGIC.len() as u64;
    scan.trusted = at;
    while let Some(next) = scan.step(at)? {
        at = next;
    }
    Ok(scan.result)
}

/// What precedes a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Before {
    /// A chunk that was read, or one of its message indexes.
    Chunk,
    /// A damaged part, of which so many messages were read nevertheless, or one of its message
    /// indexes.
    Damage { read: u64 },
    /// Another record, which begins here.
    Other(u64),
}

/// What a record's data turned out to be.
enum Found {
    /// It was read; its length is confirmed by its content.
    Whole,
    /// It was read, or is of a type that is not used.
    Read,
    /// The footer: the end.
    End,
    /// It cannot be read.
    Broken(String),
}

struct Scan<'t, S> {
    name: &'t str,
    source: S,
    bytes: u64,
    take: Take<'t>,
    /// Data of the current record.
    body: Vec<u8>,
    before: Before,
    /// End of the last record whose length is certain.
    trusted: u64,
    /// Whether the topics of the messages are known.
    has_definitions: bool,
    result: ScanResult,
}

impl<S: Read + Seek> Scan<'_, S> {
    /// Reads the record at this place; returns the place of the next one, if there is one.
    fn step(&mut self, at: u64) -> Result<Option<u64>, McapRecordingError> {
        let left = self.bytes.saturating_sub(at);
        if left == 0 {
            return Ok(None);
        }
        if !self.read(RECORD_HEAD as u64)? {
            return self.resync(at, at, "the file ends within a record".to_owned());
        }
        let Some((opcode, length)) = record_head(&self.body) else { return Ok(None) };
        if length > left - RECORD_HEAD as u64 {
            let why = format!("a record of {length} bytes at byte {at} exceeds the file");
            return self.resync(at, self.trusted, why);
        }
        if !self.read(length)? {
            self.result.cut = Some("the file was truncated while it was read".to_owned());
            return Ok(None);
        }
        let end = at + RECORD_HEAD as u64 + length;
        let found = match opcode {
            _ if opcode == op::CHUNK || is_chunk_head(&self.body, self.body.len()) => {
                return self.chunk(opcode, at, end);
            }
            op::MESSAGE_INDEX => self.message_index(at),
            _ => self.record(opcode)?,
        };
        if let Found::Broken(why) = found {
            return self.broken(opcode, at, end, why);
        }
        if !matches!(found, Found::Read) {
            self.trusted = end;
        }
        if opcode != op::MESSAGE_INDEX {
            self.before = Before::Other(at);
        }
        Ok((!matches!(found, Found::End)).then_some(end))
    }

    /// A record outside of chunks.
    fn record(&mut self, opcode: u8) -> Result<Found, McapRecordingError> {
        match parse_used(opcode, &self.body) {
            Ok(Some(McapRecord::Footer(_))) => {
                self.result.has_footer = true;
                Ok(Found::End)
            }
            Ok(Some(record)) => {
                self.has_definitions |= matches!(record, McapRecord::Channel(_));
                (self.take)(record)?;
                Ok(Found::Read)
            }
            Ok(None) => Ok(Found::Read),
            Err(why) => Ok(Found::Broken(why)),
        }
    }

    /// Counts the messages of a damaged chunk by its index. An index without a chunk before it tells
    /// that the record before it was one.
    fn message_index(&mut self, at: u64) -> Found {
        let entries = self.body.get(2..).map(RecordStrings).and_then(RecordStrings::length);
        let Some((length, rest)) = entries else {
            return Found::Broken("a message index is too short".to_owned());
        };
        if length != rest.len() || length % INDEX_ENTRY != 0 {
            return Found::Broken("a message index has an invalid length".to_owned());
        }
        let count = (length / INDEX_ENTRY) as u64;
        if let Before::Other(from) = self.before {
            self.before = Before::Damage { read: 0 };
            let why = "another record in the place of a chunk".to_owned();
            self.result.damage.push(Damage {
                at_byte: from,
                bytes: at - from,
                why,
                messages: None,
                between_ns: None,
            });
        }
        if let (Before::Damage { read }, Some(part)) =
            (&mut self.before, self.result.damage.last_mut())
        {
            let lost = count.saturating_sub(*read);
            *read = read.saturating_sub(count);
            part.messages = Some(part.messages.unwrap_or(0) + lost);
        }
        Found::Whole
    }

    /// A chunk, whose data is in `body`; its type may be wrong.
    fn chunk(&mut self, opcode: u8, at: u64, end: u64) -> Result<Option<u64>, McapRecordingError> {
        if let Some(compression) = compression(&self.body) {
            let what = format!(
                "its chunks are compressed ({compression}); decompress it first, with `mcap decompress`"
            );
            return Err(McapRecordingError::NotOurs { name: self.name.to_owned(), what });
        }
        if !is_chunk_head(&self.body, self.body.len()) {
            let why = "the lengths in the chunk disagree".to_owned();
            return self.resync(at, at, why);
        }
        let mut read = 0;
        let why = read_chunk(&self.body, &mut |opcode, data| match parse_used(opcode, data) {
            Ok(None) => Ok(None),
            Ok(Some(record)) => {
                self.has_definitions |= matches!(record, McapRecord::Channel(_));
                read += u64::from(matches!(record, McapRecord::Message { .. }));
                (self.take)(record).map(|()| None)
            }
            Err(why) => Ok(Some(why)),
        })?;
        self.trusted = end;
        self.before = Before::Chunk;
        let wrong_type =
            (opcode != op::CHUNK).then(|| "the type of the record is wrong".to_owned());
        // The message index says how many were not read.
        let messages = if why.is_none() { Some(0) } else { None };
        if let Some(why) = why.or(wrong_type) {
            self.before = Before::Damage { read };
            self.result.damage.push(Damage {
                at_byte: at,
                bytes: end - at,
                why,
                messages,
                between_ns: times(&self.body),
            });
            self.find_definitions(end)?;
        }
        Ok(Some(end))
    }

    /// After a record that cannot be read: goes on behind it if another record begins there.
    fn broken(
        &mut self,
        opcode: u8,
        at: u64,
        end: u64,
        why: String,
    ) -> Result<Option<u64>, McapRecordingError> {
        let is_followed = end + RECORD_HEAD as u64 <= self.bytes
            && self.read_at(end, RECORD_HEAD as u64)?
            && record_head(&self.body).is_some_and(|(opcode, length)| {
                (op::HEADER..=op::DATA_END).contains(&opcode)
                    && length <= self.bytes - end - RECORD_HEAD as u64
            });
        self.seek(end)?;
        if !is_followed {
            return self.resync(at, at, why);
        }
        if opcode == op::MESSAGE_INDEX {
            // It holds no messages; those of its chunk were read or counted.
            return Ok(Some(end));
        }
        self.before = Before::Damage { read: 0 };
        self.result.damage.push(Damage {
            at_byte: at,
            bytes: end - at,
            why,
            messages: None,
            between_ns: None,
        });
        self.find_definitions(end)?;
        Ok(Some(end))
    }

    /// Where the length of a record cannot be right: goes on with the next chunk after `from`.
    fn resync(
        &mut self,
        at: u64,
        from: u64,
        why: String,
    ) -> Result<Option<u64>, McapRecordingError> {
        let Some(next) = self.next_chunk(from + 1)? else {
            self.result.cut = Some(why);
            return Ok(None);
        };
        self.before = Before::Chunk;
        self.trusted = next;
        // Where only what lies before the wrong length may be wrong, that part is named too.
        let at_byte = from.min(at);
        self.result.damage.push(Damage {
            at_byte,
            bytes: next - at_byte,
            why,
            messages: None,
            between_ns: None,
        });
        self.find_definitions(next)?;
        Ok(Some(next))
    }

    /// The first place from `from` on where a complete chunk begins, by its lengths.
    fn next_chunk(&mut self, from: u64) -> Result<Option<u64>, McapRecordingError> {
        let head = RECORD_HEAD + CHUNK_HEAD;
        let mut at = from;
        while at + head as u64 <= self.bytes {
            let wanted = (self.bytes - at).min((SEARCH_BYTES + head) as u64);
            if !self.read_at(at, wanted)? {
                return Ok(None);
            }
            for (place, window) in self.body.windows(head).enumerate() {
                let (record, chunk) = window.split_at(RECORD_HEAD);
                let Some((op::CHUNK, length)) = record_head(record) else { continue };
                let left = self.bytes - at - (place + RECORD_HEAD) as u64;
                let Ok(bytes) = usize::try_from(length) else { continue };
                if length <= left && is_chunk_head(chunk, bytes) {
                    return Ok(Some(at + place as u64));
                }
            }
            at += wanted - head as u64 + 1;
        }
        Ok(None)
    }

    /// After damage: takes schemas and channels from the end of a closed file, or, where none was
    /// seen, from the damaged chunk in `body`. Then goes on at `next`.
    fn find_definitions(&mut self, next: u64) -> Result<(), McapRecordingError> {
        if !self.has_definitions {
            let chunk = std::mem::take(&mut self.body);
            if !self.definitions_at_end()? && is_chunk_head(&chunk, chunk.len()) {
                self.take_definitions(chunk.get(CHUNK_HEAD..).unwrap_or_default())?;
            }
        }
        self.seek(next)
    }

    /// Whether schemas and channels stand at the end of the file; they are taken then.
    fn definitions_at_end(&mut self) -> Result<bool, McapRecordingError> {
        let end = self.bytes.saturating_sub((RECORD_HEAD + FOOTER + mcap::MAGIC.len()) as u64);
        if !self.read_at(end, self.bytes - end)? || !self.body.ends_with(mcap::MAGIC) {
            return Ok(false);
        }
        let footer = record_head(&self.body).filter(|(opcode, _)| *opcode == op::FOOTER);
        let start = self.body.get(RECORD_HEAD..).and_then(|footer| number(footer, 0));
        let Some(start) = start.filter(|start| footer.is_some() && (1..end).contains(start)) else {
            return Ok(false);
        };
        if self.read_at(start, end - start)? {
            let summary = std::mem::take(&mut self.body);
            self.take_definitions(&summary)?;
        }
        Ok(self.has_definitions)
    }

    /// Takes the schemas and channels of these records, as far as they can be read.
    fn take_definitions(&mut self, mut records: &[u8]) -> Result<(), McapRecordingError> {
        while let Some((opcode, length)) = record_head(records) {
            let rest = records.get(RECORD_HEAD..).unwrap_or_default();
            let Some((data, behind)) =
                usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length))
            else {
                break;
            };
            if matches!(opcode, op::SCHEMA | op::CHANNEL)
                && let Ok(Some(record)) = parse_used(opcode, data)
            {
                self.has_definitions |= opcode == op::CHANNEL;
                (self.take)(record)?;
            }
            records = behind;
        }
        Ok(())
    }

    fn seek(&mut self, at: u64) -> Result<(), McapRecordingError> {
        self.source.seek(SeekFrom::Start(at)).map(drop).map_err(|source| self.refused(source))
    }

    fn read_at(&mut self, at: u64, bytes: u64) -> Result<bool, McapRecordingError> {
        self.seek(at)?;
        self.read(bytes)
    }

    /// Fills `body`; `false` if the source ends before.
    fn read(&mut self, bytes: u64) -> Result<bool, McapRecordingError> {
        self.body.clear();
        let read = self.source.by_ref().take(bytes).read_to_end(&mut self.body);
        read.map(|count| count as u64 == bytes).map_err(|source| self.refused(source))
    }

    fn refused(&self, source: io::Error) -> McapRecordingError {
        McapRecordingError::Io { action: "read", path: self.name.into(), source }
    }
}

/// Type and length of a record.
fn record_head(bytes: &[u8]) -> Option<(u8, u64)> {
    Some((*bytes.first()?, number(bytes, 1)?))
}

/// The 64-bit number at this place.
fn number(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

/// Whether this is the beginning of a chunk record of `bytes` bytes without compression: its lengths
/// agree.
fn is_chunk_head(chunk: &[u8], bytes: usize) -> bool {
    let records = bytes.checked_sub(CHUNK_HEAD).map(|records| records as u64);
    records.is_some()
        && number(chunk, 16) == records
        && number(chunk, 32) == records
        && chunk.get(28..32) == Some(&[0; 4])
}

/// The compression of a chunk, if it has one that MCAP defines.
fn compression(chunk: &[u8]) -> Option<&'static str> {
    let (length, rest) = RecordStrings(chunk.get(28..)?).length()?;
    let name = rest.get(..length)?;
    ["zstd", "lz4"].into_iter().find(|known| known.as_bytes() == name)
}

/// The times that a chunk states.
fn times(chunk: &[u8]) -> Option<(u64, u64)> {
    let times = (number(chunk, 0)?, number(chunk, 8)?);
    (times.0 <= times.1).then_some(times)
}

type TakeRaw<'t> = &'t mut dyn FnMut(u8, &[u8]) -> Result<Option<String>, McapRecordingError>;

/// Passes the records of a chunk to `take` after its checksum was compared; returns what is wrong
/// with it.
fn read_chunk(chunk: &[u8], take: TakeRaw<'_>) -> Result<Option<String>, McapRecordingError> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(chunk.len());
    let mut reader = LinearReader::new_with_options(options);
    let mut record = vec![op::CHUNK];
    record.extend_from_slice(&(chunk.len() as u64).to_le_bytes());
    let mut source = record.as_slice().chain(chunk);
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let room = reader.insert(wanted);
                // A slice is read without errors.
                let given = full(&mut source, room).unwrap_or(0);
                reader.notify_read(given);
                if given == 0 {
                    break;
                }
            }
            Ok(LinearReadEvent::Record { data, opcode }) => {
                if let Some(why) = take(opcode, data)? {
                    return Ok(Some(why));
                }
            }
            Err(error) => return Ok(Some(error.to_string())),
        }
    }
    Ok(None)
}

/// Fills the buffer as far as possible; returns the length.
fn full(source: &mut impl Read, room: &mut [u8]) -> io::Result<usize> {
    let mut given = 0;
    while given < room.len() {
        match source.read(&mut room[given..]) {
            Ok(0) => break,
            Ok(more) => given += more,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(given)
}

/// The record, or `None` if its kind is not used; an error says why the scan ends here.
fn parse_used(opcode: u8, data: &[u8]) -> Result<Option<McapRecord<'_>>, String> {
    // The library allocates memory for a string before it checks its length.
    let fits = match opcode {
        op::METADATA => RecordStrings(data).text().and_then(RecordStrings::pairs).is_some(),
        op::CHANNEL => {
            let texts = data.get(4..).map(RecordStrings);
            texts
                .and_then(RecordStrings::text)
                .and_then(RecordStrings::text)
                .and_then(RecordStrings::pairs)
                .is_some()
        }
        op::SCHEMA => {
            let texts = data.get(2..).map(RecordStrings);
            let data = texts.and_then(RecordStrings::text).and_then(RecordStrings::text);
            data.and_then(RecordStrings::text).is_some()
        }
        op::ATTACHMENT => attachment_fits(data),
        op::CHUNK_INDEX => chunk_index_fits(data),
        op::MESSAGE | op::FOOTER | op::DATA_END => true,
        _ => return Ok(None),
    };
    if !fits {
        return Err("a string is longer than its record".to_owned());
    }
    parse_record(opcode, data).map(Some).map_err(|error| error.to_string())
}

fn attachment_fits(data: &[u8]) -> bool {
    let texts = data.get(ATTACHMENT_TIMES..).map(RecordStrings);
    let Some(RecordStrings(rest)) =
        texts.and_then(RecordStrings::text).and_then(RecordStrings::text)
    else {
        return false;
    };
    let Some((length, rest)) = rest.split_first_chunk() else { return false };
    usize::try_from(u64::from_le_bytes(*length))
        .ok()
        .and_then(|length| length.checked_add(ATTACHMENT_CRC))
        .is_some_and(|length| length == rest.len())
}

/// The map follows four 64-bit numbers, the string follows one more.
fn chunk_index_fits(data: &[u8]) -> bool {
    let map = data.get(32..).map(RecordStrings).and_then(RecordStrings::text);
    map.and_then(|RecordStrings(rest)| rest.get(8..))
        .map(RecordStrings)
        .and_then(RecordStrings::text)
        .is_some()
}

/// Consecutive strings in a record, each after its length.
struct RecordStrings<'d>(&'d [u8]);

impl<'d> RecordStrings<'d> {
    /// The leading length, and the rest.
    fn length(self) -> Option<(usize, &'d [u8])> {
        let (length, rest) = self.0.split_first_chunk()?;
        Some((usize::try_from(u32::from_le_bytes(*length)).ok()?, rest))
    }

    /// The rest after the first string; `None` if that is longer than the record.
    fn text(self) -> Option<Self> {
        let (length, rest) = self.length()?;
        rest.get(length..).map(Self)
    }

    /// The rest after a map of string pairs.
    fn pairs(self) -> Option<Self> {
        let (length, rest) = self.length()?;
        let (pairs, behind) = rest.split_at_checked(length)?;
        let mut texts = Self(pairs);
        while !texts.0.is_empty() {
            texts = texts.text()?.text()?;
        }
        Some(Self(behind))
    }
}
