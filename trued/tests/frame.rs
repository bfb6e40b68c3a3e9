//! The program itself, from outside: help, version, usage, and closed streams.

use std::fs::File;
use std::process::{Command, Output, Stdio};

fn trued(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trued"));
    command.args(args).stdin(Stdio::null()).env_remove("NO_COLOR");
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn code(output: &Output) -> Option<i32> {
    output.status.code()
}

#[test]
fn help_is_an_answer_on_standard_output() {
    let output = trued(&["--help"]).output().expect("runs");
    assert_eq!(code(&output), Some(0));
    let help = text(&output.stdout);
    for part in ["Usage: trued", "--json", "Exit codes:\n  0    success\n", "130"] {
        assert!(help.contains(part), "{part} in {help}");
    }
    assert!(!help.contains('\u{1b}'), "no colour where there is no terminal");
    assert!(output.stderr.is_empty());
}

#[test]
fn the_version_is_reported() {
    let output = trued(&["--version"]).output().expect("runs");
    assert_eq!(text(&output.stdout), format!("{}\n", recording::program::version()));
    assert!(text(&output.stdout).starts_with(concat!("trued ", env!("CARGO_PKG_VERSION"))));
}

#[test]
fn bad_usage_is_refused_with_2_on_standard_error() {
    for args in [&[][..], &["dance"], &["--color", "sometimes"], &["-q", "-v"]] {
        let output = trued(args).output().expect("runs");
        assert_eq!(code(&output), Some(2), "{args:?}");
        assert!(output.stdout.is_empty() && !output.stderr.is_empty(), "{args:?}");
    }
}

#[test]
fn a_reader_that_left_is_no_error() {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let output = trued(&["--help"]).stdout(writer).output().expect("runs");
    assert_eq!(code(&output), Some(0), "{}", text(&output.stderr));
}

#[test]
fn a_full_disk_is_a_failure_of_the_system() {
    let full = File::options().write(true).open("/dev/full").expect("Linux has it");
    let output = trued(&["--help"]).stdout(full).output().expect("runs");
    assert_eq!(code(&output), Some(3), "{}", text(&output.stderr));
}
