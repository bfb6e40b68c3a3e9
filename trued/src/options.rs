//! Common options of commands, to be flattened into theirs.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{ArgAction, Args, ValueEnum};
use diagnosis::threads::limit_threads;

use crate::exit::Failure;

/// Options of every command.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Options of every command")]
pub struct Common {
    /// Also write the result as one JSON object to FILE; `-`: to standard output, and the text to standard error
    #[arg(long, value_name = "FILE", global = true)]
    pub json: Option<PathBuf>,
    /// Overwrite existing files. Without it, only earlier results of trued (JSON, pages, plots) are overwritten. Input files are never overwritten
    #[arg(long, global = true)]
    pub overwrite: bool,
    /// Show no progress, and log errors only
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Log more; `-vv` logs everything
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub verbose: u8,
    /// Colour the text output; `auto`: on a terminal, unless `NO_COLOR` is set
    #[arg(long, value_name = "auto|always|never", global = true, value_enum, default_value_t)]
    #[arg(hide_possible_values = true, hide_default_value = true)]
    pub color: Color,
}

/// When text is coloured.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Color {
    /// On a terminal, unless `NO_COLOR` is set.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// For commands where chance plays a part. A seed is never refused, also where nothing is drawn: scripts give it to
/// every call.
#[derive(Debug, Clone, Args)]
pub struct Seed {
    /// Seed of the random numbers; if not given, a random one is used and reported
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

impl Seed {
    /// The given seed, or a random one below a million so that it can be typed. The command states
    /// it.
    #[must_use]
    pub fn resolve(&self) -> u64 {
        self.seed.unwrap_or_else(|| RandomState::new().build_hasher().finish() % 1_000_000)
    }
}

/// For commands whose work is spread over threads; results do not depend on it.
#[derive(Debug, Clone, Args)]
pub struct Threads {
    /// Number of threads; if not given, one for each available core
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
}

impl Threads {
    /// How many threads to work with.
    #[must_use]
    pub fn resolve(&self) -> NonZeroUsize {
        let offered = || std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
        self.threads.unwrap_or_else(offered)
    }

    /// Limits the threads of this process's diagnoses, if a number is given.
    ///
    /// # Errors
    /// The system provides no threads.
    pub(crate) fn bound(&self) -> Result<(), Failure> {
        self.threads.map_or(Ok(()), |threads| limit_threads(threads).map_err(Failure::system))
    }
}

/// Parses `--tolerance-mm`, mm: above 0.
///
/// # Errors
/// Why the text is not such a length.
pub(crate) fn tolerance_mm(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(format!("{text} is out of range, expected a length above 0 mm"))
    }
}

/// The name of a value on the command line, for the default in a help text.
pub(crate) fn value_name(value: &impl ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

/// A default in the unit of its option, without the last digits of the conversion.
pub(crate) fn in_unit(si: f64, unit_si: f64) -> f64 {
    /// Decimals that a default may have.
    const DECIMALS: f64 = 1e9;
    (si / unit_si * DECIMALS).round() / DECIMALS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_given_seed_is_used_and_a_drawn_one_can_be_typed() {
        assert_eq!(Seed { seed: Some(7) }.resolve(), 7);
        assert!(Seed { seed: None }.resolve() < 1_000_000);
    }
}
