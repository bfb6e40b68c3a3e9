//! One blind case of forces: cut, passes, model, hidden effects, measurements. Everything follows from the case and its seed.

use crate::case::{Known as Known_, Tier};
use crate::chance::Chance;
use crate::law::Trial;
use crate::space::V3;

use super::cut::Cut;
use super::kinds::{Effect, Kind};
use super::laws::Ride;
use super::scene::{Row, Scene};

/// An effect of the model.
pub type Known = Known_<Kind>;

/// Noise of the force sensor, per axis, N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of the fast noise.
    pub sigma: V3,
    /// Quantisation step.
    pub digit: V3,
    /// AR(1) coefficient from row to row.
    pub colour: f64,
    /// Standard deviation of the amplifier drift over a pass, as a fraction of `sigma`.
    pub drift: f64,
    /// Number of gaps.
    pub gaps: usize,
}

/// Simulated measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Forces row by row, N.
    pub forces: Vec<V3>,
    /// Whether each row was recorded.
    pub there: Vec<bool>,
}

/// A case.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Its tier.
    pub tier: Tier,
    /// The cut as stated in the recording.
    pub cut: Cut,
    /// Its passes.
    pub scene: Scene,
    /// Noise of the sensor.
    pub noise: Noise,
    /// Effects in the model.
    pub known: Vec<Known>,
    /// Effects missing from the model.
    pub hidden: Vec<Effect>,
    /// Seed of the noise and of the unseen passes.
    pub seed: u64,
}

impl Noise {
    /// Standard deviation of the fast noise of an axis, with quantisation, N.
    #[must_use]
    pub fn total(&self, axis: usize) -> f64 {
        let (sigma, digit) = (self.sigma[axis], self.digit[axis]);
        (sigma * sigma + digit * digit / 12.0).sqrt()
    }
}

/// Relative time of a row within its pass, 0 to 1.
#[must_use]
pub fn along(scene: &Scene, row: &Row) -> f64 {
    let last = scene.passes[row.pass].times_s.last().copied().unwrap_or(1.0);
    row.t_s / last.max(f64::MIN_POSITIVE)
}

impl Case {
    /// Measurements of passes; `part` selects the noise stream of one recording.
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

    /// Other passes of the same cutter, which the solver never sees.
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
            // The spindle angle has no covariate of its own; its speed is used.
            Kind::BrokenTooth | Kind::PloughingSpeed => "spindle_rpm",
            Kind::BuiltUpEdge | Kind::SensorCreep => "t_s",
            Kind::TableFriction => "feed_mm_s",
            _ => return Vec::new(),
        };
        vec![word.to_owned()]
    }
}
