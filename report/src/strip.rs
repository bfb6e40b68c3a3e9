//! The strip under a title: input files, time, program and command of a page.
//!
//! Never: a clock, a file, a hash of its own; whoever makes the page says them.

use crate::escape::escape;
use crate::table::{Cell, Table};

/// Files that the strip has room for.
const FILES: usize = 4;
/// Digits of a hash in the strip: enough to tell files apart by eye.
const DIGITS: usize = 12;

/// A file that went into a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputFile {
    /// Its name, without the folder.
    pub name: String,
    /// SHA-256 of its bytes, 64 hexadecimal digits.
    pub sha256: String,
}

/// Of what, when and by what a page was made.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Provenance {
    /// The files that were read, in the order in which they were named.
    pub files: Vec<InputFile>,
    /// Date and time in UTC, as it is to be read.
    pub date_utc: String,
    /// The program with its version.
    pub version: String,
    /// The command line, to be typed again.
    pub command: String,
}

impl Provenance {
    pub(crate) fn strip(&self) -> String {
        let file = |InputFile { name, sha256 }: &InputFile| {
            let short: String = sha256.chars().take(DIGITS).collect();
            let (name, sha256, short) = (escape(name), escape(sha256), escape(&short));
            format!("<span title=\"SHA-256 {sha256}\">{name} <code>{short}</code></span>")
        };
        let mut files: Vec<String> = self.files.iter().take(FILES).map(file).collect();
        if self.files.len() > FILES {
            files.push(format!("and {} more", self.files.len() - FILES));
        }
        let command = match self.command.as_str() {
            "" => String::new(),
            command => format!("<code>{}</code>", escape(command)),
        };
        [
            ("Made", escape(&self.date_utc)),
            ("By", escape(&self.version)),
            ("Files", files.join(", ")),
            ("Command", command),
        ]
        .iter()
        .map(|(name, value)| entry(name, value))
        .collect()
    }

    /// All files with their whole hashes, where the strip has no room for all.
    pub(crate) fn table(&self) -> Option<Table> {
        let table = Table::new("Input files", ["File", "SHA-256"]);
        let all = self.files.iter().fold(table, |table, file| {
            table.row([Cell::Text(file.name.clone()), Cell::Text(file.sha256.clone())])
        });
        (self.files.len() > FILES).then_some(all)
    }
}

/// An entry of the strip, of text that is escaped already; nothing where there is none.
pub(crate) fn entry(name: &str, html: &str) -> String {
    match html {
        "" => String::new(),
        html => format!("<div><dt>{name}</dt><dd>{html}</dd></div>"),
    }
}
