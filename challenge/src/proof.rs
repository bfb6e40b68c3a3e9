//! What an answer is worth on a motion that nobody saw: error before, after, and of an oracle that knows the true form.
//!
//! Registration is fitted on training rows alone; outliers are left out; the oracle fits the true form's numbers and the model's own (with
//! their uncertainty) to the training rows by Gauss and Newton.
//!
//! Promises: the three errors are over the same rows. Never: a look at an answer's name.

use crate::bench::registration;
use crate::case::Case;
use crate::kinds::Effect;
use crate::laws::Run;
use crate::linear::Span;
use crate::scene::Scene;
use crate::space::{T4, mul, point};
use crate::view::{Measured, Whitener};

const STEPS: usize = 2;

/// Where a model puts the robot at each row.
#[derive(Clone, Debug, PartialEq)]
pub enum Predicted {
    /// The tool, base coordinates.
    Tools(Vec<T4>),
    /// Joint positions on the link side, rad, joint by joint of each row.
    Links(Vec<Vec<f64>>),
}

/// One recording with what was measured on it.
struct Part<'a> {
    scene: &'a Scene,
    measured: Measured,
    whitener: Whitener,
    registration: Vec<Vec<f64>>,
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
    pub fn of(case: &'a Case, unseen: &'a Scene) -> Self {
        let part = |scene: &'a Scene, number: u64| {
            let measured = case.measured(scene, number);
            let width = case.view.width(scene);
            let whitener = Whitener::of(scene, &case.noise, &measured.right, width);
            let motors = Run::of(scene, &[]).motors();
            Part { scene, measured, whitener, registration: registration(case, scene, &motors) }
        };
        Self { case, training: part(&case.scene, 0), unseen: part(unseen, 1) }
    }

    /// Error of the model as given, rms over single values, m or rad.
    #[must_use]
    pub fn before(&self) -> f64 {
        let nominal = self.case.nominal();
        self.error(&self.exact(&self.training, &nominal), &self.exact(&self.unseen, &nominal))
    }

    /// Error of predictions of both recordings; none where they have not a row for each.
    #[must_use]
    pub fn after(&self, training: &Predicted, unseen: &Predicted) -> Option<f64> {
        let training = self.values(&self.training, training)?;
        let unseen = self.values(&self.unseen, unseen)?;
        Some(self.error(&training, &unseen)).filter(|error| error.is_finite())
    }

    /// Error of the true form with its numbers fitted.
    #[must_use]
    pub fn oracle(&self) -> f64 {
        let (mut known, mut hidden) = (self.case.nominal(), self.case.hidden.clone());
        for _ in 0..STEPS {
            self.step(&mut known, &mut hidden);
        }
        let all: Vec<Effect> = known.into_iter().chain(hidden).collect();
        self.error(&self.exact(&self.training, &all), &self.exact(&self.unseen, &all))
    }

    /// One step of Gauss and Newton on all numbers.
    fn step(&self, known: &mut [Effect], hidden: &mut [Effect]) {
        let priors = known.len();
        let part = &self.training;
        let all = |known: &[Effect], hidden: &[Effect]| -> Vec<Effect> {
            known.iter().chain(hidden).cloned().collect()
        };
        let now = self.exact(part, &all(known, hidden));
        let off: Vec<f64> = part.measured.values.iter().zip(&now).map(|(a, b)| a - b).collect();
        let mut target = part.whitener.apply(&off);
        for (known, effect) in self.case.known.iter().zip(known.iter()) {
            target.push((known.nominal.numbers[0] - effect.numbers[0]) / known.sigma);
        }
        let mut span = Span::default();
        for column in &part.registration {
            let mut column = part.whitener.apply(column);
            column.resize(target.len(), 0.0);
            span.take(column);
        }
        let mut places = Vec::new();
        for which in 0..known.len() + hidden.len() {
            let numbers = if which < priors { 1 } else { hidden[which - priors].numbers.len() };
            for n in 0..numbers {
                let (mut moved_known, mut moved_hidden) = (known.to_vec(), hidden.to_vec());
                let effect = if which < priors {
                    &mut moved_known[which]
                } else {
                    &mut moved_hidden[which - priors]
                };
                let h = 1e-3 * effect.numbers[n].abs().max(effect.lead()).max(1e-9);
                effect.numbers[n] += h;
                let moved = self.exact(part, &all(&moved_known, &moved_hidden));
                let slope: Vec<f64> = moved.iter().zip(&now).map(|(a, b)| (a - b) / h).collect();
                let mut column = part.whitener.apply(&slope);
                column.resize(target.len(), 0.0);
                if which < priors {
                    let at = column.len() - priors + which;
                    column[at] = 1.0 / self.case.known[which].sigma;
                }
                span.take(column);
                places.push((which, n));
            }
        }
        let found = span.solve(&target);
        for ((which, n), by) in places.into_iter().zip(&found[part.registration.len()..]) {
            let effect =
                if which < priors { &mut known[which] } else { &mut hidden[which - priors] };
            let (from, facts) = (effect.numbers[n], effect.kind.facts());
            let positive = n >= facts.leads && from > 0.0;
            let wanted = from + by;
            effect.numbers[n] = if positive { wanted.max(0.3 * from) } else { wanted };
            if facts.not_negative && n < facts.leads {
                effect.numbers[n] = effect.numbers[n].max(0.0);
            }
        }
    }

    fn exact(&self, part: &Part<'_>, effects: &[Effect]) -> Vec<f64> {
        self.case.exact(part.scene, effects)
    }

    fn values(&self, part: &Part<'_>, predicted: &Predicted) -> Option<Vec<f64>> {
        let view = &self.case.view;
        let rows = part.scene.rows.len();
        match predicted {
            Predicted::Tools(tools) if tools.len() == rows && !view.places.is_empty() => {
                let seen = |tool: &T4| mul(&view.measuring_from_base, tool);
                let points = |tool: &T4| -> Vec<f64> {
                    let seen = seen(tool);
                    view.places.iter().flat_map(|place| point(&seen, *place)).collect()
                };
                Some(tools.iter().flat_map(points).collect())
            }
            Predicted::Links(links) if links.len() == rows && view.places.is_empty() => {
                Some(links.iter().flatten().copied().collect())
            }
            _ => None,
        }
    }

    /// Registration on the training rows, then the error on the unseen.
    fn error(&self, training: &[f64], unseen: &[f64]) -> f64 {
        let off = |part: &Part<'_>, predicted: &[f64]| -> Vec<f64> {
            part.measured.values.iter().zip(predicted).map(|(a, b)| a - b).collect()
        };
        let mut span = Span::default();
        for column in &self.training.registration {
            span.take(self.training.whitener.apply(column));
        }
        let found = span.solve(&self.training.whitener.apply(&off(&self.training, training)));
        let mut rest = off(&self.unseen, unseen);
        for (column, share) in self.unseen.registration.iter().zip(found) {
            rest.iter_mut().zip(column).for_each(|(x, c)| *x -= share * c);
        }
        let kept = self.unseen.whitener.kept(&rest);
        (kept.iter().map(|x| x * x).sum::<f64>() / kept.len().max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Tier;
    use crate::draw;

    #[test]
    fn the_oracle_comes_down_to_the_noise_and_the_true_robot_is_worth_as_much() {
        for index in 0..12 {
            let drawn = draw::case(6, index, (Tier::Single, 3 * index));
            let case = &drawn.case;
            let unseen = case.unseen();
            let proof = Proof::of(case, &unseen);
            let (before, oracle) = (proof.before(), proof.oracle());
            let noise = case.noise.total();
            let kind = case.hidden[0].kind;
            assert!(oracle < 1.08 * noise, "{kind:?}: {oracle} of noise {noise}");
            assert!(oracle < before, "{kind:?}: {oracle} from {before}");
            let all = case.real();
            let predicted = |scene: &Scene| {
                let run = Run::of(scene, &all);
                let (motors, bends) = (run.motors(), run.bends(&all));
                if case.view.places.is_empty() {
                    let width = case.view.width(scene);
                    let values = case.view.values(scene, &motors, &bends);
                    return Predicted::Links(values.chunks(width).map(<[f64]>::to_vec).collect());
                }
                let tools = motors.iter().zip(&bends);
                Predicted::Tools(
                    tools.map(|(q, bend)| crate::bent::tool(&scene.arm, q, bend)).collect(),
                )
            };
            let truth = proof.after(&predicted(&case.scene), &predicted(&unseen)).expect("rows");
            assert!((truth / oracle - 1.0).abs() < 0.08, "{kind:?}: {truth} and {oracle}");
        }
    }
}
