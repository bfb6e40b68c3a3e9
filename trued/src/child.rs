//! Child processes of a command.

use std::process::Command;

/// This very program, for a further process of it.
pub(crate) fn this_program() -> std::io::Result<Command> {
    Ok(Command::new(std::env::current_exe()?))
}
