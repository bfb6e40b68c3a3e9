//! The program. Everything is in the library, so that tests can build the same program.

use std::process::ExitCode;

fn main() -> ExitCode {
    trued::run(std::env::args_os())
}
