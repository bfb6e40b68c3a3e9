//! A separate Python environment with packages from the registry.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A folder for files of tests.
pub(crate) fn scratch() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/tmp")
}

/// What a script in `tests/` answers to these lines.
pub(crate) fn answer(python: &Path, script: &str, lines: String) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(script);
    let pipe = Stdio::piped;
    let mut command = Command::new(python);
    command.arg(script).stdin(pipe()).stdout(pipe()).stderr(pipe());
    let mut child = command.spawn().expect("python starts");
    let mut input = child.stdin.take().expect("a pipe");
    let writer = std::thread::spawn(move || input.write_all(lines.as_bytes()));
    let output = child.wait_with_output().expect("python ends");
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {messages}", output.status);
    writer.join().expect("not dead").expect("written");
    String::from_utf8(output.stdout).expect("text")
}

/// The interpreter of the environment `name` with these packages, or what this machine lacks.
/// Concurrent tests share it: one installs, the others wait, and nothing is installed again,
/// because that would remove files of a running interpreter.
pub(crate) fn environment(name: &str, packages: &[&str]) -> Result<PathBuf, String> {
    let home = scratch().join(name);
    let python = home.join("bin/python");
    fs::create_dir_all(scratch()).map_err(|why| why.to_string())?;
    let lock =
        File::create(scratch().join(format!("{name}.lock"))).map_err(|why| why.to_string())?;
    lock.lock().map_err(|why| why.to_string())?;
    let installed = home.join("installed");
    if fs::read_to_string(&installed).is_ok_and(|found| found == packages.join("\n")) {
        return Ok(python);
    }
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
    fs::write(&installed, packages.join("\n")).map_err(|why| why.to_string())?;
    Ok(python)
}
