//! Claims about the client that need shared memory, and some of them other processes.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test program")]

mod jam;
mod kill;
mod mini;
mod talk;
