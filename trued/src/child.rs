//! Child processes of a command.

use std::process::Command;

/// This very program, for a further process of it.
pub(crate) fn myself() -> std::io::Result<Command> {
    Ok(Command::new(std::env::current_exe()?))
}
