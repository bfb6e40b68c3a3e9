//! All results on a recording, in the order of computation.

use super::Spectrum;
use super::listen::{self, Episode, Listened};
use super::space::{self, Space, Wheels};
use super::spectra::{self, ChannelSpectrum};
use super::subject::Subject;
use crate::exit::Failure;

/// All results.
pub(super) struct Found {
    pub(super) listened: Vec<Listened>,
    /// Lines over time, the most harmful first.
    pub(super) episodes: Vec<Episode>,
    pub(super) spectra: Vec<ChannelSpectrum>,
    /// Length of the averaged windows, s.
    pub(super) window_s: f64,
    /// Over the path; otherwise what is missing.
    pub(super) space: Result<Space, String>,
    /// The nearest stable cuts in words, if the cut is given and chatters.
    pub(super) nearest_stable: Vec<String>,
    pub(super) notes: Vec<String>,
}

impl Found {
    pub(super) fn of(asked: &Spectrum, subject: &Subject) -> Result<Self, Failure> {
        let mut notes = subject.notes.clone();
        let window_s = spectra::window_s(asked.window, subject)?;
        let wheels = Wheels::of(subject);
        let measured = spectra::measured(subject, window_s)?;
        let rms: Vec<f64> = measured.iter().map(|channel| channel.rms).collect();
        let listened = listen::listen(asked, subject, &wheels.shafts(), &rms, &mut notes)?;
        let episodes = listen::episodes(subject, &listened)?;
        let spectra = spectra::of(subject, measured, &listened, &episodes);
        let space = space::of(subject, wheels, &episodes, &spectra)?;
        let nearest_stable = Vec::new();
        Ok(Self { listened, episodes, spectra, window_s, space, nearest_stable, notes })
    }
}
