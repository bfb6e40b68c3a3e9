//! The chunks of a WAV file: what its samples are, and where.

use crate::faults::Fault;

/// Format tags of `fmt`.
const PCM: u16 = 1;
const FLOAT: u16 = 3;
const EXTENSIBLE: u16 = 0xfffe;
/// What follows the format tag in an extensible format's GUID.
const GUID_TAIL: [u8; 14] = [0, 0, 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71];
/// A size that is not known: of a file that was written to a pipe, or one that `ds64` tells.
const UNKNOWN_SIZE: u32 = u32::MAX;

/// How samples are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coding {
    /// Whole numbers.
    Pcm,
    /// IEEE floating point.
    Float,
}

/// What `fmt` says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Format {
    pub(super) coding: Coding,
    pub(super) big_endian: bool,
    pub(super) channels: usize,
    pub(super) rate_hz: u32,
    /// Bytes that one sample of one channel fills.
    pub(super) sample_bytes: usize,
    /// Of their bits, how many count.
    pub(super) valid_bits: u32,
}

/// A WAV file.
#[derive(Debug, Clone)]
pub(super) struct Wav<'a> {
    pub(super) format: Format,
    /// Whole frames of samples.
    pub(super) data: &'a [u8],
    pub(super) notes: Vec<String>,
}

/// A chunk and where it begins.
struct Chunk<'a> {
    id: [u8; 4],
    size: u32,
    at: usize,
    /// From its first byte to the end of the file.
    rest: &'a [u8],
}

/// The bytes of a file, and in which order its numbers are.
#[derive(Clone, Copy)]
struct Bytes<'a> {
    all: &'a [u8],
    big_endian: bool,
}

impl<'a> Wav<'a> {
    /// Finds `fmt` and `data`.
    pub(super) fn read(all: &'a [u8]) -> Result<Self, Box<Fault>> {
        let big_endian = match all.get(..4) {
            Some(b"RIFF" | b"RF64") => false,
            Some(b"RIFX") => true,
            _ => return Err(broken(0, "does not begin with RIFF, RIFX or RF64")),
        };
        if all.get(8..12) != Some(b"WAVE") {
            return Err(broken(8, "is a RIFF file of another kind than WAVE"));
        }
        let bytes = Bytes { all, big_endian };
        let (mut format, mut data_size, mut notes) = (None, None, Vec::new());
        let mut at = 12;
        loop {
            let Some(chunk) = bytes.chunk(at) else {
                let what =
                    if format.is_some() { "has no `data` chunk" } else { "has no `fmt ` chunk" };
                return Err(broken(at, what));
            };
            match &chunk.id {
                b"ds64" => data_size = bytes.whole(chunk.at + 8),
                b"fmt " => format = Some(bytes.format(&chunk)?),
                b"data" => {
                    let Some(format) = format else {
                        return Err(broken(at, "has `data` before `fmt `"));
                    };
                    let data = samples(&chunk, data_size, &format, &mut notes)?;
                    return Ok(Self { format, data, notes });
                }
                _ => {}
            }
            at = bytes.after(&chunk)?;
        }
    }
}

/// The samples of `data`: as many as it says, or up to the end where it does not know.
fn samples<'a>(
    chunk: &Chunk<'a>,
    data_size: Option<u64>,
    format: &Format,
    notes: &mut Vec<String>,
) -> Result<&'a [u8], Box<Fault>> {
    let stated = match (chunk.size, data_size) {
        (UNKNOWN_SIZE, Some(size)) => usize::try_from(size).unwrap_or(usize::MAX),
        (UNKNOWN_SIZE | 0, None) if !chunk.rest.is_empty() => {
            notes.push("does not say how long it is, as of a pipe: read to its end".to_owned());
            chunk.rest.len()
        }
        (size, _) => size as usize,
    };
    let there = stated.min(chunk.rest.len());
    if there < stated {
        let what = format!("is cut off: {there} of {stated} bytes of samples are there");
        if there == 0 {
            return Err(broken(chunk.at, what));
        }
        notes.push(what);
    }
    let frame = format.channels * format.sample_bytes;
    let whole = there - there % frame;
    if whole < there && there == stated {
        notes.push(format!("its last {} bytes are no whole sample: left out", there - whole));
    }
    Ok(&chunk.rest[..whole])
}

impl<'a> Bytes<'a> {
    fn slice(&self, at: usize, length: usize) -> Option<&'a [u8]> {
        self.all.get(at..at.checked_add(length)?)
    }

    fn number(&self, at: usize, length: usize) -> Option<u64> {
        let fold = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        let bytes = self.slice(at, length)?;
        Some(if self.big_endian {
            bytes.iter().fold(0, fold)
        } else {
            bytes.iter().rev().fold(0, fold)
        })
    }

    fn short(&self, at: usize) -> Option<u16> {
        self.number(at, 2).and_then(|number| u16::try_from(number).ok())
    }

    fn long(&self, at: usize) -> Option<u32> {
        self.number(at, 4).and_then(|number| u32::try_from(number).ok())
    }

    fn whole(&self, at: usize) -> Option<u64> {
        self.number(at, 8)
    }

    fn chunk(&self, at: usize) -> Option<Chunk<'a>> {
        let mut id = [0; 4];
        id.copy_from_slice(self.slice(at, 4)?);
        Some(Chunk { id, size: self.long(at + 4)?, at: at + 8, rest: self.all.get(at + 8..)? })
    }

    /// Where the next chunk begins: a chunk of an odd size is followed by one byte that belongs to none.
    fn after(&self, chunk: &Chunk<'_>) -> Result<usize, Box<Fault>> {
        let size = chunk.size as usize;
        let end = chunk.at.checked_add(size).filter(|end| *end <= self.all.len());
        let name = String::from_utf8_lossy(&chunk.id).into_owned();
        let Some(end) = end else {
            return Err(broken(
                chunk.at,
                format!("chunk `{name}` of {size} bytes ends beyond the file"),
            ));
        };
        let padded = end + size % 2;
        let is_chunk = |at: usize| {
            let id = self.slice(at, 4);
            id.is_some_and(|id| id.iter().all(|byte| (b' '..=b'~').contains(byte)))
        };
        if size % 2 == 1 && !is_chunk(padded) && is_chunk(end) {
            let what = format!(
                "chunk `{name}` of {size} bytes is not followed by the byte that makes its size even"
            );
            let fault = *broken(end, what);
            let help = "have it written anew by a program that pads its chunks";
            return Err(Box::new(fault.help(help)));
        }
        Ok(padded)
    }

    fn format(&self, chunk: &Chunk<'_>) -> Result<Format, Box<Fault>> {
        let short = |at: usize| self.short(chunk.at + at);
        let bad = |what: String| {
            Box::new(Fault::new("fmt", what).expected("PCM, or IEEE floats of 32 or 64 bits"))
        };
        let (tag, channels, rate_hz, block, bits) =
            (short(0), short(2), self.long(chunk.at + 4), short(12), short(14));
        let (Some(mut tag), Some(channels), Some(rate_hz), Some(block), Some(bits), true) =
            (tag, channels, rate_hz, block, bits, chunk.size >= 16)
        else {
            return Err(bad(format!("has {} bytes, too few for a format", chunk.size)));
        };
        let mut valid_bits = bits;
        if tag == EXTENSIBLE {
            let guid = self.slice(chunk.at + 24, 16).filter(|_| chunk.size >= 40);
            let Some(guid) = guid else {
                return Err(bad("is extensible and too short for its sub-format".to_owned()));
            };
            valid_bits = short(18).unwrap_or(bits);
            // A GUID's first number is in the file's order, or as it always is.
            let tail = guid.get(2..).unwrap_or_default();
            if tail != GUID_TAIL && !self.big_endian {
                return Err(bad("has a sub-format that is none of WAVE's own".to_owned()));
            }
            tag = if self.big_endian {
                short(26).filter(|tag| *tag != 0).or(short(24))
            } else {
                short(24)
            }
            .unwrap_or(0);
        }
        self.checked(tag, Layout { channels, rate_hz, block, bits, valid_bits }).map_err(bad)
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
            other => return Err(format!("has format tag {other}, which is not read")),
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

fn broken(at: usize, what: impl Into<String>) -> Box<Fault> {
    Box::new(Fault::new(format!("byte {at}"), what.into()).expected("a whole WAV file"))
}
