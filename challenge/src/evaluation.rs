//! Evaluation of an answer on an unseen motion: error before, after, and of an oracle that knows the true form.
//!
//! Registration (frame and targets) is fitted on training rows only; outliers are excluded. All three errors are over the same rows, and do not
//! depend on which effects the answer reports.

use crate::case::PositionCase;
use crate::detectability::registration_columns;
use crate::effect::BlindCase;
use crate::fit::{MeasuredRecording, RecordingPair};
use crate::instrument::Whitener;
use crate::kinds::Effect;
use crate::laws::Run;
use crate::scene::Scene;
use crate::transform::{Transform, mul, transform_point};

const STEPS: usize = 2;

/// Predictions of a model at each row.
#[derive(Clone, Debug, PartialEq)]
pub enum Predicted {
    /// Pose of the tool, base coordinates.
    Tools(Vec<Transform>),
    /// Joint positions on the link side, rad, joint by joint of each row.
    Links(Vec<Vec<f64>>),
}

/// The two recordings of a case: training and unseen.
pub struct Evaluation<'a> {
    case: &'a PositionCase,
    scenes: [&'a Scene; 2],
    pair: RecordingPair,
}

impl<'a> Evaluation<'a> {
    /// Prepares the case's recording and the one that the solver never sees.
    #[must_use]
    pub fn of(case: &'a PositionCase, unseen: &'a Scene) -> Self {
        let part = |scene: &'a Scene, number: u64| {
            let measured = case.simulate_measurements(scene, number);
            let width = case.instrument.values_per_row(scene);
            let whitener = Whitener::of(scene, &case.noise, &measured.usable, width);
            let motors = Run::new(scene, &[]).motor_positions();
            MeasuredRecording {
                measured: measured.values,
                whitener,
                nuisance_columns: registration_columns(case, scene, &motors),
            }
        };
        let pair = RecordingPair { training: part(&case.scene, 0), unseen: part(unseen, 1) };
        Self { case, scenes: [&case.scene, unseen], pair }
    }

    /// Error of the nominal model, rms over scalar values, m or rad.
    #[must_use]
    pub fn nominal_error(&self) -> f64 {
        self.error(&self.case.nominal())
    }

    /// Error of predictions of both recordings; `None` unless each has one value per row.
    #[must_use]
    pub fn predicted_error(&self, training: &Predicted, unseen: &Predicted) -> Option<f64> {
        let training = self.values(self.scenes[0], training)?;
        let unseen = self.values(self.scenes[1], unseen)?;
        Some(self.pair.error(&training, &unseen)).filter(|error| error.is_finite())
    }

    /// Error of the oracle: the true form with fitted parameters.
    #[must_use]
    pub fn oracle_error(&self) -> f64 {
        let exact = |effects: &[Effect]| self.case.exact_values(self.scenes[0], effects);
        self.error(&self.pair.fit_effects(self.case, STEPS, exact))
    }

    fn error(&self, effects: &[Effect]) -> f64 {
        let [training, unseen] = self.scenes.map(|scene| self.case.exact_values(scene, effects));
        self.pair.error(&training, &unseen)
    }

    fn values(&self, scene: &Scene, predicted: &Predicted) -> Option<Vec<f64>> {
        let view = &self.case.instrument;
        let rows = scene.rows.len();
        match predicted {
            Predicted::Tools(tools) if tools.len() == rows && !view.points.is_empty() => {
                let measured = |tool: &Transform| mul(&view.measuring_from_base, tool);
                let points = |tool: &Transform| -> Vec<f64> {
                    let measured = measured(tool);
                    view.points
                        .iter()
                        .flat_map(|place| transform_point(&measured, *place))
                        .collect()
                };
                Some(tools.iter().flat_map(points).collect())
            }
            Predicted::Links(links) if links.len() == rows && view.points.is_empty() => {
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
    use crate::generate;

    #[test]
    fn the_oracle_comes_down_to_the_noise_and_the_true_robot_is_worth_as_much() {
        for index in 0..12 {
            let generated = generate::generate_case(6, index, (Tier::Single, 3 * index));
            let case = &generated.case;
            let unseen = case.unseen_scene();
            let evaluation = Evaluation::of(case, &unseen);
            let (before, oracle) = (evaluation.nominal_error(), evaluation.oracle_error());
            let noise = case.noise.total_sigma();
            let kind = case.hidden[0].kind;
            assert!(oracle < 1.08 * noise, "{kind:?}: {oracle} of noise {noise}");
            assert!(oracle < before, "{kind:?}: {oracle} from {before}");
            let all = case.true_effects();
            let predicted = |scene: &Scene| {
                let run = Run::new(scene, &all);
                let (motors, deviations) = (run.motor_positions(), run.deviations(&all));
                if case.instrument.points.is_empty() {
                    let width = case.instrument.values_per_row(scene);
                    let values = case.instrument.values(scene, &motors, &deviations);
                    return Predicted::Links(values.chunks(width).map(<[f64]>::to_vec).collect());
                }
                let tools = motors.iter().zip(&deviations);
                Predicted::Tools(
                    tools
                        .map(|(q, deviation)| crate::deviation::tool_pose(&scene.arm, q, deviation))
                        .collect(),
                )
            };
            let truth = evaluation
                .predicted_error(&predicted(&case.scene), &predicted(&unseen))
                .expect("rows");
            assert!((truth / oracle - 1.0).abs() < 0.08, "{kind:?}: {truth} and {oracle}");
        }
    }
}
