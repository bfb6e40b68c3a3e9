//! The program, for the tests of real processes.

fn main() {}
