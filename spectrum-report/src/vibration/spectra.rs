//! Spectra of the whole recording: power density and lines of every channel.

use spectrum::offline::{AveragedSpectrum, Line, LineConditions, SpectrumAverager};
use spectrum::welch::{Detrend, Scaling, Segments, Spectrum, Taper};
use spectrum::{Axis, Class, State, Verdict};

use super::input::{Piece, Source};
use super::monitor::{Episode, MonitoredGroup};
use super::samples::GapHandling;
use crate::error::Error;
use crate::parallel;

/// Maximum number of lines of a channel.
const LINES_MAX: usize = 20;
/// Uncertainty of a line's frequency between the bins, bins.
const LINE_PART: f64 = 0.1;
/// A line of the whole recording is one that the monitor tracked if they are this close, Hz.
const SAME_HZ: f64 = 1.0;

/// One channel's spectrum over the whole recording.
pub struct ChannelSpectrum {
    /// Its channel, from 0.
    pub channel: usize,
    /// One-sided power density, unit²/Hz.
    pub density: Spectrum,
    /// Root mean square of the signal.
    pub rms: f64,
    /// Its lines, the strongest first.
    pub lines: Vec<ClassifiedLine>,
}

/// A line of the whole recording, and its most likely cause.
pub struct ClassifiedLine {
    /// Frequency in Hz and amplitude.
    pub line: Line,
    /// Its class, with the reasons.
    pub verdict: Verdict,
    /// Whether the monitor tracked it: its class then uses more than its frequency.
    pub is_tracked: bool,
}

/// Least number of samples of a window.
const SAMPLES_LEAST: usize = 16;

/// Length of the segments that are averaged, s: an eighth of the recording, within a quarter and two seconds.
pub(super) fn window_s(given_s: Option<f64>, source: &Source) -> Result<f64, Error> {
    let longest_s = source.pieces.iter().map(Piece::len).max().unwrap_or(0) as f64 / source.rate_hz;
    let window_s = given_s.unwrap_or_else(|| (0.125 * source.seconds()).clamp(0.25, 2.0));
    if !(window_s.is_finite() && window_s * source.rate_hz >= SAMPLES_LEAST as f64) {
        let window = match given_s {
            Some(_) => "--window is",
            None => "without --window, the window is",
        };
        return Err(Error::input(format!(
            "{window} {window_s} s, expected {SAMPLES_LEAST} samples or more; at {} Hz that is {:.3} s, of a recording of {longest_s:.3} s",
            source.rate_hz,
            SAMPLES_LEAST as f64 / source.rate_hz
        )));
    }
    if let Some(given_s) = given_s.filter(|given_s| *given_s > longest_s) {
        return Err(Error::input(format!(
            "--window is {given_s} s, longer than the recording without a gap, {} s: shorten the window, or leave it out",
            report::significant(longest_s, 4)
        )));
    }
    Ok(window_s.min(longest_s))
}

/// How segments of a time are cut.
pub(super) fn segments(rate_hz: f64, window_s: f64) -> Segments {
    let length = ((window_s * rate_hz).round() as usize).max(2);
    Segments {
        rate: rate_hz,
        length,
        overlap: length / 2,
        detrend: Detrend::Linear,
        taper: Taper::Hann,
        scaling: Scaling::Density,
    }
}

/// Power density and rms of one channel.
pub(super) struct ChannelMeasurement {
    averaged: AveragedSpectrum,
    pub(super) rms: f64,
}

/// Power density and rms of every channel, in one pass over the samples on each core.
pub(super) fn measure_all(
    source: &Source,
    window_s: f64,
) -> Result<Vec<ChannelMeasurement>, Error> {
    let all: Vec<usize> = (0..source.channels.len()).collect();
    let shares: Vec<&[usize]> = all.chunks(all.len().div_ceil(parallel::cores()).max(1)).collect();
    let mut measured = Vec::new();
    for share in parallel::map(&shares, |share| measure_channels(source, share, window_s)) {
        measured.extend(share?);
    }
    Ok(measured)
}

/// The same of some channels.
fn measure_channels(
    source: &Source,
    channels: &[usize],
    window_s: f64,
) -> Result<Vec<ChannelMeasurement>, Error> {
    let segments = segments(source.rate_hz, window_s);
    let mut averaging: Vec<SpectrumAverager> =
        channels.iter().map(|_| SpectrumAverager::new(segments)).collect();
    let mut rms: Vec<RmsOverSeconds> =
        channels.iter().map(|_| RmsOverSeconds::of_seconds(source.rate_hz)).collect();
    let mut samples = Vec::new();
    for piece in &source.pieces {
        for averaging in &mut averaging {
            averaging.begin(piece.len()).map_err(Error::input)?;
        }
        piece.samples.parts(GapHandling::Bridged, channels, 0..piece.len(), |part| {
            for (index, (averaging, rms)) in averaging.iter_mut().zip(&mut rms).enumerate() {
                samples.clear();
                samples.extend(part.iter().skip(index).step_by(channels.len()));
                averaging.push(&samples);
                rms.push(&samples);
            }
        })?;
        rms.iter_mut().for_each(RmsOverSeconds::end);
    }
    let finished = |(averaging, rms): (SpectrumAverager, RmsOverSeconds)| {
        Ok(ChannelMeasurement {
            averaged: averaging.finish().map_err(Error::input)?,
            rms: rms.value(),
        })
    };
    averaging.into_iter().zip(rms).map(finished).collect()
}

/// Root mean square around the mean of each second.
struct RmsOverSeconds {
    second: usize,
    held: Vec<f64>,
    sum: f64,
    count: usize,
}

impl RmsOverSeconds {
    fn of_seconds(rate_hz: f64) -> Self {
        Self { second: (rate_hz as usize).max(2), held: Vec::new(), sum: 0.0, count: 0 }
    }

    fn push(&mut self, mut samples: &[f64]) {
        while let Some((part, rest)) = samples.split_at_checked(self.second - self.held.len()) {
            self.held.extend_from_slice(part);
            samples = rest;
            self.end();
        }
        self.held.extend_from_slice(samples);
    }

    /// Ends the second that has begun.
    fn end(&mut self) {
        if self.held.is_empty() {
            return;
        }
        let mean = self.held.iter().sum::<f64>() / self.held.len() as f64;
        self.sum += self.held.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
        self.count += self.held.len();
        self.held.clear();
    }

    fn value(&self) -> f64 {
        if self.count > 0 { (self.sum / self.count as f64).sqrt() } else { 0.0 }
    }
}

/// The spectra of all channels with their lines.
pub(super) fn of(
    source: &Source,
    measured: Vec<ChannelMeasurement>,
    all: &[MonitoredGroup],
    episodes: &[Episode],
) -> Vec<ChannelSpectrum> {
    let longest = source.pieces.iter().max_by_key(|piece| piece.len());
    let mut spectra = Vec::new();
    for (channel, ChannelMeasurement { averaged, rms }) in measured.into_iter().enumerate() {
        let resolution_hz = averaged.mean.frequency.get(1).copied().unwrap_or(0.0);
        let uncertainty_hz = LINE_PART * resolution_hz;
        let standing =
            longest.map(|piece| piece.motion.line_conditions(source.teeth, uncertainty_hz));
        let standing = standing.unwrap_or_default();
        let mut classified: Vec<ClassifiedLine> = averaged
            .lines()
            .into_iter()
            .map(|line| classify(line, channel, resolution_hz, &standing, all, episodes))
            .collect();
        classified.truncate(LINES_MAX);
        spectra.push(ChannelSpectrum { channel, density: averaged.mean, rms, lines: classified });
    }
    spectra
}

/// The monitor's verdict on a line that it tracked, otherwise the class that follows from the
/// line's frequency.
fn classify(
    line: Line,
    channel: usize,
    resolution_hz: f64,
    standing: &LineConditions,
    all: &[MonitoredGroup],
    episodes: &[Episode],
) -> ClassifiedLine {
    let is_near = |episode: &&Episode| {
        (episode.frequency_hz - line.frequency).abs() < SAME_HZ.max(resolution_hz)
    };
    let tracked = episodes.iter().filter(is_near).min_by(|a, b| {
        let distance = |episode: &Episode| (episode.frequency_hz - line.frequency).abs();
        distance(a).total_cmp(&distance(b))
    });
    if let Some(episode) = tracked {
        return ClassifiedLine { line, verdict: episode.verdict, is_tracked: true };
    }
    let place = all.iter().find_map(|monitored| {
        let index = monitored.group.iter().position(|member| *member == channel)?;
        Some((monitored, Axis::of_channel(index)))
    });
    let verdict = place.map_or_else(unknown, |(monitored, axis)| {
        monitored.watch.classify_steady_line(axis, line.frequency, standing)
    });
    ClassifiedLine { line, verdict, is_tracked: false }
}

/// The verdict without a monitor.
fn unknown() -> Verdict {
    Verdict { state: State::Warn, class: Class::Unknown, ..Verdict::default() }
}
