//! Records too long for memory: samples stay in the file and are read in parts.

use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::wav::{self, Layout, Opened, WavError};
use super::{Form, Grid, Options, Wave, is_mapped};
use crate::files::FileError;

/// Number of bytes that identify a file's format.
const HEAD_BYTES: u64 = 512;

/// A record whose samples stay in its file.
#[derive(Debug)]
pub struct Stored {
    file: File,
    path: PathBuf,
    layout: Layout,
    /// Positions of the samples.
    pub grid: Grid,
    /// Name, unit and axis of each channel, without values.
    pub channels: Vec<Wave>,
    /// Remarks on the file that are not faults, one sentence each.
    pub notes: Vec<String>,
}

impl Stored {
    /// Opens the record of a WAV file; `None` for other formats, which [`super::read`] reads.
    ///
    /// # Errors
    /// The file cannot be read, or every fault of it.
    pub fn open(path: &Path, options: &Options) -> Result<Option<Self>, FileError> {
        // A file without random access, such as a pipe, is read as a whole: its first bytes would be gone.
        if path.exists() && !path.is_file() {
            return Ok(None);
        }
        let file = File::open(path).map_err(FileError::io("read", path))?;
        let mut head = Vec::new();
        (&file).take(HEAD_BYTES).read_to_end(&mut head).map_err(FileError::io("read", path))?;
        if !matches!(Form::of(path, &head), Form::Wav) || is_mapped(path, &head, options)? {
            return Ok(None);
        }
        let Opened { layout, grid, channels, notes } =
            wav::open(&path.display().to_string(), &file, options).map_err(|why| match why {
                WavError::Faults(faults) => faults.into(),
                WavError::Io(error) => FileError::io("read", path)(error),
            })?;
        Ok(Some(Self { file, path: path.to_owned(), layout, grid, channels, notes }))
    }

    /// Number of samples of each channel.
    #[must_use]
    pub fn len(&self) -> usize {
        self.layout.frames
    }

    /// Whether it has none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Passes the samples of some channels to `each`, one part of the range after the other,
    /// interleaved.
    ///
    /// # Errors
    /// The file cannot be read any more.
    pub fn parts(
        &self,
        channels: &[usize],
        range: Range<usize>,
        each: impl FnMut(&[f64]),
    ) -> Result<(), FileError> {
        let read = self.layout.parts(&self.file, channels, range, &mut Vec::new(), each);
        read.map_err(FileError::io("read", &self.path))
    }
}
