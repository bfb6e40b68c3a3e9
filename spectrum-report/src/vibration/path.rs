//! Spectra over the tool's path in cycles per mm, matched with the gears.

use physics::JOINTS_MAX;
use recording::model::RobotModel;
use spectrum::GearFrequency;
use spectrum::offline::{AveragedSpectrum, Line};
use spectrum::spatial::{match_gears, resample_over_path};
use spectrum::welch::{Detrend, Segments, Spectrum, detrended};

use super::Settings;
use super::input::{Piece, Source};
use super::monitor::Episode;
use super::motion::{Motion, median, turns};
use super::samples::GapHandling;
use super::spectra::ChannelSpectrum;
use crate::error::Error;

/// The finest step of path, mm.
const FINEST_MM: f64 = 0.005;
/// Neither gears (decision 0010) nor waviness have more cycles per mm.
const MOST_PER_MM: f64 = 5.0;
/// Maximum number of steps.
const STEPS_MAX: f64 = 4e6;
/// Number of parts of a path, to check whether the joints turn evenly along it.
const PARTS: usize = 8;
/// Maximum number of lines of a channel.
const LINES_MAX: usize = 10;

/// Results over the path.
pub struct PathSpectra {
    /// How the path was determined, as text.
    pub by: &'static str,
    /// Length of the path, mm.
    pub length_mm: f64,
    /// Step of the path between two values of a spectrum's input, mm.
    pub step_mm: f64,
    /// Whether the feed was constant: a line in time then looks like a line over the path.
    pub one_feed: bool,
    /// The spectrum of each channel.
    pub channels: Vec<ChannelPathSpectrum>,
    /// The gear shafts and meshes along the path.
    pub wheels: PathGearFrequencies,
}

/// One channel's spectrum over the path.
pub struct ChannelPathSpectrum {
    /// Its channel, from 0.
    pub channel: usize,
    /// One-sided power density, unit² mm.
    pub density: Spectrum,
    /// Its lines, the strongest first.
    pub lines: Vec<PathLine>,
}

/// A line over the path, and matching gear shafts and meshes.
pub struct PathLine {
    /// Frequency in cycles per mm, and amplitude.
    pub line: Line,
    /// The gear shaft or mesh that fits best.
    pub wheel: Option<GearMatch>,
    /// The line in time that has this frequency over the path at the feed of its time, Hz.
    pub in_time_hz: Option<f64>,
}

/// The gear shaft or mesh that fits a line best.
#[derive(Clone, Copy, Debug)]
pub struct GearMatch {
    /// Shaft or mesh.
    pub wheel: GearFrequency,
    /// The line is this multiple of it.
    pub multiple: u32,
    /// Number of others that fit within the tolerance too.
    pub others: usize,
}

impl GearMatch {
    /// As text: `joint 1, shaft 2`; `joint 1, 10 teeth of shaft 1`.
    pub(super) fn text(&self) -> String {
        let times =
            if self.multiple > 1 { format!("{} × ", self.multiple) } else { String::new() };
        let others = match self.others {
            0 => String::new(),
            1 => " (or one other)".to_owned(),
            others => format!(" (or {others} others)"),
        };
        format!("{times}{}{others}", self.wheel)
    }
}

/// The gear shafts along this path, or why they are unknown.
#[derive(Default)]
pub struct PathGearFrequencies {
    /// Shafts and meshes.
    pub list: Vec<GearFrequency>,
    /// Relative change of their speeds along the path; no unit.
    pub spread: f64,
    /// What is missing to determine them, as text.
    pub missing: Option<String>,
}

impl PathGearFrequencies {
    pub(super) fn of(source: &Source) -> Self {
        let missing = |what: &str| Self { missing: Some(what.to_owned()), ..Self::default() };
        let Some(model) = &source.model else {
            return missing("no wheel is matched: that needs a model with gear_teeth (--model)");
        };
        if model.file.joints.iter().all(|joint| joint.gear_teeth.is_empty()) {
            return missing("no wheel is matched: the model has no gear_teeth");
        }
        if !source.any(Motion::has_joints) {
            return missing(
                "no wheel is matched: the joints' speeds along the path are not known; record q1_deg … with the forces",
            );
        }
        Self::for_path(source, model)
    }

    /// The shafts, as the monitor uses them.
    pub(super) fn shafts(&self) -> Vec<GearFrequency> {
        self.list.iter().filter(|wheel| wheel.teeth == 1).copied().collect()
    }

    /// The best match of a line.
    fn matching(&self, cycles_per_mm: f64, tolerance: f64) -> Option<GearMatch> {
        let fitting = match_gears(cycles_per_mm, &self.list, tolerance);
        let (wheel, multiple) = *fitting.first()?;
        Some(GearMatch { wheel, multiple, others: fitting.len() - 1 })
    }

    fn for_path(source: &Source, model: &RobotModel) -> Self {
        let mut wheels = Self::default();
        let mut turning = [0.0; JOINTS_MAX];
        for (index, joint) in model.file.joints.iter().enumerate().filter(|(_, j)| turns(j.kind)) {
            let found: Vec<f64> = source
                .pieces
                .iter()
                .filter_map(|piece| piece.motion.gear_frequencies(index, PARTS, source.rate_hz))
                .flatten()
                .collect();
            let Some(turns_per_mm) = median(found.iter().copied()).filter(|turns| *turns > 1e-9)
            else {
                continue;
            };
            let deviations = found.iter().map(|turns| (turns / turns_per_mm - 1.0).abs());
            if !joint.gear_teeth.is_empty() {
                wheels.spread = wheels.spread.max(median(deviations).unwrap_or(0.0));
            }
            if let Some(turns) = turning.get_mut(index) {
                *turns = turns_per_mm;
            }
        }
        wheels.list = model.file.gear_cycles(&turning, GearFrequency::new).collect();
        wheels
    }
}

/// The pieces with a known path, its length and speed.
struct KnownPath<'a> {
    settings: &'a Settings,
    pieces: Vec<&'a Piece>,
    length_mm: f64,
    longest_mm: f64,
    /// Least and largest feed, mm/s.
    feed_mm_s: [f64; 2],
}

impl<'a> KnownPath<'a> {
    /// `Err` states what is missing.
    fn of(settings: &'a Settings, source: &'a Source) -> Result<Self, String> {
        let known = |piece: &&Piece| piece.motion.path_mm.len() == piece.len() && piece.len() > 1;
        let pieces: Vec<&Piece> = source.pieces.iter().filter(known).collect();
        if pieces.is_empty() {
            let missing = "give the feed (--feed-mm-s), or record feed_mm_s, x_mm …, or q1_deg … with a model";
            return Err(missing.to_owned());
        }
        let longest_mm = pieces.iter().map(|piece| length_mm(piece)).fold(0.0, f64::max);
        let least_mm = settings.path_least_mm;
        if longest_mm < least_mm {
            return Err(format!(
                "the path is {longest_mm:.1} mm long, {least_mm} mm and more are needed"
            ));
        }
        let ranges = pieces.iter().filter_map(|piece| piece.motion.feed_range_mm_s());
        let feed_mm_s = ranges.fold([f64::INFINITY, 0.0], |[low, high], range| {
            [range[0].min(low), range[1].max(high)]
        });
        let length_mm = pieces.iter().map(|piece| length_mm(piece)).sum();
        Ok(Self { settings, pieces, length_mm, longest_mm, feed_mm_s })
    }

    /// The feed, if it was constant.
    fn one_feed_mm_s(&self) -> Option<f64> {
        let [low, high] = self.feed_mm_s;
        let feeds = self.pieces.iter().filter_map(|piece| piece.motion.median_feed_mm_s());
        median(feeds).filter(|_| high < (1.0 + self.settings.feed_part) * low)
    }

    /// How the path is cut into steps and segments.
    fn segments(&self, rate_hz: f64) -> Segments {
        // At least one sample per step at the highest feed: wider steps would cause aliasing.
        let fastest_mm = self.feed_mm_s[1] / rate_hz;
        let step_mm = fastest_mm.max(FINEST_MM).max(self.length_mm / STEPS_MAX);
        let window_mm = (self.longest_mm / 3.0).clamp((0.98 * self.longest_mm).min(60.0), 120.0);
        let length = ((window_mm / step_mm) as usize).max(16);
        Segments { detrend: Detrend::Linear, ..Segments::new(1.0 / step_mm, length) }
    }

    /// A channel over the path.
    fn averaged(&self, channel: usize, segments: &Segments) -> Result<AveragedSpectrum, Error> {
        let mut runs = Vec::new();
        for piece in
            self.pieces.iter().filter(|piece| length_mm(piece) >= self.settings.path_least_mm)
        {
            let mut samples = Vec::with_capacity(piece.len());
            piece.samples.parts(GapHandling::Bridged, &[channel], 0..piece.len(), |part| {
                samples.extend_from_slice(part);
            })?;
            let samples = detrended(&samples, Detrend::Constant);
            let run = resample_over_path(&piece.motion.path_mm, &samples, 1.0 / segments.rate);
            runs.push(run.map_err(Error::input)?);
        }
        AveragedSpectrum::from_runs(runs.iter().map(Vec::as_slice), segments).map_err(Error::input)
    }
}

fn length_mm(piece: &Piece) -> f64 {
    let path = &piece.motion.path_mm;
    path.last().zip(path.first()).map_or(0.0, |(last, first)| last - first)
}

/// The spectra over the path; the inner `Err` states what is missing.
pub(super) fn of(
    settings: &Settings,
    source: &Source,
    wheels: PathGearFrequencies,
    episodes: &[Episode],
    spectra: &[ChannelSpectrum],
) -> Result<Result<PathSpectra, String>, Error> {
    let known = match KnownPath::of(settings, source) {
        Ok(known) => known,
        Err(missing) => return Ok(Err(missing)),
    };
    let segments = known.segments(source.rate_hz);
    let bin = segments.rate / segments.length as f64;
    let in_time = lines_in_time(source, episodes, spectra, known.one_feed_mm_s());
    let matched = |line: Line| {
        let half_bin = 0.5 * bin / line.frequency;
        let same = |(_, cycles): &&(f64, f64)| {
            (line.frequency / cycles - 1.0).abs() < settings.same_part + half_bin
        };
        PathLine {
            line,
            wheel: wheels.matching(line.frequency, settings.wheel_part + wheels.spread + half_bin),
            in_time_hz: in_time.iter().find(same).map(|(hz, _)| *hz),
        }
    };
    let mut channels = Vec::new();
    for channel in 0..source.channels.len() {
        let averaged = known.averaged(channel, &segments)?;
        let coarse = averaged.lines().into_iter().filter(|line| line.frequency <= MOST_PER_MM);
        let lines = coarse.take(LINES_MAX).map(matched).collect();
        channels.push(ChannelPathSpectrum { channel, density: averaged.mean, lines });
    }
    let by = known.pieces.first().map_or("", |piece| piece.motion.path_by);
    let (one_feed, length_mm) = (known.one_feed_mm_s().is_some(), known.length_mm);
    Ok(Ok(PathSpectra { by, length_mm, step_mm: 1.0 / segments.rate, one_feed, channels, wheels }))
}

/// A line of a channel over the path.
pub(crate) struct ChannelLine {
    /// Name of the channel.
    pub(crate) channel: String,
    /// Its unit; empty if the recording states none.
    pub(crate) unit: String,
    /// Frequency in cycles per mm, and amplitude.
    pub(crate) line: Line,
    /// Resolution of lines, cycles per mm.
    pub(crate) step_per_mm: f64,
    /// Whether the feed was constant: it may then be a line in time.
    pub(crate) one_feed: bool,
}

/// The lines over the path alone, with the default settings.
pub(crate) fn lines_over_path(source: &Source) -> Result<Vec<ChannelLine>, Error> {
    let spectra = of(&Settings::default(), source, PathGearFrequencies::default(), &[], &[])?
        .map_err(|missing| Error::input(format!("{}: {missing}", source.file.display())))?;
    let (one_feed, mut lines) = (spectra.one_feed, Vec::new());
    for one in spectra.channels {
        let step_per_mm = one.density.frequency.get(1).copied().unwrap_or(0.0);
        let channel = &source.channels[one.channel];
        lines.extend(one.lines.into_iter().map(|found| ChannelLine {
            channel: channel.name.clone(),
            unit: channel.unit.clone(),
            line: found.line,
            step_per_mm,
            one_feed,
        }));
    }
    Ok(lines)
}

/// Lines in time converted to the path: those of the monitor with the feed of their time; with a
/// constant feed all.
fn lines_in_time(
    source: &Source,
    episodes: &[Episode],
    spectra: &[ChannelSpectrum],
    the_feed_mm_s: Option<f64>,
) -> Vec<(f64, f64)> {
    let point = |episode: &Episode| {
        let t_s = 0.5 * (episode.from_s + episode.to_s.unwrap_or(episode.from_s));
        let piece = source.pieces.iter().rfind(|piece| piece.at_s <= t_s)?;
        let sample = ((t_s - piece.at_s) * source.rate_hz) as usize;
        let feed_mm_s = piece.motion.state(sample, 0).feed_mm_s;
        (feed_mm_s > 0.0).then(|| (episode.frequency_hz, episode.frequency_hz / feed_mm_s))
    };
    let lines = spectra.iter().flat_map(|one| &one.lines).map(|one| one.line.frequency);
    let lines = lines.flat_map(|hz| the_feed_mm_s.map(|feed| (hz, hz / feed)));
    episodes.iter().filter_map(point).chain(lines).collect()
}
