//! Iterates over the records of an MCAP recording, complete or truncated.
//!
//! No input causes a panic; memory is limited to the current record.

use std::io::{self, Read};

use mcap::parse_record;
use mcap::records::{Record as McapRecord, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::McapRecordingError;

/// Bytes of an attachment record before its strings (two times) and after its data (checksum).
const ATTACHMENT_TIMES: usize = 16;
const ATTACHMENT_CRC: usize = 4;

/// Result of a scan.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct ScanResult {
    /// Why the scan ended early, if a record is invalid or truncated.
    pub(super) cut: Option<String>,
    /// Whether a footer was found.
    pub(super) has_footer: bool,
}

/// Passes every relevant record from a source of `bytes` bytes to `take`, whose error ends the
/// scan.
pub(super) fn scan(
    name: &str,
    source: impl Read,
    bytes: usize,
    take: &mut dyn FnMut(McapRecord<'_>) -> Result<(), McapRecordingError>,
) -> Result<ScanResult, McapRecordingError> {
    let refused = |source| McapRecordingError::Io { action: "read", path: name.into(), source };
    let mut head = Vec::new();
    let mut source = source.take(bytes as u64);
    source.by_ref().take(mcap::MAGIC.len() as u64).read_to_end(&mut head).map_err(refused)?;
    if head != mcap::MAGIC {
        let what = "is not an MCAP file (magic bytes missing)".to_owned();
        return Err(McapRecordingError::NotOurs { name: name.to_owned(), what });
    }
    let mut source = head.as_slice().chain(source);
    let options = LinearReaderOptions::default()
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        // No record is longer than the file: an invalid length allocates no memory.
        .with_record_length_limit(bytes);
    let mut reader = LinearReader::new_with_options(options);
    let mut scanned = ScanResult::default();
    let mut left = bytes;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let room = reader.insert(wanted.min(left));
                let given = full(&mut source, room).map_err(refused)?;
                reader.notify_read(given);
                // A file that was truncated meanwhile ends here.
                left = if given < wanted.min(left) { 0 } else { left - given };
            }
            Ok(LinearReadEvent::Record { data, opcode }) => match parse_used(opcode, data) {
                Ok(Some(McapRecord::Footer(_))) => scanned.has_footer = true,
                Ok(Some(record)) => take(record)?,
                Ok(None) => {}
                Err(cut) => {
                    scanned.cut = Some(cut);
                    break;
                }
            },
            Err(error) => {
                scanned.cut = Some(error.to_string());
                break;
            }
        }
    }
    Ok(scanned)
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
