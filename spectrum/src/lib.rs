//! Windows, transforms, floors, peaks and verdicts on vibration; offline, FRF and surface profiles.
//!
//! No dependency on other crates of the workspace. No IPC, no clock, no file, no log. Planning can
//! allocate ([`Watch::new`]); execution ([`Watch::push`]) neither allocates nor panics, so that the
//! vibration thread can call it in real time.
//!
//! Path of a sample: [`Block`] → sensor checks → one-revolution average and decimation → Hann
//! windows of several lengths → power over a learned floor → peaks that two or three disjoint
//! windows agree on → a tracked line → a [`Verdict`].

mod advice;
mod alias;
mod asynchronous;
pub mod bench;
mod block;
mod branch;
mod classify;
mod config;
mod decimate;
mod ellipse;
mod family;
mod fault;
mod floor;
pub mod frf;
mod history;
mod judge;
pub mod modal;
pub mod offline;
mod overview;
mod peak;
mod rules;
mod share;
mod sliding;
pub mod spatial;
pub mod stability;
mod stream;
pub mod surface;
mod surroundings;
pub mod tap;
mod track;
mod transform;
mod verdict;
mod view;
mod watch;
pub mod welch;
mod window;

pub use alias::folded_hz;
pub use block::{Axis, Block, CHANNELS_MAX, ProcessState};
pub use config::{ConfigError, MODES_MAX, Mode, WHEELS_MAX, WatchConfig, Wheel};
pub use fault::{Fault, Faults, Health};
pub use overview::{Bins, Overview};
pub use realfft::num_complex::Complex;
pub use rules::Rules;
pub use stream::Stream;
pub use verdict::{Advice, Class, ClassSet, NearestLine, State, VERDICTS_MAX, Verdict, Verdicts};
pub use watch::Watch;
pub use window::{amplitude_scale, density_scale, hann};
