//! The C interface of the client library.
//!
//! Promise: no panic crosses it, no call waits without a time limit, every detectable misuse is an error with a message; the
//! content of `trued.h` is stable while the library is `.so.1`. Never: corrections, connections or rules of its own; these are in
//! `trued_client`.
//!
//! `unsafe` is used where C cannot express guarantees by types. Each `SAFETY` comment relies on the rules at the top of `trued.h`.
#![expect(unsafe_code, reason = "pointers of C; this crate is where they end")]
#![expect(non_camel_case_types, reason = "the names are C's")]
#![expect(clippy::doc_markdown, reason = "these words stand in a C header")]
#![expect(clippy::missing_safety_doc, reason = "said once for all at the top of trued.h")]

mod border;
mod client;
mod client_ask;
mod code;
mod force;
mod handle;
mod instrument;
mod lists;
mod monitor;
mod reply;
mod structs;
mod translate;

pub use border::TRUED_LIMIT_NS_MAX;
pub use client::*;
pub use client_ask::*;
pub use code::{trued_code, trued_code_name, trued_last_error};
pub use force::*;
pub use instrument::*;
pub use lists::*;
pub use monitor::*;
pub use structs::*;

use core::ffi::c_char;

/// The version of what is declared here: major in the upper 16 bits, minor in the lower ones.
pub const TRUED_ABI_VERSION: u32 = 0x0001_0001;

/// The version of the loaded library. A major version other than TRUED_ABI_VERSION's is incompatible; a smaller minor version lacks
/// parts of this header.
#[unsafe(no_mangle)]
pub extern "C" fn trued_abi_version() -> u32 {
    TRUED_ABI_VERSION
}

/// The version of the library as text, with the version of the shared-memory contract. Never NULL; do not free.
#[unsafe(no_mangle)]
pub extern "C" fn trued_version() -> *const c_char {
    static WORDS: std::sync::OnceLock<std::ffi::CString> = std::sync::OnceLock::new();
    let made = || std::ffi::CString::new(::trued_client::contract()).unwrap_or_default();
    WORDS.get_or_init(made).as_ptr()
}

/// CLOCK_MONOTONIC, the one clock of all times here.
#[unsafe(no_mangle)]
pub extern "C" fn trued_monotonic_ns() -> u64 {
    ::trued_client::monotonic_ns()
}
