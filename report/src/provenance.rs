//! The strip below a title: input files, time, program and command of a page.
//!
//! Its values are arguments: no clock, no file, no hash is computed here.

use crate::escape::escape;
use crate::table::{Cell, Table};

/// Limit on the files in the strip.
const FILES: usize = 4;
/// Digits of a hash in the strip: enough to distinguish files by eye.
const DIGITS: usize = 12;

/// An input file of a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputFile {
    /// Its name, without the folder.
    pub name: String,
    /// SHA-256 of its bytes, 64 hexadecimal digits.
    pub sha256: String,
}

/// Inputs, time and program of a page.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Provenance {
    /// The files that were read, in the order in which they were named.
    pub files: Vec<InputFile>,
    /// Date and time in UTC, as displayed.
    pub date_utc: String,
    /// The program with its version.
    pub version: String,
    /// The command line.
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

    /// All files with their complete hashes, if the strip has no room for all.
    pub(crate) fn table(&self) -> Option<Table> {
        let table = Table::new("Input files", ["File", "SHA-256"]);
        let all = self.files.iter().fold(table, |table, file| {
            table.row([Cell::Text(file.name.clone()), Cell::Text(file.sha256.clone())])
        });
        (self.files.len() > FILES).then_some(all)
    }
}

/// An entry of the strip, with text that is already escaped; empty without text.
pub(crate) fn entry(name: &str, html: &str) -> String {
    match html {
        "" => String::new(),
        html => format!("<div><dt>{name}</dt><dd>{html}</dd></div>"),
    }
}
