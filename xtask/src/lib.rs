//! Development tasks with tests: the generator of `docs/evidence.md`.
//!
//! Not part of the product: only tests depend on it.

pub mod evidence;
