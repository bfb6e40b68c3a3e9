//! The key of a result: SHA-256 (FIPS 180-4) over everything that the result is computed from.
//!
//! Each part is preceded by its length, so that different sequences of parts give different bytes. Files are hashed while being read: memory does not grow with their size.
//! The key contains no time, absolute path or machine name.

use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use sha2::{Digest, Sha256};

/// Bytes that are hashed at once.
const CHUNK: usize = 1 << 16;

/// SHA-256 hash of the inputs of a result; displayed as 64 hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key([u8; 32]);

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl Key {
    /// The hash of bytes by themselves.
    #[must_use]
    pub fn of_bytes(bytes: &[u8]) -> Self {
        Self(Sha256::digest(bytes).into())
    }

    /// The hash of a file by itself.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_file(path: &Path) -> io::Result<Self> {
        // Opening a pipe would block until it has a writer.
        if !path.metadata()?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
        }
        let (mut file, mut hash) = (File::open(path)?, Sha256::new());
        let mut chunk = vec![0; CHUNK];
        loop {
            match file.read(&mut chunk)? {
                0 => return Ok(Self(hash.finalize().into())),
                read => hash.update(chunk.get(..read).unwrap_or_default()),
            }
        }
    }
}

/// Builder of a key.
#[derive(Debug, Clone)]
pub struct KeyBuilder(Sha256);

impl KeyBuilder {
    /// A builder for results of this format.
    #[must_use]
    pub fn of(form: &str) -> Self {
        Self(Sha256::new()).part("form", form.as_bytes())
    }

    /// The same with a named part.
    #[must_use]
    pub fn part(mut self, name: &str, bytes: &[u8]) -> Self {
        for field in [name.as_bytes(), bytes] {
            self.0.update((field.len() as u64).to_le_bytes());
            self.0.update(field);
        }
        self
    }

    /// The same with an optional named part; missing differs from empty.
    #[must_use]
    pub fn optional_part(self, name: &str, bytes: Option<&[u8]>) -> Self {
        match bytes {
            Some(bytes) => self.part(name, bytes),
            None => self.part("without", name.as_bytes()),
        }
    }

    /// The same with the content of a file.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn file(self, name: &str, path: &Path) -> io::Result<Self> {
        let content = Key::of_file(path)?;
        Ok(self.part(name, &content.0))
    }

    /// The key.
    #[must_use]
    pub fn finish(self) -> Key {
        Key(self.0.finalize().into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hash_is_that_of_the_standard() {
        // FIPS 180-2, appendix B.1.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(Key::of_bytes(b"abc").to_string(), expected);
    }

    #[test]
    fn bytes_that_move_from_one_part_to_the_next_change_the_key() {
        let key = |a: &[u8], b: &[u8]| KeyBuilder::of("x").part("a", a).part("b", b).finish();
        assert_ne!(key(b"12", b"3"), key(b"1", b"23"));
        assert_ne!(key(b"", b"1"), key(b"1", b""));
        let maybe = |serial| KeyBuilder::of("x").optional_part("serial", serial).finish();
        assert_ne!(maybe(None), maybe(Some(b"".as_slice())));
    }

    #[test]
    fn what_is_no_regular_file_is_not_opened() {
        let refused = Key::of_file(&std::env::temp_dir()).expect_err("a folder");
        assert!(refused.to_string().contains("not a regular file"), "{refused}");
    }
}
