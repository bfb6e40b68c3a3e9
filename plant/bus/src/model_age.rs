//! Since when a model is in use in a cell, as far as this bridge saw it: a file beside the spool, so that a restart does not make a model new.

use std::path::{Path, PathBuf};

/// The model of a cell and when it was first seen.
#[derive(Debug)]
pub(crate) struct ModelSince {
    path: PathBuf,
    known: Option<(String, u64)>,
}

impl ModelSince {
    /// As noted in `folder`.
    #[must_use]
    pub(crate) fn read(folder: &Path) -> Self {
        let path = folder.join("model");
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let mut fields = text.split_whitespace();
        let hash = fields.next().map(str::to_owned);
        let known = hash.zip(fields.next().and_then(|field| field.parse().ok()));
        Self { path, known }
    }

    /// When the model was first seen, ms since 1970-01-01 UTC; now, where it is another one than before.
    ///
    /// # Errors
    /// The note cannot be written.
    pub(crate) fn of(&mut self, hash: &str, now_unix_ms: u64) -> std::io::Result<u64> {
        if let Some((_, since)) = self.known.as_ref().filter(|(known, _)| known == hash) {
            return Ok(*since);
        }
        let beside = self.path.with_extension("part");
        std::fs::write(&beside, format!("{hash} {now_unix_ms}\n"))?;
        std::fs::rename(&beside, &self.path)?;
        self.known = Some((hash.to_owned(), now_unix_ms));
        Ok(now_unix_ms)
    }
}
