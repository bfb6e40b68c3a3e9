//! A Python environment of its own, with packages from the registry.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::clients::has;

/// The interpreter of the environment in `home`, with these packages; made where it is not there.
///
/// # Errors
/// In words, what this machine lacks.
pub fn environment(home: &Path, packages: &[&str]) -> Result<PathBuf, String> {
    if !has("python3") {
        return Err("no `python3`".to_owned());
    }
    let python = home.join("bin/python");
    if !python.exists() {
        tried(Command::new("python3").args(["-m", "venv"]).arg(home), "no `venv`")?;
    }
    tried(pip(&python).args(packages), "what is needed cannot be installed")?;
    Ok(python)
}

/// `pip install` of that interpreter.
#[must_use]
pub fn pip(python: &Path) -> Command {
    let mut pip = Command::new(python);
    pip.args(["-m", "pip", "--disable-pip-version-check", "install", "--quiet"]);
    pip
}

/// Runs a command whose failure is this machine's.
///
/// # Errors
/// `what`, with what the command said.
pub fn tried(command: &mut Command, what: &str) -> Result<(), String> {
    match command.output() {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(format!("{what}: {}", String::from_utf8_lossy(&output.stderr))),
        Err(e) => Err(format!("{what}: {e}")),
    }
}
