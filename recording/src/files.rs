//! Reads files, and writes them atomically.
//!
//! A file under its final name is never partially written, whatever fails. Several files at once, all
//! or none: [`crate::outputs`].

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use encoding_rs::{UTF_16BE, UTF_16LE};

use crate::faults::{Fault, Faults, Location};
use crate::partial_file::Part;

/// UTF-16 without a byte-order mark is recognised by this many bytes.
const UTF16_HEAD_BYTES: usize = 16;
/// Least number of characters there.
const UTF16_PAIRS_MIN: usize = 4;

/// Zero bytes are searched in this many bytes at the start of a file.
const BINARY_HEAD_BYTES: usize = 4096;

/// Why a file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried: `read`, `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file was read, and its content is wrong.
    #[error(transparent)]
    Content(#[from] Faults),
}

impl FileError {
    pub(crate) fn io(action: &'static str, path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_owned(), source }
    }
}

/// The text of a file, without a byte-order mark.
///
/// # Errors
/// The file cannot be read, or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    let bytes = fs::read(path).map_err(FileError::io("read", path))?;
    Ok(text_of(&path.display().to_string(), bytes)?)
}

/// Bytes of UTF-16 as UTF-8; `None` for anything else. Recognised by the byte-order mark, or by zero bytes between the first characters of ASCII.
/// `None` also if it is not valid UTF-16.
#[must_use]
pub fn utf16_as_utf8(bytes: &[u8]) -> Option<String> {
    let head = bytes.get(..UTF16_HEAD_BYTES.min(bytes.len())).unwrap_or_default();
    let (pairs, _) = head.as_chunks::<2>();
    let is_text = |text: u8, zero: u8| text.is_ascii() && text != 0 && zero == 0;
    let has_pairs = pairs.len() >= UTF16_PAIRS_MIN;
    let encoding = match bytes {
        [0xff, 0xfe, ..] => UTF_16LE,
        [0xfe, 0xff, ..] => UTF_16BE,
        _ if has_pairs && pairs.iter().all(|[a, b]| is_text(*a, *b)) => UTF_16LE,
        _ if has_pairs && pairs.iter().all(|[a, b]| is_text(*b, *a)) => UTF_16BE,
        _ => return None,
    };
    let (text, _, is_broken) = encoding.decode(bytes);
    (!is_broken).then(|| text.into_owned())
}

/// First bytes of formats that are no text, and their names.
const BINARY_FORMATS: [(&[u8], &str); 11] = [
    (b"\x1f\x8b", "compressed (gzip)"),
    (b"PK\x03\x04", "an archive or a spreadsheet (zip)"),
    (b"\xd0\xcf\x11\xe0", "a spreadsheet or document (OLE)"),
    (b"\x28\xb5\x2f\xfd", "compressed (Zstandard)"),
    (b"\xfd7zXZ", "compressed (xz)"),
    (b"BZh", "compressed (bzip2)"),
    (b"PAR1", "a Parquet file"),
    (b"\x89HDF", "an HDF5 file"),
    (b"\x89MCAP", "a recording in MCAP"),
    (b"MATLAB 5.0", "a MATLAB file"),
    (b"RIFF", "a WAV file"),
];

/// The fault of content that is no text by its first bytes, or by zero bytes at its start.
pub(crate) fn binary_fault(bytes: &[u8]) -> Option<Fault> {
    let head = bytes.get(..BINARY_HEAD_BYTES.min(bytes.len())).unwrap_or_default();
    let known = BINARY_FORMATS.iter().find(|(mark, _)| bytes.starts_with(mark));
    let what = match known {
        Some((_, what)) => *what,
        None if head.iter().filter(|byte| **byte == 0).count() > 1 => "binary",
        None => return None,
    };
    let fault = Fault::new("", format!("is {what}, not text")).expected("a text table");
    Some(match what {
        "a Parquet file" => fault.help("name it with the ending .parquet"),
        "a recording in MCAP" => fault.help("name it with the ending .mcap"),
        what if what.starts_with("compressed") => fault.help("decompress it first"),
        _ => fault.help("export it as CSV"),
    })
}

/// Bytes as text, without a byte-order mark: UTF-8, or UTF-16.
///
/// # Errors
/// The bytes are neither; the fault names the line.
pub fn text_of(name: &str, bytes: Vec<u8>) -> Result<String, Faults> {
    if let Some(text) = utf16_as_utf8(&bytes) {
        return Ok(text);
    }
    match String::from_utf8(bytes) {
        Ok(mut text) => {
            if text.starts_with('\u{feff}') {
                text.remove(0);
            }
            Ok(text)
        }
        Err(error) => {
            if let Some(fault) = binary_fault(error.as_bytes()) {
                let mut faults = Faults::new(name);
                faults.push(fault);
                return Err(faults);
            }
            let good = error.utf8_error().valid_up_to();
            let head = String::from_utf8_lossy(error.as_bytes().get(..good).unwrap_or_default());
            let place = Location::from_span(&head, &(good..good));
            let mut faults = Faults::new(name);
            faults.push(
                Fault::new("", format!("byte {good} is not UTF-8 text"))
                    .at(place)
                    .expected("UTF-8 text")
                    .help("save the file as UTF-8 (a spreadsheet: \"CSV UTF-8\")"),
            );
            Err(faults)
        }
    }
}

/// Writes a file as a whole: into a temporary file in the same folder, synced, then renamed to
/// `path`.
///
/// # Errors
/// The system refused; then `path` is unchanged.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let written = Part::create(path).and_then(|mut part| {
        part.write(bytes)?;
        part.finish()
    });
    written.map_err(FileError::io("write", path))
}

/// A hash of content (FNV-1a, 64 bit): distinguishes versions, but does not prove authenticity.
#[must_use]
pub fn content_hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// The file named by the key `model` of a cell's or a recording's TOML; `None` without the key, or for a preset.
#[must_use]
pub fn referenced_model(toml: &Path) -> Option<PathBuf> {
    let is_toml = toml.extension().is_some_and(|ending| ending == "toml");
    let text = is_toml.then(|| fs::read_to_string(toml).ok()).flatten()?;
    let table: toml::Table = text.parse().ok()?;
    let model = toml.parent()?.join(table.get("model")?.as_str()?);
    model.is_file().then_some(model)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_litter() {
        let dir = std::env::temp_dir().join(format!("trued-files-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let path = dir.join("a.toml");
        write_atomic(&path, b"old").unwrap();
        write_atomic(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        let blocked = dir.join("taken");
        fs::create_dir_all(blocked.join("inside")).unwrap();
        assert!(write_atomic(&blocked, b"x").is_err());
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 2);
        fs::remove_dir_all(&dir).unwrap();
    }

    #[test]
    fn the_hash_is_fnv_1a() {
        assert_eq!(content_hash(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(content_hash(b"a"), 0xaf63_dc4c_8601_ec8c);
    }

    #[test]
    fn text_that_is_not_utf8_is_reported_with_its_line() {
        let faults = text_of("x.csv", b"t_s,q1_deg\n1,\xff\n".to_vec()).unwrap_err();
        assert_eq!(faults.list()[0].location.as_ref().unwrap().line, 2);
        assert_eq!(text_of("x", b"\xef\xbb\xbfa".to_vec()).unwrap(), "a");
    }

    #[test]
    fn content_that_is_no_text_is_named_as_what_it_is() {
        for (bytes, what) in [
            (&b"\x1f\x8b\x08\x00\xff"[..], "compressed (gzip)"),
            (b"PK\x03\x04\xff", "a spreadsheet (zip)"),
            (b"PAR1\xff", "a Parquet file"),
            (b"a\0b\0\xff", "is binary"),
            (b"gr\xf6sse", "byte 2 is not UTF-8"),
        ] {
            text_of("x.csv", bytes.to_vec()).unwrap_err().assert_say(what);
        }
    }

    #[test]
    fn utf16_is_read_with_and_without_a_byte_order_mark_and_binary_data_are_not_taken_for_it() {
        let text = "t_s,q1_deg,µ\n0,1,2\n";
        for mark in ["", "\u{feff}"] {
            let units: Vec<u16> = format!("{mark}{text}").encode_utf16().collect();
            let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
            let big: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
            assert_eq!(text_of("x", little).unwrap(), text);
            assert_eq!(text_of("x", big).unwrap(), text);
        }
        // A half of a surrogate pair.
        assert!(text_of("x", b"\xff\xfe1\0\x00\xd8,\0".to_vec()).is_err());
        for bytes in [&b"RIFF\x24\0\0\0WAVEfmt "[..], b"", b"a\0", text.as_bytes()] {
            assert_eq!(utf16_as_utf8(bytes), None);
        }
    }
}
