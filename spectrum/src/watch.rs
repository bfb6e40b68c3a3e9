//! The vibration monitor: blocks in, verdicts out.
//!
//! [`Watch::new`] plans and allocates; [`Watch::push`] does neither allocate, lock, log nor panic.
//! Verdicts depend on the samples alone, not on how they are cut into blocks.

use crate::alias::{RecentSpeed, Spindle};
use crate::asynchronous::Asynchronous;
use crate::block::{Block, ProcessState};
use crate::branch::{Branch, SPLIT_HZ};
use crate::config::{ConfigError, MODES_MAX, Mode, WHEELS_MAX, WatchConfig, Wheel};
use crate::decimate::FrontEnd;
use crate::family::hold_sidebands_back;
use crate::fault::Health;
use crate::history::History;
use crate::judge::{Context, FeedMemory};
use crate::share::hold_small_lines_back;
use crate::stream::{Admission, Stream};
use crate::surroundings::{Level, Surroundings};
use crate::track::{LINGER_S, TRACKS, Track, Tracks};
use crate::verdict::{Class, Verdicts};
use realfft::RealFftPlanner;

/// A line that is seen this soon after the floor was learned may have been there before, s.
const FROM_START_S: f64 = 0.3;
/// A speed that differs by more than this part is another speed.
const SPEED_CHANGE: f64 = 0.005;

/// The vibration monitor over one force sensor.
pub struct Watch {
    config: WatchConfig,
    process: ProcessState,
    stream: Stream,
    level: Level,
    front: FrontEnd,
    raw: Vec<History>,
    low: Branch,
    full: Option<Branch>,
    asynchronous: Asynchronous,
    tracks: Tracks,
    speed: RecentSpeed,
    spindle: Spindle,
    steady_rpm: f64,
    speed_changed_s: f64,
    feeds: FeedMemory,
    hums: bool,
    ready_s: Option<f64>,
    judged_s: f64,
    samples: u64,
    decimate_in: usize,
    block_start: (u64, u64),
}

impl Watch {
    /// Plans everything for a checked configuration.
    ///
    /// # Errors
    /// The first setting that is out of its range.
    pub fn new(mut config: WatchConfig) -> Result<Self, ConfigError> {
        config.check()?;
        config.modes.reserve(MODES_MAX.saturating_sub(config.modes.len()));
        config.wheels.reserve(WHEELS_MAX.saturating_sub(config.wheels.len()));
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
            asynchronous: Asynchronous::new(&mut planner, &config, &front, low_top_hz, split),
            decimate_in: front.factor(),
            front,
            tracks: Tracks::default(),
            speed: RecentSpeed::default(),
            spindle: Spindle::default(),
            steady_rpm: 0.0,
            speed_changed_s: f64::NEG_INFINITY,
            feeds: FeedMemory::default(),
            hums: false,
            ready_s: None,
            judged_s: 0.0,
            samples: 0,
            block_start: (0, 0),
            config,
        })
    }

    /// Sets the state of the process. Invalid numbers count as unknown.
    pub fn process_state(&mut self, state: ProcessState) {
        let known = |x: f64| if x.is_finite() && x > 0.0 { x } else { 0.0 };
        self.process = ProcessState {
            spindle_rpm: known(state.spindle_rpm),
            feed_mm_s: known(state.feed_mm_s),
            ..state
        };
        let rpm = self.process.spindle_rpm;
        self.front.set_spindle(rpm / 60.0);
        self.asynchronous.set_spindle(rpm / 60.0);
        if (rpm - self.steady_rpm).abs() > SPEED_CHANGE * rpm.max(self.steady_rpm) {
            self.steady_rpm = rpm;
            self.speed_changed_s = self.now_s();
            self.tracks.unsettle();
        }
    }

    /// Sets the rotation of the gear shafts along the present path, replacing the previous one. At
    /// most [`WHEELS_MAX`]; shafts that do not rotate are ignored.
    pub fn wheels(&mut self, wheels: impl IntoIterator<Item = Wheel>) {
        let turning = wheels.into_iter().filter(Wheel::is_possible);
        self.config.wheels.clear();
        self.config.wheels.extend(turning.take(WHEELS_MAX));
    }

    /// Sets the machine's natural frequencies, replacing the previous ones. At most [`MODES_MAX`];
    /// impossible ones are ignored.
    pub fn modes(&mut self, modes: impl IntoIterator<Item = Mode>) {
        let possible = modes.into_iter().filter(Mode::is_possible);
        self.config.modes.clear();
        self.config.modes.extend(possible.take(MODES_MAX));
    }

    /// Processes a block and returns changes: new lines, states reached, lines ended.
    pub fn push(&mut self, block: &Block<'_>) -> Verdicts {
        let mut verdicts = Verdicts::default();
        match self.stream.admit(block) {
            Admission::Refused => return verdicts,
            Admission::Anew => self.reset(),
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
            verdicts.push(self.context().verdict(track, self.now_ns()));
        }
        verdicts
    }

    fn reset(&mut self) {
        for history in &mut self.raw {
            history.clear();
        }
        self.decimate_in = self.front.factor();
        self.asynchronous.reset();
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
                self.asynchronous.take(channel, sample);
                self.level.take(channel, sample);
                if let Some(full) = &mut self.full {
                    full.histories[channel].push(sample);
                }
            }
        }
        let run = frames.len() / channels;
        self.samples += run as u64;
        self.stream.advance(run);
        self.forget_still_channels();
        self.level.advance(run);
        self.decimate_in -= run;
        if let Some(full) = &mut self.full {
            full.waiting -= run;
        }
    }

    /// The floor learned while a channel stood still is invalid.
    fn forget_still_channels(&mut self) {
        let recovered = self.stream.take_recovered();
        for channel in (0..self.config.channels).filter(|channel| recovered >> channel & 1 == 1) {
            self.low.forget(channel);
            self.asynchronous.forget(channel);
            if let Some(full) = &mut self.full {
                full.forget(channel);
            }
        }
    }

    /// Processes what is due: a hop at the full rate, a decimated sample and its hop.
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
        // Once started, a channel that learns again does not delay the others.
        let judges = self.ready_s.is_some() || self.low.is_ready();
        if (full_due || low_due) && judges {
            self.judge(surroundings, verdicts);
        }
    }

    /// Computes one sample of the low branch; returns whether its hop is due.
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
        self.asynchronous.decimate(&self.front);
        self.low.waiting -= 1;
        self.low.waiting == 0
    }

    fn look_at_full_rate(&mut self, surroundings: Surroundings) {
        let now_s = self.now_s();
        let (lines_hz, count) = self.tracks.frequencies();
        let settled_s = now_s - self.speed_changed_s;
        let (tracks, stream, apart) = (&mut self.tracks, &self.stream, &mut self.asynchronous);
        let Some(full) = &mut self.full else { return };
        let is_still = |channel| stream.is_still(channel);
        full.switch(surroundings);
        full.look(&lines_hz[..count], |sighting| {
            let is_due = !apart.sees(sighting.frequency_hz) && sighting.is_after_change(settled_s);
            if is_due && !stream.is_held(sighting.channel) {
                tracks.sight(&sighting, now_s);
            }
        });
        let above = |hz: f64| hz >= SPLIT_HZ;
        full.measure(tracks, now_s, |hz| above(hz) && !apart.sees(hz), |_| 1.0, is_still);
        apart.look_at_full_rate(surroundings, &lines_hz[..count], |sighting| {
            if !stream.is_held(sighting.channel) && sighting.is_after_change(settled_s) {
                tracks.sight(&sighting, now_s);
            }
        });
        if let Some(full) = &apart.full {
            full.measure(
                tracks,
                now_s,
                |hz| above(hz) && apart.sees(hz),
                |hz| apart.gain(hz),
                is_still,
            );
        }
    }

    fn look_low(&mut self, surroundings: Surroundings) {
        let now_s = self.now_s();
        let (lines_hz, count) = self.tracks.frequencies();
        let settled_s = now_s - self.speed_changed_s;
        let (tracks, stream, front) = (&mut self.tracks, &self.stream, &self.front);
        let apart = &mut self.asynchronous;
        let is_still = |channel| stream.is_still(channel);
        self.low.switch(surroundings);
        self.low.look(&lines_hz[..count], |mut sighting| {
            let is_due = !apart.sees(sighting.frequency_hz) && sighting.is_after_change(settled_s);
            if is_due && !stream.is_held(sighting.channel) {
                sighting.power /= front.gain(sighting.frequency_hz).powi(2);
                tracks.sight(&sighting, now_s);
            }
        });
        let top_hz = if self.full.is_some() { SPLIT_HZ } else { f64::INFINITY };
        let below = |hz: f64| hz < top_hz;
        let gain = |hz: f64| front.gain(hz);
        self.low.measure(tracks, now_s, |hz| below(hz) && !apart.sees(hz), gain, is_still);
        apart.look_low(surroundings, &lines_hz[..count], |sighting| {
            if !stream.is_held(sighting.channel) && sighting.is_after_change(settled_s) {
                tracks.sight(&sighting, now_s);
            }
        });
        apart.low.measure(
            tracks,
            now_s,
            |hz| below(hz) && apart.sees(hz),
            |hz| apart.gain(hz),
            is_still,
        );
    }

    /// Classifies every line, updates its state, and returns changes.
    fn judge(&mut self, surroundings: Surroundings, verdicts: &mut Verdicts) {
        let now_s = self.now_s();
        let rpm = self.process.spindle_rpm;
        self.spindle = self.speed.take(rpm / 60.0, self.process.teeth, now_s);
        let before_s = std::mem::replace(&mut self.judged_s, now_s);
        let lived_s = if surroundings == Surroundings::Air { now_s - before_s } else { 0.0 };
        let ready_s = *self.ready_s.get_or_insert(now_s);
        let mut tracks = std::mem::take(&mut self.tracks);
        let mut news = [None; TRACKS];
        for track in tracks.iter_mut() {
            track.air_s += lived_s;
            let is_early = track.born_s - ready_s < FROM_START_S;
            track.from_start |= is_early && track.heard > self.config.rules.heard_part;
            self.feeds.note(track, self.process.feed_mm_s, now_s);
            // While the speed changes, previous multiples still count as such.
            let held =
                track.class == Class::Forced && now_s - self.speed_changed_s < 2.0 * LINGER_S;
            if track.is_fresh(now_s) && !held {
                self.context().classify(track);
            }
        }
        let near_mode = |track: &Track| self.context().nearness(track);
        let knows_modes = !self.config.modes.is_empty();
        hold_sidebands_back(&mut tracks, self.spindle.hz, now_s, knows_modes, near_mode);
        let energy = (surroundings == Surroundings::Cut).then(|| self.level.energy());
        hold_small_lines_back(&mut tracks, energy, self.config.rules.least_share);
        for (track, news) in tracks.iter_mut().zip(&mut news) {
            *news = track.advance(now_s).then_some(*track);
        }
        tracks.bury();
        self.hums = tracks.iter().any(|track| track.class == Class::Electrical);
        self.tracks = tracks;
        for track in news.iter().flatten() {
            verdicts.push(self.context().verdict(track, self.now_ns()));
        }
    }

    pub(crate) fn context(&self) -> Context<'_> {
        Context {
            config: &self.config,
            process: self.process,
            spindle: self.spindle,
            feeds: &self.feeds,
            hums: self.hums,
            knows_air: self.process.in_cut.is_some() || self.level.knows_air(),
        }
    }

    /// Air or cut: as stated by the cell, otherwise by the level of the forces.
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

    /// Time of the newest sample, by the block's times.
    fn now_ns(&self) -> u64 {
        let (block_ns, block_sample) = self.block_start;
        let since_s = (self.samples - block_sample) as f64 / self.config.rate_hz;
        block_ns.saturating_add((since_s * 1e9).round() as u64)
    }
}

#[cfg(test)]
mod class_tests;
#[cfg(test)]
mod tests;
