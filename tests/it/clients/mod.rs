//! The client library in every language, against the real daemon: the same bits, the same errors.

mod abi;
mod faulty;
mod figures;
mod outage;
mod python;
mod ros2;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use tests::clients::{Language, Prefix, has, skipped};
use tests::place::{CELL, TestDirectory};
use tests::process::Process;

use crate::TRUED;

/// The examples in Rust.
const EVERY_CALL: &str = env!("CARGO_BIN_EXE_every-call");
const OUTAGE: &str = env!("CARGO_BIN_EXE_outage");
const LIMIT: Duration = Duration::from_secs(20);

/// Tables of the examples' cell besides its robot.
const TABLES: &str = "[force]\nrate_Hz = 10000.0\nchannels = 3\n[vibration]\nenabled = true\n[cycle]\nperiod_ms = 0.1\n[recorder]\ndir = \"recordings\"\n";

/// Folder of the build for files shared by tests.
fn scratch() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

/// The daemon that takes its time from the commands: the same commands get the same bits.
fn lockstep(tables: &str) -> (TestDirectory, Process) {
    started("full", tables, &["--lockstep"])
}

/// A daemon that is ready.
fn started(mode: &str, tables: &str, arguments: &[&str]) -> (TestDirectory, Process) {
    let place = TestDirectory::new(mode, tables);
    let config = place.file("cell.toml");
    let run = ["run", "--config", config.to_str().unwrap()];
    let daemon = Process::start(TRUED, &[&run, arguments].concat(), &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    (place, daemon)
}

/// A program of that place's cell.
fn beside(place: &TestDirectory, program: &Path) -> Command {
    let mut command = Command::new(program);
    command.env(shm_schema::RUNTIME_DIR_ENV, place.root()).arg(CELL);
    command
}

/// One program per language supported by this machine.
fn compiled(prefix: &Prefix, source: &str) -> Vec<(Language, PathBuf)> {
    let all = [Language::C, Language::Cpp].into_iter();
    all.filter_map(|language| Some((language, built(prefix, language, source)?))).collect()
}

/// A program in that language; `None` if this machine lacks the tools.
fn built(prefix: &Prefix, language: Language, source: &str) -> Option<PathBuf> {
    can_build(language, source).then(|| prefix.build(language, source))
}

/// Whether this machine has the tools for a language; otherwise this is reported and counted.
fn can_build(language: Language, source: &str) -> bool {
    let needs = ["pkg-config", language.compiler()];
    if let Some(missing) = needs.iter().find(|program| !has(program)) {
        skipped(scratch(), &format!("{source} in {language:?}"), &format!("no `{missing}`"));
        return false;
    }
    true
}
