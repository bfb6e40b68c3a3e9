//! Evaluation of a tracked line: collects evidence, determines class, recommendation and verdict.
//!
//! Fixed-size state, no allocation.

use crate::advice::{AdviceInput, advise};
use crate::alias::Spindle;
use crate::block::{Axis, ProcessState};
use crate::classify::{Evidence, classify, max_state};
use crate::config::MonitorConfig;
use crate::track::Track;
use crate::verdict::{Class, NearestLine, State, Verdict};

/// Largest relative distance of a line from a near mode.
const NEAR_MODE: f64 = 0.05;
/// Largest relative distance between two close modes.
const CLOSE_MODES: f64 = 0.15;
/// Largest distance of a line from the alias of a harmonic that makes it suspect, Hz.
const SUSPECT_HZ: f64 = 2.0;
/// Largest distance of an electrical line from a multiple of the mains frequency, Hz.
const MAINS_HZ: f64 = 0.3;
/// Least duration in air of a line that counts as present in air, s; a shorter time may be a cut
/// not yet detected.
const PRESENT_IN_AIR_S: f64 = 0.2;
/// Largest possible spatial frequency of a gear, cycles per mm: at most 2000 tooth meshes per
/// revolution of a joint (the pinion of the reference robot's joint 5: 26 · 63.7), times three for
/// the third multiple, at a lever arm of at least 0.2 m: 6000 / (2π · 200 mm).
const GEAR_CYCLES_PER_MM: f64 = 5.0;
/// Relative change of the feed required to decide whether a line follows it.
const FEED_CHANGE: f64 = 0.1;
/// Time for which feed and frequency must be constant before the pair is stored, s.
const FEED_SETTLED_S: f64 = 0.3;
/// Number of stored pairs of feed and frequency.
const HISTORY_LINES: usize = 16;

/// Frequencies of lines at previous feeds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FeedHistory {
    history: [(f64, f64); HISTORY_LINES],
    next: usize,
}

impl FeedHistory {
    /// Stores the frequency of a line at a feed.
    pub(crate) fn remember(&mut self, feed_mm_s: f64, frequency_hz: f64) {
        self.history[self.next] = (feed_mm_s, frequency_hz);
        self.next = (self.next + 1) % HISTORY_LINES;
    }

    /// Stores the frequency of a line when the feed changes or the line ends.
    pub(crate) fn update(&mut self, track: &mut Track, feed_mm_s: f64, now_s: f64) {
        let (at_feed, since_s) = track.feed;
        if (feed_mm_s - at_feed).abs() > 0.05 * at_feed {
            if at_feed > 0.0 && now_s - since_s > FEED_SETTLED_S {
                self.remember(at_feed, track.frequency_hz);
            }
            track.feed = (feed_mm_s, now_s);
        }
        if feed_mm_s > 0.0 && track.is_fading(now_s) && now_s - since_s > FEED_SETTLED_S {
            self.remember(feed_mm_s, track.frequency_hz);
            track.feed = (feed_mm_s, now_s);
        }
    }

    /// Whether the frequency of a line is proportional to the feed (`Some(true)`) or constant
    /// (`Some(false)`); `None` if unknown.
    fn follows_feed(&self, feed_mm_s: f64, frequency_hz: f64, uncertainty_hz: f64) -> Option<bool> {
        let tolerance = 0.02 + uncertainty_hz / frequency_hz;
        let other = self.history.iter().filter(|(feed, _)| {
            *feed > 0.0 && feed_mm_s > 0.0 && (feed_mm_s / feed).ln().abs() > FEED_CHANGE
        });
        let like = |ratio: f64| ratio.ln().abs() < tolerance;
        let mut stays = false;
        for (feed, before_hz) in other {
            let moved = frequency_hz / before_hz;
            if like(moved / (feed_mm_s / feed)) {
                return Some(true);
            }
            stays |= like(moved);
        }
        stays.then_some(false)
    }
}

/// Present state of process and configuration for the evaluation of lines.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LineContext<'a> {
    pub(crate) config: &'a MonitorConfig,
    pub(crate) process: ProcessState,
    pub(crate) spindle: Spindle,
    pub(crate) feed_history: &'a FeedHistory,
    /// Whether a line is classified as electrical.
    pub(crate) mains_present: bool,
    /// Whether air and cut are distinguished, by the cell or by the force level.
    pub(crate) air_known: bool,
}

impl LineContext<'_> {
    /// Sets class, alternatives and highest state of a line from the present evidence.
    pub(crate) fn classify(&self, track: &mut Track) {
        let evidence = self.evidence(track);
        (track.class, track.alternatives) = classify(&evidence);
        track.max_state = max_state(track.class, track.alternatives, &evidence);
        track.suspect_alias = evidence.aliased;
        let is_gear = track.class == Class::Gear;
        let wheel = || self.matching_gear(track.frequency_hz, track.uncertainty_hz());
        track.gear = is_gear.then(wheel).flatten();
    }

    /// Whether a line is near a known mode.
    pub(crate) fn is_near_mode(&self, track: &Track) -> bool {
        let (f, uncertainty_hz) = (track.frequency_hz, track.uncertainty_hz());
        self.config.modes.iter().any(|mode| is_near(mode.frequency_hz, f, uncertainty_hz))
    }

    /// Proximity of a line to a known mode: 2 near it, 1 within the range of chatter at that mode,
    /// 0 otherwise.
    pub(crate) fn mode_proximity(&self, track: &Track) -> u8 {
        let f = track.frequency_hz;
        let pulled = |mode_hz: f64| (f / mode_hz - 1.0).abs() < CLOSE_MODES;
        if self.is_near_mode(track) {
            2
        } else {
            u8::from(self.config.modes.iter().any(|mode| pulled(mode.frequency_hz)))
        }
    }

    fn evidence(&self, track: &Track) -> Evidence {
        let (f, uncertainty_hz) = (track.frequency_hz, track.uncertainty_hz());
        let at_spindle_harmonic = self.spindle.has_harmonic_at(f, 0.5 + uncertainty_hz);
        let suspect = |line: NearestLine| line.distance_hz.abs() < SUSPECT_HZ.max(uncertainty_hz);
        let alias = self.spindle.nearest_alias(f, self.config.rate_hz);
        let feed = self.process.feed_mm_s;
        let near_mode = self.is_near_mode(track);
        Evidence {
            speed_known: self.spindle.hz > 0.0,
            at_spindle_harmonic,
            aliased: !at_spindle_harmonic && alias.is_some_and(suspect),
            on_mains: self.is_mains_multiple(f, uncertainty_hz, track.class == Class::Electrical),
            mains_present: self.mains_present,
            near_mode,
            has_close_modes: near_mode && self.has_close_modes(f),
            rotates: track.ellipse.is_known().then(|| track.ellipse.rotates()),
            in_air: self.air_known.then_some(is_present_in_air(track)),
            from_start: track.from_start,
            follows_feed: self.feed_history.follows_feed(feed, f, uncertainty_hz),
            gear_possible: feed > 0.0 && f < GEAR_CYCLES_PER_MM * feed,
            at_gear_frequency: self.matching_gear(f, uncertainty_hz).is_some(),
        }
    }

    /// Whether a frequency is a multiple of the mains frequency. The tolerance is wider for a line
    /// already classified as electrical (`was`), because a cut shifts its measured frequency
    /// slightly.
    fn is_mains_multiple(&self, f: f64, uncertainty_hz: f64, was: bool) -> bool {
        let near_hz = if was { 4.0 * MAINS_HZ } else { MAINS_HZ };
        let on = |mains: f64| {
            let order = (f / mains).round().max(1.0);
            (f - order * mains).abs() < near_hz + uncertainty_hz.min(1.0)
        };
        self.config.mains_hz.map_or_else(|| on(50.0) || on(60.0), on)
    }

    /// Whether two modes near `f` are close to each other.
    fn has_close_modes(&self, f: f64) -> bool {
        let around = self
            .config
            .modes
            .iter()
            .filter(|mode| (mode.frequency_hz / f - 1.0).abs() < CLOSE_MODES);
        let range = around.fold((f64::INFINITY, 0.0_f64, 0), |(low, high, n), mode| {
            (low.min(mode.frequency_hz), high.max(mode.frequency_hz), n + 1)
        });
        range.2 >= 2 && range.1 > range.0
    }

    /// The gear frequency that matches at the present feed: joint and shaft.
    fn matching_gear(&self, f: f64, uncertainty_hz: f64) -> Option<(u8, u8)> {
        let feed = self.process.feed_mm_s;
        let distance = |cycles_per_mm: f64| (cycles_per_mm * feed - f).abs();
        self.config
            .gear_frequencies
            .iter()
            .filter(|wheel| distance(wheel.cycles_per_mm) < 0.02 * f + uncertainty_hz)
            .min_by(|a, b| distance(a.cycles_per_mm).total_cmp(&distance(b.cycles_per_mm)))
            .map(|wheel| (wheel.joint, wheel.shaft))
    }

    fn nearest_mode(&self, f: f64) -> Option<NearestLine> {
        let lines = self.config.modes.iter().enumerate().map(|(order, mode)| NearestLine {
            frequency_hz: mode.frequency_hz,
            distance_hz: f - mode.frequency_hz,
            order: order as u32,
        });
        lines.min_by(|a, b| a.distance_hz.abs().total_cmp(&b.distance_hz.abs()))
    }

    /// The verdict on a line.
    pub(crate) fn verdict(&self, track: &Track, t_ns: u64) -> Verdict {
        let f = track.frequency_hz;
        let uncertainty_hz = track.uncertainty_hz();
        let mode = self.nearest_mode(f);
        let case = AdviceInput {
            class: track.class,
            frequency_hz: f,
            suspect_alias: track.suspect_alias,
            near_mode_hz: mode
                .map(|mode| mode.frequency_hz)
                .filter(|mode_hz| is_near(*mode_hz, f, uncertainty_hz)),
            modes: &self.config.modes,
            spindle_rpm: self.process.spindle_rpm,
            teeth: self.process.teeth,
            gear: track.gear,
        };
        Verdict {
            line: track.id,
            t_ns,
            state: track.state,
            frequency_hz: f,
            amplitude_n: track.amplitude(),
            axis: Axis::of_channel(track.channel),
            class: track.class,
            alternatives: track.alternatives,
            growth_per_s: if track.state == State::Over { 0.0 } else { track.growth_per_s() },
            mode,
            harmonic: self.spindle.nearest_harmonic(f, self.config.rate_hz),
            alias: self.spindle.nearest_alias(f, self.config.rate_hz),
            suspect_alias: track.suspect_alias,
            advice: advise(&case),
        }
    }
}

/// Whether a line was present in air for a long time, or for most of its duration: a line that
/// arises in air is not excited by the cut.
fn is_present_in_air(track: &Track) -> bool {
    track.time_in_air_s > PRESENT_IN_AIR_S.min(0.5 * (track.last_seen_s - track.first_seen_s))
}

fn is_near(mode_hz: f64, f: f64, uncertainty_hz: f64) -> bool {
    (f - mode_hz).abs() < NEAR_MODE * mode_hz + uncertainty_hz.min(3.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_follows_the_feed_is_distinguished_from_a_constant_one() {
        let mut memory = FeedHistory::default();
        assert_eq!(memory.follows_feed(10.0, 60.0, 0.2), None);
        memory.remember(5.0, 30.0);
        assert_eq!(memory.follows_feed(10.0, 60.0, 0.2), Some(true));
        assert_eq!(memory.follows_feed(10.0, 30.1, 0.2), Some(false));
        assert_eq!(memory.follows_feed(10.0, 44.0, 0.2), None);
        assert_eq!(memory.follows_feed(5.1, 30.0, 0.2), None, "the same feed tells nothing");
    }
}
