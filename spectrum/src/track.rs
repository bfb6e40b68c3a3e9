//! Tracking of lines over time, from the first agreement of two windows to the end of the line.
//!
//! Fixed capacity, no allocation. Amplitude and growth are measured in one window of the branch
//! that covers the line; the frequency is the mean of all detections, weighted by their accuracy.

use crate::block::CHANNELS_MAX;
use crate::ellipse::Ellipse;
use crate::sliding::Detection;
use crate::verdict::{Class, ClassSet, State};

/// Largest number of lines tracked at once: [`crate::VERDICTS_MAX`]. With eight, the harmonics of a
/// slow spindle filled the list, and chatter was reported up to one second late (`cuts 80 3040`:
/// 0.74 s in the ninth decile, with sixteen 0.34 s).
pub(crate) const TRACKS: usize = crate::verdict::VERDICTS_MAX;
/// Number of amplitudes stored for the growth rate.
const POINTS: usize = 16;
/// Interval between two of them, s.
const POINT_S: f64 = 0.016;
/// Least smoothed ratio of power to floor of a live line.
const KEEP_RATIO: f64 = 4.0;
/// Upper limit of the ratio before smoothing, so that a strong line does not last longer after its
/// end.
const RATIO_MAX: f64 = 12.0;
/// A line ends after this time without detection or sufficient power, s.
pub(crate) const LINGER_S: f64 = 0.5;
/// Least duration of a confirmed line, s.
const CONFIRM_S: f64 = 0.5;
/// Interval of repeated verdicts on a line with constant state, s.
const REPORT_INTERVAL_S: f64 = 0.1;
/// Growth rate (d ln A / dt, 1/s) below which a line is a ring-down.
const RING_DOWN_PER_S: f64 = -4.0;
/// Time constant of the smoothed power, s.
const SMOOTH_S: f64 = 0.05;
/// Time constant of the smoothed ratio, s: long enough that noise does not prolong a line.
const SMOOTH_RATIO_S: f64 = 0.15;

/// The last verdict on a line: state, class, whether it may be an alias, its gear shaft.
type ReportedState = (State, Class, bool, Option<(u8, u8)>);

/// A tracked line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Track {
    pub(crate) id: u32,
    pub(crate) state: State,
    pub(crate) channel: usize,
    pub(crate) frequency_hz: f64,
    /// Smoothed squared amplitude per channel.
    pub(crate) power: [f64; CHANNELS_MAX],
    pub(crate) ratio: [f64; CHANNELS_MAX],
    pub(crate) first_seen_s: f64,
    pub(crate) last_seen_s: f64,
    pub(crate) class: Class,
    pub(crate) alternatives: ClassSet,
    pub(crate) suspect_alias: bool,
    /// The matching gear frequency of a gear line: joint and shaft.
    pub(crate) gear: Option<(u8, u8)>,
    /// The highest state that the class allows.
    pub(crate) max_state: State,
    /// Mean power at its frequency while the noise floor was learned, over the power at its first
    /// detection.
    pub(crate) learned_share: f64,
    /// Whether it was weak compared with the cutting force.
    pub(crate) is_weak: bool,
    /// Whether it was detected in the signal without spindle harmonics.
    is_asynchronous: bool,
    /// Whether the line was present before the floor was learned.
    pub(crate) from_start: bool,
    /// Total time of the line in air, s.
    pub(crate) time_in_air_s: f64,
    /// Present feed, mm/s, and the time since which it is constant, s.
    pub(crate) feed: (f64, f64),
    pub(crate) ellipse: Ellipse,
    /// Whether the next detection replaces the frequency.
    frequency_invalid: bool,
    three_windows_agree: bool,
    reported: Option<ReportedState>,
    reported_s: f64,
    weight: f64,
    points: [(f64, f64); POINTS],
    point: usize,
}

impl Track {
    pub(crate) fn new(id: u32, sighting: &Detection, now_s: f64) -> Self {
        let mut power = [0.0; CHANNELS_MAX];
        power[sighting.channel] = sighting.power;
        let mut ratio = [0.0; CHANNELS_MAX];
        ratio[sighting.channel] = sighting.ratio.min(RATIO_MAX);
        Self {
            id,
            state: State::Warn,
            channel: sighting.channel,
            frequency_hz: sighting.frequency_hz,
            power,
            ratio,
            first_seen_s: now_s,
            last_seen_s: now_s,
            class: Class::Unknown,
            alternatives: ClassSet::default(),
            suspect_alias: false,
            gear: None,
            max_state: State::Confirmed,
            learned_share: sighting.learned_share,
            is_weak: false,
            is_asynchronous: sighting.is_asynchronous,
            from_start: false,
            time_in_air_s: 0.0,
            feed: (0.0, now_s),
            ellipse: Ellipse::default(),
            frequency_invalid: false,
            three_windows_agree: sighting.three_windows_agree,
            reported: None,
            reported_s: now_s,
            weight: frequency_weight(sighting),
            points: [(f64::NEG_INFINITY, 0.0); POINTS],
            point: 0,
        }
    }

    /// Amplitude on the strongest channel, N or Nm.
    pub(crate) fn amplitude(&self) -> f64 {
        self.power[self.channel].sqrt()
    }

    /// Whether a detection can belong to this line. A detection in the asynchronous signal is not a
    /// harmonic, and a line detected there is different from one next to a harmonic: in short
    /// windows either would shift the frequency of the other.
    fn can_include(&self, sighting: &Detection) -> bool {
        if sighting.is_asynchronous { self.class != Class::Forced } else { !self.is_asynchronous }
    }

    fn update(&mut self, sighting: &Detection, now_s: f64) {
        let weight = frequency_weight(sighting);
        // Exponential forgetting, so that a slow change of the frequency is tracked.
        let kept = if self.frequency_invalid { 0.0 } else { 0.98 * self.weight };
        self.frequency_invalid = false;
        self.weight = kept + weight;
        self.frequency_hz += (sighting.frequency_hz - self.frequency_hz) * weight / self.weight;
        self.three_windows_agree |= sighting.three_windows_agree;
        self.is_asynchronous |= sighting.is_asynchronous;
        self.last_seen_s = now_s;
    }

    /// Updates power and ratio on every channel, `step_s` after the previous update.
    pub(crate) fn measure(
        &mut self,
        strength: impl Fn(usize) -> (f64, f64),
        channels: usize,
        now_s: f64,
        step_s: f64,
    ) {
        let follow = (step_s / SMOOTH_S).min(1.0);
        let settle = (step_s / SMOOTH_RATIO_S).min(1.0);
        for channel in 0..channels.min(CHANNELS_MAX) {
            let (power, ratio) = strength(channel);
            self.power[channel] += follow * (power - self.power[channel]);
            let ratio = ratio.min(RATIO_MAX);
            self.ratio[channel] += settle * (ratio - self.ratio[channel]);
        }
        self.channel = self.strongest_channel(channels);
        if self.ratio[self.channel] >= KEEP_RATIO {
            self.last_seen_s = now_s;
        }
        if now_s - self.points[self.point].0 >= POINT_S {
            self.point = (self.point + 1) % POINTS;
            self.points[self.point] = (now_s, self.amplitude().max(1e-300).ln());
        }
    }

    /// The strongest force channel; a moment channel only if no force exceeds its floor.
    fn strongest_channel(&self, channels: usize) -> usize {
        let best = |range: std::ops::Range<usize>| {
            range
                .filter(|&c| self.ratio[c] >= KEEP_RATIO)
                .max_by(|&a, &b| self.power[a].total_cmp(&self.power[b]))
        };
        best(0..channels.min(3)).or_else(|| best(3..channels)).unwrap_or(self.channel)
    }

    /// Slope of the logarithm of the amplitude over the last quarter second, 1/s.
    pub(crate) fn growth_per_s(&self) -> f64 {
        let known = self.points.iter().filter(|point| point.0.is_finite());
        let n = known.clone().count() as f64;
        if n < 3.0 {
            return 0.0;
        }
        let (t, y) = known.clone().fold((0.0, 0.0), |(t, y), p| (t + p.0 / n, y + p.1 / n));
        let (tt, ty) = known.fold((0.0, 0.0), |(tt, ty), p| {
            (tt + (p.0 - t) * (p.0 - t), ty + (p.0 - t) * (p.1 - y))
        });
        if tt > 0.0 { ty / tt } else { 0.0 }
    }

    /// Whether the line was detected or had sufficient power in the last 0.1 s; only then it is
    /// evaluated.
    pub(crate) fn is_fresh(&self, now_s: f64) -> bool {
        now_s - self.last_seen_s < 0.2 * LINGER_S
    }

    /// Whether the line was absent for half of the time after which it ends.
    pub(crate) fn is_fading(&self, now_s: f64) -> bool {
        now_s - self.last_seen_s > 0.5 * LINGER_S
    }

    /// Standard uncertainty of the frequency, Hz, from accuracy and number of the detections.
    pub(crate) fn uncertainty_hz(&self) -> f64 {
        0.5 / self.weight.sqrt()
    }

    /// Updates the state, limited by the class; returns whether there is a change to report: of the
    /// state, or (at most every 100 ms) of class or gear shaft.
    pub(crate) fn advance(&mut self, now_s: f64) -> bool {
        let earned = self.reached_state(now_s);
        let allowed = if earned == State::Over { earned } else { earned.min(self.max_state) };
        if earned == State::Over || self.is_fresh(now_s) {
            self.state = self.state.max(allowed);
        }
        let now = (self.state, self.class, self.suspect_alias, self.gear);
        let is_change = match self.reported {
            None => true,
            Some((state, ..)) if state != self.state => true,
            Some(reported) => reported != now && now_s - self.reported_s >= REPORT_INTERVAL_S,
        };
        if is_change {
            self.reported = Some(now);
            self.reported_s = now_s;
        }
        is_change
    }

    /// The state reached, without the limit of the class; `Over` if the line has ended.
    fn reached_state(&self, now_s: f64) -> State {
        let lasts = self.three_windows_agree && self.growth_per_s() > RING_DOWN_PER_S;
        if now_s - self.last_seen_s > LINGER_S {
            State::Over
        } else if lasts && self.last_seen_s - self.first_seen_s >= CONFIRM_S {
            State::Confirmed
        } else if self.from_start {
            // A line present from the start needs no early alarm.
            State::Warn
        } else if lasts {
            State::Alarm
        } else {
            State::Warn
        }
    }
}

/// Inverse variance of the frequency of a detection, up to a factor.
fn frequency_weight(sighting: &Detection) -> f64 {
    sighting.ratio / (sighting.cell_hz * sighting.cell_hz)
}

/// All tracked lines.
#[derive(Debug)]
pub(crate) struct Tracks {
    slots: [Option<Track>; TRACKS],
    next_id: u32,
}

impl Default for Tracks {
    fn default() -> Self {
        Self { slots: [None; TRACKS], next_id: 1 }
    }
}

impl Tracks {
    /// Assigns a detection to its line, or starts a new one; discarded if all slots are in use.
    pub(crate) fn assign(&mut self, sighting: &Detection, now_s: f64) {
        let distance = |track: &Track| (track.frequency_hz - sighting.frequency_hz).abs();
        let nearest = self
            .slots
            .iter_mut()
            .flatten()
            .filter(|track| track.can_include(sighting))
            .filter(|track| distance(track) <= 0.75 * sighting.cell_hz)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(track) = nearest {
            track.update(sighting, now_s);
        } else if let Some(place) = self.slots.iter_mut().find(|place| place.is_none()) {
            *place = Some(Track::new(self.next_id, sighting, now_s));
            self.next_id = self.next_id.wrapping_add(1).max(1);
        }
    }

    /// After a change of the spindle speed the harmonics move: the next detection of each line
    /// replaces its frequency.
    pub(crate) fn invalidate_frequencies(&mut self) {
        for track in self.iter_mut() {
            track.frequency_invalid = true;
        }
    }

    /// The live lines.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Track> {
        self.slots.iter_mut().flatten()
    }

    /// The live lines.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Track> {
        self.slots.iter().flatten()
    }

    /// Removes the lines that have ended.
    pub(crate) fn remove_ended(&mut self) {
        for place in &mut self.slots {
            if place.is_some_and(|track| track.state == State::Over) {
                *place = None;
            }
        }
    }

    /// Frequencies of the live lines, and their number.
    pub(crate) fn frequencies(&self) -> ([f64; TRACKS], usize) {
        let mut list = [0.0; TRACKS];
        let mut count = 0;
        for track in self.iter() {
            list[count] = track.frequency_hz;
            count += 1;
        }
        (list, count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sighting(frequency_hz: f64, cell_hz: f64, three_windows_agree: bool) -> Detection {
        Detection {
            channel: 1,
            frequency_hz,
            power: 4.0,
            ratio: 50.0,
            cell_hz,
            three_windows_agree,
            learned_share: 0.0,
            is_asynchronous: false,
        }
    }

    #[test]
    fn sightings_of_one_line_keep_its_identity_and_sharpen_it() {
        let mut tracks = Tracks::default();
        tracks.assign(&sighting(75.0, 31.0, false), 0.0);
        for _ in 0..50 {
            tracks.assign(&sighting(72.0, 7.8, false), 0.01);
        }
        assert_eq!(tracks.iter().count(), 1);
        let line = tracks.iter().next().expect("one line");
        assert!((line.frequency_hz - 72.0).abs() < 0.05, "{}", line.frequency_hz);
    }

    #[test]
    fn growth_is_the_slope_of_the_logarithm() {
        let mut tracks = Tracks::default();
        tracks.assign(&sighting(72.0, 7.8, true), 0.0);
        for k in 0..120 {
            let t = 0.004 * f64::from(k);
            for track in tracks.iter_mut() {
                track.measure(|_| ((2.0 * 3.0 * t).exp(), 50.0), 3, t, 0.004);
            }
        }
        let growth = tracks.iter().next().expect("one line").growth_per_s();
        assert!((growth - 3.0).abs() < 0.1, "{growth}");
    }

    #[test]
    fn a_line_that_fades_is_over_after_half_a_second() {
        let mut tracks = Tracks::default();
        tracks.assign(&sighting(72.0, 7.8, true), 0.0);
        let mut t = 0.0;
        while tracks.iter().any(|track| track.reached_state(t) != State::Over) {
            t += 0.004;
            for track in tracks.iter_mut() {
                track.measure(|_| (0.01, 1.0), 3, t, 0.004);
            }
        }
        assert!((0.5..0.8).contains(&t), "{t}");
    }

    #[test]
    fn more_lines_than_places_are_let_go() {
        let mut tracks = Tracks::default();
        for k in 0..20 {
            tracks.assign(&sighting(50.0 + 20.0 * f64::from(k), 7.8, false), 0.0);
        }
        assert_eq!(tracks.iter().count(), TRACKS);
    }
}
