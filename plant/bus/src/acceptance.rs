//! Which offered models a cell takes: the owner's file, the checks of an offer, the staged files and the counter against replay.
//!
//! Promises: without the owner's file nothing is taken; an offer is checked in the order of [`Reason`], and nothing of the model is parsed before its signature was verified; the counter of an offer is on disk
//! before its model is, so that no offer is taken twice, also after a loss of power; a model is staged whole or not at all. Never: a request to a daemon, the network.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use minisign_verify::PublicKey;
use recording::files::{read_text, write_atomic};
use recording::model::{Identity, RobotModel};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::offer::{self, OfferError, OfferedRobot, Statement};

/// Name of the format of the owner's file.
pub const SCHEMA: &str = "trued.models/1";

/// What becomes of an offer that passes all checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Accept {
    /// It is refused.
    #[default]
    Never,
    /// The model is written into the folder; the daemon is not asked.
    Stage,
    /// The model is written into the folder, and the daemon is asked to load it.
    Load,
}

/// The owner's file of a cell, `trued.models/1` (docs/reference/plant.md): which offered models it takes. Relative paths count from the folder of this file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Written {
    /// Name and version of the format.
    #[schemars(extend("const" = "trued.models/1"))]
    schema: String,
    /// What becomes of a model that passes all checks.
    #[serde(default)]
    accept: Accept,
    /// A model file of this robot that states its serial number.
    robot: PathBuf,
    /// Where accepted models and the counter are written.
    folder: PathBuf,
    /// Public keys of minisign.
    #[schemars(length(min = 1))]
    keys: Vec<String>,
}

/// The JSON Schema of the owner's file.
#[must_use]
pub fn schema() -> schemars::Schema {
    schemars::schema_for!(Written)
}

/// Why the owner's file cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", path.display())]
pub struct AcceptanceError {
    path: PathBuf,
    what: String,
}

fn error<E: ToString>(path: &Path) -> impl Fn(E) -> AcceptanceError + '_ {
    |why| AcceptanceError { path: path.to_owned(), what: why.to_string() }
}

/// Why a model was not taken, in the order of the checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The cell takes no models by its configuration.
    NotAccepted,
    /// Signature or statement cannot be read.
    Unreadable,
    /// The bytes are not the stated ones.
    Torn,
    /// No accepted key signed it.
    NotSigned,
    /// The offer has expired.
    Expired,
    /// The counter is not above the last one: an older offer, or the same one again.
    Replayed,
    /// The bytes are no model.
    NotAModel,
    /// The model is of another robot, or does not say of which.
    OtherRobot,
    /// The daemon does not respond, and the model was to be loaded.
    DaemonAway,
    /// Model or counter cannot be written.
    Storage,
    /// The daemon refused to load it.
    DaemonRefused,
}

/// A refused offer; nothing changed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Refusal {
    /// Why.
    pub reason: Reason,
    /// In words, with what to do.
    pub message: String,
}

impl Refusal {
    /// A refusal in words.
    pub fn new(reason: Reason, message: impl Into<String>) -> Self {
        Self { reason, message: message.into() }
    }
}

impl From<OfferError> for Refusal {
    fn from(why: OfferError) -> Self {
        let reason = match why {
            OfferError::Signature(_) | OfferError::Statement(_) => Reason::Unreadable,
            OfferError::Torn { .. } => Reason::Torn,
            OfferError::NotSigned(_) => Reason::NotSigned,
            OfferError::Model(_) => Reason::NotAModel,
            OfferError::NoSerial | OfferError::RobotsDiffer => Reason::OtherRobot,
        };
        Self::new(reason, why.to_string())
    }
}

/// An offer that passed all checks; nothing is written yet.
#[derive(Debug)]
pub struct Checked<'a> {
    /// What was signed.
    pub statement: Statement,
    model: &'a [u8],
    signature: &'a str,
}

/// Which models a cell takes.
#[derive(Debug)]
pub struct Acceptance {
    accept: Accept,
    keys: Vec<PublicKey>,
    robot: Identity,
    folder: PathBuf,
    last_counter: u64,
    /// Held while the folder is in use.
    _lock: File,
}

impl Acceptance {
    /// Reads the owner's file; paths in it are relative to its folder.
    ///
    /// # Errors
    /// What is wrong with the file, or with what it names.
    pub fn read(path: &Path) -> Result<Self, AcceptanceError> {
        let text = read_text(path).map_err(error(path))?;
        let written: Written = toml::from_str(&text).map_err(error(path))?;
        if written.schema != SCHEMA {
            let what = format!("schema is `{}`; expected `{SCHEMA}`", written.schema);
            return Err(error(path)(what));
        }
        let base = path.parent().unwrap_or(Path::new(""));
        let keys = written.keys.iter().map(|key| public_key(key).map_err(error(path)));
        let keys = keys.collect::<Result<Vec<_>, _>>()?;
        if keys.is_empty() {
            return Err(error(path)("keys: expected at least one public key of minisign"));
        }
        let robot_path = base.join(&written.robot);
        let robot = RobotModel::read(&robot_path).map_err(error(path))?;
        OfferedRobot::of(&robot).map_err(error(&robot_path))?;
        let folder = base.join(&written.folder);
        fs::create_dir_all(&folder).map_err(error(&folder))?;
        // The daemon has a working folder of its own.
        let folder = folder.canonicalize().map_err(error(&folder))?;
        let lock = File::create(folder.join("lock")).map_err(error(&folder))?;
        let taken = "another bridge uses this folder; use a separate folder for each cell";
        lock.try_lock().map_err(|_| error(&folder)(taken))?;
        let last_counter = read_counter(&folder.join("counter"))?;
        let robot = robot.file.identity();
        Ok(Self { accept: written.accept, keys, robot, folder, last_counter, _lock: lock })
    }

    /// What becomes of an offer that passes all checks.
    #[must_use]
    pub fn accept(&self) -> Accept {
        self.accept
    }

    /// Checks an offer; changes nothing.
    ///
    /// # Errors
    /// The first [`Reason`] to refuse it.
    pub fn check<'a>(
        &self,
        model: &'a [u8],
        signature: &'a str,
        now_unix_ms: u64,
    ) -> Result<Checked<'a>, Refusal> {
        if self.accept == Accept::Never {
            let message = "this cell accepts no models: `accept` is \"never\" in its owner's file";
            return Err(Refusal::new(Reason::NotAccepted, message));
        }
        let statement = Statement::read(signature)?;
        let found = offer::sha256(model);
        if found != statement.sha256 {
            return Err(OfferError::Torn { found, stated: statement.sha256 }.into());
        }
        offer::verify(model, signature, &self.keys)?;
        if now_unix_ms >= statement.expires_unix_ms {
            let ago_s = (now_unix_ms - statement.expires_unix_ms) / 1000;
            let message = format!("the offer expired {ago_s} s ago; sign it again");
            return Err(Refusal::new(Reason::Expired, message));
        }
        if statement.counter <= self.last_counter {
            let (counter, last) = (statement.counter, self.last_counter);
            let message = format!(
                "counter {counter} is not above {last}, that of the last accepted offer; sign it again with a higher one"
            );
            return Err(Refusal::new(Reason::Replayed, message));
        }
        self.check_robot(model, &statement)?;
        Ok(Checked { statement, model, signature })
    }

    fn check_robot(&self, model: &[u8], statement: &Statement) -> Result<(), Refusal> {
        let model = offer::read_model(model)?;
        if OfferedRobot::of(&model)? != statement.robot {
            return Err(OfferError::RobotsDiffer.into());
        }
        let differences = model.file.identity().differences(&self.robot);
        if differences.is_empty() {
            return Ok(());
        }
        let message = format!("another robot: {}", differences.join("; "));
        Err(Refusal::new(Reason::OtherRobot, message))
    }

    /// Writes the counter, then signature and model; returns the model's file. From then on the offer is used up.
    ///
    /// # Errors
    /// [`Reason::Storage`]; then no model was written.
    pub fn stage(&mut self, checked: &Checked<'_>) -> Result<PathBuf, Refusal> {
        let path = self.folder.join(format!("{}.toml", checked.statement.sha256));
        let counter = checked.statement.counter;
        let storage = |why: String| Refusal::new(Reason::Storage, why);
        let write = |path: &Path, bytes: &[u8]| {
            write_atomic(path, bytes).map_err(|why| storage(why.to_string()))
        };
        write(&self.folder.join("counter"), format!("{counter}\n").as_bytes())?;
        self.last_counter = counter;
        // The counter's name is on disk before the model's is.
        let synced = File::open(&self.folder).and_then(|folder| folder.sync_all());
        synced.map_err(|why| storage(format!("{}: {why}", self.folder.display())))?;
        write(&path.with_extension("toml.minisig"), checked.signature.as_bytes())?;
        write(&path, checked.model)?;
        Ok(path)
    }

    /// Removes a staged model that the daemon refused.
    pub fn discard(&self, file: &Path) {
        // One that stays is only litter: nobody loads it.
        let _ = fs::remove_file(file);
        let _ = fs::remove_file(file.with_extension("toml.minisig"));
    }
}

/// A public key as `minisign -G` prints it.
fn public_key(text: &str) -> Result<PublicKey, String> {
    PublicKey::from_base64(text.trim()).map_err(|why| {
        format!("keys: `{text}`: {why}; expected the second line of a minisign.pub (RW…)")
    })
}

/// The counter of the last offer that was taken; 0 before the first.
fn read_counter(path: &Path) -> Result<u64, AcceptanceError> {
    match fs::read_to_string(path) {
        Err(why) if why.kind() == std::io::ErrorKind::NotFound => Ok(0),
        Err(why) => Err(error(path)(why)),
        Ok(text) => text.trim().parse().map_err(|_| {
            let message = format!("is `{}`; expected a number: the counter of the last accepted offer (a higher one is safe)", text.trim());
            error(path)(message)
        }),
    }
}
