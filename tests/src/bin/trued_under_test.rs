//! The program, for the tests of real processes.

fn main() -> std::process::ExitCode {
    trued::run(std::env::args_os())
}
