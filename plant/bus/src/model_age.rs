//! Since when a model is in use in a cell, as far as this bridge saw it: a file beside the spool, so that a restart does not make a model new.

use std::path::{Path, PathBuf};

/// The model of a cell and when it was first seen.
#[derive(Debug)]
pub(crate) struct ModelSince {
    path: PathBuf,
    seen: Option<(String, u64)>,
}

impl ModelSince {
    /// As noted in `folder`.
    #[must_use]
    pub(crate) fn read(folder: &Path) -> Self {
        let path = folder.join("model");
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let mut words = text.split_whitespace();
        let hash = words.next().map(str::to_owned);
        let seen = hash.zip(words.next().and_then(|word| word.parse().ok()));
        Self { path, seen }
    }

    /// When the model was first seen, ms since 1970-01-01 UTC; now, where it is another one than before.
    ///
    /// # Errors
    /// The note cannot be written.
    pub(crate) fn of(&mut self, hash: &str, now_unix_ms: u64) -> std::io::Result<u64> {
        if let Some((_, since)) = self.seen.as_ref().filter(|(seen, _)| seen == hash) {
            return Ok(*since);
        }
        let beside = self.path.with_extension("part");
        std::fs::write(&beside, format!("{hash} {now_unix_ms}\n"))?;
        std::fs::rename(&beside, &self.path)?;
        self.seen = Some((hash.to_owned(), now_unix_ms));
        Ok(now_unix_ms)
    }
}
