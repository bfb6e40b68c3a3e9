//! Offers a model file with its signature to one cell, and brings its answer: a query with the model as payload and the signature as attachment.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Deserialize;
use zenoh::Wait;

use crate::keys::{Keys, NotAName};
use crate::zenoh_bus::{BusError, Endpoints, Part, zenoh_error};

/// Why no answer was obtained.
#[derive(Debug, thiserror::Error)]
pub enum OfferingError {
    /// Group or cell cannot be part of a key.
    #[error(transparent)]
    Name(#[from] NotAName),
    /// The cell is none.
    #[error("cell `{0}`: write GROUP/CELL")]
    Cell(String),
    /// A file cannot be read.
    #[error("cannot read {}: {why}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        why: std::io::Error,
    },
    /// The bus cannot be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// No bridge answers.
    #[error(
        "cell `{0}` does not answer; check that its `trued-plant bridge` is running and connected to the same router"
    )]
    Nobody(String),
    /// The bridge cannot take an offer now.
    #[error("cell `{cell}`: {why}")]
    NotJudged {
        /// The cell.
        cell: String,
        /// What it said.
        why: String,
    },
    /// The answer cannot be read.
    #[error("cell `{cell}`: the answer cannot be read: {why}")]
    Answer {
        /// The cell.
        cell: String,
        /// What is wrong with it.
        why: String,
    },
}

/// What became of an offer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Told {
    /// The message of the event, as JSON.
    pub message: String,
    /// One line in words.
    pub words: String,
    /// Whether the model was staged or loaded.
    pub is_taken: bool,
}

#[derive(Deserialize)]
struct Read {
    body: Body,
}

/// What is read of an event: a later version may say more.
#[derive(Deserialize)]
struct Body {
    event: String,
    path: Option<String>,
    message: Option<String>,
}

/// The signature of a model file stands beside it, as `minisign -S` writes it.
#[must_use]
pub fn signature_of(model: &Path) -> PathBuf {
    let mut name = model.as_os_str().to_owned();
    name.push(".minisig");
    PathBuf::from(name)
}

/// Offers `model`, a file with its signature beside it, to `cell` (`GROUP/CELL`).
///
/// # Errors
/// See [`OfferingError`]; a refusal is an answer, not an error.
pub fn offer(
    endpoints: &Endpoints,
    cell: &str,
    model: &Path,
    within: Duration,
) -> Result<Told, OfferingError> {
    let name = || cell.to_owned();
    let (group, short) = cell.split_once('/').ok_or_else(|| OfferingError::Cell(name()))?;
    let keys = Keys::new(group, short)?;
    let read = |path: &Path| {
        std::fs::read(path).map_err(|why| OfferingError::Read { path: path.to_owned(), why })
    };
    let (bytes, signature) = (read(model)?, read(&signature_of(model))?);
    let session = endpoints.open(Part::Client)?;
    let query = session.get(keys.offer()).payload(bytes).attachment(signature).timeout(within);
    let replies = query.wait().map_err(zenoh_error("offer"))?;
    let reply = replies.recv().map_err(|_| OfferingError::Nobody(name()))?;
    let message = match reply.result() {
        Ok(sample) => sample.payload().to_bytes().into_owned(),
        Err(why) => {
            let why = why.payload().to_bytes();
            let why = String::from_utf8_lossy(&why).into_owned();
            // Zenoh itself answers so where the time is over.
            let is_late = why == "Timeout";
            let not_judged = OfferingError::NotJudged { cell: name(), why };
            return Err(if is_late { OfferingError::Nobody(name()) } else { not_judged });
        }
    };
    let unreadable = |why: String| OfferingError::Answer { cell: name(), why };
    let body =
        serde_json::from_slice::<Read>(&message).map_err(|why| unreadable(why.to_string()))?;
    let message = String::from_utf8(message).map_err(|why| unreadable(why.to_string()))?;
    let Body { event, path, message: detail } = body.body;
    let (path, detail) = (path.unwrap_or_default(), detail.unwrap_or_default());
    let (words, is_taken) = match event.as_str() {
        "model_loaded" => (format!("loaded by the daemon: {detail}"), true),
        "model_staged" => (format!("staged as {path}; not loaded into the daemon"), true),
        "model_refused" => (format!("rejected: {detail}"), false),
        other => return Err(unreadable(format!("event `{other}`"))),
    };
    Ok(Told { message, words, is_taken })
}
