//! The command line: common parts, and one file per command under `commands`.
//!
//! The conventions of docs/inputs.md and docs/reference/results.md (streams, `--json`, exit codes,
//! files complete or not at all) are implemented here once for every command. Logic that belongs to
//! a library of this project does not belong here.

pub mod atomic;
mod child;
mod cli;
mod commands;
mod corrections;
pub mod exit;
mod help;
mod in_time;
mod input;
pub mod interrupt;
mod lockstep;
mod logs;
pub mod options;
pub mod output;
pub mod progress;
pub mod provenance;
#[cfg(feature = "schema")]
pub mod schemas;
mod setpoints;
pub mod table;
mod wrap;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches};
use recording::program;

use crate::cli::Cli;
use crate::exit::{Answer, Failure};
use crate::output::Console;
use crate::provenance::Invocation;

/// Runs the program with these arguments, the first of which is its name; never panics on any of them.
///
/// Exit codes: see [`exit`].
pub fn run(args: impl Iterator<Item = OsString>) -> ExitCode {
    let args: Vec<OsString> = args.collect();
    let invocation = Invocation::of(&args);
    let cli = match parse(args) {
        Ok(cli) => cli,
        Err(told) => return tell(&told),
    };
    let mut console = Console::new(cli.common.clone()).of(invocation);
    logs::start(&console);
    let outcome = commands::run(&cli.command, &mut console);
    let outcome = outcome.and_then(|answer| console.close().map(|()| answer));
    if let Err(failure) = &outcome {
        console.complain(failure);
    }
    logs::finish();
    exit::code(&outcome)
}

/// The command line, for generating man pages and completions.
#[must_use]
pub fn command() -> clap::Command {
    // Clap puts the program's name before it.
    let version = program::version().trim_start_matches("trued ");
    help::dressed(Cli::command().version(version))
}

fn parse(args: Vec<OsString>) -> Result<Cli, clap::Error> {
    let mut matches = command().try_get_matches_from(args)?;
    Cli::from_arg_matches_mut(&mut matches)
}

/// Help and version are results; everything else is a usage error.
fn tell(told: &clap::Error) -> ExitCode {
    let outcome = match told.print() {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::system(error)),
        _ if told.use_stderr() => Err(Failure::input("usage")),
        _ => Ok(Answer::Done),
    };
    exit::code(&outcome)
}
