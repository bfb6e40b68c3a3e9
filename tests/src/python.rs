//! A separate Python environment, with packages from the registry.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::clients::has;

/// The interpreter of the environment in `home`, with these packages; created if it does not exist.
/// Concurrent tests share it: one installs, the others wait, and nothing is installed again,
/// because that would remove files of a running interpreter.
///
/// # Errors
/// What this machine lacks.
pub fn environment(home: &Path, packages: &[&str]) -> Result<PathBuf, String> {
    if !has("python3") {
        return Err("no `python3`".to_owned());
    }
    let python = home.join("bin/python");
    let refused = |why: std::io::Error| format!("{}: {why}", home.display());
    fs::create_dir_all(home.parent().unwrap_or(home)).map_err(refused)?;
    let lock = File::create(home.with_extension("lock")).map_err(refused)?;
    lock.lock().map_err(refused)?;
    let installed = home.join("installed");
    if fs::read_to_string(&installed).is_ok_and(|found| found == packages.join("\n")) {
        return Ok(python);
    }
    if !python.exists() {
        tried(Command::new("python3").args(["-m", "venv"]).arg(home), "no `venv`")?;
    }
    tried(pip(&python).args(packages), "what is needed cannot be installed")?;
    fs::write(&installed, packages.join("\n")).map_err(refused)?;
    Ok(python)
}

/// `pip install` of that interpreter.
#[must_use]
pub fn pip(python: &Path) -> Command {
    let mut pip = Command::new(python);
    pip.args(["-m", "pip", "--disable-pip-version-check", "install", "--quiet"]);
    pip
}

/// Runs a command whose failure is due to this machine.
///
/// # Errors
/// `what`, with the command's output.
pub fn tried(command: &mut Command, what: &str) -> Result<(), String> {
    match command.output() {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(format!("{what}: {}", String::from_utf8_lossy(&output.stderr))),
        Err(e) => Err(format!("{what}: {e}")),
    }
}
