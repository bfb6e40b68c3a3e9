//! One blind case of torques: rig, its model, hidden effects, measurements. Everything follows from the case and its seed.

use crate::arm::{JOINTS, Joints};
use crate::case::Tier;
use crate::effect::BlindCase;
use crate::rng::Rng;
use crate::scene::Excitation;

use super::kinds::{Effect, Kind};
use super::laws::{SampledMotion, recorded_torques};
use super::motion::Motion;
use super::rig::Rig;

/// An effect of the model.
pub type ModelledEffect = crate::case::ModelledEffect<Kind>;

/// Noise of torques and positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of each joint's torque, Nm or N.
    pub sigma: Joints,
    /// Quantisation step of each joint's torque, Nm or N.
    pub quantum: Joints,
    /// AR(1) coefficient from row to row.
    pub autocorrelation: f64,
    /// Resolution of the encoders on the joint side, rad or m.
    pub encoder_quantum: f64,
    /// Number of gaps.
    pub gaps: usize,
}

/// Simulated measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurements {
    /// Torques, row by row, Nm or N.
    pub torques: Vec<Joints>,
    /// Encoder positions, row by row, rad or m.
    pub encoder_positions: Vec<Joints>,
    /// Whether each row was recorded.
    pub recorded: Vec<bool>,
}

/// A case.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueCase {
    /// Its tier.
    pub tier: Tier,
    /// Robot or single-axis rig.
    pub rig: Rig,
    /// Its motion.
    pub motion: Motion,
    /// Excitation of the motion.
    pub excitation: Excitation,
    /// Noise of the measurements.
    pub noise: Noise,
    /// Effects in the model.
    pub modelled: Vec<ModelledEffect>,
    /// Effects missing from the model.
    pub hidden: Vec<Effect>,
    /// Seed of the noise and of the unseen motion.
    pub seed: u64,
}

impl Noise {
    /// Standard deviation of a torque: noise and quantisation.
    #[must_use]
    pub fn total_sigma(&self, joint: usize) -> f64 {
        let (sigma, digit) = (self.sigma[joint], self.quantum[joint]);
        (sigma * sigma + digit * digit / 12.0).sqrt()
    }
}

fn quantised(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

/// Whether each row was recorded, with this number of random gaps.
pub(crate) fn random_recorded_rows(rows: usize, gaps: usize, rng: &mut Rng) -> Vec<bool> {
    let mut recorded = vec![true; rows];
    for _ in 0..gaps {
        let from = rng.uniform_index(rows);
        let to = (from + 5 + rng.uniform_index(40)).min(rows);
        recorded[from..to].fill(false);
    }
    recorded
}

impl TorqueCase {
    /// Measurements of a motion; `part` selects the noise stream of one recording.
    #[must_use]
    pub fn simulate_measurements(
        &self,
        motion: &Motion,
        ride: &SampledMotion,
        part: u64,
    ) -> Measurements {
        let exact = recorded_torques(&self.rig, motion, ride, &self.true_effects());
        let mut rng = Rng::new(self.seed, 100 + part);
        let (keep, count) = (self.noise.autocorrelation, self.rig.count());
        let fresh = (1.0 - keep * keep).sqrt();
        let mut memory = [0.0; JOINTS];
        let recorded = random_recorded_rows(ride.times.len(), self.noise.gaps, &mut rng);
        let mut measured = Measurements { torques: exact, encoder_positions: Vec::new(), recorded };
        for (row, torques) in measured.torques.iter_mut().enumerate() {
            let is_segment_start = row == 0 || ride.times[row - 1].0 != ride.times[row].0;
            for i in 0..count {
                let draw = rng.normal();
                memory[i] = if is_segment_start { draw } else { keep * memory[i] + fresh * draw };
                let read = torques[i] + self.noise.sigma[i] * memory[i];
                torques[i] = quantised(read, self.noise.quantum[i]);
            }
            let place = |i: usize| quantised(ride.states[row][i][0], self.noise.encoder_quantum);
            measured.encoder_positions.push(std::array::from_fn(place));
        }
        measured
    }

    /// Another motion of the same rig, which the solver never sees.
    #[must_use]
    pub fn unseen_motion(&self) -> Motion {
        let mut rng = Rng::new(self.seed, 50);
        let length_s = (self.motion.rows() as f64 / self.motion.rate_hz).min(12.0);
        let so = (length_s, self.motion.rate_hz);
        Motion::random(
            &self.rig.ranges,
            so,
            self.motion.has_temperatures,
            self.excitation,
            &mut rng,
        )
    }
}

impl BlindCase for TorqueCase {
    type Kind = Kind;

    fn tier(&self) -> Tier {
        self.tier
    }

    fn modelled(&self) -> &[ModelledEffect] {
        &self.modelled
    }

    fn hidden(&self) -> &[Effect] {
        &self.hidden
    }

    fn is_prismatic(&self) -> bool {
        self.rig.is_prismatic
    }

    fn covariates(&self, effect: &Effect) -> Vec<String> {
        let (joint, other) = (effect.joint + 1, effect.other_joint + 1);
        match effect.kind {
            Kind::SpeedCube => vec![format!("v{joint}")],
            Kind::PlaceFriction => vec![format!("q{joint}"), format!("direction_{joint}")],
            Kind::PlaceDamping => vec![format!("q{joint}"), format!("v{joint}")],
            Kind::CrossTorque => vec![format!("q{other}")],
            Kind::Wander => vec!["t_s".to_owned()],
            _ => Vec::new(),
        }
    }
}
