//! What of the chores is tried by tests: the maker of `docs/evidence.md`.
//!
//! Never part of the product: nothing but tests depends on it.

pub mod evidence;
