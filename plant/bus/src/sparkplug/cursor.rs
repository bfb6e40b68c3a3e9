//! How far the broker has received the kept messages, and the number of the last connection: a file in the spool's folder.

use std::path::{Path, PathBuf};

use crate::spool::Spool;
use recording::files::{FileError, write_atomic};

/// Place of a reader in the spool.
#[derive(Debug)]
pub(super) struct Cursor {
    path: PathBuf,
    /// The series of numbers that `next` is of.
    stream: u64,
    /// The first message that the broker has not received.
    pub(super) next: u64,
    /// Number of the last connection, 0 to 255.
    bd_seq: u8,
}

impl Cursor {
    /// As written in `folder`; where another stream has begun since, at its first message, and where nothing of the written one is kept, at the oldest.
    pub(super) fn read(folder: &Path, spool: &Spool) -> Self {
        let path = folder.join("sparkplug");
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let mut numbers = text.split_whitespace().map(str::parse::<u64>);
        let mut number = || numbers.next().and_then(Result::ok);
        let (written, next, bd_seq) = (number(), number(), number());
        let next = written.zip(next).map(|(stream, next)| spool.position(stream, next));
        let next = next.unwrap_or_else(|| spool.first());
        Self { path, stream: spool.stream(), next, bd_seq: bd_seq.unwrap_or(255) as u8 }
    }

    /// Begins another connection, and returns its number.
    pub(super) fn connect(&mut self) -> u8 {
        self.bd_seq = self.bd_seq.wrapping_add(1);
        self.bd_seq
    }

    pub(super) fn write(&self) -> Result<(), FileError> {
        let text = format!("{} {} {}\n", self.stream, self.next, self.bd_seq);
        write_atomic(&self.path, text.as_bytes())
    }
}
