//! Evaluation of an answer on forces of unseen passes: error before, after, and of an oracle that knows the true form.
//!
//! Rows are those for which the cut's laws are defined: full engagement, or nothing moves. Amplifier drift is not predictable. All three errors are
//! over the same rows. Chatter is not evaluated, because its phase is random.

use crate::effect::BlindCase;
use crate::fit::{MeasuredRecording, RecordingPair};
use crate::transform::Vector3;

use super::case::ForceCase;
use super::detectability::{noise_scaled, whitener};
use super::kinds::{Effect, Kind};
use super::laws::SimulatedPasses;
use super::passes::Passes;

const STEPS: usize = 3;

/// The two recordings of a case; values are in units of their noise.
pub struct Evaluation<'a> {
    case: &'a ForceCase,
    recordings: [SimulatedPasses<'a>; 2],
    pair: RecordingPair,
}

impl<'a> Evaluation<'a> {
    /// Prepares the case's recording and the one that the solver never sees; `None` without hidden effects or with chatter.
    #[must_use]
    pub fn of(case: &'a ForceCase, unseen: &'a Passes) -> Option<Self> {
        let swings = case.hidden.iter().any(|effect| effect.kind == Kind::Chatter);
        if case.hidden.is_empty() || swings {
            return None;
        }
        let recordings = [&case.passes, unseen].map(|scene| SimulatedPasses::of(&case.cut, scene));
        let part = |number: usize| {
            let ride = &recordings[number];
            let mut measured = case.simulate_measurements(ride, number as u64);
            let rows = ride.rows.iter().zip(&mut measured.recorded);
            rows.for_each(|(row, recorded)| *recorded &= row.has_defined_forces());
            MeasuredRecording {
                measured: noise_scaled(case, &measured.forces),
                whitener: whitener(case, ride, &measured.recorded),
                nuisance_columns: Vec::new(),
            }
        };
        let pair = RecordingPair { training: part(0), unseen: part(1) };
        Some(Self { case, recordings, pair })
    }

    /// The case's passes and the unseen ones.
    #[must_use]
    pub fn recordings(&self) -> &[SimulatedPasses<'a>; 2] {
        &self.recordings
    }

    /// Error of the nominal model, rms, N.
    #[must_use]
    pub fn nominal_error(&self) -> f64 {
        self.error(&self.case.nominal())
    }

    /// Error of predicted forces of both recordings; `None` unless each has one value per row.
    #[must_use]
    pub fn predicted_error(&self, training: &[Vector3], unseen: &[Vector3]) -> Option<f64> {
        let rows = self.recordings.each_ref().map(|ride| ride.rows.len());
        if rows != [training.len(), unseen.len()] {
            return None;
        }
        let [training, unseen] = [training, unseen].map(|forces| noise_scaled(self.case, forces));
        Some(self.mean_noise() * self.pair.error(&training, &unseen))
            .filter(|error| error.is_finite())
    }

    /// Error of the oracle: the true form with fitted parameters.
    #[must_use]
    pub fn oracle_error(&self) -> f64 {
        self.error(&self.pair.fit_effects(self.case, STEPS, |effects| self.exact(0, effects)))
    }

    fn exact(&self, part: usize, effects: &[Effect]) -> Vec<f64> {
        noise_scaled(self.case, &self.recordings[part].measured_forces(effects))
    }

    fn error(&self, effects: &[Effect]) -> f64 {
        self.mean_noise() * self.pair.error(&self.exact(0, effects), &self.exact(1, effects))
    }

    /// Geometric mean of the axes' noise, N.
    fn mean_noise(&self) -> f64 {
        (0..3).map(|axis| self.case.noise.total_sigma(axis)).product::<f64>().cbrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Tier;
    use crate::force::generate;

    #[test]
    fn the_oracle_comes_down_to_the_noise() {
        for index in 0..Kind::DICTIONARY.len() {
            let case = generate::generate_case(6, index, (Tier::Single, index)).case;
            let unseen = case.unseen_passes();
            let Some(proof) = Evaluation::of(&case, &unseen) else { continue };
            let (before, oracle) = (proof.nominal_error(), proof.oracle_error());
            let (noise, kind) = (proof.mean_noise(), case.hidden[0].kind);
            assert!(oracle < 1.15 * noise, "{kind:?}: {oracle} of noise {noise}");
            assert!(oracle < before, "{kind:?}: {oracle} from {before}");
        }
    }
}
