//! The file `diagnosis.json`.
//!
//! Contains the object of one domain, or a list of several domains.

use recording::program;
use serde::Serialize;

use super::Report;
use crate::error::Error;

/// `diagnosis.json`: the object of one domain, or several domains.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum DiagnosisJson<'a> {
    /// One domain.
    One(&'a Report),
    /// Several domains.
    Several {
        /// Positions first.
        domains: &'a [Report],
    },
}

impl<'a> DiagnosisJson<'a> {
    /// For one or several reports.
    #[must_use]
    pub fn of(reports: &'a [Report]) -> Self {
        match reports {
            [one] => Self::One(one),
            several => Self::Several { domains: several },
        }
    }
}

/// The result as JSON text.
pub(crate) fn json(reports: &[Report]) -> Result<String, Error> {
    let text =
        program::json("trued.diagnosis/1", &DiagnosisJson::of(reports)).map_err(Error::internal)?;
    Ok(text + "\n")
}
