//! A Python environment of its own for a peer, with packages from the registry.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A folder for what tests make.
pub(crate) fn scratch() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/tmp")
}

/// The interpreter of the environment `name` with these packages; in words, what this machine lacks.
pub(crate) fn environment(name: &str, packages: &[&str]) -> Result<PathBuf, String> {
    let home = scratch().join(name);
    let python = home.join("bin/python");
    let run = |command: &mut Command| match command.output() {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
        Err(error) => Err(error.to_string()),
    };
    if !python.exists() {
        run(Command::new("python3").args(["-m", "venv"]).arg(&home))?;
    }
    let pip = ["-m", "pip", "--disable-pip-version-check", "install", "--quiet"];
    run(Command::new(&python).args(pip).args(packages))?;
    Ok(python)
}
