//! `trued doctor`: checks whether a machine is suitable for a robot's cycle, with the fix if not.
//!
//! Promises: every judgement is a pure function of texts that the kernel gave, read once by [`Texts::read`]; a text that is missing or
//! makes no sense is said to be unknown, never taken for good or bad. Never: a change of the machine. On request the kernel's own tool measures wake-up latency.

mod checks;
pub(crate) mod parse;
mod texts;
mod timerlat;

use serde::Serialize;

pub use checks::examine;
pub use texts::{Core, IdleState, Texts};
pub use timerlat::TimerlatSettings;

/// What a check came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// As a robot's cycle wants it.
    Pass,
    /// Not so: the fix is said.
    Fix,
    /// The machine does not tell.
    Unknown,
}

/// One line of the answer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Check {
    /// What is looked at.
    pub name: &'static str,
    /// What it came to.
    pub state: State,
    /// What was found.
    pub found: String,
    /// What to do; empty where it passes.
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

/// The whole answer.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Diagnosis {
    /// All checks, in a fixed order.
    pub checks: Vec<Check>,
    /// Whether nothing wants a fix.
    pub ok: bool,
}

/// Looks at this machine; with settings, wake-up latency is measured as well.
#[must_use]
pub fn diagnose(timerlat: Option<TimerlatSettings>) -> Diagnosis {
    let mut checks = examine(&Texts::read(std::path::Path::new("/")));
    checks.extend(timerlat.map(timerlat::measure));
    let ok = checks.iter().all(|check| check.state != State::Fix);
    Diagnosis { checks, ok }
}
