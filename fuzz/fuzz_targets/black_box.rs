//! `cargo fuzz run black_box`: see README.md.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| trued_fuzz::run("black_box", bytes));
