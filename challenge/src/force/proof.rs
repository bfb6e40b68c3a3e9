//! Evaluation of an answer on forces of unseen passes: error before, after, and of an oracle that knows the true form.
//!
//! Rows are those for which the cut's laws are defined: full engagement, or nothing moves. Amplifier drift is not predictable. All three errors are
//! over the same rows. Chatter is not evaluated, because its phase is random.

use crate::fit::{Pair, Part};
use crate::law::Trial;
use crate::space::V3;

use super::bench::{in_noise, whitener};
use super::case::Case;
use super::kinds::{Effect, Kind};
use super::laws::Ride;
use super::scene::Scene;

const STEPS: usize = 3;

/// The two recordings of a case; values are in units of their noise.
pub struct Proof<'a> {
    case: &'a Case,
    rides: [Ride<'a>; 2],
    pair: Pair,
}

impl<'a> Proof<'a> {
    /// Prepares the case's recording and the one that the solver never sees; `None` without hidden effects or with chatter.
    #[must_use]
    pub fn of(case: &'a Case, unseen: &'a Scene) -> Option<Self> {
        let swings = case.hidden.iter().any(|effect| effect.kind == Kind::Chatter);
        if case.hidden.is_empty() || swings {
            return None;
        }
        let rides = [&case.scene, unseen].map(|scene| Ride::of(&case.cut, scene));
        let part = |number: usize| {
            let ride = &rides[number];
            let mut measured = case.measured(ride, number as u64);
            let rows = ride.rows.iter().zip(&mut measured.there);
            rows.for_each(|(row, there)| *there &= row.is_lawful());
            Part {
                measured: in_noise(case, &measured.forces),
                whitener: whitener(case, ride, &measured.there),
                anyway: Vec::new(),
            }
        };
        let pair = Pair { training: part(0), unseen: part(1) };
        Some(Self { case, rides, pair })
    }

    /// The case's passes and the unseen ones.
    #[must_use]
    pub fn rides(&self) -> &[Ride<'a>; 2] {
        &self.rides
    }

    /// Error of the nominal model, rms, N.
    #[must_use]
    pub fn before(&self) -> f64 {
        self.error(&self.case.nominal())
    }

    /// Error of predicted forces of both recordings; `None` unless each has one value per row.
    #[must_use]
    pub fn after(&self, training: &[V3], unseen: &[V3]) -> Option<f64> {
        let rows = self.rides.each_ref().map(|ride| ride.rows.len());
        if rows != [training.len(), unseen.len()] {
            return None;
        }
        let [training, unseen] = [training, unseen].map(|forces| in_noise(self.case, forces));
        Some(self.unit() * self.pair.error(&training, &unseen)).filter(|error| error.is_finite())
    }

    /// Error of the oracle: the true form with fitted parameters.
    #[must_use]
    pub fn oracle(&self) -> f64 {
        self.error(&self.pair.fitted(self.case, STEPS, |effects| self.exact(0, effects)))
    }

    fn exact(&self, part: usize, effects: &[Effect]) -> Vec<f64> {
        in_noise(self.case, &self.rides[part].read(effects))
    }

    fn error(&self, effects: &[Effect]) -> f64 {
        self.unit() * self.pair.error(&self.exact(0, effects), &self.exact(1, effects))
    }

    /// Geometric mean of the axes' noise, N.
    fn unit(&self) -> f64 {
        (0..3).map(|axis| self.case.noise.total(axis)).product::<f64>().cbrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Tier;
    use crate::force::draw;

    #[test]
    fn the_oracle_comes_down_to_the_noise() {
        for index in 0..Kind::LIBRARY.len() {
            let case = draw::case(6, index, (Tier::Single, index)).case;
            let unseen = case.unseen();
            let Some(proof) = Proof::of(&case, &unseen) else { continue };
            let (before, oracle) = (proof.before(), proof.oracle());
            let (noise, kind) = (proof.unit(), case.hidden[0].kind);
            assert!(oracle < 1.15 * noise, "{kind:?}: {oracle} of noise {noise}");
            assert!(oracle < before, "{kind:?}: {oracle} from {before}");
        }
    }
}
