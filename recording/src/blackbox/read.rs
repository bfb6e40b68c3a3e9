//! Reading a black box, whole or cut off.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use mcap::parse_record;
use mcap::records::{Record as McapRecord, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::records::Record;
use super::{BlackBoxError, Header};
use physics::JointKind;

/// Name of the metadata record that holds the header.
pub(super) const METADATA: &str = "trued";
/// Name of the metadata records that hold the models that took the place of the header's.
pub(super) const MODEL_CHANGE: &str = "trued.model_change";

/// A model that took the place of the one before.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModelChange {
    /// When the cycle had it, `CLOCK_MONOTONIC`, ns.
    pub t_ns: u64,
    /// The header with that model.
    pub header: Header,
}

/// What a black box holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Contents {
    /// The run as a whole.
    pub header: Header,
    /// The models that were loaded while the file was written, oldest first.
    pub model_changes: Vec<ModelChange>,
    /// The records in the order in which they were written.
    pub records: Vec<Record>,
    /// Why the file ends early, where it does; the records up to there are whole.
    pub cut: Option<String>,
    /// Messages of other topics, or of a form that this version does not know.
    pub unknown: usize,
}

/// Reads a black box. No more of the file is held than the record at hand.
///
/// # Errors
/// The file cannot be read, or is no black box. One that is cut off is read as far as it goes.
pub fn read(path: &Path) -> Result<Contents, BlackBoxError> {
    let refused = |source| BlackBoxError::Io { action: "read", path: path.to_owned(), source };
    let file = File::open(path).map_err(refused)?;
    let metadata = file.metadata().map_err(refused)?;
    let name = path.display().to_string();
    if !metadata.is_file() {
        // Of a pipe nobody knows how long it is.
        let mut bytes = Vec::new();
        (&file).read_to_end(&mut bytes).map_err(refused)?;
        return read_bytes(&name, &bytes);
    }
    let bytes = usize::try_from(metadata.len()).unwrap_or(usize::MAX);
    read_from(&name, BufReader::new(file), bytes, refused)
}

/// Reads a black box from memory.
///
/// # Errors
/// The bytes are no black box.
pub fn read_bytes(name: &str, bytes: &[u8]) -> Result<Contents, BlackBoxError> {
    let refused = |source| BlackBoxError::Io { action: "read", path: name.into(), source };
    read_from(name, bytes, bytes.len(), refused)
}

/// Reads a black box from a source of so many bytes.
fn read_from(
    name: &str,
    source: impl Read,
    bytes: usize,
    refused: impl Fn(io::Error) -> BlackBoxError,
) -> Result<Contents, BlackBoxError> {
    let not_ours =
        |what: &str| BlackBoxError::NotOurs { name: name.to_owned(), what: what.to_owned() };
    let mut head = Vec::new();
    let mut source = source.take(bytes as u64);
    source.by_ref().take(mcap::MAGIC.len() as u64).read_to_end(&mut head).map_err(&refused)?;
    if head != mcap::MAGIC {
        return Err(not_ours("does not begin as MCAP does"));
    }
    let mut source = head.as_slice().chain(source);
    let options = LinearReaderOptions::default()
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        // No record is longer than the file: a broken length asks for no memory.
        .with_record_length_limit(bytes);
    let mut reader = LinearReader::new_with_options(options);
    let mut gathered = Gathered::default();
    let mut left = bytes;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let room = reader.insert(wanted.min(left));
                let given = full(&mut source, room).map_err(&refused)?;
                reader.notify_read(given);
                // A file that has grown shorter ends here.
                left = if given < wanted.min(left) { 0 } else { left - given };
            }
            Ok(LinearReadEvent::Record { data, opcode }) => match of_use(opcode, data) {
                Ok(Some(record)) => gathered.take(record),
                Ok(None) => {}
                Err(cut) => {
                    gathered.contents.cut = Some(cut);
                    break;
                }
            },
            Err(error) => {
                gathered.contents.cut = Some(error.to_string());
                break;
            }
        }
    }
    if gathered.has_header { Ok(gathered.contents) } else { Err(not_ours("has no header of ours")) }
}

/// Fills the room as far as the source goes; how much that was.
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

/// A record, where it is of a kind that is looked at; else why the file ends here.
fn of_use(opcode: u8, data: &[u8]) -> Result<Option<McapRecord<'_>>, String> {
    // The library takes memory for a text before it looks whether there is as much of it.
    let fits = match opcode {
        op::METADATA => Texts(data).text().and_then(Texts::pairs).is_some(),
        op::CHANNEL => {
            let texts = data.get(4..).map(Texts);
            texts.and_then(Texts::text).and_then(Texts::text).and_then(Texts::pairs).is_some()
        }
        op::MESSAGE => true,
        _ => return Ok(None),
    };
    if !fits {
        return Err("a text is longer than the record that it stands in".to_owned());
    }
    parse_record(opcode, data).map(Some).map_err(|error| error.to_string())
}

/// Texts in a row as they stand in a record, each behind its length.
struct Texts<'d>(&'d [u8]);

impl<'d> Texts<'d> {
    /// The length that stands first, and what follows it.
    fn length(self) -> Option<(usize, &'d [u8])> {
        let (length, rest) = self.0.split_first_chunk()?;
        Some((usize::try_from(u32::from_le_bytes(*length)).ok()?, rest))
    }

    /// Behind the first text; none where it is longer than what there is.
    fn text(self) -> Option<Self> {
        let (length, rest) = self.length()?;
        rest.get(length..).map(Self)
    }

    /// Behind a list of pairs.
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

#[derive(Default)]
struct Gathered {
    contents: Contents,
    has_header: bool,
    topics: BTreeMap<u16, String>,
}

impl Gathered {
    fn take(&mut self, record: McapRecord<'_>) {
        match record {
            McapRecord::Metadata(metadata) if metadata.name == METADATA => {
                self.has_header = true;
                self.contents.header = header(&metadata.metadata);
            }
            McapRecord::Metadata(metadata) if metadata.name == MODEL_CHANGE => {
                let t_ns = metadata.metadata.get("t_ns").and_then(|t_ns| t_ns.parse().ok());
                let header = header(&metadata.metadata);
                self.contents.model_changes.push(ModelChange { t_ns: t_ns.unwrap_or(0), header });
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

fn header(pairs: &BTreeMap<String, String>) -> Header {
    let text = |key: &str| pairs.get(key).cloned().unwrap_or_default();
    let joint =
        |letter: char| if letter == 'P' { JointKind::Prismatic } else { JointKind::Revolute };
    let words = |key: &str| match pairs.get(key).map(String::as_str) {
        None | Some("") => Vec::new(),
        Some(words) => words.split('\n').map(str::to_owned).collect(),
    };
    let number = |key: &str| u64::from_str_radix(&text(key), 16).unwrap_or(0);
    Header {
        cell: text("cell"),
        version: text("version"),
        model_hash: number("model_hash"),
        robot: text("robot"),
        geometry_hash: number("geometry_hash"),
        model: text("model"),
        config: text("config"),
        joints: text("joints").chars().map(joint).collect(),
        status_words: words("status_words"),
        reason_words: words("reason_words"),
    }
}
