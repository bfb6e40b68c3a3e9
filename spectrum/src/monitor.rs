//! The vibration monitor: from blocks of force samples to verdicts on spectral lines.
//!
//! [`VibrationMonitor::new`] plans and allocates; [`VibrationMonitor::push`] does not allocate,
//! lock, log or panic. Verdicts depend on the samples only, not on their division into blocks.

use crate::alias::{SpeedRange, Spindle};
use crate::asynchronous::AsynchronousSignal;
use crate::block::{Block, ProcessState};
use crate::branch::{Branch, SPLIT_HZ};
use crate::config::{
    ConfigError, GEAR_FREQUENCIES_MAX, GearFrequency, MODES_MAX, Mode, MonitorConfig,
};
use crate::cut_detection::{CutState, ForceLevel};
use crate::decimate::FrontEnd;
use crate::fault::Health;
use crate::force_ratio::limit_weak_lines_to_warnings;
use crate::history::History;
use crate::line_evaluation::{FeedHistory, LineContext};
use crate::sidebands::limit_sidebands_to_warnings;
use crate::stream::{BlockAdmission, SensorStream};
use crate::track::{LINGER_S, TRACKS, Track, Tracks};
use crate::verdict::{Class, Verdicts};
use realfft::RealFftPlanner;

/// A line detected within this time after the floor was learned may have been present before, s.
const PRESENT_FROM_START_S: f64 = 0.3;
/// Relative difference above which the spindle speed has changed.
const SPEED_CHANGE: f64 = 0.005;

/// The vibration monitor of one force sensor.
pub struct VibrationMonitor {
    config: MonitorConfig,
    process: ProcessState,
    stream: SensorStream,
    force_level: ForceLevel,
    front_end: FrontEnd,
    raw: Vec<History>,
    low: Branch,
    full: Option<Branch>,
    asynchronous: AsynchronousSignal,
    tracks: Tracks,
    speed: SpeedRange,
    spindle: Spindle,
    steady_rpm: f64,
    speed_changed_s: f64,
    feed_history: FeedHistory,
    mains_present: bool,
    ready_s: Option<f64>,
    evaluated_s: f64,
    samples: u64,
    decimate_in: usize,
    block_start: (u64, u64),
}

impl VibrationMonitor {
    /// Validates the configuration and plans all windows.
    ///
    /// # Errors
    /// The first setting that is out of its range.
    pub fn new(mut config: MonitorConfig) -> Result<Self, ConfigError> {
        config.check()?;
        config.modes.reserve(MODES_MAX.saturating_sub(config.modes.len()));
        config
            .gear_frequencies
            .reserve(GEAR_FREQUENCIES_MAX.saturating_sub(config.gear_frequencies.len()));
        let mut planner = RealFftPlanner::new();
        let front_end = FrontEnd::new(config.rate_hz, SPLIT_HZ);
        let split = front_end.factor() > 1 && config.band_top_hz() > SPLIT_HZ;
        let low_top_hz = if split { SPLIT_HZ } else { config.band_top_hz() };
        Ok(Self {
            process: ProcessState::default(),
            stream: SensorStream::new(&config),
            force_level: ForceLevel::new(&config),
            raw: (0..config.channels).map(|_| History::new(front_end.longest())).collect(),
            low: Branch::low(&mut planner, &config, front_end.factor(), low_top_hz),
            full: split.then(|| Branch::full(&mut planner, &config)),
            asynchronous: AsynchronousSignal::new(
                &mut planner,
                &config,
                &front_end,
                low_top_hz,
                split,
            ),
            decimate_in: front_end.factor(),
            front_end,
            tracks: Tracks::default(),
            speed: SpeedRange::default(),
            spindle: Spindle::default(),
            steady_rpm: 0.0,
            speed_changed_s: f64::NEG_INFINITY,
            feed_history: FeedHistory::default(),
            mains_present: false,
            ready_s: None,
            evaluated_s: 0.0,
            samples: 0,
            block_start: (0, 0),
            config,
        })
    }

    /// Sets the state of the process. Invalid numbers count as unknown.
    pub fn set_process_state(&mut self, state: ProcessState) {
        let known = |x: f64| if x.is_finite() && x > 0.0 { x } else { 0.0 };
        self.process = ProcessState {
            spindle_rpm: known(state.spindle_rpm),
            feed_mm_s: known(state.feed_mm_s),
            ..state
        };
        let rpm = self.process.spindle_rpm;
        self.front_end.set_spindle(rpm / 60.0);
        self.asynchronous.set_spindle(rpm / 60.0);
        if (rpm - self.steady_rpm).abs() > SPEED_CHANGE * rpm.max(self.steady_rpm) {
            self.steady_rpm = rpm;
            self.speed_changed_s = self.now_s();
            self.tracks.invalidate_frequencies();
        }
    }

    /// Sets the gear frequencies for the present path, replacing the previous ones. At most
    /// [`GEAR_FREQUENCIES_MAX`]; invalid ones are ignored.
    pub fn set_gear_frequencies(&mut self, wheels: impl IntoIterator<Item = GearFrequency>) {
        let turning = wheels.into_iter().filter(GearFrequency::is_valid);
        self.config.gear_frequencies.clear();
        self.config.gear_frequencies.extend(turning.take(GEAR_FREQUENCIES_MAX));
    }

    /// Sets the machine's natural frequencies, replacing the previous ones. At most [`MODES_MAX`];
    /// invalid ones are ignored.
    pub fn set_modes(&mut self, modes: impl IntoIterator<Item = Mode>) {
        let possible = modes.into_iter().filter(Mode::is_valid);
        self.config.modes.clear();
        self.config.modes.extend(possible.take(MODES_MAX));
    }

    /// Processes a block and returns changes: new lines, states reached, lines ended.
    pub fn push(&mut self, block: &Block<'_>) -> Verdicts {
        let mut verdicts = Verdicts::default();
        match self.stream.admit(block) {
            BlockAdmission::Rejected => return verdicts,
            BlockAdmission::Restarted => self.reset(),
            BlockAdmission::Continuous => {}
        }
        self.block_start = (block.t_ns, self.samples);
        let channels = self.config.channels;
        let frames = block.samples.len() / channels;
        let mut done = 0;
        while done < frames {
            let due = self.full.as_ref().map_or(usize::MAX, |full| full.samples_to_hop);
            let run = (frames - done).min(self.decimate_in).min(due);
            self.store_frames(&block.samples[done * channels..(done + run) * channels]);
            done += run;
            self.process_due_hops(&mut verdicts);
        }
        self.stream.count_dropped(verdicts.dropped());
        verdicts
    }

    /// State of sensor and stream.
    #[must_use]
    pub fn health(&self) -> Health {
        let full_ready = self.full.as_ref().is_none_or(Branch::is_ready);
        Health { learning: !(self.low.is_ready() && full_ready), ..self.stream.health() }
    }

    /// Verdicts on all live lines.
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
        self.decimate_in = self.front_end.factor();
        self.asynchronous.reset();
        self.low.reset();
        if let Some(full) = &mut self.full {
            full.reset();
        }
    }

    /// Processes whole frames, at most up to the next output of either branch.
    fn store_frames(&mut self, frames: &[f64]) {
        let channels = self.config.channels;
        for (channel, raw) in self.raw.iter_mut().enumerate() {
            for frame in frames.chunks_exact(channels) {
                let sample = self.stream.check_sample(channel, frame[channel]);
                raw.push(sample);
                self.asynchronous.push_sample(channel, sample);
                self.force_level.add_sample(channel, sample);
                if let Some(full) = &mut self.full {
                    full.histories[channel].push(sample);
                }
            }
        }
        let run = frames.len() / channels;
        self.samples += run as u64;
        self.stream.advance(run);
        self.forget_still_channels();
        self.force_level.advance(run);
        self.decimate_in -= run;
        if let Some(full) = &mut self.full {
            full.samples_to_hop -= run;
        }
    }

    /// Discards the floors of channels that have recovered: they were learned while the channel was
    /// stuck or dead.
    fn forget_still_channels(&mut self) {
        let recovered = self.stream.take_recovered();
        for channel in (0..self.config.channels).filter(|channel| recovered >> channel & 1 == 1) {
            self.low.clear_floor(channel);
            self.asynchronous.clear_floor(channel);
            if let Some(full) = &mut self.full {
                full.clear_floor(channel);
            }
        }
    }

    /// Processes what is due: a hop at the full rate, a decimated sample and its hop.
    fn process_due_hops(&mut self, verdicts: &mut Verdicts) {
        let surroundings = self.cut_state();
        let full_due = self.full.as_ref().is_some_and(|full| full.samples_to_hop == 0);
        if full_due {
            self.process_full_rate_hop(surroundings);
        }
        let mut low_due = false;
        if self.decimate_in == 0 {
            self.decimate_in = self.front_end.factor();
            low_due = self.decimate();
        }
        if low_due {
            self.process_low_hop(surroundings);
        }
        // After the start, a channel that learns again does not delay the others.
        let can_evaluate = self.ready_s.is_some() || self.low.is_ready();
        if (full_due || low_due) && can_evaluate {
            self.evaluate_lines(surroundings, verdicts);
        }
    }

    /// Computes one sample of the low branch; returns whether its hop is due.
    fn decimate(&mut self) -> bool {
        let taps = self.front_end.taps();
        if self.raw.iter().any(|raw| raw.newest(taps).is_none()) {
            return false;
        }
        for (raw, low) in self.raw.iter().zip(&mut self.low.histories) {
            if let Some(samples) = raw.newest(taps) {
                low.push(self.front_end.output(samples));
            }
        }
        self.asynchronous.decimate(&self.front_end);
        self.low.samples_to_hop -= 1;
        self.low.samples_to_hop == 0
    }

    fn process_full_rate_hop(&mut self, surroundings: CutState) {
        let now_s = self.now_s();
        let (lines_hz, count) = self.tracks.frequencies();
        let settled_s = now_s - self.speed_changed_s;
        let (tracks, stream, apart) = (&mut self.tracks, &self.stream, &mut self.asynchronous);
        let Some(full) = &mut self.full else { return };
        let is_still = |channel| stream.is_stuck_or_dead(channel);
        full.set_cut_state(surroundings);
        full.process_hop(&lines_hz[..count], |sighting| {
            let is_due =
                !apart.covers(sighting.frequency_hz) && sighting.is_after_change(settled_s);
            if is_due && !stream.is_suspended(sighting.channel) {
                tracks.assign(&sighting, now_s);
            }
        });
        let above = |hz: f64| hz >= SPLIT_HZ;
        full.measure(tracks, now_s, |hz| above(hz) && !apart.covers(hz), |_| 1.0, is_still);
        apart.process_full_rate_hop(surroundings, &lines_hz[..count], |sighting| {
            if !stream.is_suspended(sighting.channel) && sighting.is_after_change(settled_s) {
                tracks.assign(&sighting, now_s);
            }
        });
        if let Some(full) = &apart.full {
            full.measure(
                tracks,
                now_s,
                |hz| above(hz) && apart.covers(hz),
                |hz| apart.gain(hz),
                is_still,
            );
        }
    }

    fn process_low_hop(&mut self, surroundings: CutState) {
        let now_s = self.now_s();
        let (lines_hz, count) = self.tracks.frequencies();
        let settled_s = now_s - self.speed_changed_s;
        let (tracks, stream, front) = (&mut self.tracks, &self.stream, &self.front_end);
        let apart = &mut self.asynchronous;
        let is_still = |channel| stream.is_stuck_or_dead(channel);
        self.low.set_cut_state(surroundings);
        self.low.process_hop(&lines_hz[..count], |mut sighting| {
            let is_due =
                !apart.covers(sighting.frequency_hz) && sighting.is_after_change(settled_s);
            if is_due && !stream.is_suspended(sighting.channel) {
                sighting.power /= front.gain(sighting.frequency_hz).powi(2);
                tracks.assign(&sighting, now_s);
            }
        });
        let top_hz = if self.full.is_some() { SPLIT_HZ } else { f64::INFINITY };
        let below = |hz: f64| hz < top_hz;
        let gain = |hz: f64| front.gain(hz);
        self.low.measure(tracks, now_s, |hz| below(hz) && !apart.covers(hz), gain, is_still);
        apart.process_low_hop(surroundings, &lines_hz[..count], |sighting| {
            if !stream.is_suspended(sighting.channel) && sighting.is_after_change(settled_s) {
                tracks.assign(&sighting, now_s);
            }
        });
        apart.low.measure(
            tracks,
            now_s,
            |hz| below(hz) && apart.covers(hz),
            |hz| apart.gain(hz),
            is_still,
        );
    }

    /// Classifies every line, updates its state, and returns changes.
    fn evaluate_lines(&mut self, surroundings: CutState, verdicts: &mut Verdicts) {
        let now_s = self.now_s();
        let rpm = self.process.spindle_rpm;
        self.spindle = self.speed.update(rpm / 60.0, self.process.teeth, now_s);
        let before_s = std::mem::replace(&mut self.evaluated_s, now_s);
        let elapsed_in_air_s = if surroundings == CutState::Air { now_s - before_s } else { 0.0 };
        let ready_s = *self.ready_s.get_or_insert(now_s);
        let mut tracks = std::mem::take(&mut self.tracks);
        let mut changes = [None; TRACKS];
        for track in tracks.iter_mut() {
            track.time_in_air_s += elapsed_in_air_s;
            let is_early = track.first_seen_s - ready_s < PRESENT_FROM_START_S;
            track.from_start |= is_early && track.learned_share > self.config.rules.heard_part;
            self.feed_history.update(track, self.process.feed_mm_s, now_s);
            // While the speed changes, the class `Forced` is kept.
            let held =
                track.class == Class::Forced && now_s - self.speed_changed_s < 2.0 * LINGER_S;
            if track.is_fresh(now_s) && !held {
                self.context().classify(track);
            }
        }
        let near_mode = |track: &Track| self.context().mode_proximity(track);
        let knows_modes = !self.config.modes.is_empty();
        limit_sidebands_to_warnings(&mut tracks, self.spindle.hz, now_s, knows_modes, near_mode);
        let energy = (surroundings == CutState::Cut).then(|| self.force_level.energy());
        limit_weak_lines_to_warnings(&mut tracks, energy, self.config.rules.least_share);
        for (track, news) in tracks.iter_mut().zip(&mut changes) {
            *news = track.advance(now_s).then_some(*track);
        }
        tracks.remove_ended();
        self.mains_present = tracks.iter().any(|track| track.class == Class::Electrical);
        self.tracks = tracks;
        for track in changes.iter().flatten() {
            verdicts.push(self.context().verdict(track, self.now_ns()));
        }
    }

    pub(crate) fn context(&self) -> LineContext<'_> {
        LineContext {
            config: &self.config,
            process: self.process,
            spindle: self.spindle,
            feed_history: &self.feed_history,
            mains_present: self.mains_present,
            air_known: self.process.in_cut.is_some() || self.force_level.has_seen_cut(),
        }
    }

    /// Air or cut: as reported by the cell, otherwise by the level of the forces.
    fn cut_state(&self) -> CutState {
        match self.process.in_cut {
            Some(true) => CutState::Cut,
            Some(false) => CutState::Air,
            None => self.force_level.cut_state(),
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
