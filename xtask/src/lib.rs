//! Tasks that are tested: the generator of `docs/evidence.md`.
//!
//! Never part of the product: nothing but tests depends on it.

pub mod evidence;
