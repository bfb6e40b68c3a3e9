//! Files in and out: models, recordings, mappings, cell configuration, the black box,
//! waveforms of instruments.
//!
//! Every parser of foreign input of the house stands here. Promise: no input makes it panic; a bad
//! file gives all its faults at once, with file, line, key or column, what was expected and what
//! to do; a file that is written appears whole or not at all. Inside the code all values are SI.

pub mod blackbox;
pub mod bridge;
pub mod cell;
pub mod cut;
pub mod faults;
pub mod files;
pub mod manifest;
pub mod mapping;
pub mod model;
pub mod program;
pub mod programs;
#[cfg(feature = "schema")]
pub mod schema;
pub mod series;
mod toml_text;
pub mod unit;
pub mod urdf;
mod walk;
pub mod waves;
mod xml;
