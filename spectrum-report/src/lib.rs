//! Results of vibration analyses for people and programs: JSON, text, an HTML page, and the model
//! with the results.
//!
//! - [`vibration`]: vibrations in a recording, with time and cause.
//! - [`surface`]: stylus profiles, separated into waviness and roughness, with parameters and lines.
//! - [`stability`]: whether a cut chatters, its distance from the limit, and the nearest stable cuts.
//! - [`gears`]: gear shafts and tooth meshes per millimetre of path, and the lines that they fit.
//! - [`tap`]: impact tests, from recorded hits or response functions to natural frequencies with their damping.
//!
//! The same files and settings give the same bytes. Writes no file.

mod error;
pub mod gears;
mod parallel;
pub mod stability;
pub mod surface;
pub mod tap;
pub mod vibration;

pub use error::Error;
