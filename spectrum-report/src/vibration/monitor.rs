//! Runs the vibration monitor on the recording and groups its verdicts by spectral line.

use recording::model::RobotModel;
use spectrum::offline::{Event, MonitorResult, MonitorRun, SpectrumAverager, line_near};
use spectrum::welch::{Detrend, SegmentPower, Segments, Spectrum};
use spectrum::{
    Axis, Class, GearFrequency, Mode, MonitorConfig, RATE_MAX_HZ, State, Verdict, VibrationMonitor,
};

use super::Settings;
use super::input::Source;
use super::samples::GapHandling;
use crate::error::Error;
use crate::parallel;

/// The monitor reports the end of a line this long after it was last seen, s.
const LINGER_S: f64 = 0.5;
/// Duration over which an amplitude is measured, s.
const MEASURED_S: f64 = 0.25;

/// Input and results of one monitor.
pub(super) struct MonitoredGroup {
    /// Its channels.
    pub(super) group: Vec<usize>,
    pub(super) watch: VibrationMonitor,
    pub(super) result: MonitorResult,
    /// The minimum amplitude that it reports, in the group's unit.
    pub(super) amplitude_min: f64,
}

/// The course of one spectral line.
#[derive(Clone, Debug)]
pub struct Episode {
    /// Its channel, from 0.
    pub channel: usize,
    /// Its begin on an axis on which time never runs back, s.
    pub from_s: f64,
    /// Its end, s; `None`: until the end of the recording.
    pub to_s: Option<f64>,
    /// When it was first an alarm, s.
    pub alarm_s: Option<f64>,
    /// The highest state it reached.
    pub state: State,
    /// Hz.
    pub frequency_hz: f64,
    /// The largest amplitude over a quarter of a second, in the channel's unit.
    pub amplitude: f64,
    /// The fastest growth reported, 1/s.
    pub growth_per_s: f64,
    /// The last verdict in the highest state.
    pub verdict: Verdict,
}

impl MonitoredGroup {
    /// The channel of a verdict.
    pub(super) fn channel(&self, axis: Axis) -> usize {
        self.group.get(axis.channel()).or(self.group.last()).copied().unwrap_or(0)
    }
}

/// Runs a monitor for every group of channels. Empty, with a note, if the recording's rate is too
/// low.
pub(super) fn monitor(
    settings: &Settings,
    source: &Source,
    wheels: &[GearFrequency],
    rms: &[f64],
    notes: &mut Vec<String>,
) -> Result<Vec<MonitoredGroup>, Error> {
    let rate_least_hz = settings.rate_least_hz;
    if source.rate_hz < rate_least_hz {
        let rate_hz = source.rate_hz;
        notes.push(format!(
            "the monitor needs at least {rate_least_hz} Hz, the rate is {rate_hz:.1} Hz: spectra only"
        ));
        return Ok(Vec::new());
    }
    check_rate(source)?;
    let monitored = |group: &Vec<usize>| monitor_group(group, settings, source, wheels, rms);
    let all = parallel::map(&source.groups(), monitored);
    let all = all.into_iter().collect::<Result<Vec<MonitoredGroup>, Error>>()?;
    for MonitoredGroup { result, .. } in &all {
        if result.still_learning {
            let seconds = report::significant(source.seconds(), 3);
            let note = format!(
                "{seconds} s are too short for the monitor to learn the noise: spectra only"
            );
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        if result.dropped > 0 {
            notes.push(format!("dropped verdicts: {}", result.dropped));
        }
    }
    Ok(all)
}

/// Rejects a rate that the monitor cannot process, and names its source.
fn check_rate(source: &Source) -> Result<(), Error> {
    let rate_hz = source.rate_hz;
    if rate_hz <= RATE_MAX_HZ {
        return Ok(());
    }
    Err(Error::input(if source.rate_is_given {
        format!("--rate is {rate_hz} Hz, expected at most {RATE_MAX_HZ} Hz")
    } else {
        let file = source.file.display();
        format!(
            "{file}: its times, or its header, state {rate_hz} samples per second, expected at most {RATE_MAX_HZ}; correct the unit of the time column, or give --rate HZ"
        )
    }))
}

/// Results of one monitor on a group of channels.
fn monitor_group(
    group: &[usize],
    settings: &Settings,
    source: &Source,
    wheels: &[GearFrequency],
    rms: &[f64],
) -> Result<MonitoredGroup, Error> {
    let amplitude_min =
        settings.amplitude_least.unwrap_or_else(|| least_amplitude(settings, source, group, rms));
    let usual = MonitorConfig::default();
    let config = MonitorConfig {
        rate_hz: source.rate_hz,
        channels: group.len(),
        band_hz: settings.band_hz,
        modes: source.model.as_ref().map(modes).unwrap_or_default(),
        gear_frequencies: wheels.to_vec(),
        least_amplitude_n: amplitude_min,
        least_amplitude_nm: if settings.amplitude_least.is_some() {
            amplitude_min
        } else {
            0.1 * amplitude_min
        },
        mains_hz: settings.mains_hz,
        threshold: settings.threshold,
        learn_s: (0.25 * source.seconds()).clamp(0.5, usual.learn_s),
        ..usual
    };
    let mut watch = VibrationMonitor::new(config).map_err(Error::input)?;
    let mut run = MonitorRun::new(&mut watch, source.rate_hz);
    for piece in &source.pieces {
        let state = |sample| piece.motion.state(sample, source.teeth);
        run.begin(piece.at_s, group.len());
        piece
            .samples
            .parts(GapHandling::Missing, group, 0..piece.len(), |part| run.push(part, state))?;
        run.end(state);
    }
    let result = run.finish();
    Ok(MonitoredGroup { group: group.to_vec(), watch, result, amplitude_min })
}

/// The minimum amplitude, by the unit or relative to the signal.
fn least_amplitude(settings: &Settings, source: &Source, group: &[usize], rms: &[f64]) -> f64 {
    let defaults = MonitorConfig::default();
    match group.first().map(|channel| source.channels[*channel].unit.as_str()) {
        Some("N") => defaults.least_amplitude_n,
        Some("Nm") => defaults.least_amplitude_nm,
        _ => {
            settings.amplitude_least_part
                * group.iter().filter_map(|channel| rms.get(*channel)).copied().fold(0.0, f64::max)
        }
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

/// The course of every line: alarms first, then by amplitude.
pub(super) fn episodes(source: &Source, all: &[MonitoredGroup]) -> Result<Vec<Episode>, Error> {
    let mut episodes = Vec::new();
    for monitored in all {
        let mut lines: Vec<u32> = Vec::new();
        for event in &monitored.result.events {
            if !lines.contains(&event.verdict.line) {
                lines.push(event.verdict.line);
            }
        }
        for line in lines {
            let of_line = |event: &&Event| event.verdict.line == line;
            let events: Vec<&Event> = monitored.result.events.iter().filter(of_line).collect();
            episodes.extend(episode(source, monitored, &events)?);
        }
    }
    let rank = |episode: &Episode| match (episode.state, episode.is_harmful()) {
        (State::Warn, _) => 2,
        (_, false) => 1,
        _ => 0,
    };
    episodes.sort_by(|a, b| rank(a).cmp(&rank(b)).then(b.amplitude.total_cmp(&a.amplitude)));
    Ok(episodes)
}

fn episode(
    source: &Source,
    monitored: &MonitoredGroup,
    events: &[&Event],
) -> Result<Option<Episode>, Error> {
    let alive = || events.iter().filter(|event| event.verdict.state != State::Over);
    let state = alive().map(|event| event.verdict.state).max();
    let best = alive().rev().find(|event| Some(event.verdict.state) == state);
    let over = events.iter().find(|event| event.verdict.state == State::Over);
    let alarm = events.iter().find(|event| event.verdict.state == State::Alarm);
    let (Some(state), Some(best), Some(first)) = (state, best, events.first()) else {
        return Ok(None);
    };
    let mut episode = Episode {
        channel: monitored.channel(best.verdict.axis),
        from_s: first.t_s,
        to_s: over.map(|event| (event.t_s - LINGER_S).max(first.t_s)),
        alarm_s: alarm.map(|event| event.t_s),
        state,
        frequency_hz: best.verdict.frequency_hz,
        amplitude: alive().map(|event| event.verdict.amplitude_n).fold(0.0, f64::max),
        growth_per_s: alive().map(|event| event.verdict.growth_per_s).fold(0.0, f64::max),
        verdict: best.verdict,
    };
    episode.measure(source, best.piece)?;
    Ok(Some(episode))
}

impl Episode {
    /// Whether its class requires action.
    fn is_harmful(&self) -> bool {
        !matches!(self.verdict.class, Class::Electrical | Class::Structural)
    }

    /// Whether it is an alarm that requires action.
    #[must_use]
    pub fn is_alarm(&self) -> bool {
        self.state >= State::Alarm && self.is_harmful()
    }

    /// Whether it is an alarm that another cut would remove.
    #[must_use]
    pub fn is_chatter(&self) -> bool {
        self.is_alarm() && matches!(self.verdict.class, Class::Chatter | Class::ModeCoupling)
    }

    /// Frequency and largest amplitude from the samples of its duration, if they are long enough.
    fn measure(&mut self, source: &Source, piece: usize) -> Result<(), Error> {
        let Some(piece) = source.pieces.get(piece) else { return Ok(()) };
        let rate_hz = source.rate_hz;
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
        let mut averaging = SpectrumAverager::new(whole);
        averaging.begin(length).map_err(Error::input)?;
        piece
            .samples
            .parts(GapHandling::Bridged, &[self.channel], from..to, |part| averaging.push(part))?;
        let mean = averaging.finish().map_err(Error::input)?.mean;
        let reach_hz = 3.0_f64.max(0.005 * self.frequency_hz);
        let nearest = line_near(&mean, self.frequency_hz, reach_hz);
        let Some(line) = nearest.filter(|line| line.ratio > 2.0) else { return Ok(()) };
        self.frequency_hz = line.frequency;
        let short = Segments { overlap: 3 * window / 4, length: window, ..whole };
        let mut segments = SegmentPower::new(length, &short).map_err(Error::input)?;
        let step_hz = rate_hz / window as f64;
        let mut spectrum =
            Spectrum { frequency: segments.frequencies(), power: Vec::new(), averages: 1 };
        let mut largest = 0.0_f64;
        piece.samples.parts(GapHandling::Bridged, &[self.channel], from..to, |part| {
            segments.push(part, |_, power| {
                spectrum.power.clear();
                spectrum.power.extend_from_slice(power);
                let nearest = line_near(&spectrum, line.frequency, step_hz);
                largest = largest.max(nearest.map_or(0.0, |line| line.amplitude));
            });
        })?;
        if largest > 0.0 {
            self.amplitude = largest;
        }
        Ok(())
    }
}
