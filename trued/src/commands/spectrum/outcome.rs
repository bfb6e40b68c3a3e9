//! Results with the keys of `trued.spectrum/1`.
#![expect(non_snake_case, reason = "the contract's keys carry units as they are written")]

use serde::Serialize;
use spectrum::{NearestLine, Verdict};

use super::found::Found;
use super::space::Space;
use super::subject::Subject;
use super::words::{axis_of, frequency_words};

/// All results.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Report {
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
    /// The line in time that reads so at the feed of its time.
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
    /// So many other shafts, meshes or multiples fit as well.
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

impl Report {
    pub(super) fn of(subject: &Subject, found: &Found) -> Self {
        let middle = |what: fn(&super::motion::Motion) -> Option<f64>| {
            super::motion::middle(subject.pieces.iter().filter_map(|piece| what(&piece.motion)))
        };
        Self {
            file: subject.file.display().to_string(),
            rate_Hz: subject.rate_hz,
            seconds: subject.seconds(),
            records: subject.pieces.len(),
            channels: channels(subject, found),
            spindle_rpm: middle(super::motion::Motion::middle_rpm),
            teeth: (subject.teeth > 0).then_some(subject.teeth),
            feed_mm_s: middle(super::motion::Motion::middle_feed_mm_s),
            model: subject.model.as_ref().map(|model| model.file.name.clone()),
            events: events(subject, found),
            episodes: episodes(subject, found),
            lines: lines(subject, found),
            spectra: spectra(subject, found),
            window_s: found.window_s,
            path: found.space.as_ref().ok().map(|space| path(subject, space)),
            path_missing: found.space.as_ref().err().cloned(),
            nearest_stable: found.nearest_stable.clone(),
            health: health(subject, found),
            notes: found.notes.clone(),
        }
    }
}

impl Tone {
    fn on(
        channel: &super::subject::Channel,
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
            rivals: verdict.rivals.iter().map(spectrum::Class::name).collect(),
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

fn channels(subject: &Subject, found: &Found) -> Vec<Channel> {
    let least = |at: usize| {
        let listened = found.listened.iter().find(|listened| listened.group.contains(&at))?;
        Some(listened.least)
    };
    let channel = |(at, channel): (usize, &super::subject::Channel)| Channel {
        name: channel.name.clone(),
        unit: channel.unit.clone(),
        axis: axis_of(channel),
        rms: found.spectra.iter().find(|s| s.channel == at).map_or(f64::NAN, |s| s.rms),
        samples_not_taken: channel.holes,
        least_amplitude: least(at),
    };
    subject.channels.iter().enumerate().map(channel).collect()
}

fn events(subject: &Subject, found: &Found) -> Vec<Event> {
    let mut events = Vec::new();
    for listened in &found.listened {
        for event in &listened.result.events {
            let verdict = &event.verdict;
            let channel = &subject.channels[listened.channel(verdict.axis)];
            let shifted_s = subject.pieces.get(event.piece).map_or(0.0, |p| p.at_s - p.start_s);
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

fn episodes(subject: &Subject, found: &Found) -> Vec<Episode> {
    let episode = |episode: &super::listen::Episode| {
        let channel = &subject.channels[episode.channel];
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
    found.episodes.iter().map(episode).collect()
}

fn lines(subject: &Subject, found: &Found) -> Vec<Line> {
    let all = found.spectra.iter().flat_map(|s| s.lines.iter().map(move |line| (s.channel, line)));
    let line = |(at, judged): (usize, &super::spectra::JudgedLine)| {
        let channel = &subject.channels[at];
        Line {
            tone: Tone::on(channel, judged.line.frequency, judged.line.amplitude, &judged.verdict),
            power_over_floor: judged.line.ratio,
            followed: judged.followed,
        }
    };
    all.map(line).collect()
}

fn spectra(subject: &Subject, found: &Found) -> Vec<Spectrum> {
    let spectrum = |one: &super::spectra::ChannelSpectrum| {
        let channel = &subject.channels[one.channel];
        Spectrum {
            channel: channel.name.clone(),
            unit: frequency_words::density_unit(&channel.unit, "Hz"),
            averages: one.density.averages,
            step_Hz: one.density.frequency.get(1).copied().unwrap_or(0.0),
            density: one.density.power.clone(),
        }
    };
    found.spectra.iter().map(spectrum).collect()
}

fn path(subject: &Subject, space: &Space) -> Path {
    let lines = space.channels.iter().flat_map(|one| {
        let channel = &subject.channels[one.channel];
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
    let wheel = |wheel: &spectrum::Wheel| Wheel {
        joint: wheel.joint,
        shaft: wheel.shaft,
        teeth: wheel.teeth,
        cycles_per_mm: wheel.cycles_per_mm,
    };
    Path {
        known_by: space.by,
        length_mm: space.length_mm,
        step_mm: space.step_mm,
        one_feed: space.one_feed,
        wheels: space.wheels.list.iter().map(wheel).collect(),
        wheels_missing: space.wheels.missing.clone(),
        lines: lines.collect(),
    }
}

fn health(subject: &Subject, found: &Found) -> Vec<Finding> {
    let all = found.listened.iter().flat_map(|l| l.result.findings.iter().map(move |f| (l, f)));
    let finding = |(listened, finding): (&super::listen::Listened, &spectrum::offline::Finding)| {
        let name = |at: usize| {
            let channel = listened.group.get(at).and_then(|at| subject.channels.get(*at));
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
