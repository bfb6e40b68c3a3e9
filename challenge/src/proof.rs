//! Evaluation of an answer on an unseen motion: error before, after, and of an oracle that knows the true form.
//!
//! Registration (frame and targets) is fitted on training rows only; outliers are excluded. All three errors are over the same rows, and do not
//! depend on which effects the answer reports.

use crate::bench::registration;
use crate::case::Case;
use crate::fit::{Pair, Part};
use crate::kinds::Effect;
use crate::law::Trial;
use crate::laws::Run;
use crate::scene::Scene;
use crate::space::{T4, mul, point};
use crate::view::Whitener;

const STEPS: usize = 2;

/// Predictions of a model at each row.
#[derive(Clone, Debug, PartialEq)]
pub enum Predicted {
    /// Pose of the tool, base coordinates.
    Tools(Vec<T4>),
    /// Joint positions on the link side, rad, joint by joint of each row.
    Links(Vec<Vec<f64>>),
}

/// The two recordings of a case: training and unseen.
pub struct Proof<'a> {
    case: &'a Case,
    scenes: [&'a Scene; 2],
    pair: Pair,
}

impl<'a> Proof<'a> {
    /// Prepares the case's recording and the one that the solver never sees.
    #[must_use]
    pub fn of(case: &'a Case, unseen: &'a Scene) -> Self {
        let part = |scene: &'a Scene, number: u64| {
            let measured = case.measured(scene, number);
            let width = case.view.width(scene);
            let whitener = Whitener::of(scene, &case.noise, &measured.right, width);
            let motors = Run::of(scene, &[]).motors();
            Part { measured: measured.values, whitener, anyway: registration(case, scene, &motors) }
        };
        let pair = Pair { training: part(&case.scene, 0), unseen: part(unseen, 1) };
        Self { case, scenes: [&case.scene, unseen], pair }
    }

    /// Error of the nominal model, rms over scalar values, m or rad.
    #[must_use]
    pub fn before(&self) -> f64 {
        self.error(&self.case.nominal())
    }

    /// Error of predictions of both recordings; `None` unless each has one value per row.
    #[must_use]
    pub fn after(&self, training: &Predicted, unseen: &Predicted) -> Option<f64> {
        let training = self.values(self.scenes[0], training)?;
        let unseen = self.values(self.scenes[1], unseen)?;
        Some(self.pair.error(&training, &unseen)).filter(|error| error.is_finite())
    }

    /// Error of the oracle: the true form with fitted parameters.
    #[must_use]
    pub fn oracle(&self) -> f64 {
        let exact = |effects: &[Effect]| self.case.exact(self.scenes[0], effects);
        self.error(&self.pair.fitted(self.case, STEPS, exact))
    }

    fn error(&self, effects: &[Effect]) -> f64 {
        let [training, unseen] = self.scenes.map(|scene| self.case.exact(scene, effects));
        self.pair.error(&training, &unseen)
    }

    fn values(&self, scene: &Scene, predicted: &Predicted) -> Option<Vec<f64>> {
        let view = &self.case.view;
        let rows = scene.rows.len();
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
