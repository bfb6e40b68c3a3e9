//! The time from one output to the next.
//!
//! The receiver of the outputs executes them in its own cycles. Two consequences for the time
//! that a limiter may use: it is at most the time actually elapsed, and after a pause the
//! receiver is at rest, so that motion restarts from rest instead of catching up at once.

use crate::track::NODE_SPACING_S;

/// A silence is longer than this multiple of the shorter of the two intervals before it, and than
/// [`SILENCE_S`]. With two intervals, a sender that has become slow is recognised at the third
/// interval, and one that paused twice is not taken for a slow one.
const SILENCE_INTERVALS: f64 = 3.0;
/// The shortest silence, s: five cycles of a 4 ms controller.
const SILENCE_S: f64 = 0.02;
/// Intervals over which jitter is measured.
const JITTER_INTERVALS: usize = 8;

/// The time since the last output, and by how much the times of outputs are uncertain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Elapsed {
    /// s; zero: no time has passed.
    pub dt_s: f64,
    /// s; zero if the times are exact.
    pub jitter_s: f64,
}

impl Elapsed {
    /// An interval between exactly known times.
    #[must_use]
    pub const fn exact(dt_s: f64) -> Self {
        Self { dt_s, jitter_s: 0.0 }
    }
}

/// Largest difference between the stamps of commands and the clock, ns; beyond it, the clock of the
/// stamps was set.
const STAMP_OFFSET_MAX_NS: u64 = 20_000_000;

/// Measures the time between outputs by the stamps of the commands, which both sides know and which
/// have no scheduling jitter, as long as it stays within 20 ms of the clock; otherwise by the
/// clock.
#[derive(Clone, Copy, Debug)]
pub struct Intervals {
    last_ns: Option<u64>,
    /// The newest stamp, and the offset of the stamps, ns.
    stamp_ns: u64,
    stamp_offset_ns: i64,
    /// The last two intervals, s, including silences.
    before_s: [f64; 2],
    /// The newest intervals since a silence, s, as a ring; zero for missing ones.
    ring: [f64; JITTER_INTERVALS],
    newest: usize,
}

impl Default for Intervals {
    fn default() -> Self {
        Self::new()
    }
}

impl Intervals {
    /// Before the first output.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            last_ns: None,
            stamp_ns: 0,
            stamp_offset_ns: 0,
            before_s: [0.0; 2],
            ring: [0.0; JITTER_INTERVALS],
            newest: 0,
        }
    }

    /// The time since the previous output, at `now_ns`, for a command with this stamp (`None`: no
    /// new command); `None` after a silence: the motion has come to rest. A clock that goes back
    /// counts as no time.
    pub fn elapse(&mut self, now_ns: u64, stamp_ns: Option<u64>) -> Option<Elapsed> {
        let now_ns = self.time_ns(now_ns, stamp_ns);
        let Some(last_ns) = self.last_ns else {
            self.last_ns = Some(now_ns);
            return Some(Elapsed::default());
        };
        self.last_ns = Some(now_ns.max(last_ns));
        let passed_s = now_ns.saturating_sub(last_ns) as f64 * 1e-9;
        if passed_s == 0.0 {
            return Some(Elapsed::default());
        }
        let [last_s, before_s] = self.before_s;
        self.before_s = [passed_s, last_s];
        if passed_s > SILENCE_S.max(SILENCE_INTERVALS * last_s.min(before_s)) {
            (self.ring, self.newest) = ([0.0; JITTER_INTERVALS], 0);
            return None;
        }
        self.newest = (self.newest + 1) % JITTER_INTERVALS;
        self.ring[self.newest] = passed_s;
        Some(Elapsed { dt_s: passed_s, jitter_s: self.jitter_s() })
    }

    /// The elapsed time by the stamp, if it is new and close to the clock.
    fn time_ns(&mut self, now_ns: u64, stamp_ns: Option<u64>) -> u64 {
        let Some(stamp_ns) = stamp_ns.filter(|stamp_ns| *stamp_ns != self.stamp_ns) else {
            return now_ns;
        };
        self.stamp_ns = stamp_ns;
        let by_stamp = stamp_ns.saturating_add_signed(self.stamp_offset_ns);
        if by_stamp.abs_diff(now_ns) <= STAMP_OFFSET_MAX_NS {
            return by_stamp;
        }
        self.stamp_offset_ns = now_ns.cast_signed().wrapping_sub(stamp_ns.cast_signed());
        now_ns
    }

    /// The longest of the newest intervals minus the shortest, at most the shortest: an interval
    /// several times as long is a missed cycle, not jitter. Intervals too short for a node do not
    /// count: a back-to-back loop takes its positions at the times of its stamps.
    fn jitter_s(&self) -> f64 {
        let (mut shortest, mut longest) = (f64::MAX, 0.0_f64);
        for interval_s in self.ring {
            shortest = if interval_s >= NODE_SPACING_S && interval_s < shortest {
                interval_s
            } else {
                shortest
            };
            longest = if interval_s > longest { interval_s } else { longest };
        }
        (longest - shortest).clamp(0.0, shortest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn elapsed(times_ms: &[u64]) -> impl Iterator<Item = Option<f64>> {
        let mut intervals = Intervals::new();
        times_ms.iter().map(move |ms| intervals.elapse(ms * MS, None).map(|elapsed| elapsed.dt_s))
    }

    #[test]
    fn a_steady_pace_is_counted_whatever_it_is() {
        for pace_ms in [1, 4, 12, 200] {
            let times: [u64; 12] = core::array::from_fn(|k| 5 + k as u64 * pace_ms);
            let last = elapsed(&times).last().flatten();
            assert!(last.is_some_and(|s| (s - pace_ms as f64 * 1e-3).abs() < 1e-12), "{pace_ms}");
        }
    }

    #[test]
    fn a_silence_is_no_time_in_which_anything_moved() {
        let mut all = elapsed(&[0, 1, 2, 3, 203, 204, 404, 604, 605]);
        assert_eq!(all.nth(4), Some(None));
        assert!(all.next().flatten().is_some_and(|s| (s - 1e-3).abs() < 1e-12));
        assert_eq!(all.next(), Some(None), "again");
        assert_eq!(all.next(), Some(None), "twice in a row");
        assert!(all.next().flatten().is_some_and(|s| (s - 1e-3).abs() < 1e-12));
    }

    #[test]
    fn a_clock_that_is_set_back_counts_as_no_time() {
        let mut all = elapsed(&[100, 101, 50, 51, 102]);
        assert_eq!(all.nth(2), Some(Some(0.0)));
        assert_eq!(all.next(), Some(Some(0.0)));
        assert!(all.next().flatten().is_some_and(|s| (s - 1e-3).abs() < 1e-12));
    }

    #[test]
    fn jitter_is_the_spread_of_the_newest_intervals() {
        let mut intervals = Intervals::new();
        let mut jitter_s = 0.0;
        for ns in [0, 1_000_000, 2_005_000, 3_000_000, 4_000_000] {
            jitter_s = intervals.elapse(ns, None).map_or(f64::NAN, |elapsed| elapsed.jitter_s);
        }
        assert!((jitter_s - 10e-6).abs() < 1e-12, "{jitter_s}");
    }

    #[test]
    fn stamps_count_while_they_stay_near_to_the_clock() {
        let mut intervals = Intervals::new();
        let mut dt_s = [0.0; 6];
        // The clock jitters, the stamps do not; then the stamps are set by an hour.
        let hour = 3_600_000 * MS;
        for (dt_s, (now, stamp)) in dt_s.iter_mut().zip([
            (100 * MS, 5 * MS),
            (101 * MS + 300_000, 6 * MS),
            (101 * MS + 900_000, 7 * MS),
            (103 * MS, 8 * MS),
            (104 * MS, hour),
            (105 * MS + 200_000, hour + MS),
        ]) {
            *dt_s = intervals.elapse(now, Some(stamp)).map_or(f64::NAN, |elapsed| elapsed.dt_s);
        }
        assert!(dt_s[1..].iter().all(|s| (s - 1e-3).abs() < 1e-12), "{dt_s:?}");
    }
}
