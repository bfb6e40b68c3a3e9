//! The oracle detects each kind of step, and accepts what it documents as allowed.

use super::*;
use crate::rng::TestRng;
use envelope::{Elapsed, Intervals, Limiters, Limits};
use shm_schema::JOINTS_MAX;

const MS: u64 = 1_000_000;
const Q: [f64; JOINTS] = [0.1, -0.2, 0.3, -0.4, 0.5, -0.6];

fn bounds(angle: f64, rate: f64, jerk: f64) -> JointBounds {
    JointBounds {
        min: [-3.0; JOINTS_MAX],
        max: [3.0; JOINTS_MAX],
        angle: [angle; JOINTS_MAX],
        rate: [rate; JOINTS_MAX],
        jerk: [jerk; JOINTS_MAX],
    }
}

fn oracle() -> Oracle {
    Oracle::new(&bounds(0.02, 0.05, 5.0), 0.0)
}

fn sent(c: f64) -> [f64; JOINTS] {
    Q.map(|q| q + c)
}

/// A correction that keeps all limits, from rest.
fn smooth(k: u64) -> f64 {
    2.5e-4 * (1.0 - (5.0 * k as f64 * 1e-3).cos()).powi(2)
}

fn judge(from: u64, c: impl Fn(u64) -> f64) -> Result<(), String> {
    let mut oracle = oracle();
    for k in 0..from {
        oracle.take(k * MS, k * MS, &Q, &sent(smooth(k)))?;
    }
    (from..from + 100).try_for_each(|k| oracle.take(k * MS, k * MS, &Q, &sent(c(k))))
}

#[test]
fn a_smooth_correction_breaks_nothing_and_each_kind_of_step_is_seen() {
    assert_eq!(judge(300, smooth), Ok(()));
    for (what, c) in [
        ("a dropped correction", 0.0),
        ("a step", smooth(300) + 1e-4),
        ("a small step", smooth(300) + 1e-6),
        ("no number", f64::NAN),
        ("beyond the angle", 0.03),
    ] {
        assert!(judge(300, |_| c).is_err(), "{what}");
    }
    assert!(judge(300, |k| if k == 350 { 0.0 } else { smooth(k) }).is_err(), "one tick");
}

#[test]
fn a_run_begins_at_its_command() {
    assert!(oracle().take(0, 0, &Q, &sent(1e-3)).is_err());
}

#[test]
fn after_a_silence_the_correction_is_what_it_was() {
    let after = |c: f64| {
        let mut oracle = oracle();
        (0..300).try_for_each(|k| oracle.take(k * MS, k * MS, &Q, &sent(smooth(k)))).unwrap();
        oracle.take(500 * MS, 500 * MS, &Q, &sent(c))
    };
    assert_eq!(after(smooth(299)), Ok(()));
    assert!(after(smooth(299) + 1e-6).is_err());
    assert!(after(0.0).is_err());
}

#[test]
fn after_a_silence_the_correction_continues_from_rest() {
    let after = |c: fn(u64) -> f64| {
        let mut oracle = oracle();
        (0..300).try_for_each(|k| oracle.take(k * MS, k * MS, &Q, &sent(smooth(k)))).unwrap();
        (0..20).try_for_each(|k| {
            oracle.take((500 + k) * MS, (500 + k) * MS, &Q, &sent(smooth(299) + c(k)))
        })
    };
    assert_eq!(after(|_| 0.0), Ok(()));
    assert_eq!(after(|k| 5.0 / 6.0 * (k as f64 * 1e-3).powi(3)), Ok(()));
    // At the rate that it had before.
    assert!(after(|k| smooth(299 + k) - smooth(299)).is_err());
}

#[test]
fn tighter_bounds_bind_once_they_could_be_braked_into() {
    let mut oracle = oracle();
    for k in 0..2000 {
        oracle.take(k * MS, k * MS, &Q, &sent(smooth(k))).unwrap();
    }
    oracle.set_bounds(2000 * MS, &bounds(1e-4, 0.05, 5.0));
    let broken = (2000..8000).find(|k| oracle.take(k * MS, k * MS, &Q, &sent(smooth(*k))).is_err());
    assert!(broken.is_some_and(|k| k > 2100), "{broken:?}");
}

#[test]
fn shadow_mode_is_the_command_to_the_bit() {
    let mut oracle = oracle();
    oracle.set_shadow(0, true);
    assert_eq!(oracle.take(0, 0, &Q, &Q), Ok(()));
    let mut altered = Q;
    altered[3] = altered[3].next_up();
    assert!(oracle.take(MS, MS, &Q, &altered).is_err());
}

#[test]
fn jitter_excuses_what_it_makes_of_a_motion_and_no_step() {
    let judged = |step: f64| {
        let mut oracle = oracle();
        (0..400_u64).try_for_each(|k| {
            let c = smooth(k) + if k > 300 { step } else { 0.0 };
            let t_ns = k * MS + (k * 7 % 11) * 20_000;
            oracle.take(t_ns, t_ns, &Q, &sent(c))
        })
    };
    assert_eq!(judged(0.0), Ok(()));
    assert!(judged(1e-4).is_err());
}

/// Cycles of a cell with clock jitter, overruns, missed commands, and late or missing answers, at
/// varying rates.
struct Cell {
    chance: TestRng,
    due_ns: u64,
    now_ns: u64,
    jitter_ns: u64,
    overrun_in: u64,
    missed_in: u64,
    gone: u64,
}

impl Cell {
    fn of(&mut self, choices: &[u64]) -> u64 {
        choices[self.chance.below(choices.len() as u64) as usize]
    }

    fn comes(&mut self, once_in: u64) -> bool {
        once_in > 0 && self.chance.below(once_in) == 0
    }

    fn next(&mut self, tick: u64) {
        if tick.is_multiple_of(3000) {
            self.jitter_ns = self.of(&[0, 3_000, 15_000, 60_000, 300_000]);
            self.overrun_in = self.of(&[0, 0, 20, 100, 500]);
            self.missed_in = self.of(&[0, 0, 5, 50, 300]);
        }
        self.due_ns += MS;
        if self.comes(self.overrun_in) {
            self.due_ns += self.chance.below(2 * MS);
        }
        let late_ns = if self.jitter_ns > 0 { self.chance.below(self.jitter_ns) } else { 0 };
        self.now_ns = (self.due_ns + late_ns).max(self.now_ns + 1);
        self.gone = match self.chance.below(400) {
            0 => self.chance.below(30),
            1 => self.chance.below(500),
            _ => self.gone.saturating_sub(1),
        };
    }
}

/// A joint's limiter with the times that it measures.
struct Limited {
    intervals: Intervals,
    joint: Limiters<1>,
}

impl Limited {
    const START: Self = Self { intervals: Intervals::new(), joint: Limiters::at_rest() };

    fn step(&mut self, now_ns: u64, wanted: f64, apart: bool) -> f64 {
        let limits = |_| Limits::new(0.02, 0.05, 5.0).ok();
        let elapsed = self.intervals.elapse(now_ns, Some(now_ns)).unwrap_or_else(|| {
            self.joint.rest();
            Elapsed::default()
        });
        let [sent] = if apart {
            self.joint.step_independently(&[wanted], limits, elapsed)
        } else {
            self.joint.step(&[wanted], limits, elapsed)
        };
        sent
    }
}

/// A daemon's limiter and a client's behind it.
#[test]
fn what_two_limiters_send_in_uneven_time_keeps_the_jerk_that_jitter_allows() {
    let ticks: u64 = std::env::var("TRUED_SIM_CYCLES").map_or(400_000, |n| n.parse().unwrap());
    for seed in 0..4 {
        let (due_ns, now_ns, chance) = (MS, MS, TestRng::new(seed));
        let mut cell =
            Cell { chance, due_ns, now_ns, jitter_ns: 0, overrun_in: 0, missed_in: 0, gone: 0 };
        let (mut daemon, mut client) = (Limited::START, Limited::START);
        let (mut oracle, mut proposed) = (oracle(), 0.0);
        for tick in 0..ticks / 4 {
            cell.next(tick);
            let t_s = cell.now_ns as f64 * 1e-9;
            if !cell.comes(cell.missed_in) {
                let wanted = 3e-3 * (0.7 * t_s).sin() + 1e-3 * (7.3 * t_s).sin();
                proposed = daemon.step(cell.now_ns, wanted, false);
            }
            let is_there = cell.gone == 0;
            let c = client.step(cell.now_ns, if is_there { proposed } else { 0.0 }, is_there);
            if let Err(violation) = oracle.take(cell.now_ns, cell.now_ns, &Q, &sent(c)) {
                panic!("seed {seed}, tick {tick}: {violation}");
            }
        }
    }
}
