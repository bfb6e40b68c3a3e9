//! The subcommands, one file each. Only what works stands here: what is listed in the help can be relied on.
//!
//! To add one: a file with `#[derive(clap::Args)] pub(crate) struct X` and `pub(crate) fn run(&self, &mut Console) ->
//! Outcome`, a variant below, an arm in [`run`]. Its place in the help is already kept in `help.rs`.

mod demo;
mod run;

use clap::Subcommand;

use crate::exit::Outcome;
use crate::output::Console;

/// What the program can do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Demo(demo::Demo),
    Run(run::Run),
}

/// Runs the command that was asked for.
pub(crate) fn run(command: &Command, console: &mut Console) -> Outcome {
    match command {
        Command::Demo(demo) => demo.run(console),
        Command::Run(run) => run.run(console),
    }
}
