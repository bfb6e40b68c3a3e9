//! The file `diagnosis.json`.
//!
//! Promises: one domain's object, or several as the contract has them. Never: a key of its own.

use recording::program;
use serde::Serialize;

use super::Report;
use crate::error::Error;

/// `diagnosis.json`: one domain's object, or several domains as the contract has them.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Whole<'a> {
    /// One domain.
    One(&'a Report),
    /// Several domains.
    Several {
        /// Positions first.
        domains: &'a [Report],
    },
}

impl<'a> Whole<'a> {
    /// Of one domain or several.
    #[must_use]
    pub fn of(reports: &'a [Report]) -> Self {
        match reports {
            [one] => Self::One(one),
            several => Self::Several { domains: several },
        }
    }
}

/// The object by itself.
pub(crate) fn json(reports: &[Report]) -> Result<String, Error> {
    let text = program::json("trued.diagnosis/1", &Whole::of(reports)).map_err(Error::internal)?;
    Ok(text + "\n")
}
