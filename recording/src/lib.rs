//! File formats: models, recordings, mappings, configurations, manifests, MCAP recordings,
//! waveforms of instruments.
//!
//! Contains all parsers of external input. No input causes a panic; all errors of a file are
//! reported at once, with file, line, key or column, expectation and remedy; files are written
//! atomically. Inside the code all values are SI.

pub mod bridge;
pub mod cell;
pub mod check;
pub mod cut;
pub mod faults;
pub mod files;
pub mod manifest;
pub mod mapping;
pub mod mcap_recording;
pub mod model;
pub mod outputs;
mod partial_file;
pub mod program;
pub mod programs;
pub mod quiet_panic;
pub mod ros2;
#[cfg(feature = "schema")]
pub mod schema;
pub mod series;
mod toml_reader;
mod toml_text;
pub mod unit;
pub mod urdf;
pub mod waves;
mod xml;
