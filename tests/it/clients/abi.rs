//! The C library exports exactly what its header declares, and misuse of it only causes errors.

use super::{TABLES, beside, built, lockstep, scratch};
use std::collections::BTreeSet;
use std::fs;
use std::process::Command;
use tests::clients::{Language, Prefix, figures, has, root, run, skipped};

#[test]
fn the_library_exports_what_the_header_declares_and_nothing_else() {
    if !has("nm") {
        skipped(scratch(), "exported symbols", "no `nm`");
        return;
    }
    let prefix = Prefix::install("symbols");
    let library = prefix.path().join("lib/libtrued_client.so.1");
    let output =
        run(Command::new("nm").args(["-D", "--defined-only", "--format=posix"]).arg(library));
    let text = String::from_utf8(output.stdout).unwrap();
    let exported: BTreeSet<&str> = text.lines().filter_map(|l| l.split(' ').next()).collect();
    let header = fs::read_to_string(root().join("client/c/include/trued.h")).unwrap();
    let code: String = header.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let tokens = code.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '('));
    let declared: BTreeSet<&str> = tokens
        .filter_map(|token| token.split_once('('))
        .map(|(name, _)| name)
        .filter(|name| name.starts_with("trued_"))
        .collect();
    assert!(declared.len() > 40, "{declared:?}");
    assert_eq!(exported, declared);
}

#[test]
fn programs_remember_the_library_by_its_major_version() {
    if !has("readelf") {
        skipped(scratch(), "SONAME", "no `readelf`");
        return;
    }
    let prefix = Prefix::install("soname");
    let Some(program) = built(&prefix, Language::C, "robot_loop") else { return };
    let needed = run(Command::new("readelf").arg("-d").arg(program));
    let needed = String::from_utf8(needed.stdout).unwrap();
    assert!(needed.contains("[libtrued_client.so.1]"), "{needed}");
}

#[test]
fn every_misuse_is_the_right_error_and_breaks_nothing() {
    let prefix = Prefix::install("misuse");
    let Some(program) = built(&prefix, Language::C, "misuse") else { return };
    let (place, _daemon) = lockstep(TABLES);
    let results = figures(&run(&mut beside(&place, &program)));
    assert_eq!(results["faults"], "0");

    if !has("valgrind") {
        skipped(scratch(), "misuse under valgrind", "no `valgrind`");
        return;
    }
    let mut command = Command::new("valgrind");
    command.args(["--quiet", "--error-exitcode=9", "--fair-sched=yes"]).arg(&program);
    command.env(shm_schema::RUNTIME_DIR_ENV, place.root()).arg(tests::place::CELL);
    assert_eq!(figures(&run(&mut command))["faults"], "0");
}
