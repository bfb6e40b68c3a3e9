//! `cargo fuzz run request`: see README.md.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| trued_fuzz::run("request", bytes));
