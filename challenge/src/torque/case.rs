//! One blind case of torques: rig, its model, hidden effects, measurements. Everything follows from the case and its seed.

use crate::arm::{JOINTS, Joints};
use crate::case::{Known as Known_, Tier};
use crate::chance::Chance;
use crate::law::Trial;
use crate::scene::Richness;

use super::kinds::{Effect, Kind};
use super::laws::{Ride, recorded};
use super::motion::Motion;
use super::rig::Rig;

/// An effect of the model.
pub type Known = Known_<Kind>;

/// Noise of torques and positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of each joint's torque, Nm or N.
    pub sigma: Joints,
    /// Quantisation step of each joint's torque, Nm or N.
    pub digit: Joints,
    /// AR(1) coefficient from row to row.
    pub colour: f64,
    /// Resolution of the encoders on the joint side, rad or m.
    pub step: f64,
    /// Number of gaps.
    pub gaps: usize,
}

/// Simulated measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Torques, row by row, Nm or N.
    pub torques: Vec<Joints>,
    /// Encoder positions, row by row, rad or m.
    pub places: Vec<Joints>,
    /// Whether each row was recorded.
    pub there: Vec<bool>,
}

/// A case.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Its tier.
    pub tier: Tier,
    /// Robot or single-axis rig.
    pub rig: Rig,
    /// Its motion.
    pub motion: Motion,
    /// Excitation of the motion.
    pub richness: Richness,
    /// Noise of the measurements.
    pub noise: Noise,
    /// Effects in the model.
    pub known: Vec<Known>,
    /// Effects missing from the model.
    pub hidden: Vec<Effect>,
    /// Seed of the noise and of the unseen motion.
    pub seed: u64,
}

impl Noise {
    /// Standard deviation of a torque: noise and quantisation.
    #[must_use]
    pub fn total(&self, joint: usize) -> f64 {
        let (sigma, digit) = (self.sigma[joint], self.digit[joint]);
        (sigma * sigma + digit * digit / 12.0).sqrt()
    }
}

fn rounded(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

/// Whether each row was recorded, with this number of random gaps.
pub(crate) fn without_gaps(rows: usize, gaps: usize, chance: &mut Chance) -> Vec<bool> {
    let mut there = vec![true; rows];
    for _ in 0..gaps {
        let from = chance.pick(rows);
        let to = (from + 5 + chance.pick(40)).min(rows);
        there[from..to].fill(false);
    }
    there
}

impl Case {
    /// Measurements of a motion; `part` selects the noise stream of one recording.
    #[must_use]
    pub fn measured(&self, motion: &Motion, ride: &Ride, part: u64) -> Measured {
        let exact = recorded(&self.rig, motion, ride, &self.real());
        let mut chance = Chance::new(self.seed, 100 + part);
        let (keep, count) = (self.noise.colour, self.rig.count());
        let fresh = (1.0 - keep * keep).sqrt();
        let mut memory = [0.0; JOINTS];
        let there = without_gaps(ride.at.len(), self.noise.gaps, &mut chance);
        let mut measured = Measured { torques: exact, places: Vec::new(), there };
        for (row, torques) in measured.torques.iter_mut().enumerate() {
            let anew = row == 0 || ride.at[row - 1].0 != ride.at[row].0;
            for i in 0..count {
                let draw = chance.normal();
                memory[i] = if anew { draw } else { keep * memory[i] + fresh * draw };
                let read = torques[i] + self.noise.sigma[i] * memory[i];
                torques[i] = rounded(read, self.noise.digit[i]);
            }
            let place = |i: usize| rounded(ride.states[row][i][0], self.noise.step);
            measured.places.push(std::array::from_fn(place));
        }
        measured
    }

    /// Another motion of the same rig, which the solver never sees.
    #[must_use]
    pub fn unseen(&self) -> Motion {
        let mut chance = Chance::new(self.seed, 50);
        let length_s = (self.motion.rows() as f64 / self.motion.rate_hz).min(12.0);
        let so = (length_s, self.motion.rate_hz);
        Motion::draw(&self.rig.rooms, so, self.motion.warms, self.richness, &mut chance)
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

    fn slides(&self) -> bool {
        self.rig.slides
    }

    fn follows(&self, effect: &Effect) -> Vec<String> {
        let (own, other) = (effect.joint + 1, effect.other + 1);
        match effect.kind {
            Kind::SpeedCube => vec![format!("v{own}")],
            Kind::PlaceFriction => vec![format!("q{own}"), format!("direction_{own}")],
            Kind::PlaceDamping => vec![format!("q{own}"), format!("v{own}")],
            Kind::CrossTorque => vec![format!("q{other}")],
            Kind::Wander => vec!["t_s".to_owned()],
            _ => Vec::new(),
        }
    }
}
