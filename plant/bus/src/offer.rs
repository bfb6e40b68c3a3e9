//! An offered model: the file's bytes with a signature in minisign's format, whose trusted comment states what the offer is.
//!
//! minisign signs the bytes, and with a second signature the trusted comment together with the first, so that a comment cannot be moved to other bytes. [`Statement`] is that comment:
//! SHA-256 of the file, the robot, a counter and an expiry, as JSON on one line. This program holds no secret key: the public tool `minisign` signs.

use minisign_verify::{PublicKey, Signature};
use recording::model::RobotModel;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

/// Name of the format of [`Statement`].
pub const STATEMENT_SCHEMA: &str = "trued.offer/1";
/// Largest model that is offered or taken, bytes. Models are some 10 kB.
pub const MODEL_BYTES_MAX: usize = 1 << 20;
/// Largest signature, bytes: minisign's own limit of a trusted comment (8 KiB), with the rest.
pub const SIGNATURE_BYTES_MAX: usize = 16 << 10;

/// The robot that an offer is for, as the model itself states it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OfferedRobot {
    /// The maker, as `ABB`.
    pub maker: Option<String>,
    /// The type, as `IRB 1600-6/1.45`.
    #[serde(rename = "type")]
    pub kind: Option<String>,
    /// Serial number.
    pub serial: String,
    /// Hash of the nominal geometry, as in the status.
    pub geometry_hash: String,
}

/// What is signed beside the bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Statement {
    /// `trued.offer/1`.
    pub schema: String,
    /// SHA-256 of the model file, hexadecimal.
    pub sha256: String,
    /// The robot.
    pub robot: OfferedRobot,
    /// Above the counter of the last offer that the cell took.
    pub counter: u64,
    /// From when on the offer is refused, ms since 1970-01-01 UTC.
    pub expires_unix_ms: u64,
}

/// Why an offer cannot be read, or is not what was signed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OfferError {
    /// No signature of minisign.
    #[error("the signature cannot be read: {0}; expected the file that `minisign -S` writes")]
    Signature(String),
    /// Its trusted comment is no statement.
    #[error(
        "the trusted comment cannot be read: {0}; expected what `trued-plant statement` prints"
    )]
    Statement(String),
    /// The bytes are others than the stated ones.
    #[error(
        "the model has SHA-256 {found}, the statement has {stated}; the file is incomplete or was changed"
    )]
    Torn {
        /// Of the bytes.
        found: String,
        /// As stated.
        stated: String,
    },
    /// No accepted key signed it.
    #[error("not signed by any of the accepted keys: {0}")]
    NotSigned(String),
    /// The bytes are no model.
    #[error("not a model: {0}")]
    Model(String),
    /// The model does not say for which robot it is.
    #[error("the model states no serial number; add `serial` to its table [robot]")]
    NoSerial,
    /// The model is of another robot than the statement says.
    #[error("the statement is for another robot than the model")]
    RobotsDiffer,
}

/// SHA-256 in hexadecimal digits.
#[must_use]
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Reads the bytes of a model.
///
/// # Errors
/// [`OfferError::Model`] with the first faults.
pub fn read_model(bytes: &[u8]) -> Result<RobotModel, OfferError> {
    let text = str::from_utf8(bytes).map_err(|why| OfferError::Model(why.to_string()))?;
    RobotModel::parse("offered", text).map_err(|why| OfferError::Model(why.to_string()))
}

impl OfferedRobot {
    /// The robot of a model.
    ///
    /// # Errors
    /// [`OfferError::NoSerial`].
    pub fn of(model: &RobotModel) -> Result<Self, OfferError> {
        let identity = model.file.identity();
        let geometry_hash = identity.geometry();
        let serial = identity.robot.serial.ok_or(OfferError::NoSerial)?;
        Ok(Self { maker: identity.robot.maker, kind: identity.robot.kind, serial, geometry_hash })
    }
}

impl Statement {
    /// What is to be signed with these bytes of a model.
    ///
    /// # Errors
    /// The bytes are no model, or one without a serial number.
    pub fn of(bytes: &[u8], counter: u64, expires_unix_ms: u64) -> Result<Self, OfferError> {
        let robot = OfferedRobot::of(&read_model(bytes)?)?;
        let schema = STATEMENT_SCHEMA.to_owned();
        Ok(Self { schema, sha256: sha256(bytes), robot, counter, expires_unix_ms })
    }

    /// Reads the trusted comment of a signature, which is not verified by this.
    ///
    /// # Errors
    /// See [`OfferError`].
    pub fn read(signature: &str) -> Result<Self, OfferError> {
        let signature = decode(signature)?;
        let read: Self = serde_json::from_str(signature.trusted_comment())
            .map_err(|why| OfferError::Statement(why.to_string()))?;
        if read.schema != STATEMENT_SCHEMA {
            let why = format!("format `{}` instead of `{STATEMENT_SCHEMA}`", read.schema);
            return Err(OfferError::Statement(why));
        }
        Ok(read)
    }
}

fn decode(signature: &str) -> Result<Signature, OfferError> {
    Signature::decode(signature).map_err(|why| OfferError::Signature(why.to_string()))
}

/// Verifies bytes and trusted comment against the keys.
///
/// # Errors
/// [`OfferError::NotSigned`] where no key fits.
pub fn verify(bytes: &[u8], signature: &str, keys: &[PublicKey]) -> Result<(), OfferError> {
    let signature = decode(signature)?;
    let mut why = "the signature is of another key".to_owned();
    for key in keys {
        match key.verify(bytes, &signature, false) {
            Ok(()) => return Ok(()),
            Err(minisign_verify::Error::UnexpectedKeyId) => {}
            Err(minisign_verify::Error::UnexpectedAlgorithm) => {
                why = "the signature has the legacy format; sign without `-l`, with minisign 0.10 or later".to_owned();
            }
            Err(refused) => why = refused.to_string(),
        }
    }
    Err(OfferError::NotSigned(why))
}
