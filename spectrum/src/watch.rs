//! The vibration watch: blocks in, verdicts out.
//!
//! [`Watch::new`] plans and allocates; [`Watch::push`] does neither allocate, lock, log nor panic.
//! Verdicts depend on the samples alone, not on how they are cut into blocks.

use crate::block::{Axis, Block, ProcessState};
use crate::branch::{Branch, SPLIT_HZ};
use crate::config::{ConfigError, WatchConfig};
use crate::decimate::FrontEnd;
use crate::fault::Health;
use crate::history::History;
use crate::stream::{Admission, Stream};
use crate::surroundings::{Level, Surroundings};
use crate::track::{TRACKS, Track, Tracks};
use crate::verdict::{State, Verdict, Verdicts};
use realfft::RealFftPlanner;

/// The vibration watch over one force sensor.
pub struct Watch {
    config: WatchConfig,
    process: ProcessState,
    stream: Stream,
    level: Level,
    front: FrontEnd,
    raw: Vec<History>,
    low: Branch,
    full: Option<Branch>,
    tracks: Tracks,
    samples: u64,
    decimate_in: usize,
    block_start: (u64, u64),
}

impl Watch {
    /// Plans everything for a checked configuration.
    ///
    /// # Errors
    /// The first setting that is out of its range.
    pub fn new(config: WatchConfig) -> Result<Self, ConfigError> {
        config.check()?;
        let mut planner = RealFftPlanner::new();
        let front = FrontEnd::new(config.rate_hz, SPLIT_HZ);
        let split = front.factor() > 1 && config.band_top_hz() > SPLIT_HZ;
        let low_top_hz = if split { SPLIT_HZ } else { config.band_top_hz() };
        Ok(Self {
            process: ProcessState::default(),
            stream: Stream::new(&config),
            level: Level::new(&config),
            raw: (0..config.channels).map(|_| History::new(front.longest())).collect(),
            low: Branch::low(&mut planner, &config, front.factor(), low_top_hz),
            full: split.then(|| Branch::full(&mut planner, &config)),
            decimate_in: front.factor(),
            front,
            tracks: Tracks::default(),
            samples: 0,
            block_start: (0, 0),
            config,
        })
    }

    /// Takes note of what the process does. Numbers that cannot be are read as "not known".
    pub fn process_state(&mut self, state: ProcessState) {
        let known = |x: f64| if x.is_finite() && x > 0.0 { x } else { 0.0 };
        self.process = ProcessState {
            spindle_rpm: known(state.spindle_rpm),
            feed_mm_s: known(state.feed_mm_s),
            ..state
        };
        self.front.set_spindle(self.process.spindle_rpm / 60.0);
    }

    /// Takes a block and says what is new: lines seen, states reached, lines over.
    pub fn push(&mut self, block: &Block<'_>) -> Verdicts {
        let mut verdicts = Verdicts::default();
        match self.stream.admit(block) {
            Admission::Refused => return verdicts,
            Admission::AfterGap => self.reset(),
            Admission::Next => {}
        }
        self.block_start = (block.t_ns, self.samples);
        let channels = self.config.channels;
        let frames = block.samples.len() / channels;
        let mut done = 0;
        while done < frames {
            let due = self.full.as_ref().map_or(usize::MAX, |full| full.waiting);
            let run = (frames - done).min(self.decimate_in).min(due);
            self.feed(&block.samples[done * channels..(done + run) * channels]);
            done += run;
            self.look(&mut verdicts);
        }
        self.stream.note_dropped(verdicts.dropped());
        verdicts
    }

    /// State of sensor and stream.
    #[must_use]
    pub fn health(&self) -> Health {
        let full_ready = self.full.as_ref().is_none_or(Branch::is_ready);
        Health { learning: !(self.low.is_ready() && full_ready), ..self.stream.health() }
    }

    /// The lines that live now, as verdicts.
    #[must_use]
    pub fn lines(&self) -> Verdicts {
        let mut verdicts = Verdicts::default();
        for track in self.tracks.iter() {
            verdicts.push(self.verdict(track));
        }
        verdicts
    }

    fn reset(&mut self) {
        for history in &mut self.raw {
            history.clear();
        }
        self.decimate_in = self.front.factor();
        self.low.reset();
        if let Some(full) = &mut self.full {
            full.reset();
        }
    }

    /// Takes whole frames, no more than up to the next output of either branch.
    fn feed(&mut self, frames: &[f64]) {
        let channels = self.config.channels;
        for (channel, raw) in self.raw.iter_mut().enumerate() {
            for frame in frames.chunks_exact(channels) {
                let sample = self.stream.sample(channel, frame[channel]);
                raw.push(sample);
                self.level.take(channel, sample);
                if let Some(full) = &mut self.full {
                    full.histories[channel].push(sample);
                }
            }
        }
        let run = frames.len() / channels;
        self.samples += run as u64;
        self.stream.advance(run);
        self.level.advance(run);
        self.decimate_in -= run;
        if let Some(full) = &mut self.full {
            full.waiting -= run;
        }
    }

    /// Does what has become due: a hop at the full rate, a decimated sample and its hop.
    fn look(&mut self, verdicts: &mut Verdicts) {
        let surroundings = self.surroundings();
        let full_due = self.full.as_ref().is_some_and(|full| full.waiting == 0);
        if full_due {
            self.look_at_full_rate(surroundings);
        }
        let mut low_due = false;
        if self.decimate_in == 0 {
            self.decimate_in = self.front.factor();
            low_due = self.decimate();
        }
        if low_due {
            self.look_low(surroundings);
        }
        if full_due || low_due {
            self.judge(verdicts);
        }
    }

    /// Makes one sample of the low branch; says whether its hop is due.
    fn decimate(&mut self) -> bool {
        let taps = self.front.taps();
        if self.raw.iter().any(|raw| raw.newest(taps).is_none()) {
            return false;
        }
        for (raw, low) in self.raw.iter().zip(&mut self.low.histories) {
            if let Some(samples) = raw.newest(taps) {
                low.push(self.front.output(samples));
            }
        }
        self.low.waiting -= 1;
        self.low.waiting == 0
    }

    fn look_at_full_rate(&mut self, surroundings: Surroundings) {
        let now_s = self.now_s();
        let (lines_hz, count) = self.tracks.frequencies();
        let (tracks, stream) = (&mut self.tracks, &self.stream);
        let Some(full) = &mut self.full else { return };
        full.switch(surroundings);
        full.look(&lines_hz[..count], |sighting| {
            if !stream.is_held(sighting.channel) {
                tracks.sight(&sighting, now_s);
            }
        });
        full.measure(tracks, now_s, &(SPLIT_HZ..f64::INFINITY), |_| 1.0);
    }

    fn look_low(&mut self, surroundings: Surroundings) {
        let now_s = self.now_s();
        let (lines_hz, count) = self.tracks.frequencies();
        let (tracks, stream, front) = (&mut self.tracks, &self.stream, &self.front);
        self.low.switch(surroundings);
        self.low.look(&lines_hz[..count], |mut sighting| {
            if !stream.is_held(sighting.channel) {
                sighting.power /= front.gain(sighting.frequency_hz).powi(2);
                tracks.sight(&sighting, now_s);
            }
        });
        let top_hz = if self.full.is_some() { SPLIT_HZ } else { f64::INFINITY };
        self.low.measure(tracks, now_s, &(0.0..top_hz), |hz| front.gain(hz));
    }

    /// Moves every line to the state it has earned, and says so.
    fn judge(&mut self, verdicts: &mut Verdicts) {
        let now_s = self.now_s();
        let mut news = [None; TRACKS];
        for (track, news) in self.tracks.iter_mut().zip(&mut news) {
            *news = track.advance(now_s).then_some(*track);
        }
        for track in news.iter().flatten() {
            verdicts.push(self.verdict(track));
        }
        self.tracks.bury();
    }

    /// Where the tool is: by the cell's own word, else by the level of the forces.
    fn surroundings(&self) -> Surroundings {
        match self.process.in_cut {
            Some(true) => Surroundings::Cut,
            Some(false) => Surroundings::Air,
            None => self.level.present(),
        }
    }

    fn now_s(&self) -> f64 {
        self.samples as f64 / self.config.rate_hz
    }

    fn verdict(&self, track: &Track) -> Verdict {
        let (block_ns, block_sample) = self.block_start;
        let since_s = (self.samples - block_sample) as f64 / self.config.rate_hz;
        Verdict {
            line: track.id,
            t_ns: block_ns.saturating_add((since_s * 1e9) as u64),
            state: track.state,
            frequency_hz: track.frequency_hz,
            amplitude_n: track.amplitude(),
            axis: Axis::of_channel(track.channel),
            growth_per_s: if track.state == State::Over { 0.0 } else { track.growth_per_s() },
            ..Verdict::default()
        }
    }
}

#[cfg(test)]
mod tests;
