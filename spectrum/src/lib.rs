//! Vibration analysis: real-time monitor, offline spectra, modal analysis, stability of cuts,
//! surface profiles.
//!
//! No dependency on other crates of the workspace. No IPC, no clock, no file, no log. Planning can
//! allocate ([`VibrationMonitor::new`]); execution ([`VibrationMonitor::push`]) neither allocates
//! nor panics, so that the vibration thread can call it in real time.
//!
//! Processing chain of the monitor: [`Block`] → sensor checks → average over one revolution and
//! decimation → Hann windows of several lengths → power over a learned noise floor → peaks present
//! in two or three disjoint windows → tracked line → [`Verdict`].

mod advice;
mod alias;
mod asynchronous;
pub mod bench;
mod block;
mod branch;
mod channel_spectrum;
mod classify;
mod config;
mod cut_detection;
mod decimate;
mod display_spectrum;
mod ellipse;
mod fault;
mod floor;
mod force_ratio;
pub mod frf;
mod history;
mod line_evaluation;
pub mod modal;
mod monitor;
pub mod offline;
mod peak;
mod rules;
mod sidebands;
mod sliding;
pub mod spatial;
pub mod stability;
mod stream;
pub mod surface;
pub mod tap;
mod track;
mod transform;
mod verdict;
pub mod welch;
mod window;

pub use advice::against_chatter;
pub use alias::folded_hz;
pub use block::{Axis, Block, CHANNELS_MAX, ProcessState};
pub use config::{
    ConfigError, GEAR_FREQUENCIES_MAX, GearFrequency, MODES_MAX, Mode, MonitorConfig, RATE_MAX_HZ,
};
pub use display_spectrum::{BinLayout, DisplaySpectrum};
pub use fault::{Fault, Faults, Health};
pub use monitor::VibrationMonitor;
pub use realfft::num_complex::Complex;
pub use rules::Rules;
pub use stream::SensorStream;
pub use verdict::{Advice, Class, ClassSet, NearestLine, State, VERDICTS_MAX, Verdict, Verdicts};
pub use window::{amplitude_scale, density_scale, hann};
