//! The file `diagnosis.json`.
//!
//! Promises: one domain's object, or several as the contract has them. Never: a key of its own.

use recording::program;
use serde::Serialize;

use super::Report;
use crate::exit::Failure;

/// `diagnosis.json`: one domain's object, or several domains as the contract has them.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub(in crate::commands::diagnose) enum Whole<'a> {
    One(&'a Report),
    Several { domains: &'a [Report] },
}

impl<'a> Whole<'a> {
    pub(in crate::commands::diagnose) fn of(reports: &'a [Report]) -> Self {
        match reports {
            [one] => Self::One(one),
            several => Self::Several { domains: several },
        }
    }
}

/// The object by itself.
pub(in crate::commands::diagnose) fn json(reports: &[Report]) -> Result<String, Failure> {
    #[derive(Serialize)]
    struct File<'a> {
        schema: &'static str,
        version: &'static str,
        #[serde(flatten)]
        whole: Whole<'a>,
    }
    let whole = Whole::of(reports);
    let file = File { schema: "trued.diagnosis/1", version: program::version(), whole };
    let mut text = serde_json::to_string_pretty(&file).map_err(Failure::system)?;
    text.push('\n');
    Ok(text)
}
