//! Child processes of a command, which end with their handle.

use std::process::{Command, Stdio};

use harness::child::Guarded;

use crate::exit::Failure;

/// Starts a process without standard input.
pub(crate) fn spawned(command: &mut Command) -> Result<Guarded, Failure> {
    let started = Guarded::spawn(command.stdin(Stdio::null()));
    let program = command.get_program().display();
    started.map_err(|why| Failure::system(format!("cannot start {program}: {why}")))
}

/// This very program, for a further process of it.
pub(crate) fn myself() -> std::io::Result<Command> {
    Ok(Command::new(std::env::current_exe()?))
}
