//! The Python package: installed by `pip` into a separate environment, as by a user.
//!
//! Needs `python3` with `venv`, and the package registry for the build tools; otherwise the test is
//! SKIPPED.

use super::{TABLES, lockstep, scratch, started};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use tests::clients::{figures, root, run, skipped};
use tests::python::{environment, pip, tried};

/// Packages needed besides `trued` itself: to build it, to run it, to check its types.
const TOOLS: [&str; 4] = ["maturin>=1.16,<2", "numpy>=1.23", "mypy", "typing_extensions"];

/// An example of the package.
pub(super) fn example(name: &str) -> PathBuf {
    root().join("client/python/examples").join(name)
}

/// A Python with the package, built from this tree; `None` if this machine lacks the tools.
pub(super) fn interpreter(what: &str) -> Option<&'static Path> {
    static MADE: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    match MADE.get_or_init(make) {
        Ok(python) => Some(python),
        Err(why) => {
            skipped(scratch(), what, why);
            None
        }
    }
}

fn make() -> Result<PathBuf, String> {
    let home = scratch().join("python");
    let python = environment(&home, &TOOLS)?;
    let crates = root().join("client/python/Cargo.toml");
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let mut fetch = Command::new(cargo);
    fetch.args(["fetch", "--quiet", "--locked", "--manifest-path"]).arg(crates);
    tried(&mut fetch, "the crates of the package cannot be had")?;
    // From here on nothing is missing: a failure is the package's. The profile is that of these
    // tests.
    let bin = home.join("bin").display().to_string();
    let path = format!("{bin}:{}", std::env::var("PATH").unwrap_or_default());
    run(pip(&python)
        .args(["--no-build-isolation", "--no-deps", "--force-reinstall"])
        .arg(root().join("client/python"))
        .env("PATH", path)
        .env("CARGO_TARGET_DIR", scratch().join("python-target"))
        .env("MATURIN_PEP517_ARGS", "--profile dev")
        .env_remove("RUSTFLAGS"));
    Ok(python)
}

/// Most processor time of a cycle in Python, µs: half of its millisecond.
const CPU_US_MAX: f64 = 500.0;

#[test]
fn python_holds_a_kilohertz() {
    let what = "a kilohertz in Python";
    let Some(python) = interpreter(what) else { return };
    let mut best = 0.0_f64;
    for _ in 0..5 {
        let (place, _daemon) = started("full", TABLES, &[]);
        let mut command = Command::new(python);
        command.arg(root().join("client/python/tests/kilohertz.py"));
        command.env(shm_schema::RUNTIME_DIR_ENV, place.root());
        let results = figures(&run(command.args([tests::place::CELL, "3"])));
        println!("{results:?}");
        let number = |name: &str| results[name].parse::<f64>().unwrap();
        assert!(number("cpu_us") < CPU_US_MAX, "whatever else runs here: {results:?}");
        let is_answered = number("answered") > 0.5 * number("cycles");
        best = best.max(if is_answered { number("rate_hz") } else { 0.0 });
        if best > 990.0 {
            return;
        }
    }
    // By its processor time it could; by the clock this machine did not let it.
    skipped(scratch(), what, &format!("{best} Hz at most by the clock: this machine is busy"));
}

#[test]
fn the_package_behaves_as_its_types_and_words_say() {
    let Some(python) = interpreter("behaviour of the Python package") else { return };
    let (place, _daemon) = lockstep(TABLES);
    let mut command = Command::new(python);
    command.arg(root().join("client/python/tests/behaviour.py"));
    let output =
        run(command.env(shm_schema::RUNTIME_DIR_ENV, place.root()).arg(tests::place::CELL));
    println!("{}", String::from_utf8_lossy(&output.stdout));
}

#[test]
fn the_stubs_are_those_of_the_package_and_the_examples_keep_to_them() {
    let Some(python) = interpreter("types of the Python package") else { return };
    run(Command::new(python).current_dir(scratch()).args(["-m", "mypy.stubtest", "trued"]));
    let examples = ["robot_loop.py", "every_call.py", "outage.py"].map(example);
    run(Command::new(python)
        .current_dir(scratch())
        .args(["-m", "mypy", "--strict"])
        .args(examples));
}
