//! Spindle speed and feed row by row: passes through a workpiece with bevelled borders.
//!
//! A pass may begin without contact, at rest or moving, and end without contact. The depth grows over the bevel on entry and falls on exit. Tooth 0
//! is at angle 0 at the beginning of a pass; speeds and feeds are those of the recording's columns.

use std::f64::consts::TAU;

use crate::rng::Rng;
use crate::scene::Excitation;

use super::cut::Cut;

/// Engagement of the tool in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engagement {
    /// No contact.
    Air,
    /// Entry or exit, dwell at a border, or first chips thinner than the others.
    Partial,
    /// Full engagement.
    Full,
}

/// One pass.
#[derive(Clone, Debug, PartialEq)]
pub struct Pass {
    /// Spindle speed, rev/s.
    pub spindle_hz: f64,
    /// Feed rate during motion, m/s.
    pub feed_m_s: f64,
    /// Time at rest before the motion, s; 0 if it moved before the recording.
    pub start_s: f64,
    /// Time at which it stops, s.
    pub stop_s: f64,
    /// Feed positions at the beginning of the first bevel and at the end of the last, m, from the beginning of the pass.
    pub work_m: [f64; 2],
    /// Length of each bevel along the feed, m.
    pub bevel_m: f64,
    /// Sampling times, s from the beginning of the pass.
    pub times_s: Vec<f64>,
}

/// State of the tool in a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolState {
    /// Index of the pass.
    pub pass: usize,
    /// Time since the beginning of the pass, s.
    pub t_s: f64,
    /// Engagement.
    pub engagement: Engagement,
    /// Feed rate, m/s.
    pub feed_m_s: f64,
    /// Feed position since the beginning of the pass, m.
    pub feed_position_m: f64,
}

/// All passes of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Passes {
    /// Passes in order of time.
    pub passes: Vec<Pass>,
    /// Excitation.
    pub excitation: Excitation,
    /// Typical spindle speed, rev/s.
    pub spindle_hz: f64,
    /// Typical feed per tooth, m.
    pub feed_m: f64,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Whether the tool is out of contact at times.
    pub has_air: bool,
}

impl Pass {
    /// Feed position at an instant, m; also before the recording.
    #[must_use]
    pub fn feed_position_m(&self, t_s: f64) -> f64 {
        let moves_s = t_s.min(self.stop_s) - self.start_s;
        self.feed_m_s * if self.start_s > 0.0 { moves_s.max(0.0) } else { moves_s }
    }

    /// Fraction of the nominal depth that is cut at this feed position.
    #[must_use]
    pub fn depth_fraction(&self, way_m: f64) -> f64 {
        let rises = |distance_m: f64| {
            if distance_m == f64::INFINITY { 1.0 } else { distance_m / self.bevel_m }
        };
        rises(way_m - self.work_m[0]).min(rises(self.work_m[1] - way_m)).clamp(0.0, 1.0)
    }

    fn engagement(&self, t_s: f64, way_m: f64) -> Engagement {
        // At the beginning of a pass, tooth 0 is at the angle at which many cuts begin.
        if t_s == 0.0 && self.depth_fraction(way_m) > 0.0 {
            return Engagement::Partial;
        }
        // During the first revolution, chips are limited by the bevel instead of the preceding tooth.
        let turn_m = 1.5 * self.feed_m_s / self.spindle_hz;
        match self.depth_fraction(way_m) {
            share if share <= 0.0 => Engagement::Air,
            share if share < 1.0 || way_m < self.work_m[0] + self.bevel_m + turn_m => {
                Engagement::Partial
            }
            _ => Engagement::Full,
        }
    }
}

impl Passes {
    /// Random passes of a cutter; rich ones have several feeds and speeds, poor ones one each.
    #[must_use]
    pub fn random(cut: &Cut, excitation: Excitation, has_air: bool, rng: &mut Rng) -> Self {
        let feed_m = cut.feed_m(rng);
        let spindle_hz = if cut.turning {
            rng.log_uniform_between(8.0, 25.0)
        } else {
            rng.log_uniform_between(60.0, 200.0)
        };
        let per_turn = rng.uniform_between(24.0, 48.0);
        let rate_hz = (spindle_hz * per_turn).round();
        let scene = Self { passes: Vec::new(), excitation, spindle_hz, feed_m, rate_hz, has_air };
        scene.new_passes(cut, rng)
    }

    /// Other passes of the same kind.
    #[must_use]
    pub fn new_passes(&self, cut: &Cut, rng: &mut Rng) -> Self {
        let count = if self.excitation == Excitation::Poor { 2 } else { 3 };
        let mut feeds = [1.0, rng.uniform_between(0.5, 0.7), rng.uniform_between(1.3, 1.6)];
        let mut speeds = [1.0, rng.uniform_between(0.75, 0.9), rng.uniform_between(1.1, 1.25)];
        rng.shuffle(&mut feeds);
        rng.shuffle(&mut speeds);
        if self.excitation == Excitation::Poor {
            (feeds, speeds) = ([1.0; 3], [1.0; 3]);
        }
        let pass = |number: usize| {
            let spindle_hz = (6000.0 * self.spindle_hz * speeds[number]).round() / 6000.0;
            let feed = self.feed_m * feeds[number] * cut.teeth as f64 * spindle_hz;
            let feed_m_s = (1e6 * feed).round() / 1e6;
            let border = (self.has_air && number == 0, self.has_air && number + 1 == count);
            self.pass((spindle_hz, feed_m_s), border, rng)
        };
        Self { passes: (0..count).map(pass).collect(), ..self.clone() }
    }

    fn pass(
        &self,
        (spindle_hz, feed_m_s): (f64, f64),
        (enters, leaves): (bool, bool),
        rng: &mut Rng,
    ) -> Pass {
        let turn_m = feed_m_s / spindle_hz;
        let bevel_m = turn_m * rng.uniform_between(6.0, 16.0);
        let cut_m = turn_m * rng.uniform_between(45.0, 75.0);
        let air_s = rng.uniform_between(14.0, 24.0) / spindle_hz;
        let mut pass = Pass {
            spindle_hz,
            feed_m_s,
            start_s: 0.0,
            stop_s: f64::INFINITY,
            work_m: [f64::NEG_INFINITY, f64::INFINITY],
            bevel_m,
            times_s: Vec::new(),
        };
        let mut length_s = cut_m / feed_m_s;
        if enters {
            let starts_in_air = rng.bernoulli(0.6);
            let gap_m = if starts_in_air { 0.5 * turn_m } else { feed_m_s * air_s };
            pass.start_s = if starts_in_air { air_s } else { 0.0 };
            pass.work_m[0] = gap_m;
            length_s += pass.start_s + (gap_m + bevel_m) / feed_m_s;
        }
        if leaves {
            pass.work_m[1] = feed_m_s * (length_s - pass.start_s) + bevel_m;
            length_s += bevel_m / feed_m_s + air_s;
            pass.stop_s = pass.start_s + pass.work_m[1] / feed_m_s + 1.0 / spindle_hz;
        }
        let rows = (length_s * self.rate_hz) as usize;
        pass.times_s = (0..rows).map(|row| row as f64 / self.rate_hz).collect();
        pass
    }

    /// All rows in order.
    #[must_use]
    pub fn rows(&self) -> Vec<ToolState> {
        let of_pass = |(number, pass): (usize, &Pass)| -> Vec<ToolState> {
            let row = |t_s: &f64| {
                let feed_position_m = pass.feed_position_m(*t_s);
                let moves = *t_s >= pass.start_s && *t_s < pass.stop_s;
                let feed_m_s = if moves { pass.feed_m_s } else { 0.0 };
                let engagement = pass.engagement(*t_s, feed_position_m);
                ToolState { pass: number, t_s: *t_s, engagement, feed_m_s, feed_position_m }
            };
            pass.times_s.iter().map(row).collect()
        };
        self.passes.iter().enumerate().flat_map(of_pass).collect()
    }

    /// Smallest feed per tooth, m.
    #[must_use]
    pub fn min_feed_per_tooth_m(&self, cut: &Cut) -> f64 {
        let feeds = self.passes.iter().map(|p| p.feed_m_s / (p.spindle_hz * cut.teeth as f64));
        feeds.fold(f64::INFINITY, f64::min)
    }
}

impl ToolState {
    /// Rotation of the spindle since the beginning of the pass, rad.
    #[must_use]
    pub fn angle(&self, pass: &Pass) -> f64 {
        TAU * pass.spindle_hz * self.t_s
    }

    /// Whether the force laws are defined for this row: full engagement, or nothing moves.
    #[must_use]
    pub fn has_defined_forces(&self) -> bool {
        self.engagement == Engagement::Full
            || self.engagement == Engagement::Air && self.feed_m_s == 0.0
    }
}
