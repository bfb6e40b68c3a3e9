//! `cargo fuzz run manifest`: see README.md.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| trued_fuzz::run("manifest", bytes));
