//! Evaluation of an answer on torques of an unseen motion: error before, after, and of an oracle that knows the true form.
//!
//! Masses that the model does not state are fitted on training rows for all three; the oracle also fits the true form's parameters and the model's
//! own (with their uncertainty), by Gauss-Newton. Joints are weighted by their noise, in units of its geometric mean. All three errors are over the
//! same rows.

use crate::arm::Joints;
use crate::effect::BlindCase;
use crate::fit::{MeasuredRecording, RecordingPair};

use super::case::TorqueCase;
use super::detectability::{noise_scaled, unit_mass_torques, whitener};
use super::kinds::Effect;
use super::laws::{SampledMotion, recorded_torques};
use super::motion::Motion;

const STEPS: usize = 3;

/// The two recordings of a case; values are in units of their noise.
pub struct Evaluation<'a> {
    case: &'a TorqueCase,
    motions: [&'a Motion; 2],
    samples: [SampledMotion; 2],
    pair: RecordingPair,
}

impl<'a> Evaluation<'a> {
    /// Prepares the case's recording and the one that the solver never sees.
    #[must_use]
    pub fn of(case: &'a TorqueCase, unseen: &'a Motion) -> Self {
        let motions = [&case.motion, unseen];
        let samples = motions.map(|motion| SampledMotion::from_motion(&case.rig, motion, 0.0));
        let part = |number: usize| {
            let ride = &samples[number];
            let measured = case.simulate_measurements(motions[number], ride, number as u64);
            let unit_torques = unit_mass_torques(&case.rig, ride);
            MeasuredRecording {
                measured: noise_scaled(case, &measured.torques),
                whitener: whitener(case, ride, &measured.recorded),
                nuisance_columns: unit_torques
                    .iter()
                    .map(|torques| noise_scaled(case, torques))
                    .collect(),
            }
        };
        let pair = RecordingPair { training: part(0), unseen: part(1) };
        Self { case, motions, samples, pair }
    }

    /// The case's motion and the unseen one.
    #[must_use]
    pub fn motions(&self) -> [&Motion; 2] {
        self.motions
    }

    /// Error of the nominal model, rms, Nm or N.
    #[must_use]
    pub fn nominal_error(&self) -> f64 {
        self.error(&self.case.nominal())
    }

    /// Error of predicted torques of both recordings; `None` unless each has one value per row.
    #[must_use]
    pub fn predicted_error(&self, training: &[Joints], unseen: &[Joints]) -> Option<f64> {
        let rows = self.samples.each_ref().map(|ride| ride.times.len());
        if rows != [training.len(), unseen.len()] {
            return None;
        }
        let [training, unseen] = [training, unseen].map(|torques| noise_scaled(self.case, torques));
        Some(self.mean_noise() * self.pair.error(&training, &unseen))
            .filter(|error| error.is_finite())
    }

    /// Error of the oracle: the true form with fitted parameters.
    #[must_use]
    pub fn oracle_error(&self) -> f64 {
        self.error(&self.pair.fit_effects(self.case, STEPS, |effects| self.exact(0, effects)))
    }

    fn exact(&self, part: usize, effects: &[Effect]) -> Vec<f64> {
        noise_scaled(
            self.case,
            &recorded_torques(&self.case.rig, self.motions[part], &self.samples[part], effects),
        )
    }

    fn error(&self, effects: &[Effect]) -> f64 {
        self.mean_noise() * self.pair.error(&self.exact(0, effects), &self.exact(1, effects))
    }

    /// Geometric mean of the joints' noise, Nm or N.
    fn mean_noise(&self) -> f64 {
        let count = self.case.rig.count();
        let sum = (0..count).map(|i| self.case.noise.total_sigma(i).ln()).sum::<f64>();
        (sum / count as f64).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Tier;
    use crate::torque::generate;
    use crate::torque::kinds::Kind;

    #[test]
    fn the_oracle_comes_down_to_the_noise() {
        for index in 0..Kind::DICTIONARY.len() {
            let case = generate::generate_case(6, index, (Tier::Single, index)).case;
            let unseen = case.unseen_motion();
            let evaluation = Evaluation::of(&case, &unseen);
            let (before, oracle) = (evaluation.nominal_error(), evaluation.oracle_error());
            let (noise, kind) = (evaluation.mean_noise(), case.hidden[0].kind);
            assert!(oracle < 1.1 * noise, "{kind:?}: {oracle} of noise {noise}");
            assert!(oracle < before, "{kind:?}: {oracle} from {before}");
        }
    }
}
