//! Spectra over the tool's path in cycles per mm, matched with the gears.

use physics::JOINTS_MAX;
use recording::model::RobotModel;
use spectrum::Wheel;
use spectrum::offline::{Averaged, Line};
use spectrum::spatial::{match_wheels, over_path};
use spectrum::welch::{Detrend, Segments, Spectrum, detrended};

use super::listen::Episode;
use super::motion::{Motion, middle, turns};
use super::samples::Gaps;
use super::spectra::ChannelSpectrum;
use super::subject::{Piece, Subject};
use crate::exit::Failure;

/// Minimum length of a path, mm.
const SHORTEST_MM: f64 = 20.0;
/// The finest step of path, mm.
const FINEST_MM: f64 = 0.005;
/// Nothing of a gear (decision 0010) or of waviness has more cycles per mm.
const MOST_PER_MM: f64 = 5.0;
/// Maximum number of steps.
const STEPS_MAX: f64 = 4e6;
/// A line over the path is a line in time where both agree within this part.
const SAME_PART: f64 = 0.02;
/// A wheel is matched within this part of a line's frequency, and half a bin.
const WHEEL_PART: f64 = 0.02;
/// Relative difference of feeds from which lines over the path can be distinguished from lines in
/// time.
const FEED_PART: f64 = 0.1;
/// Number of parts of a path, to check whether the joints turn evenly along it.
const PARTS: usize = 8;
/// Maximum number of lines of a channel.
const LINES_MAX: usize = 10;

/// Results over the path.
pub(super) struct Space {
    /// How the path was determined, in words.
    pub(super) by: &'static str,
    pub(super) length_mm: f64,
    pub(super) step_mm: f64,
    /// Whether the feed was constant: a line in time then looks like a line over the path.
    pub(super) one_feed: bool,
    pub(super) channels: Vec<ChannelSpace>,
    pub(super) wheels: Wheels,
}

/// One channel over the path.
pub(super) struct ChannelSpace {
    pub(super) channel: usize,
    /// One-sided power density, unit² mm.
    pub(super) density: Spectrum,
    pub(super) lines: Vec<SpaceLine>,
}

/// A line over the path, cycles per mm, and matching gear shafts and meshes.
pub(super) struct SpaceLine {
    pub(super) line: Line,
    pub(super) wheel: Option<Match>,
    /// The line in time that reads so at the feed of its time, Hz.
    pub(super) in_time_hz: Option<f64>,
}

/// What of the gears fits a line best.
#[derive(Debug, Clone, Copy)]
pub(super) struct Match {
    pub(super) wheel: Wheel,
    /// The line is this multiple of it.
    pub(super) multiple: u32,
    /// So many others fit within the tolerance too.
    pub(super) others: usize,
}

impl Match {
    /// In words: `joint 1, shaft 2`; `joint 1, 10 teeth of shaft 1`.
    pub(super) fn words(&self) -> String {
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
pub(super) struct Wheels {
    pub(super) list: Vec<Wheel>,
    /// How much their speeds change along the path, as a part.
    pub(super) spread: f64,
    /// What is missing to determine them.
    pub(super) missing: Option<String>,
}

impl Wheels {
    pub(super) fn of(subject: &Subject) -> Self {
        let missing = |what: &str| Self { missing: Some(what.to_owned()), ..Self::default() };
        let Some(model) = &subject.model else {
            return missing("no wheel is matched: that needs a model with gear_teeth (--model)");
        };
        if model.file.joints.iter().all(|joint| joint.gear_teeth.is_empty()) {
            return missing("no wheel is matched: the model has no gear_teeth");
        }
        if !subject.any(Motion::has_joints) {
            return missing(
                "no wheel is matched: the joints' speeds along the path are not known; record q1_deg … with the forces",
            );
        }
        Self::along(subject, model)
    }

    /// The shafts as the daemon's monitor uses them.
    pub(super) fn shafts(&self) -> Vec<Wheel> {
        self.list.iter().filter(|wheel| wheel.teeth == 1).copied().collect()
    }

    /// What fits a line.
    fn matching(&self, cycles_per_mm: f64, tolerance: f64) -> Option<Match> {
        let fitting = match_wheels(cycles_per_mm, &self.list, tolerance);
        let (wheel, multiple) = *fitting.first()?;
        Some(Match { wheel, multiple, others: fitting.len() - 1 })
    }

    fn along(subject: &Subject, model: &RobotModel) -> Self {
        let mut wheels = Self::default();
        let mut turning = [0.0; JOINTS_MAX];
        for (at, joint) in model.file.joints.iter().enumerate().filter(|(_, j)| turns(j.kind)) {
            let found: Vec<f64> = subject
                .pieces
                .iter()
                .filter_map(|piece| piece.motion.turns_per_mm(at, PARTS, subject.rate_hz))
                .flatten()
                .collect();
            let Some(turns_per_mm) = middle(found.iter().copied()).filter(|turns| *turns > 1e-9)
            else {
                continue;
            };
            let off = found.iter().map(|turns| (turns / turns_per_mm - 1.0).abs());
            if !joint.gear_teeth.is_empty() {
                wheels.spread = wheels.spread.max(middle(off).unwrap_or(0.0));
            }
            if let Some(turns) = turning.get_mut(at) {
                *turns = turns_per_mm;
            }
        }
        wheels.list = daemon::travel::wheels(&model.file, &turning);
        wheels
    }
}

/// The pieces with a known path, its length and speed.
struct Known<'a> {
    pieces: Vec<&'a Piece>,
    length_mm: f64,
    longest_mm: f64,
    /// Least and largest feed, mm/s.
    feed_mm_s: [f64; 2],
}

impl<'a> Known<'a> {
    /// `Err` states what is missing.
    fn of(subject: &'a Subject) -> Result<Self, String> {
        let known = |piece: &&Piece| piece.motion.path_mm.len() == piece.len() && piece.len() > 1;
        let pieces: Vec<&Piece> = subject.pieces.iter().filter(known).collect();
        if pieces.is_empty() {
            let missing = "give the feed (--feed-mm-s), or record feed_mm_s, x_mm …, or q1_deg … with a model";
            return Err(missing.to_owned());
        }
        let longest_mm = pieces.iter().map(|piece| length_mm(piece)).fold(0.0, f64::max);
        if longest_mm < SHORTEST_MM {
            return Err(format!(
                "the path is {longest_mm:.1} mm long, {SHORTEST_MM} mm and more are needed"
            ));
        }
        let ranges = pieces.iter().filter_map(|piece| piece.motion.feed_range_mm_s());
        let feed_mm_s = ranges.fold([f64::INFINITY, 0.0], |[low, high], range| {
            [range[0].min(low), range[1].max(high)]
        });
        let length_mm = pieces.iter().map(|piece| length_mm(piece)).sum();
        Ok(Self { pieces, length_mm, longest_mm, feed_mm_s })
    }

    /// The feed, if it was constant.
    fn one_feed_mm_s(&self) -> Option<f64> {
        let [low, high] = self.feed_mm_s;
        let feeds = self.pieces.iter().filter_map(|piece| piece.motion.middle_feed_mm_s());
        middle(feeds).filter(|_| high < (1.0 + FEED_PART) * low)
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
    fn averaged(&self, channel: usize, segments: &Segments) -> Result<Averaged, Failure> {
        let mut runs = Vec::new();
        for piece in self.pieces.iter().filter(|piece| length_mm(piece) >= SHORTEST_MM) {
            let mut samples = Vec::with_capacity(piece.len());
            piece.samples.parts(Gaps::Bridged, &[channel], 0..piece.len(), |part| {
                samples.extend_from_slice(part);
            })?;
            let samples = detrended(&samples, Detrend::Constant);
            let run = over_path(&piece.motion.path_mm, &samples, 1.0 / segments.rate);
            runs.push(run.map_err(Failure::input)?);
        }
        Averaged::of(runs.iter().map(Vec::as_slice), segments).map_err(Failure::input)
    }
}

fn length_mm(piece: &Piece) -> f64 {
    let path = &piece.motion.path_mm;
    path.last().zip(path.first()).map_or(0.0, |(last, first)| last - first)
}

/// The spectra over the path; the inner `Err` states what is missing.
pub(super) fn of(
    subject: &Subject,
    wheels: Wheels,
    episodes: &[Episode],
    spectra: &[ChannelSpectrum],
) -> Result<Result<Space, String>, Failure> {
    let known = match Known::of(subject) {
        Ok(known) => known,
        Err(missing) => return Ok(Err(missing)),
    };
    let segments = known.segments(subject.rate_hz);
    let bin = segments.rate / segments.length as f64;
    let in_time = lines_in_time(subject, episodes, spectra, known.one_feed_mm_s());
    let matched = |line: Line| {
        let half_bin = 0.5 * bin / line.frequency;
        let same = |(_, cycles): &&(f64, f64)| {
            (line.frequency / cycles - 1.0).abs() < SAME_PART + half_bin
        };
        SpaceLine {
            line,
            wheel: wheels.matching(line.frequency, WHEEL_PART + wheels.spread + half_bin),
            in_time_hz: in_time.iter().find(same).map(|(hz, _)| *hz),
        }
    };
    let mut channels = Vec::new();
    for channel in 0..subject.channels.len() {
        let averaged = known.averaged(channel, &segments)?;
        let coarse = averaged.lines().into_iter().filter(|line| line.frequency <= MOST_PER_MM);
        let lines = coarse.take(LINES_MAX).map(matched).collect();
        channels.push(ChannelSpace { channel, density: averaged.mean, lines });
    }
    let by = known.pieces.first().map_or("", |piece| piece.motion.path_by);
    let (one_feed, length_mm) = (known.one_feed_mm_s().is_some(), known.length_mm);
    Ok(Ok(Space { by, length_mm, step_mm: 1.0 / segments.rate, one_feed, channels, wheels }))
}

/// A line over the path, as used by other commands.
pub(in crate::commands) struct ChannelLine {
    pub(in crate::commands) channel: String,
    pub(in crate::commands) unit: String,
    pub(in crate::commands) line: Line,
    /// Resolution of lines, cycles per mm.
    pub(in crate::commands) step_per_mm: f64,
    /// Whether the feed was constant: it may then be a line in time.
    pub(in crate::commands) one_feed: bool,
}

/// The lines over the path alone; the inner `Err` states what is missing.
pub(super) fn lines_over_path(
    subject: &Subject,
) -> Result<Result<Vec<ChannelLine>, String>, Failure> {
    let space = match of(subject, Wheels::default(), &[], &[])? {
        Ok(space) => space,
        Err(missing) => return Ok(Err(missing)),
    };
    let (one_feed, mut lines) = (space.one_feed, Vec::new());
    for one in space.channels {
        let step_per_mm = one.density.frequency.get(1).copied().unwrap_or(0.0);
        let channel = &subject.channels[one.channel];
        lines.extend(one.lines.into_iter().map(|found| ChannelLine {
            channel: channel.name.clone(),
            unit: channel.unit.clone(),
            line: found.line,
            step_per_mm,
            one_feed,
        }));
    }
    Ok(Ok(lines))
}

/// Lines in time converted to the path: those of the monitor with the feed of their time; with a
/// constant feed all.
fn lines_in_time(
    subject: &Subject,
    episodes: &[Episode],
    spectra: &[ChannelSpectrum],
    the_feed_mm_s: Option<f64>,
) -> Vec<(f64, f64)> {
    let at = |episode: &Episode| {
        let t_s = 0.5 * (episode.from_s + episode.to_s.unwrap_or(episode.from_s));
        let piece = subject.pieces.iter().rfind(|piece| piece.at_s <= t_s)?;
        let sample = ((t_s - piece.at_s) * subject.rate_hz) as usize;
        let feed_mm_s = piece.motion.state(sample, 0).feed_mm_s;
        (feed_mm_s > 0.0).then(|| (episode.frequency_hz, episode.frequency_hz / feed_mm_s))
    };
    let lines = spectra.iter().flat_map(|one| &one.lines).map(|judged| judged.line.frequency);
    let lines = lines.flat_map(|hz| the_feed_mm_s.map(|feed| (hz, hz / feed)));
    episodes.iter().filter_map(at).chain(lines).collect()
}
