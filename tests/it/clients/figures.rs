//! Each language's example corrects 10 000 targets, with the same bits as Rust's.

use super::{EVERY_CALL, TABLES, beside, compiled, lockstep, python, scratch};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use tests::clients::{Prefix, figures, has, run, skipped};

const TARGETS: &str = "10000";

/// Output of an example, without times; each uses a separate daemon, because a correction continues
/// from its present value.
fn said_by(program: &Path, targets: &str, arguments: &[&Path]) -> BTreeMap<String, String> {
    let (place, mut daemon) = lockstep(TABLES);
    let mut command = Command::new(program);
    command.args(arguments).env(shm_schema::RUNTIME_DIR_ENV, place.root());
    let output = run(command.args([tests::place::CELL, targets]));
    let mut results = figures(&output);
    println!("{}: {results:?}", program.display());
    results.retain(|name, _| !name.starts_with("round_trip"));
    assert!(daemon.end().success());
    assert_eq!(place.remaining_names(), Vec::<String>::new(), "a client that left leaves nothing");
    results
}

fn rust(targets: &str) -> BTreeMap<String, String> {
    let results = said_by(Path::new(EVERY_CALL), targets, &[]);
    for (name, value) in [
        ("targets", targets),
        ("force_blocks", "350"),
        ("force_lost", "0"),
        ("rings_hz", "72"),
        ("rings_axis", "1"),
        ("joints", "6"),
        ("mode", "2"),
        ("bypassed", "1"),
        ("reload_refused", "1"),
        ("steered", "1"),
        ("mark_refused", "1"),
        ("points_sent", "2"),
        ("points_lost", "0"),
        ("trim_state", "0"),
        ("trim_points", "0"),
    ] {
        assert_eq!(results.get(name).map(String::as_str), Some(value), "{name}");
    }
    assert!(results["corrected"].parse::<u32>().unwrap() > 0, "{results:?}");
    results
}

#[test]
fn ten_thousand_targets_have_the_same_bits_in_every_language() {
    let expected = rust(TARGETS);
    assert_eq!(said_by(Path::new(EVERY_CALL), TARGETS, &[]), expected, "Rust itself, once more");
    let prefix = Prefix::install("figures");
    for (language, program) in compiled(&prefix, "every_call") {
        assert_eq!(said_by(&program, TARGETS, &[]), expected, "{language:?}");
    }
    if let Some(interpreter) = python::interpreter("every_call in Python") {
        let script = python::example("every_call.py");
        assert_eq!(said_by(interpreter, TARGETS, &[&script]), expected, "Python");
    }
}

#[test]
fn a_prefix_that_was_moved_still_builds_and_runs() {
    let expected = rust("300");
    let mut prefix = Prefix::install("moved");
    prefix.move_away();
    for (language, program) in compiled(&prefix, "every_call") {
        assert_eq!(said_by(&program, "300", &[]), expected, "{language:?}");
    }
    if ["cmake", "make", "cc", "c++"].iter().all(|program| has(program)) {
        for program in prefix.build_by_cmake("every_call") {
            assert_eq!(said_by(&program, "300", &[]), expected, "{}", program.display());
        }
    } else {
        skipped(scratch(), "CMake package after moving", "no `cmake`, `make`, `cc` or `c++`");
    }
}

#[test]
fn the_cmake_package_is_found_where_it_was_installed() {
    if !["cmake", "make", "cc", "c++"].iter().all(|program| has(program)) {
        skipped(scratch(), "CMake package", "no `cmake`, `make`, `cc` or `c++`");
        return;
    }
    let expected = rust("300");
    let prefix = Prefix::install("cmake");
    for program in prefix.build_by_cmake("every_call") {
        assert_eq!(said_by(&program, "300", &[]), expected, "{}", program.display());
    }
}

#[test]
fn the_ten_lines_run_in_every_language() {
    let (place, _daemon) = lockstep("");
    let prefix = Prefix::install("ten-lines");
    for (_, program) in compiled(&prefix, "robot_loop") {
        run(beside(&place, &program).arg("20"));
    }
    if let Some(interpreter) = python::interpreter("robot_loop in Python") {
        let mut command = Command::new(interpreter);
        command.arg(python::example("robot_loop.py"));
        run(command
            .env(shm_schema::RUNTIME_DIR_ENV, place.root())
            .args([tests::place::CELL, "20"]));
    }
}

#[test]
fn a_c_program_leaks_nothing_and_touches_nothing_that_is_not_its_own() {
    if !has("valgrind") {
        skipped(scratch(), "examples under valgrind", "no `valgrind`");
        return;
    }
    let expected = rust("300");
    let prefix = Prefix::install("valgrind");
    for (language, program) in compiled(&prefix, "every_call") {
        let arguments = [
            Path::new("--quiet"),
            Path::new("--error-exitcode=9"),
            Path::new("--leak-check=full"),
            Path::new("--errors-for-leak-kinds=definite,indirect"),
            &program,
        ];
        let results = said_by(Path::new("valgrind"), "300", &arguments);
        assert_eq!(results, expected, "{language:?}");
    }
}
