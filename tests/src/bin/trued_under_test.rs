//! The program, for the tests of real processes.

use std::process::ExitCode;

fn main() -> ExitCode {
    trued::run(std::env::args_os())
}
