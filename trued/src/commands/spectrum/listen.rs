//! Runs the daemon's vibration monitor on the recording and groups its verdicts by spectral line.

use recording::model::RobotModel;
use spectrum::offline::{Averaging, Event, MonitorResult, MonitorRun, line_near};
use spectrum::welch::{Detrend, SegmentPower, Segments, Spectrum};
use spectrum::{Axis, Class, Mode, State, Verdict, Watch, WatchConfig, Wheel};

use super::Spectrum as Asked;
use super::samples::Gaps;
use super::subject::Subject;
use crate::exit::Failure;
use crate::parallel;

/// Minimum sampling rate of a recording for the monitor, Hz.
const SLOWEST_HZ: f64 = 400.0;
/// Without a known unit, lines below this part of the signal's rms are not reported.
const LEAST_PART: f64 = 0.02;
/// The monitor reports the end of a line this long after it was last seen, s.
const LINGER_S: f64 = 0.5;
/// Duration over which an amplitude is measured, s.
const MEASURED_S: f64 = 0.25;

/// Input and results of one monitor.
pub(super) struct Listened {
    /// The channels that it monitored.
    pub(super) group: Vec<usize>,
    pub(super) watch: Watch,
    pub(super) result: MonitorResult,
    /// The minimum amplitude that it reports, in the group's unit.
    pub(super) least: f64,
}

/// The course of one line.
#[derive(Debug, Clone)]
pub(super) struct Episode {
    pub(super) channel: usize,
    /// Times on a continuous axis, s.
    pub(super) from_s: f64,
    /// `None`: until the end of the recording.
    pub(super) to_s: Option<f64>,
    /// When it was first an alarm, s.
    pub(super) alarm_s: Option<f64>,
    /// The highest state it reached.
    pub(super) state: State,
    pub(super) frequency_hz: f64,
    /// The largest amplitude over a quarter of a second.
    pub(super) amplitude: f64,
    /// The fastest growth reported, 1/s.
    pub(super) growth_per_s: f64,
    /// The last verdict in the highest state.
    pub(super) verdict: Verdict,
}

impl Listened {
    /// The channel of a verdict.
    pub(super) fn channel(&self, axis: Axis) -> usize {
        self.group.get(axis.channel()).or(self.group.last()).copied().unwrap_or(0)
    }
}

/// Runs a monitor for every group of channels. Empty, with a note, if the recording's rate is too
/// low.
pub(super) fn listen(
    asked: &Asked,
    subject: &Subject,
    wheels: &[Wheel],
    rms: &[f64],
    notes: &mut Vec<String>,
) -> Result<Vec<Listened>, Failure> {
    if subject.rate_hz < SLOWEST_HZ {
        let rate_hz = subject.rate_hz;
        notes.push(format!(
            "the watch needs {SLOWEST_HZ} Hz and more, this is {rate_hz:.1} Hz: spectra only"
        ));
        return Ok(Vec::new());
    }
    let listened = |group: &Vec<usize>| listen_to(group, asked, subject, wheels, rms);
    let all = parallel::map(&subject.groups(), listened);
    let all = all.into_iter().collect::<Result<Vec<Listened>, Failure>>()?;
    for Listened { result, .. } in &all {
        if result.still_learning {
            let seconds = report::significant(subject.seconds(), 3);
            let note =
                format!("{seconds} s are too short for the watch to learn the noise: spectra only");
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        if result.dropped > 0 {
            notes.push(format!("verdicts that found no place: {}", result.dropped));
        }
    }
    Ok(all)
}

/// Results of one monitor on a group of channels.
fn listen_to(
    group: &[usize],
    asked: &Asked,
    subject: &Subject,
    wheels: &[Wheel],
    rms: &[f64],
) -> Result<Listened, Failure> {
    let least = asked.least.unwrap_or_else(|| least(subject, group, rms));
    let [low_hz, high_hz] = [0, 1].map(|at| asked.band.get(at).copied().unwrap_or(f64::NAN));
    let usual = WatchConfig::default();
    let config = WatchConfig {
        rate_hz: subject.rate_hz,
        channels: group.len(),
        band_hz: [low_hz, high_hz],
        modes: subject.model.as_ref().map(modes).unwrap_or_default(),
        wheels: wheels.to_vec(),
        least_amplitude_n: least,
        least_amplitude_nm: if asked.least.is_some() { least } else { 0.1 * least },
        mains_hz: asked.mains,
        threshold: asked.threshold,
        learn_s: (0.25 * subject.seconds()).clamp(0.5, usual.learn_s),
        ..usual
    };
    let mut watch = Watch::new(config).map_err(Failure::input)?;
    let mut run = MonitorRun::new(&mut watch, subject.rate_hz);
    for piece in &subject.pieces {
        let state = |sample| piece.motion.state(sample, subject.teeth);
        run.begin(piece.at_s, group.len());
        piece.samples.parts(Gaps::Missing, group, 0..piece.len(), |part| run.push(part, state))?;
        run.end(state);
    }
    let result = run.finish();
    Ok(Listened { group: group.to_vec(), watch, result, least })
}

/// The minimum amplitude, by the unit or relative to the signal.
fn least(subject: &Subject, group: &[usize], rms: &[f64]) -> f64 {
    let defaults = WatchConfig::default();
    match group.first().map(|at| subject.channels[*at].unit.as_str()) {
        Some("N") => defaults.least_amplitude_n,
        Some("Nm") => defaults.least_amplitude_nm,
        _ => LEAST_PART * group.iter().filter_map(|at| rms.get(*at)).copied().fold(0.0, f64::max),
    }
}

fn modes(model: &RobotModel) -> Vec<Mode> {
    let mode = |mode: &recording::model::ModeEntry| Mode {
        frequency_hz: mode.frequency_hz,
        damping: mode.damping_ratio.unwrap_or(0.0),
        direction: mode.direction.unwrap_or([0.0; 3]),
    };
    model.file.modes.iter().map(mode).collect()
}

/// The course of every line, those with an alarm first, the strongest first.
pub(super) fn episodes(subject: &Subject, all: &[Listened]) -> Result<Vec<Episode>, Failure> {
    let mut episodes = Vec::new();
    for listened in all {
        let mut lines: Vec<u32> = Vec::new();
        for event in &listened.result.events {
            if !lines.contains(&event.verdict.line) {
                lines.push(event.verdict.line);
            }
        }
        for line in lines {
            let of_line = |event: &&Event| event.verdict.line == line;
            let events: Vec<&Event> = listened.result.events.iter().filter(of_line).collect();
            episodes.extend(episode(subject, listened, &events)?);
        }
    }
    let rank = |episode: &Episode| match (episode.state, is_harmful(&episode.verdict)) {
        (State::Warn, _) => 2,
        (_, false) => 1,
        _ => 0,
    };
    episodes.sort_by(|a, b| rank(a).cmp(&rank(b)).then(b.amplitude.total_cmp(&a.amplitude)));
    Ok(episodes)
}

/// Whether a line requires action.
pub(super) fn is_harmful(verdict: &Verdict) -> bool {
    !matches!(verdict.class, Class::Electrical | Class::Structural)
}

fn episode(
    subject: &Subject,
    listened: &Listened,
    events: &[&Event],
) -> Result<Option<Episode>, Failure> {
    let alive = || events.iter().filter(|event| event.verdict.state != State::Over);
    let state = alive().map(|event| event.verdict.state).max();
    let best = alive().rev().find(|event| Some(event.verdict.state) == state);
    let over = events.iter().find(|event| event.verdict.state == State::Over);
    let alarm = events.iter().find(|event| event.verdict.state == State::Alarm);
    let (Some(state), Some(best), Some(first)) = (state, best, events.first()) else {
        return Ok(None);
    };
    let mut episode = Episode {
        channel: listened.channel(best.verdict.axis),
        from_s: first.t_s,
        to_s: over.map(|event| (event.t_s - LINGER_S).max(first.t_s)),
        alarm_s: alarm.map(|event| event.t_s),
        state,
        frequency_hz: best.verdict.frequency_hz,
        amplitude: alive().map(|event| event.verdict.amplitude_n).fold(0.0, f64::max),
        growth_per_s: alive().map(|event| event.verdict.growth_per_s).fold(0.0, f64::max),
        verdict: best.verdict,
    };
    episode.measure(subject, best.piece)?;
    Ok(Some(episode))
}

impl Episode {
    /// Frequency and largest amplitude from the samples of its duration, if they are long enough.
    fn measure(&mut self, subject: &Subject, piece: usize) -> Result<(), Failure> {
        let Some(piece) = subject.pieces.get(piece) else { return Ok(()) };
        let rate_hz = subject.rate_hz;
        let sample = |t_s: f64| (((t_s - piece.at_s) * rate_hz).max(0.0) as usize).min(piece.len());
        let from = sample(self.from_s - 0.1);
        let to = self.to_s.map_or(piece.len(), sample);
        let window = (MEASURED_S * rate_hz) as usize;
        let length = to.saturating_sub(from);
        if length < 2 * window {
            return Ok(());
        }
        let whole =
            Segments { detrend: Detrend::Linear, ..Segments::new(rate_hz, length.min(4 * window)) };
        let mut averaging = Averaging::new(whole);
        averaging.begin(length).map_err(Failure::input)?;
        piece
            .samples
            .parts(Gaps::Bridged, &[self.channel], from..to, |part| averaging.push(part))?;
        let mean = averaging.finish().map_err(Failure::input)?.mean;
        let reach_hz = 3.0_f64.max(0.005 * self.frequency_hz);
        let near = line_near(&mean, self.frequency_hz, reach_hz);
        let Some(line) = near.filter(|line| line.ratio > 2.0) else { return Ok(()) };
        self.frequency_hz = line.frequency;
        let short = Segments { overlap: 3 * window / 4, length: window, ..whole };
        let mut segments = SegmentPower::new(length, &short).map_err(Failure::input)?;
        let step_hz = rate_hz / window as f64;
        let mut spectrum =
            Spectrum { frequency: segments.frequencies(), power: Vec::new(), averages: 1 };
        let mut largest = 0.0_f64;
        piece.samples.parts(Gaps::Bridged, &[self.channel], from..to, |part| {
            segments.push(part, |_, power| {
                spectrum.power.clear();
                spectrum.power.extend_from_slice(power);
                let near = line_near(&spectrum, line.frequency, step_hz);
                largest = largest.max(near.map_or(0.0, |line| line.amplitude));
            });
        })?;
        if largest > 0.0 {
            self.amplitude = largest;
        }
        Ok(())
    }
}
