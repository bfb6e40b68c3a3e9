//! Evaluation of an answer on torques of an unseen motion: error before, after, and of an oracle that knows the true form.
//!
//! Masses that the model does not state are fitted on training rows for all three; the oracle also fits the true form's parameters and the model's
//! own (with their uncertainty), by Gauss-Newton. Joints are weighted by their noise, in units of its geometric mean. All three errors are over the
//! same rows.

use crate::arm::Joints;
use crate::fit::{Pair, Part};
use crate::law::Trial;

use super::bench::{in_noise, unsaid, whitener};
use super::case::Case;
use super::kinds::Effect;
use super::laws::{Ride, recorded};
use super::motion::Motion;

const STEPS: usize = 3;

/// The two recordings of a case; values are in units of their noise.
pub struct Proof<'a> {
    case: &'a Case,
    motions: [&'a Motion; 2],
    rides: [Ride; 2],
    pair: Pair,
}

impl<'a> Proof<'a> {
    /// Prepares the case's recording and the one that the solver never sees.
    #[must_use]
    pub fn of(case: &'a Case, unseen: &'a Motion) -> Self {
        let motions = [&case.motion, unseen];
        let rides = motions.map(|motion| Ride::of(&case.rig, motion, 0.0));
        let part = |number: usize| {
            let ride = &rides[number];
            let measured = case.measured(motions[number], ride, number as u64);
            let unsaid = unsaid(&case.rig, ride);
            Part {
                measured: in_noise(case, &measured.torques),
                whitener: whitener(case, ride, &measured.there),
                anyway: unsaid.iter().map(|torques| in_noise(case, torques)).collect(),
            }
        };
        let pair = Pair { training: part(0), unseen: part(1) };
        Self { case, motions, rides, pair }
    }

    /// The case's motion and the unseen one.
    #[must_use]
    pub fn motions(&self) -> [&Motion; 2] {
        self.motions
    }

    /// Error of the nominal model, rms, Nm or N.
    #[must_use]
    pub fn before(&self) -> f64 {
        self.error(&self.case.nominal())
    }

    /// Error of predicted torques of both recordings; `None` unless each has one value per row.
    #[must_use]
    pub fn after(&self, training: &[Joints], unseen: &[Joints]) -> Option<f64> {
        let rows = self.rides.each_ref().map(|ride| ride.at.len());
        if rows != [training.len(), unseen.len()] {
            return None;
        }
        let [training, unseen] = [training, unseen].map(|torques| in_noise(self.case, torques));
        Some(self.unit() * self.pair.error(&training, &unseen)).filter(|error| error.is_finite())
    }

    /// Error of the oracle: the true form with fitted parameters.
    #[must_use]
    pub fn oracle(&self) -> f64 {
        self.error(&self.pair.fitted(self.case, STEPS, |effects| self.exact(0, effects)))
    }

    fn exact(&self, part: usize, effects: &[Effect]) -> Vec<f64> {
        in_noise(
            self.case,
            &recorded(&self.case.rig, self.motions[part], &self.rides[part], effects),
        )
    }

    fn error(&self, effects: &[Effect]) -> f64 {
        self.unit() * self.pair.error(&self.exact(0, effects), &self.exact(1, effects))
    }

    /// Geometric mean of the joints' noise, Nm or N.
    fn unit(&self) -> f64 {
        let count = self.case.rig.count();
        let sum = (0..count).map(|i| self.case.noise.total(i).ln()).sum::<f64>();
        (sum / count as f64).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Tier;
    use crate::torque::draw;
    use crate::torque::kinds::Kind;

    #[test]
    fn the_oracle_comes_down_to_the_noise() {
        for index in 0..Kind::LIBRARY.len() {
            let case = draw::case(6, index, (Tier::Single, index)).case;
            let unseen = case.unseen();
            let proof = Proof::of(&case, &unseen);
            let (before, oracle) = (proof.before(), proof.oracle());
            let (noise, kind) = (proof.unit(), case.hidden[0].kind);
            assert!(oracle < 1.1 * noise, "{kind:?}: {oracle} of noise {noise}");
            assert!(oracle < before, "{kind:?}: {oracle} from {before}");
        }
    }
}
