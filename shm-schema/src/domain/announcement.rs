//! The file `current`: the present epoch and its contract version.
//!
//! Invariant: it is written atomically, after everything that it names exists. It is human-readable text.

use std::fs;
use std::path::Path;

use super::cell::Cell;
use super::error::{DomainError, JoinError};
use crate::services::{CONTRACT_HASH, CONTRACT_VERSION, TRANSPORT_VERSION};

const HEADER: &str = "trued.current/1";

/// Versions on which daemon and client must agree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Contract {
    /// Version of services and payloads.
    pub version: u32,
    /// Layout hash of all payloads.
    pub layout: u64,
    /// Version of the transport.
    pub transport: String,
    /// Version of the program, for users.
    pub program: String,
}

impl Contract {
    /// The contract of this build.
    #[must_use]
    pub fn of_this_build() -> Self {
        Self {
            version: CONTRACT_VERSION,
            layout: CONTRACT_HASH,
            transport: TRANSPORT_VERSION.to_owned(),
            program: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }

    /// Whether two sides are compatible; the program's version is not compared.
    #[must_use]
    pub fn is_compatible_with(&self, other: &Self) -> bool {
        (self.version, self.layout, &self.transport)
            == (other.version, other.layout, &other.transport)
    }
}

impl core::fmt::Display for Contract {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { version, layout, transport, program } = self;
        write!(
            f,
            "trued {program} (contract {version}, layout {layout:016x}, transport {transport})"
        )
    }
}

/// The announced epoch, which clients may join.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Announcement {
    /// The daemon's contract.
    pub contract: Contract,
    /// Identifies the epoch.
    pub epoch: u64,
    /// The daemon's process.
    pub pid: u32,
}

impl Announcement {
    /// The last announcement of the cell's daemon, which may have terminated since.
    ///
    /// # Errors
    /// [`JoinError::NoDaemon`] where nothing is announced, [`JoinError::WrongUser`] where the
    /// directory belongs to another user, [`JoinError::Unreadable`] where the file cannot be parsed.
    pub fn read(cell: &Cell) -> Result<Self, JoinError> {
        let path = cell.file("current");
        let no_daemon =
            || JoinError::NoDaemon { cell: cell.name().to_owned(), dir: cell.dir().into() };
        match cell.check_owner() {
            Ok(()) => {}
            Err(DomainError::WrongOwner { dir, owner, me, .. }) => {
                return Err(JoinError::WrongUser { dir, owner, me });
            }
            Err(_) => return Err(no_daemon()),
        }
        let text = fs::read_to_string(&path).map_err(|_| no_daemon())?;
        Self::parse(&text).ok_or(JoinError::Unreadable { path })
    }

    pub(crate) fn write(&self, cell: &Cell) -> Result<(), DomainError> {
        let (path, fresh) = (cell.file("current"), cell.file("current.new"));
        let io = |step, path: &Path, e| DomainError::io(step, path, e);
        fs::write(&fresh, self.to_text()).map_err(|e| io("write", &fresh, e))?;
        fs::rename(&fresh, &path).map_err(|e| io("rename to", &path, e))
    }

    fn to_text(&self) -> String {
        let Contract { version, layout, transport, program } = &self.contract;
        format!(
            "{HEADER}\ncontract {version}\nlayout {layout:016x}\ntransport {transport}\n\
             program {program}\nepoch {:016x}\npid {}\n",
            self.epoch, self.pid
        )
    }

    /// Parses the text of such a file; `None` if it is invalid.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        if lines.next()? != HEADER {
            return None;
        }
        let mut value = |key: &str| lines.next()?.strip_prefix(key)?.strip_prefix(' ');
        Some(Self {
            contract: Contract {
                version: value("contract")?.parse().ok()?,
                layout: u64::from_str_radix(value("layout")?, 16).ok()?,
                transport: value("transport")?.to_owned(),
                program: value("program")?.to_owned(),
            },
            epoch: u64::from_str_radix(value("epoch")?, 16).ok()?,
            pid: value("pid")?.parse().ok()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_announced_is_what_is_read() {
        let current = Announcement { contract: Contract::of_this_build(), epoch: 0xabc, pid: 42 };
        assert_eq!(Announcement::parse(&current.to_text()), Some(current));
    }

    #[test]
    fn half_a_file_is_no_announcement() {
        let text = Announcement { contract: Contract::of_this_build(), epoch: 1, pid: 2 }.to_text();
        let last_line = text.trim_end().rfind('\n').unwrap();
        for end in 0..=last_line {
            assert_eq!(Announcement::parse(&text[..end]), None, "{end} bytes");
        }
    }
}
