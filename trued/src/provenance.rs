//! Provenance of a page: command line, time, input files.
//!
//! The time is the program's start, or `SOURCE_DATE_EPOCH` (s since 1970, reproducible-builds.org):
//! with it the same inputs give the same bytes.

use std::ffi::OsString;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use recording::mcap_recording::Utc;
use recording::program;
use report::{InputFile, Provenance, shell_word};
use sha2::{Digest, Sha256};

/// The environment variable that fixes the time of pages.
const FIXED_TIME: &str = "SOURCE_DATE_EPOCH";
/// Bytes that are hashed at once.
const CHUNK: usize = 1 << 16;

/// A run of the program.
#[derive(Debug, Clone, Default)]
pub struct Invocation {
    command: String,
    date_utc: String,
}

impl Invocation {
    /// The run that these arguments began, the first of which is the program's name.
    #[must_use]
    pub fn from_args(args: &[OsString]) -> Self {
        let arguments = args.iter().skip(1).map(|argument| argument.to_string_lossy().into_owned());
        Self { command: typed(arguments), date_utc: date(now_s()) }
    }

    /// The same run with another command line: the one a user would type for it.
    pub(crate) fn typed<T: Into<String>>(&self, arguments: impl IntoIterator<Item = T>) -> Self {
        Self { command: typed(arguments.into_iter().map(Into::into)), ..self.clone() }
    }

    /// The information for a page about this run and its input files.
    pub(crate) fn provenance(&self, files: Vec<InputFile>) -> Provenance {
        Provenance {
            files,
            date_utc: self.date_utc.clone(),
            version: program::version().to_owned(),
            command: self.command.clone(),
        }
    }
}

/// A file's name and the hash of its bytes; `None` if it is not an ordinary file, or cannot be
/// read.
pub(crate) fn hashed(path: &Path) -> Option<InputFile> {
    // A pipe loses what is read of it here.
    let mut file = File::open(path.is_file().then_some(path)?).ok()?;
    let (mut hash, mut chunk) = (Sha256::new(), vec![0; CHUNK]);
    loop {
        match file.read(&mut chunk).ok()? {
            0 => break,
            read => hash.update(chunk.get(..read)?),
        }
    }
    let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    Some(InputFile { name: path.file_name()?.to_string_lossy().into_owned(), sha256 })
}

/// The command line, quoted for a shell.
fn typed(arguments: impl Iterator<Item = String>) -> String {
    let arguments = arguments.map(|argument| shell_word(&argument));
    std::iter::once("trued".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}

/// Seconds since 1970.
fn now_s() -> u64 {
    let fixed = std::env::var(FIXED_TIME).ok().and_then(|text| text.trim().parse().ok());
    let now = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    fixed.unwrap_or_else(now)
}

/// To the minute.
fn date(since_1970_s: u64) -> String {
    let text = Utc(since_1970_s.saturating_mul(1_000_000_000)).to_string();
    let minutes = text.get(..16).unwrap_or(&text).replace('T', " ");
    format!("{minutes} UTC")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_line_is_written_so_that_a_shell_gives_the_same_words() {
        let arguments = ["plan", "--zone", "0,1,2", "my robot.toml", "", "it's"];
        let command_line = typed(arguments.iter().map(|argument| (*argument).to_owned()));
        assert_eq!(command_line, r"trued plan --zone 0,1,2 'my robot.toml' '' 'it'\''s'");
    }

    #[test]
    fn a_date_is_written_in_utc_to_the_minute() {
        assert_eq!(date(1_700_000_000), "2023-11-14 22:13 UTC");
    }

    #[test]
    fn a_hash_is_that_of_the_bytes() {
        let path = std::env::temp_dir().join(format!("trued-hash-{}", std::process::id()));
        std::fs::write(&path, "abc").expect("written");
        let file = hashed(&path).expect("hashed");
        std::fs::remove_file(&path).expect("removed");
        // FIPS 180-2, appendix B.1.
        assert_eq!(file.sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        assert_eq!(hashed(std::path::Path::new("/dev/null")), None);
    }
}
