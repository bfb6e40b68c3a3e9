//! One blind case of forces: cut, passes, model, hidden effects, measurements. Everything follows from the case and its seed.

use crate::case::Tier;
use crate::effect::BlindCase;
use crate::rng::Rng;
use crate::transform::Vector3;

use super::cut::Cut;
use super::kinds::{Effect, Kind};
use super::laws::SimulatedPasses;
use super::passes::{Passes, ToolState};

/// An effect of the model.
pub type ModelledEffect = crate::case::ModelledEffect<Kind>;

/// Noise of the force sensor, per axis, N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of the fast noise.
    pub sigma: Vector3,
    /// Quantisation step.
    pub quantum: Vector3,
    /// AR(1) coefficient from row to row.
    pub autocorrelation: f64,
    /// Standard deviation of the amplifier drift over a pass, as a fraction of `sigma`.
    pub drift: f64,
    /// Number of gaps.
    pub gaps: usize,
}

/// Simulated measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurements {
    /// Forces row by row, N.
    pub forces: Vec<Vector3>,
    /// Whether each row was recorded.
    pub recorded: Vec<bool>,
}

/// A case.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceCase {
    /// Its tier.
    pub tier: Tier,
    /// The cut as stated in the recording.
    pub cut: Cut,
    /// Its passes.
    pub passes: Passes,
    /// Noise of the sensor.
    pub noise: Noise,
    /// Effects in the model.
    pub modelled: Vec<ModelledEffect>,
    /// Effects missing from the model.
    pub hidden: Vec<Effect>,
    /// Seed of the noise and of the unseen passes.
    pub seed: u64,
}

impl Noise {
    /// Standard deviation of the fast noise of an axis, with quantisation, N.
    #[must_use]
    pub fn total_sigma(&self, axis: usize) -> f64 {
        let (sigma, digit) = (self.sigma[axis], self.quantum[axis]);
        (sigma * sigma + digit * digit / 12.0).sqrt()
    }
}

/// Relative time of a row within its pass, 0 to 1.
#[must_use]
pub fn relative_time(scene: &Passes, row: &ToolState) -> f64 {
    let last = scene.passes[row.pass].times_s.last().copied().unwrap_or(1.0);
    row.t_s / last.max(f64::MIN_POSITIVE)
}

impl ForceCase {
    /// Measurements of passes; `part` selects the noise stream of one recording.
    #[must_use]
    pub fn simulate_measurements(&self, ride: &SimulatedPasses<'_>, part: u64) -> Measurements {
        let mut rng = Rng::new(self.seed, 100 + part);
        let noise = &self.noise;
        let fresh = (1.0 - noise.autocorrelation * noise.autocorrelation).sqrt();
        let recorded =
            crate::torque::case::random_recorded_rows(ride.rows.len(), noise.gaps, &mut rng);
        let mut measured =
            Measurements { forces: ride.measured_forces(&self.true_effects()), recorded };
        let (mut memory, mut drift, mut pass) = ([0.0; 3], [0.0; 3], usize::MAX);
        for (row, force) in ride.rows.iter().zip(&mut measured.forces) {
            let is_pass_start = row.pass != pass;
            pass = row.pass;
            for axis in 0..3 {
                let draw = rng.normal();
                memory[axis] = if is_pass_start {
                    draw
                } else {
                    noise.autocorrelation * memory[axis] + fresh * draw
                };
                if is_pass_start {
                    drift[axis] = noise.drift * rng.truncated_normal();
                }
                let deviation = memory[axis] + drift[axis] * relative_time(ride.scene, row);
                let digit = noise.quantum[axis];
                let read = force[axis] + noise.sigma[axis] * deviation;
                force[axis] = if digit > 0.0 { (read / digit).round() * digit } else { read };
            }
        }
        measured
    }

    /// Other passes of the same cutter, which the solver never sees.
    #[must_use]
    pub fn unseen_passes(&self) -> Passes {
        self.passes.new_passes(&self.cut, &mut Rng::new(self.seed, 50))
    }
}

impl BlindCase for ForceCase {
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

    fn covariates(&self, effect: &Effect) -> Vec<String> {
        let covariate = match effect.kind {
            // The spindle angle has no covariate of its own; its speed is used.
            Kind::BrokenTooth | Kind::PloughingSpeed => "spindle_rpm",
            Kind::BuiltUpEdge | Kind::SensorCreep => "t_s",
            Kind::TableFriction => "feed_mm_s",
            _ => return Vec::new(),
        };
        vec![covariate.to_owned()]
    }
}
