//! The chunks of a WAV file: format and position of its samples.

use std::fs::File;
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt;

use crate::faults::Fault;

/// Format tags of `fmt`.
const PCM: u16 = 1;
const FLOAT: u16 = 3;
const EXTENSIBLE: u16 = 0xfffe;
/// What follows the format tag in an extensible format's GUID.
const GUID_TAIL: [u8; 14] = [0, 0, 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71];
/// An unknown size: of a file written to a pipe, or one stated by `ds64`.
const UNKNOWN_SIZE: u32 = u32::MAX;

/// How samples are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coding {
    /// Integers.
    Pcm,
    /// IEEE floating point.
    Float,
}

/// Content of `fmt`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Format {
    pub(super) coding: Coding,
    pub(super) big_endian: bool,
    pub(super) channels: usize,
    pub(super) rate_hz: u32,
    /// Bytes that one sample of one channel fills.
    pub(super) sample_bytes: usize,
    /// Number of valid bits.
    pub(super) valid_bits: u32,
}

/// A WAV file.
#[derive(Debug, Clone)]
pub(super) struct Wav {
    pub(super) format: Format,
    /// The bytes of whole frames of samples.
    pub(super) data: Range<u64>,
    pub(super) notes: Vec<String>,
}

/// Random access to bytes.
pub(super) trait Source {
    /// Their number.
    fn len(&self) -> io::Result<u64>;

    /// Fills `into` from `offset` on.
    fn read_at(&self, offset: u64, into: &mut [u8]) -> io::Result<()>;
}

impl Source for File {
    fn len(&self) -> io::Result<u64> {
        Ok(self.metadata()?.len())
    }

    fn read_at(&self, offset: u64, into: &mut [u8]) -> io::Result<()> {
        self.read_exact_at(into, offset)
    }
}

impl Source for &[u8] {
    fn len(&self) -> io::Result<u64> {
        Ok((**self).len() as u64)
    }

    fn read_at(&self, offset: u64, into: &mut [u8]) -> io::Result<()> {
        let from = usize::try_from(offset)
            .ok()
            .and_then(|offset| self.get(offset..offset.checked_add(into.len())?));
        into.copy_from_slice(from.ok_or(io::ErrorKind::UnexpectedEof)?);
        Ok(())
    }
}

/// Why a file is refused.
#[derive(Debug)]
pub(super) enum ChunkError {
    Fault(Box<Fault>),
    Io(io::Error),
}

impl From<Box<Fault>> for ChunkError {
    fn from(fault: Box<Fault>) -> Self {
        Self::Fault(fault)
    }
}

impl From<io::Error> for ChunkError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// A chunk, and the offset of its content.
struct Chunk {
    id: [u8; 4],
    size: u32,
    offset: u64,
    /// Bytes from there to the end of the file.
    rest: u64,
}

/// The bytes of a file, and their byte order.
struct Bytes<'a> {
    all: &'a dyn Source,
    length: u64,
    big_endian: bool,
}

impl Wav {
    /// Finds `fmt` and `data`.
    pub(super) fn read(all: &dyn Source) -> Result<Self, ChunkError> {
        let mut bytes = Bytes { all, length: all.len()?, big_endian: false };
        bytes.big_endian = match bytes.array(0)?.as_ref() {
            Some(b"RIFF" | b"RF64") => false,
            Some(b"RIFX") => true,
            _ => return Err(broken(0, "does not begin with RIFF, RIFX or RF64").into()),
        };
        if bytes.array(8)? != Some(*b"WAVE") {
            return Err(broken(8, "is a RIFF file, but not WAVE").into());
        }
        let (mut format, mut data_size, mut notes) = (None, None, Vec::new());
        let mut offset = 12;
        loop {
            let Some(chunk) = bytes.chunk(offset)? else {
                let what =
                    if format.is_some() { "has no `data` chunk" } else { "has no `fmt ` chunk" };
                return Err(broken(offset, what).into());
            };
            match &chunk.id {
                // 0 before the size is known: a pipe leaves it so.
                b"ds64" => {
                    data_size = bytes.number::<8>(chunk.offset + 8)?.filter(|size| *size > 0);
                }
                b"fmt " => format = Some(bytes.format(&chunk)?),
                b"data" => {
                    let Some(format) = format else {
                        return Err(broken(offset, "has `data` before `fmt `").into());
                    };
                    let data = bytes.samples(&chunk, data_size, &format, &mut notes)?;
                    return Ok(Self { format, data, notes });
                }
                _ => {}
            }
            offset = bytes.after(&chunk)?;
        }
    }
}

impl Chunk {
    fn is(&self, ids: &[&[u8; 4]]) -> bool {
        ids.contains(&&self.id)
    }

    /// Whether it is plausible: its name is printable and its bytes exist; samples may be
    /// truncated.
    fn is_sound(&self) -> bool {
        let is_named = self.id.iter().all(|byte| (b' '..=b'~').contains(byte));
        is_named && (u64::from(self.size) <= self.rest || self.is(&[b"data"]))
    }

    fn padded_end(&self) -> u64 {
        self.offset + u64::from(self.size) + u64::from(self.size % 2)
    }
}

/// What follows an offset in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tail {
    /// Chunks up to the file's end, or none.
    Chunks,
    /// Chunks, one of them with samples.
    Samples,
    /// Anything else.
    Other,
}

impl Bytes<'_> {
    /// The samples of `data`: the stated number, or up to the end if the size is unknown.
    fn samples(
        &self,
        chunk: &Chunk,
        data_size: Option<u64>,
        format: &Format,
        notes: &mut Vec<String>,
    ) -> Result<Range<u64>, ChunkError> {
        let is_of_pipe = data_size.is_none()
            && chunk.rest > 0
            && (chunk.size == UNKNOWN_SIZE
                || (chunk.size == 0 && self.tail(chunk.offset)? == Tail::Other));
        let stated = match (chunk.size, data_size) {
            _ if is_of_pipe => {
                notes.push(
                    "does not state its length (as written to a pipe); read to the end".to_owned(),
                );
                chunk.rest
            }
            (UNKNOWN_SIZE, Some(size)) => size,
            (size, _) => u64::from(size),
        };
        let available = stated.min(chunk.rest);
        if available < stated {
            let what =
                format!("is truncated: it contains {available} of {stated} bytes of samples");
            if available == 0 {
                return Err(broken(chunk.offset, what).into());
            }
            notes.push(what);
        }
        let frame = (format.channels * format.sample_bytes) as u64;
        let whole = available - available % frame;
        if whole < available && available == stated {
            notes.push(format!(
                "skipped the last {} bytes, an incomplete sample",
                available - whole
            ));
        }
        notes.extend(self.note_behind(chunk.offset + available)?);
        Ok(chunk.offset..chunk.offset + whole)
    }

    /// Notes what is ignored after the samples.
    fn note_behind(&self, end: u64) -> io::Result<Option<String>> {
        let behind = match self.tail(end + end % 2)? {
            Tail::Other => self.tail(end)?,
            tail => tail,
        };
        Ok(match behind {
            Tail::Chunks => None,
            Tail::Samples => Some("contains a second `data` chunk, which was skipped".to_owned()),
            Tail::Other => Some(format!(
                "skipped {} bytes after the samples that are not a chunk; the header may be outdated",
                self.length - end
            )),
        })
    }

    fn tail(&self, mut offset: u64) -> io::Result<Tail> {
        let mut tail = Tail::Chunks;
        while offset < self.length {
            let Some(chunk) = self.chunk(offset)?.filter(Chunk::is_sound) else {
                return Ok(Tail::Other);
            };
            if chunk.is(&[b"data"]) {
                tail = Tail::Samples;
            }
            offset = chunk.padded_end();
        }
        Ok(tail)
    }

    /// `N` bytes at an offset; `None` if the file ends before.
    fn array<const N: usize>(&self, offset: u64) -> io::Result<Option<[u8; N]>> {
        if offset.checked_add(N as u64).is_none_or(|end| end > self.length) {
            return Ok(None);
        }
        let mut bytes = [0; N];
        self.all.read_at(offset, &mut bytes)?;
        Ok(Some(bytes))
    }

    fn number<const N: usize>(&self, offset: u64) -> io::Result<Option<u64>> {
        let fold = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        let bytes = self.array::<N>(offset)?;
        Ok(bytes.map(|bytes| match self.big_endian {
            true => bytes.iter().fold(0, fold),
            false => bytes.iter().rev().fold(0, fold),
        }))
    }

    fn short(&self, offset: u64) -> io::Result<Option<u16>> {
        Ok(self.number::<2>(offset)?.and_then(|number| u16::try_from(number).ok()))
    }

    fn long(&self, offset: u64) -> io::Result<Option<u32>> {
        Ok(self.number::<4>(offset)?.and_then(|number| u32::try_from(number).ok()))
    }

    fn chunk(&self, offset: u64) -> io::Result<Option<Chunk>> {
        let (Some(id), Some(size)) = (self.array(offset)?, self.long(offset + 4)?) else {
            return Ok(None);
        };
        Ok(Some(Chunk { id, size, offset: offset + 8, rest: self.length - (offset + 8) }))
    }

    /// Start of the next chunk; a chunk of odd size is followed by a padding byte.
    fn after(&self, chunk: &Chunk) -> Result<u64, ChunkError> {
        let size = chunk.size;
        let name = String::from_utf8_lossy(&chunk.id).into_owned();
        if u64::from(size) > chunk.rest {
            let what = format!("chunk `{name}` of {size} bytes ends beyond the file");
            return Err(broken(chunk.offset, what).into());
        }
        let end = chunk.offset + u64::from(size);
        let padded = chunk.padded_end();
        let (unpadded, even) = (self.chunk(end)?, self.chunk(padded)?);
        let is_sound = |chunk: &Option<Chunk>| chunk.as_ref().is_some_and(Chunk::is_sound);
        let is_known = unpadded.as_ref().is_some_and(|unpadded| unpadded.is(&[b"data", b"fmt "]));
        if padded > end && (is_known || (is_sound(&unpadded) && !is_sound(&even))) {
            let what = format!(
                "chunk `{name}` of {size} bytes is not followed by the byte that makes its size even"
            );
            let fault = *broken(end, what);
            let help = "export it with a program that pads its chunks";
            return Err(Box::new(fault.help(help)).into());
        }
        Ok(padded)
    }

    fn format(&self, chunk: &Chunk) -> Result<Format, ChunkError> {
        let short = |offset: u64| self.short(chunk.offset + offset);
        let bad = |what: String| {
            Box::new(Fault::new("fmt", what).expected("PCM, or IEEE floats of 32 or 64 bits"))
        };
        let (tag, channels, rate_hz, block, bits) =
            (short(0)?, short(2)?, self.long(chunk.offset + 4)?, short(12)?, short(14)?);
        let (Some(mut tag), Some(channels), Some(rate_hz), Some(block), Some(bits), true) =
            (tag, channels, rate_hz, block, bits, chunk.size >= 16)
        else {
            return Err(bad(format!("has {} bytes, too few for a format", chunk.size)).into());
        };
        let mut valid_bits = bits;
        if tag == EXTENSIBLE {
            let guid = self.array::<16>(chunk.offset + 24)?.filter(|_| chunk.size >= 40);
            let Some(guid) = guid else {
                return Err(bad("is extensible but too short for its sub-format".to_owned()).into());
            };
            valid_bits = short(18)?.unwrap_or(bits);
            // A GUID's first number is in the file's byte order, or in little-endian order.
            let tail = guid.get(2..).unwrap_or_default();
            if tail != GUID_TAIL && !self.big_endian {
                return Err(
                    bad("has a sub-format that is not a standard WAVE format".to_owned()).into()
                );
            }
            let first = short(24)?;
            tag = match self.big_endian {
                true => short(26)?.filter(|tag| *tag != 0).or(first),
                false => first,
            }
            .unwrap_or(0);
        }
        let layout = Layout { channels, rate_hz, block, bits, valid_bits };
        Ok(self.checked(tag, layout).map_err(bad)?)
    }

    fn checked(&self, tag: u16, layout: Layout) -> Result<Format, String> {
        let Layout { channels, rate_hz, block, bits, valid_bits } = layout;
        let coding = match tag {
            PCM => Coding::Pcm,
            FLOAT => Coding::Float,
            2 | 0x11 => return Err("is ADPCM, which is compressed".to_owned()),
            6 => return Err("is A-law, which is companded".to_owned()),
            7 => return Err("is µ-law, which is companded".to_owned()),
            0x55 => return Err("is MP3, which is compressed".to_owned()),
            other => return Err(format!("has the unsupported format tag {other}")),
        };
        if channels == 0 || bits == 0 || bits > 64 || block == 0 || block % channels != 0 {
            return Err(format!(
                "has {channels} channels of {bits} bits in blocks of {block} bytes"
            ));
        }
        let sample_bytes = usize::from(block / channels);
        let fits =
            |bits: u16| bits > 0 && usize::from(bits) <= 8 * sample_bytes && sample_bytes <= 8;
        let float = coding == Coding::Pcm
            || (bits == 32 && sample_bytes == 4)
            || (bits == 64 && sample_bytes == 8);
        if !fits(bits) || !float {
            return Err(format!("has samples of {bits} bits in {sample_bytes} bytes"));
        }
        // Zero means all of them.
        let valid_bits = if valid_bits == 0 { bits } else { valid_bits.min(bits) };
        Ok(Format {
            coding,
            big_endian: self.big_endian,
            channels: usize::from(channels),
            rate_hz,
            sample_bytes,
            valid_bits: u32::from(valid_bits),
        })
    }
}

/// Numbers of `fmt` that have to fit together.
#[derive(Clone, Copy)]
struct Layout {
    channels: u16,
    rate_hz: u32,
    block: u16,
    bits: u16,
    valid_bits: u16,
}

fn broken(offset: u64, what: impl Into<String>) -> Box<Fault> {
    Box::new(Fault::new(format!("byte {offset}"), what.into()).expected("a complete WAV file"))
}
