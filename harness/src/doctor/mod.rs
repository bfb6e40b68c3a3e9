//! `trued doctor`: checks whether a machine is suitable for a robot's cycle, with the fix if not.
//!
//! Every result is a pure function of texts of the kernel, read once by [`KernelInfo::read`]; a
//! text that is missing or invalid gives the result unknown. The machine is not changed. On request
//! the kernel's own tool measures wake-up latency.

mod checks;
pub(crate) mod parse;
mod texts;
mod timerlat;

use serde::Serialize;

pub use checks::run_checks;
pub use texts::{Core, IdleState, KernelInfo};
pub use timerlat::TimerlatSettings;

/// Result of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Suitable for a robot's cycle.
    Pass,
    /// Not suitable: the remedy is stated.
    Fix,
    /// The machine does not provide the information.
    Unknown,
}

/// One line of the result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Check {
    /// The subject.
    pub name: &'static str,
    /// The result.
    pub state: State,
    /// The value found.
    pub found: String,
    /// The remedy; empty if it passes.
    pub fix: String,
}

impl Check {
    fn pass(name: &'static str, found: impl Into<String>) -> Self {
        Self { name, state: State::Pass, found: found.into(), fix: String::new() }
    }

    fn fix(name: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { name, state: State::Fix, found: found.into(), fix: fix.into() }
    }

    fn unknown(name: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { name, state: State::Unknown, found: found.into(), fix: fix.into() }
    }
}

/// Result of all checks.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Diagnosis {
    /// All checks, in a fixed order.
    pub checks: Vec<Check>,
    /// Whether no check needs a fix.
    pub ok: bool,
}

/// Checks this machine; with settings, wake-up latency is measured as well.
#[must_use]
pub fn diagnose(timerlat: Option<TimerlatSettings>) -> Diagnosis {
    let mut checks = run_checks(&KernelInfo::read(std::path::Path::new("/")));
    checks.extend(timerlat.map(timerlat::measure));
    let ok = checks.iter().all(|check| check.state != State::Fix);
    Diagnosis { checks, ok }
}
