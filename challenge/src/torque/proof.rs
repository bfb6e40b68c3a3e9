//! What an answer is worth on torques of a motion that nobody saw: error before, after, and of an oracle that knows the true form.
//!
//! Masses that the model does not say are fitted on training rows for all three; the oracle fits the true form's numbers and the model's own (with their
//! uncertainty) there by Gauss and Newton. Joints count by their noise, in units of its geometric mean.
//!
//! Promises: the three errors are over the same rows. Never: a look at an answer's name.

use crate::arm::Joints;
use crate::linear::Span;
use crate::view::Whitener;

use super::bench::{in_noise, minus, step, unsaid, whitener};
use super::case::{Case, Measured};
use super::kinds::Effect;
use super::laws::{Ride, recorded};
use super::motion::Motion;

const STEPS: usize = 3;

/// One recording with what was measured on it.
struct Part<'a> {
    motion: &'a Motion,
    ride: Ride,
    measured: Measured,
    whitener: Whitener,
    unsaid: Vec<Vec<f64>>,
}

/// Both recordings of a case.
pub struct Proof<'a> {
    case: &'a Case,
    training: Part<'a>,
    unseen: Part<'a>,
}

impl<'a> Proof<'a> {
    /// The case's recording and the one that the solver never sees.
    #[must_use]
    pub fn of(case: &'a Case, unseen: &'a Motion) -> Self {
        let part = |motion: &'a Motion, number: u64| {
            let ride = Ride::of(&case.rig, motion, 0.0);
            let measured = case.measured(motion, &ride, number);
            let whitener = whitener(case, &ride, &measured.there);
            let unsaid = unsaid(&case.rig, &ride);
            let unsaid = unsaid.iter().map(|torques| in_noise(case, torques)).collect();
            Part { motion, ride, measured, whitener, unsaid }
        };
        Self { case, training: part(&case.motion, 0), unseen: part(unseen, 1) }
    }

    /// The case's motion and the unseen one.
    #[must_use]
    pub fn motions(&self) -> [&Motion; 2] {
        [self.training.motion, self.unseen.motion]
    }

    /// Error of the model as given, Nm or N.
    #[must_use]
    pub fn before(&self) -> f64 {
        let nominal = self.case.nominal();
        self.error(&self.exact(&self.training, &nominal), &self.exact(&self.unseen, &nominal))
    }

    /// Error of predicted torques of both recordings; none where they have not a row for each.
    #[must_use]
    pub fn after(&self, training: &[Joints], unseen: &[Joints]) -> Option<f64> {
        let fits = |part: &Part<'_>, torques: &[Joints]| part.ride.at.len() == torques.len();
        if !fits(&self.training, training) || !fits(&self.unseen, unseen) {
            return None;
        }
        Some(self.error(training, unseen)).filter(|error| error.is_finite())
    }

    /// Error of the true form with its numbers fitted.
    #[must_use]
    pub fn oracle(&self) -> f64 {
        let (mut all, known) = (self.case.nominal(), self.case.known.len());
        all.extend(self.case.hidden.iter().cloned());
        for _ in 0..STEPS {
            self.step(&mut all, known);
        }
        self.error(&self.exact(&self.training, &all), &self.exact(&self.unseen, &all))
    }

    /// One step of Gauss and Newton on the first number of each of the first `known`, and all numbers of the others.
    fn step(&self, all: &mut [Effect], known: usize) {
        let part = &self.training;
        let now = self.exact(part, all);
        let white = |torques: &[Joints]| part.whitener.apply(&in_noise(self.case, torques));
        let mut target = white(&minus(&part.measured.torques, &now));
        let rows = target.len();
        for (one, effect) in self.case.known.iter().zip(all.iter()) {
            target.push((one.nominal.numbers[0] - effect.numbers[0]) / one.sigma);
        }
        let mut span = Span::default();
        for column in &part.unsaid {
            let mut column = part.whitener.apply(column);
            column.resize(target.len(), 0.0);
            span.take(column);
        }
        let mut places = Vec::new();
        for which in 0..all.len() {
            let numbers = if which < known { 1 } else { all[which].numbers.len() };
            for n in 0..numbers {
                let mut moved = all.to_vec();
                let h = 1e-3 * step(&all[which], n);
                moved[which].numbers[n] += h;
                let moved = minus(&self.exact(part, &moved), &now);
                let mut column = white(&moved);
                column.iter_mut().for_each(|x| *x /= h);
                column.resize(target.len(), 0.0);
                if which < known {
                    column[rows + which] = 1.0 / self.case.known[which].sigma;
                }
                span.take(column);
                places.push((which, n));
            }
        }
        let found = span.solve(&target);
        for ((which, n), by) in places.into_iter().zip(&found[part.unsaid.len()..]) {
            let facts = all[which].kind.facts();
            let from = all[which].numbers[n];
            // A speed or a way stays above nothing.
            let scale = n >= facts.leads && from > 0.0 && n == 1 && all[which].numbers.len() <= 3;
            let wanted = from + by;
            all[which].numbers[n] = if scale { wanted.max(0.3 * from) } else { wanted };
        }
    }

    fn exact(&self, part: &Part<'_>, effects: &[Effect]) -> Vec<Joints> {
        recorded(&self.case.rig, part.motion, &part.ride, effects)
    }

    /// Masses that are not said on the training rows, then the error on the unseen.
    fn error(&self, training: &[Joints], unseen: &[Joints]) -> f64 {
        let off = |part: &Part<'_>, predicted: &[Joints]| {
            in_noise(self.case, &minus(&part.measured.torques, predicted))
        };
        let mut span = Span::default();
        for column in &self.training.unsaid {
            span.take(self.training.whitener.apply(column));
        }
        let found = span.solve(&self.training.whitener.apply(&off(&self.training, training)));
        let mut rest = off(&self.unseen, unseen);
        for (column, share) in self.unseen.unsaid.iter().zip(found) {
            rest.iter_mut().zip(column).for_each(|(x, c)| *x -= share * c);
        }
        let kept = self.unseen.whitener.kept(&rest);
        let rms = (kept.iter().map(|x| x * x).sum::<f64>() / kept.len().max(1) as f64).sqrt();
        let count = self.case.rig.count();
        let mean = (0..count).map(|i| self.case.noise.total(i).ln()).sum::<f64>() / count as f64;
        rms * mean.exp()
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
            let count = case.rig.count();
            let ln = (0..count).map(|i| case.noise.total(i).ln()).sum::<f64>() / count as f64;
            let kind = case.hidden[0].kind;
            assert!(oracle < 1.1 * ln.exp(), "{kind:?}: {oracle} of noise {}", ln.exp());
            assert!(oracle < before, "{kind:?}: {oracle} from {before}");
        }
    }
}
