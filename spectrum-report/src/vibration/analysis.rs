//! All results on a recording, in the order of computation.

use std::path::Path;

use super::Settings;
use super::input::{Channel, Source};
use super::monitor::{self, Episode, MonitoredGroup};
use super::path::{self, PathGearFrequencies, PathSpectra};
use super::spectra::{self, ChannelSpectrum, ClassifiedLine};
use crate::error::Error;
use crate::stability;

/// Vibrations of a recording.
pub struct Analysis {
    /// The recording.
    pub source: Source,
    /// Lines over time: alarms first, then by amplitude.
    pub episodes: Vec<Episode>,
    /// The spectrum of each channel over the whole recording.
    pub spectra: Vec<ChannelSpectrum>,
    /// Length of the averaged windows, s.
    pub window_s: f64,
    /// The spectra over the tool's path; otherwise what is missing, as text.
    pub path: Result<PathSpectra, String>,
    /// The nearest stable cuts, as text, if they were added.
    pub nearest_stable: Vec<String>,
    /// Remarks, as text.
    pub notes: Vec<String>,
    pub(super) monitored: Vec<MonitoredGroup>,
}

/// Runs the vibration monitor on a recording, and computes spectra over time and over the tool's path.
///
/// Computes on all cores; the result does not depend on their number.
///
/// # Errors
/// [`Error::Input`] if a setting is impossible for this recording; [`Error::File`] if samples that
/// remained in the file cannot be read.
pub fn analyse(source: Source, settings: &Settings) -> Result<Analysis, Error> {
    let mut notes = source.notes.clone();
    let window_s = spectra::window_s(settings.window_s, &source)?;
    let wheels = PathGearFrequencies::of(&source);
    let measured = spectra::measure_all(&source, window_s)?;
    let rms: Vec<f64> = measured.iter().map(|channel| channel.rms).collect();
    let monitored = monitor::monitor(settings, &source, &wheels.shafts(), &rms, &mut notes)?;
    let episodes = monitor::episodes(&source, &monitored)?;
    let spectra = spectra::of(&source, measured, &monitored, &episodes);
    let path = path::of(settings, &source, wheels, &episodes, &spectra)?;
    let nearest_stable = Vec::new();
    Ok(Analysis { source, episodes, spectra, window_s, path, nearest_stable, notes, monitored })
}

impl Analysis {
    /// Whether a line is an alarm that requires action.
    #[must_use]
    pub fn has_alarm(&self) -> bool {
        self.episodes.iter().any(Episode::is_alarm)
    }

    /// Whether a line is an alarm that another cut would remove.
    #[must_use]
    pub fn chatters(&self) -> bool {
        self.episodes.iter().any(Episode::is_chatter)
    }

    /// Adds the nearest stable cuts that are predicted from a cut's file (`trued.cut/1`), if the cut
    /// chatters; otherwise the file is not read.
    ///
    /// # Errors
    /// As [`stability::nearest_stable`].
    pub fn add_nearest_stable(&mut self, cut: &Path) -> Result<(), Error> {
        let found = stability::nearest_stable(cut)?;
        if self.chatters() {
            self.nearest_stable = found;
        }
        Ok(())
    }

    /// The lines of the whole recording, each with its channel.
    pub(crate) fn lines(&self) -> impl Iterator<Item = (&Channel, &ClassifiedLine)> {
        self.spectra.iter().flat_map(move |one| {
            let channel = &self.source.channels[one.channel];
            one.lines.iter().map(move |line| (channel, line))
        })
    }

    /// Whether the monitor had enough data for a result.
    #[must_use]
    pub fn is_monitored(&self) -> bool {
        self.monitored.iter().any(|monitored| !monitored.result.still_learning)
    }
}
