//! One blind case of forces: cut, passes, model, hidden effects, measurements.
//!
//! Promises: everything follows from it and its seed. Never: what the solver is told beyond the files.

use crate::case::{Known as Known_, Tier};
use crate::chance::Chance;
use crate::law::Trial;
use crate::space::V3;

use super::cut::Cut;
use super::kinds::{Effect, Kind};
use super::laws::Ride;
use super::scene::{Row, Scene};

/// An effect that the model has.
pub type Known = Known_<Kind>;

/// How well forces are read. Per axis, N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of what is fast.
    pub sigma: V3,
    /// Last digit.
    pub digit: V3,
    /// Correlation from row to row.
    pub colour: f64,
    /// How far the amplifier drifts over a pass: a standard deviation, as a share of `sigma`.
    pub drift: f64,
    /// Stretches in which nothing was recorded.
    pub gaps: usize,
}

/// What was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Row by row, N.
    pub forces: Vec<V3>,
    /// Rows that are there.
    pub there: Vec<bool>,
}

/// A case.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What it asks.
    pub tier: Tier,
    /// What is cut, as it is told.
    pub cut: Cut,
    /// How.
    pub scene: Scene,
    /// How well it is measured.
    pub noise: Noise,
    /// What the model knows.
    pub known: Vec<Known>,
    /// What it does not.
    pub hidden: Vec<Effect>,
    /// Seed of its noise and of its unseen passes.
    pub seed: u64,
}

impl Noise {
    /// All that is fast and disturbs a value of an axis, as a standard deviation, N.
    #[must_use]
    pub fn total(&self, axis: usize) -> f64 {
        let (sigma, digit) = (self.sigma[axis], self.digit[axis]);
        (sigma * sigma + digit * digit / 12.0).sqrt()
    }
}

/// How far along its pass each row stands, from 0 to 1.
#[must_use]
pub fn along(scene: &Scene, row: &Row) -> f64 {
    let last = scene.passes[row.pass].times_s.last().copied().unwrap_or(1.0);
    row.t_s / last.max(f64::MIN_POSITIVE)
}

impl Case {
    /// What is recorded of passes; `part` tells one recording's noise from another's.
    #[must_use]
    pub fn measured(&self, ride: &Ride<'_>, part: u64) -> Measured {
        let mut chance = Chance::new(self.seed, 100 + part);
        let noise = &self.noise;
        let fresh = (1.0 - noise.colour * noise.colour).sqrt();
        let there = crate::torque::case::without_gaps(ride.rows.len(), noise.gaps, &mut chance);
        let mut measured = Measured { forces: ride.read(&self.real()), there };
        let (mut memory, mut drift, mut pass) = ([0.0; 3], [0.0; 3], usize::MAX);
        for (row, force) in ride.rows.iter().zip(&mut measured.forces) {
            let anew = row.pass != pass;
            pass = row.pass;
            for axis in 0..3 {
                let draw = chance.normal();
                memory[axis] = if anew { draw } else { noise.colour * memory[axis] + fresh * draw };
                if anew {
                    drift[axis] = noise.drift * chance.normal_within_two();
                }
                let off = memory[axis] + drift[axis] * along(ride.scene, row);
                let digit = noise.digit[axis];
                let read = force[axis] + noise.sigma[axis] * off;
                force[axis] = if digit > 0.0 { (read / digit).round() * digit } else { read };
            }
        }
        measured
    }

    /// Passes of the same cutter that the solver never sees.
    #[must_use]
    pub fn unseen(&self) -> Scene {
        self.scene.again(&self.cut, &mut Chance::new(self.seed, 50))
    }
}

impl Trial for Case {
    type Kind = Kind;

    fn tier(&self) -> Tier {
        self.tier
    }

    fn known(&self) -> &[Known] {
        &self.known
    }

    fn hidden(&self) -> &[Effect] {
        &self.hidden
    }

    fn follows(&self, effect: &Effect) -> Vec<String> {
        let word = match effect.kind {
            // The spindle's angle has no word but its speed's.
            Kind::BrokenTooth | Kind::PloughingSpeed => "spindle_rpm",
            Kind::BuiltUpEdge | Kind::SensorCreep => "t_s",
            Kind::TableFriction => "feed_mm_s",
            _ => return Vec::new(),
        };
        vec![word.to_owned()]
    }
}
