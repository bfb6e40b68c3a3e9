//! Results of vibration analyses for people and programs: JSON, text, an HTML page, and the model
//! with the results.
//!
//! [`tap`]: impact tests, from recorded hits or response functions to natural frequencies with their damping.
//!
//! The same files and settings give the same bytes. Writes no file.

mod error;
pub mod tap;

pub use error::Error;
