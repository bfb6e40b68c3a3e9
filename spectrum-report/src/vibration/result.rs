//! Vibrations of a recording as an object: `trued.spectrum/1`.
#![expect(non_snake_case, reason = "the contract's keys carry units as they are written")]

use recording::program;
use serde::Serialize;
use spectrum::{NearestLine, Verdict};

use super::analysis::Analysis;
use super::input::Source;
use super::monitor::MonitoredGroup;
use super::motion::{Motion, median};
use super::path::PathSpectra;
use super::text::{axis_of, density_unit};
use crate::error::Error;

/// Vibrations of a recording: `trued.spectrum/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    file: String,
    rate_Hz: f64,
    seconds: f64,
    records: usize,
    channels: Vec<Channel>,
    spindle_rpm: Option<f64>,
    teeth: Option<u32>,
    feed_mm_s: Option<f64>,
    model: Option<String>,
    /// The monitor's reports, in order.
    events: Vec<Event>,
    /// The same, joined: one for each line, the most harmful first.
    episodes: Vec<Episode>,
    lines: Vec<Line>,
    spectra: Vec<Spectrum>,
    window_s: f64,
    path: Option<Path>,
    /// What would be needed for a spectrum over the path.
    path_missing: Option<String>,
    nearest_stable: Vec<String>,
    health: Vec<Finding>,
    notes: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Channel {
    name: String,
    unit: String,
    axis: Option<&'static str>,
    rms: f64,
    samples_not_taken: usize,
    /// The monitor reports no line below this amplitude.
    least_amplitude: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Event {
    /// Time as the recording has it, s.
    t_s: f64,
    /// The continuous run of samples in which it was reported, from 1.
    record: usize,
    line: u32,
    state: &'static str,
    #[serde(flatten)]
    tone: Tone,
    growth_per_s: f64,
}

/// A line's frequency, and its cause.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Tone {
    frequency_Hz: f64,
    amplitude: f64,
    unit: String,
    channel: String,
    axis: Option<&'static str>,
    #[serde(flatten)]
    judged: Judged,
}

/// A line's cause, as far as it can be determined.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Judged {
    class: &'static str,
    rivals: Vec<&'static str>,
    suspect_alias: bool,
    mode: Option<Near>,
    harmonic: Option<Near>,
    alias: Option<Near>,
    advice: String,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Near {
    frequency_Hz: f64,
    distance_Hz: f64,
    /// Multiple of the spindle's speed; for a mode its place in the model's list, from 1.
    order: u32,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Episode {
    from_s: f64,
    to_s: Option<f64>,
    alarm_s: Option<f64>,
    line: u32,
    state: &'static str,
    #[serde(flatten)]
    tone: Tone,
    growth_per_s: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Line {
    #[serde(flatten)]
    tone: Tone,
    power_over_floor: f64,
    /// Whether the monitor tracked it; otherwise its class follows from its frequency alone.
    followed: bool,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Spectrum {
    channel: String,
    /// Unit of the density, the channel's unit squared per Hz.
    unit: String,
    averages: usize,
    step_Hz: f64,
    /// One-sided power density from 0 Hz on.
    density: Vec<f64>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Path {
    known_by: &'static str,
    length_mm: f64,
    step_mm: f64,
    /// Whether the feed was constant: a line in time then looks like one over the path.
    one_feed: bool,
    wheels: Vec<Wheel>,
    wheels_missing: Option<String>,
    lines: Vec<PathLine>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Wheel {
    joint: u8,
    shaft: u8,
    /// Cycles per revolution of the shaft: 1, or the driver's teeth that mesh.
    teeth: u32,
    cycles_per_mm: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct PathLine {
    cycles_per_mm: f64,
    amplitude: f64,
    unit: String,
    channel: String,
    power_over_floor: f64,
    /// The line in time that has this frequency over the path at the feed of its time.
    in_time_Hz: Option<f64>,
    wheel: Option<MatchedWheel>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct MatchedWheel {
    joint: u8,
    shaft: u8,
    /// Cycles per revolution of the shaft: 1, or the driver's teeth that mesh.
    teeth: u32,
    /// The line is this multiple of it.
    multiple: u32,
    /// Number of other shafts, meshes or multiples that fit as well.
    others: usize,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Finding {
    channel: Option<String>,
    fault: &'static str,
    words: String,
    from_s: f64,
    to_s: f64,
}

impl Analysis {
    /// The result as an object.
    #[must_use]
    pub fn report(&self) -> Report {
        Report::of(self)
    }

    /// The same as JSON.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn json(&self) -> Result<String, Error> {
        let text = program::json("trued.spectrum/1", &self.report()).map_err(Error::internal)?;
        Ok(text + "\n")
    }
}

impl Report {
    fn of(analysis: &Analysis) -> Self {
        let source = &analysis.source;
        let median = |what: fn(&Motion) -> Option<f64>| {
            median(source.pieces.iter().filter_map(|piece| what(&piece.motion)))
        };
        Self {
            file: analysis.source.file.display().to_string(),
            rate_Hz: analysis.source.rate_hz,
            seconds: analysis.source.seconds(),
            records: analysis.source.pieces.len(),
            channels: channels(analysis),
            spindle_rpm: median(Motion::median_rpm),
            teeth: (analysis.source.teeth > 0).then_some(analysis.source.teeth),
            feed_mm_s: median(Motion::median_feed_mm_s),
            model: analysis.source.model.as_ref().map(|model| model.file.name.clone()),
            events: events(analysis),
            episodes: episodes(analysis),
            lines: lines(analysis),
            spectra: spectra(analysis),
            window_s: analysis.window_s,
            path: analysis.path.as_ref().ok().map(|spectra| path(source, spectra)),
            path_missing: analysis.path.as_ref().err().cloned(),
            nearest_stable: analysis.nearest_stable.clone(),
            health: health(analysis),
            notes: analysis.notes.clone(),
        }
    }
}

impl Tone {
    fn on(
        channel: &super::input::Channel,
        frequency_hz: f64,
        amplitude: f64,
        verdict: &Verdict,
    ) -> Self {
        Self {
            frequency_Hz: frequency_hz,
            amplitude,
            unit: channel.unit.clone(),
            channel: channel.name.clone(),
            axis: axis_of(channel),
            judged: Judged::of(verdict),
        }
    }
}

impl Judged {
    fn of(verdict: &Verdict) -> Self {
        Self {
            class: verdict.class.name(),
            rivals: verdict.alternatives.iter().map(spectrum::Class::name).collect(),
            suspect_alias: verdict.suspect_alias,
            mode: verdict.mode.map(|line| Near { order: line.order + 1, ..Near::of(line) }),
            harmonic: verdict.harmonic.map(Near::of),
            alias: verdict.alias.map(Near::of),
            advice: verdict.advice.to_string(),
        }
    }
}

impl Near {
    fn of(line: NearestLine) -> Self {
        Self { frequency_Hz: line.frequency_hz, distance_Hz: line.distance_hz, order: line.order }
    }
}

fn channels(analysis: &Analysis) -> Vec<Channel> {
    let amplitude_min = |channel_index: usize| {
        let monitored =
            analysis.monitored.iter().find(|monitored| monitored.group.contains(&channel_index))?;
        Some(monitored.amplitude_min)
    };
    let channel = |(channel_index, channel): (usize, &super::input::Channel)| Channel {
        name: channel.name.clone(),
        unit: channel.unit.clone(),
        axis: axis_of(channel),
        rms: analysis
            .spectra
            .iter()
            .find(|s| s.channel == channel_index)
            .map_or(f64::NAN, |s| s.rms),
        samples_not_taken: channel.missing,
        least_amplitude: amplitude_min(channel_index),
    };
    analysis.source.channels.iter().enumerate().map(channel).collect()
}

fn events(analysis: &Analysis) -> Vec<Event> {
    let mut events = Vec::new();
    for monitored in &analysis.monitored {
        for event in &monitored.result.events {
            let verdict = &event.verdict;
            let channel = &analysis.source.channels[monitored.channel(verdict.axis)];
            let shifted_s =
                analysis.source.pieces.get(event.piece).map_or(0.0, |p| p.at_s - p.start_s);
            events.push(Event {
                t_s: event.t_s - shifted_s,
                record: event.piece + 1,
                line: verdict.line,
                state: verdict.state.name(),
                tone: Tone::on(channel, verdict.frequency_hz, verdict.amplitude_n, verdict),
                growth_per_s: verdict.growth_per_s,
            });
        }
    }
    events.sort_by(|a, b| {
        (a.record, a.t_s).partial_cmp(&(b.record, b.t_s)).unwrap_or(std::cmp::Ordering::Equal)
    });
    events
}

fn episodes(analysis: &Analysis) -> Vec<Episode> {
    let episode = |episode: &super::monitor::Episode| {
        let channel = &analysis.source.channels[episode.channel];
        Episode {
            from_s: episode.from_s,
            to_s: episode.to_s,
            alarm_s: episode.alarm_s,
            line: episode.verdict.line,
            state: episode.state.name(),
            tone: Tone::on(channel, episode.frequency_hz, episode.amplitude, &episode.verdict),
            growth_per_s: episode.growth_per_s,
        }
    };
    analysis.episodes.iter().map(episode).collect()
}

fn lines(analysis: &Analysis) -> Vec<Line> {
    let all =
        analysis.spectra.iter().flat_map(|s| s.lines.iter().map(move |line| (s.channel, line)));
    let line = |(channel_index, one): (usize, &super::spectra::ClassifiedLine)| {
        let channel = &analysis.source.channels[channel_index];
        Line {
            tone: Tone::on(channel, one.line.frequency, one.line.amplitude, &one.verdict),
            power_over_floor: one.line.ratio,
            followed: one.is_tracked,
        }
    };
    all.map(line).collect()
}

fn spectra(analysis: &Analysis) -> Vec<Spectrum> {
    let spectrum = |one: &super::spectra::ChannelSpectrum| {
        let channel = &analysis.source.channels[one.channel];
        Spectrum {
            channel: channel.name.clone(),
            unit: density_unit(&channel.unit, "Hz"),
            averages: one.density.averages,
            step_Hz: one.density.frequency.get(1).copied().unwrap_or(0.0),
            density: one.density.power.clone(),
        }
    };
    analysis.spectra.iter().map(spectrum).collect()
}

fn path(source: &Source, spectra: &PathSpectra) -> Path {
    let lines = spectra.channels.iter().flat_map(|one| {
        let channel = &source.channels[one.channel];
        one.lines.iter().map(|found| PathLine {
            cycles_per_mm: found.line.frequency,
            amplitude: found.line.amplitude,
            unit: channel.unit.clone(),
            channel: channel.name.clone(),
            power_over_floor: found.line.ratio,
            in_time_Hz: found.in_time_hz,
            wheel: found.wheel.map(|found| MatchedWheel {
                joint: found.wheel.joint,
                shaft: found.wheel.shaft,
                teeth: found.wheel.teeth,
                multiple: found.multiple,
                others: found.others,
            }),
        })
    });
    let wheel = |wheel: &spectrum::GearFrequency| Wheel {
        joint: wheel.joint,
        shaft: wheel.shaft,
        teeth: wheel.teeth,
        cycles_per_mm: wheel.cycles_per_mm,
    };
    Path {
        known_by: spectra.by,
        length_mm: spectra.length_mm,
        step_mm: spectra.step_mm,
        one_feed: spectra.one_feed,
        wheels: spectra.wheels.list.iter().map(wheel).collect(),
        wheels_missing: spectra.wheels.missing.clone(),
        lines: lines.collect(),
    }
}

fn health(analysis: &Analysis) -> Vec<Finding> {
    let all =
        analysis.monitored.iter().flat_map(|one| one.result.findings.iter().map(move |f| (one, f)));
    let finding = |(monitored, finding): (&MonitoredGroup, &spectrum::offline::FaultInterval)| {
        let name = |index: usize| {
            let channel =
                monitored.group.get(index).and_then(|index| analysis.source.channels.get(*index));
            channel.map(|channel| channel.name.clone())
        };
        Finding {
            channel: finding.channel.and_then(name),
            fault: finding.fault.name(),
            words: finding.fault.to_string(),
            from_s: finding.from_s,
            to_s: finding.to_s,
        }
    };
    all.map(finding).collect()
}
