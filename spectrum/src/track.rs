//! The identity of a line over time: from the first agreement of two windows to its end.
//!
//! Fixed capacity, no allocation. Amplitude and growth come from one window of the branch that sees
//! the line; frequency from all sightings, each weighted by its accuracy.

use crate::block::CHANNELS_MAX;
use crate::ellipse::Ellipse;
use crate::sliding::Sighting;
use crate::verdict::{Class, ClassSet, State};

/// Limit on lines tracked at once: [`crate::VERDICTS_MAX`]. With eight, the multiples of a slow
/// spindle filled the list, and a chatter was reported up to a second late (`cuts 80 3040`: 0.74 s
/// in the ninth decile, with sixteen 0.34 s).
pub(crate) const TRACKS: usize = crate::verdict::VERDICTS_MAX;
/// Amplitudes kept for the growth rate.
const POINTS: usize = 16;
/// Seconds between two of them.
const POINT_S: f64 = 0.016;
/// A line is kept while its smoothed power is this many floors.
const KEEP_RATIO: f64 = 4.0;
/// Ratios above this do not prolong a line further.
const ENOUGH_RATIO: f64 = 12.0;
/// A line that was not kept for this long is over.
pub(crate) const LINGER_S: f64 = 0.5;
/// A line must have lasted this long to be confirmed.
const CONFIRM_S: f64 = 0.5;
/// Interval of repeated verdicts on a line with constant state, s.
const RETELL_S: f64 = 0.1;
/// A line whose amplitude falls faster than this (d ln A / dt, 1/s) is ringing down.
const RING_DOWN_PER_S: f64 = -4.0;
/// Time constant of the smoothed power, s.
const SMOOTH_S: f64 = 0.05;
/// Time constant of the smoothed ratio, s: long enough that noise does not keep a line alive.
const SMOOTH_RATIO_S: f64 = 0.15;

/// The last verdict on a line: state, class, whether it may be an alias, its gear shaft.
type Told = (State, Class, bool, Option<(u8, u8)>);

/// One line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Track {
    pub(crate) id: u32,
    pub(crate) state: State,
    pub(crate) channel: usize,
    pub(crate) frequency_hz: f64,
    /// Smoothed squared amplitude per channel.
    pub(crate) power: [f64; CHANNELS_MAX],
    pub(crate) ratio: [f64; CHANNELS_MAX],
    pub(crate) born_s: f64,
    pub(crate) alive_s: f64,
    pub(crate) class: Class,
    pub(crate) rivals: ClassSet,
    pub(crate) suspect_alias: bool,
    /// The wheel that a gear's line turns with: joint and shaft.
    pub(crate) wheel: Option<(u8, u8)>,
    /// The highest state that the class allows.
    pub(crate) ceiling: State,
    /// Its power as it was heard while the noise was learned, over the power at which it was first seen.
    pub(crate) heard: f64,
    /// Whether it was small compared with the force in the cut.
    pub(crate) is_small: bool,
    /// Whether it was seen in the signal without spindle multiples.
    apart: bool,
    /// The line was there when the floor had just been learned.
    pub(crate) from_start: bool,
    /// Time that the line has lived in air, s.
    pub(crate) air_s: f64,
    /// Feed of the present frequency, mm/s, and since when.
    pub(crate) feed: (f64, f64),
    pub(crate) ellipse: Ellipse,
    /// Whether the next sighting sets the frequency again.
    unsettled: bool,
    threefold: bool,
    told: Option<Told>,
    told_s: f64,
    weight: f64,
    points: [(f64, f64); POINTS],
    point: usize,
}

impl Track {
    pub(crate) fn new(id: u32, sighting: &Sighting, now_s: f64) -> Self {
        let mut power = [0.0; CHANNELS_MAX];
        power[sighting.channel] = sighting.power;
        let mut ratio = [0.0; CHANNELS_MAX];
        ratio[sighting.channel] = sighting.ratio.min(ENOUGH_RATIO);
        Self {
            id,
            state: State::Warn,
            channel: sighting.channel,
            frequency_hz: sighting.frequency_hz,
            power,
            ratio,
            born_s: now_s,
            alive_s: now_s,
            class: Class::Unknown,
            rivals: ClassSet::default(),
            suspect_alias: false,
            wheel: None,
            ceiling: State::Confirmed,
            heard: sighting.heard,
            is_small: false,
            apart: sighting.apart,
            from_start: false,
            air_s: 0.0,
            feed: (0.0, now_s),
            ellipse: Ellipse::default(),
            unsettled: false,
            threefold: sighting.threefold,
            told: None,
            told_s: now_s,
            weight: sharpness(sighting),
            points: [(f64::NEG_INFINITY, 0.0); POINTS],
            point: 0,
        }
    }

    /// Amplitude on the line's axis, N or Nm.
    pub(crate) fn amplitude(&self) -> f64 {
        self.power[self.channel].sqrt()
    }

    /// Whether a sighting can belong to this line. A sighting without the spindle's multiples is
    /// not one of them, and a line seen in this way is different from one next to a multiple: in
    /// short windows either would shift the other's frequency.
    fn may_be(&self, sighting: &Sighting) -> bool {
        if sighting.apart { self.class != Class::Forced } else { !self.apart }
    }

    fn see(&mut self, sighting: &Sighting, now_s: f64) {
        let weight = sharpness(sighting);
        // Old sightings fade, so that a line which moves slowly is followed.
        let kept = if self.unsettled { 0.0 } else { 0.98 * self.weight };
        self.unsettled = false;
        self.weight = kept + weight;
        self.frequency_hz += (sighting.frequency_hz - self.frequency_hz) * weight / self.weight;
        self.threefold |= sighting.threefold;
        self.apart |= sighting.apart;
        self.alive_s = now_s;
    }

    /// Takes the present strength on every channel, `step_s` after the last one.
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
            let ratio = ratio.min(ENOUGH_RATIO);
            self.ratio[channel] += settle * (ratio - self.ratio[channel]);
        }
        self.channel = self.strongest_channel(channels);
        if self.ratio[self.channel] >= KEEP_RATIO {
            self.alive_s = now_s;
        }
        if now_s - self.points[self.point].0 >= POINT_S {
            self.point = (self.point + 1) % POINTS;
            self.points[self.point] = (now_s, self.amplitude().max(1e-300).ln());
        }
    }

    /// The strongest force; a moment only if no force exceeds its floor.
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

    /// Whether the line was seen or kept just now: only then is there anything to judge.
    pub(crate) fn is_fresh(&self, now_s: f64) -> bool {
        now_s - self.alive_s < 0.2 * LINGER_S
    }

    /// Whether the line was not kept for half of the time that ends it.
    pub(crate) fn is_fading(&self, now_s: f64) -> bool {
        now_s - self.alive_s > 0.5 * LINGER_S
    }

    /// Standard uncertainty of the frequency, Hz: from accuracy and number of the sightings.
    pub(crate) fn uncertainty_hz(&self) -> f64 {
        0.5 / self.weight.sqrt()
    }

    /// Moves to the state reached, as far as its class allows; returns whether there is a change:
    /// of the state, or (at most every 100 ms) of class or gear shaft.
    pub(crate) fn advance(&mut self, now_s: f64) -> bool {
        let earned = self.earned(now_s);
        let allowed = if earned == State::Over { earned } else { earned.min(self.ceiling) };
        if earned == State::Over || self.is_fresh(now_s) {
            self.state = self.state.max(allowed);
        }
        let now = (self.state, self.class, self.suspect_alias, self.wheel);
        let is_news = match self.told {
            None => true,
            Some((state, ..)) if state != self.state => true,
            Some(told) => told != now && now_s - self.told_s >= RETELL_S,
        };
        if is_news {
            self.told = Some(now);
            self.told_s = now_s;
        }
        is_news
    }

    /// The state reached; `Over` if the line has ended.
    fn earned(&self, now_s: f64) -> State {
        let lasts = self.threefold && self.growth_per_s() > RING_DOWN_PER_S;
        if now_s - self.alive_s > LINGER_S {
            State::Over
        } else if lasts && self.alive_s - self.born_s >= CONFIRM_S {
            State::Confirmed
        } else if self.from_start {
            // What was always there can wait for its class.
            State::Warn
        } else if lasts {
            State::Alarm
        } else {
            State::Warn
        }
    }
}

/// Inverse variance of a sighting's frequency, up to a factor.
fn sharpness(sighting: &Sighting) -> f64 {
    sighting.ratio / (sighting.cell_hz * sighting.cell_hz)
}

/// All lines.
#[derive(Debug)]
pub(crate) struct Tracks {
    places: [Option<Track>; TRACKS],
    next_id: u32,
}

impl Default for Tracks {
    fn default() -> Self {
        Self { places: [None; TRACKS], next_id: 1 }
    }
}

impl Tracks {
    /// Gives a sighting to its line, or starts a new one; one too many is let go.
    pub(crate) fn sight(&mut self, sighting: &Sighting, now_s: f64) {
        let distance = |track: &Track| (track.frequency_hz - sighting.frequency_hz).abs();
        let near = self
            .places
            .iter_mut()
            .flatten()
            .filter(|track| track.may_be(sighting))
            .filter(|track| distance(track) <= 0.75 * sighting.cell_hz)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(track) = near {
            track.see(sighting, now_s);
        } else if let Some(place) = self.places.iter_mut().find(|place| place.is_none()) {
            *place = Some(Track::new(self.next_id, sighting, now_s));
            self.next_id = self.next_id.wrapping_add(1).max(1);
        }
    }

    /// The spindle's speed has changed, and its multiples move: previous frequencies are invalid.
    pub(crate) fn unsettle(&mut self) {
        for track in self.iter_mut() {
            track.unsettled = true;
        }
    }

    /// The live lines.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Track> {
        self.places.iter_mut().flatten()
    }

    /// The live lines.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Track> {
        self.places.iter().flatten()
    }

    /// Lets go of the lines that are over.
    pub(crate) fn bury(&mut self) {
        for place in &mut self.places {
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

    fn sighting(frequency_hz: f64, cell_hz: f64, threefold: bool) -> Sighting {
        Sighting {
            channel: 1,
            frequency_hz,
            power: 4.0,
            ratio: 50.0,
            cell_hz,
            threefold,
            heard: 0.0,
            apart: false,
        }
    }

    #[test]
    fn sightings_of_one_line_keep_its_identity_and_sharpen_it() {
        let mut tracks = Tracks::default();
        tracks.sight(&sighting(75.0, 31.0, false), 0.0);
        for _ in 0..50 {
            tracks.sight(&sighting(72.0, 7.8, false), 0.01);
        }
        assert_eq!(tracks.iter().count(), 1);
        let line = tracks.iter().next().expect("one line");
        assert!((line.frequency_hz - 72.0).abs() < 0.05, "{}", line.frequency_hz);
    }

    #[test]
    fn growth_is_the_slope_of_the_logarithm() {
        let mut tracks = Tracks::default();
        tracks.sight(&sighting(72.0, 7.8, true), 0.0);
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
        tracks.sight(&sighting(72.0, 7.8, true), 0.0);
        let mut t = 0.0;
        while tracks.iter().any(|track| track.earned(t) != State::Over) {
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
            tracks.sight(&sighting(50.0 + 20.0 * f64::from(k), 7.8, false), 0.0);
        }
        assert_eq!(tracks.iter().count(), TRACKS);
    }
}
