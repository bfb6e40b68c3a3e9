//! Analyses of vibration for people and programs: JSON, lines of text, an HTML page, and the model with what was found.
//!
//! [`tap`]: impact tests, from recorded hits or response functions to natural frequencies with their damping.
//!
//! The same files and settings give the same bytes. Writes no file.

mod error;
pub mod tap;

pub use error::Error;
