//! Vibrations in a recording, with time and cause, as JSON (`trued.spectrum/1`), text and HTML page.
//!
//! [`read`] takes a recording with what is known of the cut; [`analyse`] runs the vibration monitor of the daemon over it, and computes spectra over time and
//! over the tool's path. Information that the recording lacks is stated as missing, never guessed; amplitudes are in the channels' own units. Modules in the
//! order in which to read them: `input` (channels without gaps), `samples` (in memory or in the file), `motion` (spindle, feed, path), `monitor` (lines over
//! time), `spectra` (lines of the whole recording), `path` (lines over the path, and gears), `analysis` (all of it), `result`, `text`, `page` and `plots`.
//!
//! ```no_run
//! use std::fs;
//!
//! use spectrum_report::vibration::{Inputs, Settings, analyse, read};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let inputs = Inputs { spindle_rpm: Some(6000.0), teeth: Some(2), ..Inputs::default() };
//! let source = read("forces.csv", &inputs)?;
//! let analysis = analyse(source, &Settings::default())?;
//! for episode in analysis.episodes.iter().filter(|episode| episode.is_alarm()) {
//!     let class = episode.verdict.class.name();
//!     println!("{:.1} Hz from {:.2} s: {class}", episode.frequency_hz, episode.from_s);
//! }
//! println!("{}", analysis.text(None, str::to_owned));
//! fs::write("spectrum.json", analysis.json()?)?;
//! fs::write("spectrum.html", analysis.page()?.render())?;
//! # Ok(())
//! # }
//! ```

mod analysis;
mod input;
mod monitor;
mod motion;
mod page;
mod path;
mod plots;
mod result;
mod samples;
mod spectra;
mod text;

pub use analysis::{Analysis, analyse};
pub use input::{Channel, Inputs, Source, read};
pub use monitor::Episode;
pub(crate) use path::lines_over_path;
pub use path::{ChannelPathSpectrum, GearMatch, PathGearFrequencies, PathLine, PathSpectra};
pub use result::Report;
pub use spectra::{ChannelSpectrum, ClassifiedLine};

/// How a recording is analysed.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// The monitor looks for lines between these frequencies, Hz; the lower first. Default 10 to
    /// 1000. Origin: the daemon's.
    pub band_hz: [f64; 2],
    /// Length of the windows of the averaged spectrum, s; at least 16 samples, at most the longest piece without a gap. Default: none, which is
    /// an eighth of the recording, at least 0.25 and at most 2.
    pub window_s: Option<f64>,
    /// The monitor reports no line below this amplitude, in the channel's unit; above 0. Default: none,
    /// which is 0.1 N and 0.01 Nm as in the daemon, and `amplitude_least_part` for other units.
    pub amplitude_least: Option<f64>,
    /// The same for channels in other units, relative to the signal's rms; no unit, above 0. Default
    /// 0.02. Origin: a choice.
    pub amplitude_least_part: f64,
    /// How far a line must stand above the noise, relative to the daemon's threshold; no unit, 0.25 to
    /// 10. Default 1.
    pub threshold: f64,
    /// Mains frequency, Hz. Default: none, which is 50 or 60.
    pub mains_hz: Option<f64>,
    /// Recordings with fewer samples per second are not monitored, Hz; above 0. Default 400. Origin: a
    /// choice; windows of the monitor have too few samples below.
    pub rate_least_hz: f64,
    /// Shorter paths have no spectrum, mm; above 0. Default 20. Origin: a choice.
    pub path_least_mm: f64,
    /// A line over the path is one in time if both frequencies agree within this and half a bin; no
    /// unit, 0 to 1. Default 0.02. Origin: a choice.
    pub same_part: f64,
    /// A gear shaft fits a line within this, half a bin and the change of its speed; no unit, 0 to 1.
    /// Default 0.02. Origin: a choice.
    pub wheel_part: f64,
    /// Relative difference of feeds from which a line over the path can be distinguished from a line
    /// in time; no unit, above 0. Default 0.1. Origin: a choice.
    pub feed_part: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            band_hz: [10.0, 1000.0],
            window_s: None,
            amplitude_least: None,
            amplitude_least_part: 0.02,
            threshold: 1.0,
            mains_hz: None,
            rate_least_hz: 400.0,
            path_least_mm: 20.0,
            same_part: 0.02,
            wheel_part: 0.02,
            feed_part: 0.1,
        }
    }
}
