//! Dynamic effects of a hypothesis (delay, lag, modes, reversal spikes) over the paths of a campaign.
//!
//! These effects do not act on single poses; they change the input positions and add deflections. Their derivatives are central differences of the
//! joint positions.
//!
//! Hypotheses without such effects are not evaluated here, and settled poses are unchanged.

use crate::campaign::Campaign;
use crate::hold_out::runs;
use crate::hypothesis::{FreeParameter, Hypothesis, plausible_size};
use crate::tool_motion::ToolMotion;
use physics::effects::OverPath;
use physics::{AnyEffect, Arm, Chain, Contribution, Evaluation, Inputs, Model};
use std::ops::Range;
use world::dynamics::{Dynamics, VibratingPart};
use world::executed_path::ExecutedPath;

/// Steps of a central difference, as fractions of the largest plausible value.
const STEP: f64 = 1e-3;

/// Runs of a campaign along a path, on which velocity and memory are defined.
pub(crate) fn paths(campaign: &Campaign) -> impl Iterator<Item = Range<usize>> {
    let is_path = |run: &Range<usize>| {
        let source = campaign.recordings.get(campaign.poses[run.start].recording);
        source.is_some_and(|source| source.is_path) && run.len() > 2
    };
    runs(campaign).into_iter().filter(is_path)
}

/// The paths of a campaign under one model's dynamics.
pub(crate) struct PathDynamics {
    paths: Vec<(Range<usize>, ExecutedPath)>,
    /// Index of the path of each pose; empty if no effect of the model needs one.
    of_pose: Vec<Option<usize>>,
}

impl PathDynamics {
    pub(crate) fn of(model: &Model, campaign: &Campaign) -> Self {
        let has_dynamics = model.effects().any(|effect| matches!(effect, AnyEffect::OverPath(_)));
        if has_dynamics {
            Self::for_all_paths(model, campaign)
        } else {
            Self { paths: Vec::new(), of_pose: Vec::new() }
        }
    }

    /// The same, even if no effect needs it.
    pub(crate) fn for_all_paths(model: &Model, campaign: &Campaign) -> Self {
        let dynamics = Dynamics::from_model(model);
        let mut of_pose = vec![None; campaign.poses.len()];
        let mut executed = Vec::new();
        for run in paths(campaign) {
            of_pose[run.clone()].fill(Some(executed.len()));
            let path = ExecutedPath::of(model, &dynamics, &rows(campaign, &run));
            executed.push((run, path));
        }
        Self { paths: executed, of_pose }
    }

    fn at(&self, pose: usize) -> Option<(&ExecutedPath, usize)> {
        let (run, ride) = self.paths.get((*self.of_pose.get(pose)?)?)?;
        Some((ride, pose - run.start))
    }

    /// Inputs of a pose after delay and lag.
    pub(crate) fn inputs<'a>(&'a self, campaign: &'a Campaign, pose: usize) -> &'a Inputs {
        self.at(pose).map_or(&campaign.poses[pose].inputs, |(ride, row)| &ride.inputs[row])
    }

    /// Adds the deflections of modes and reversal spikes to an evaluation.
    pub(crate) fn add_deflections(&self, arm: &Arm, pose: usize, evaluation: &mut Evaluation) {
        if let Some((ride, row)) = self.at(pose).filter(|(ride, _)| ride.has_deflections()) {
            ride.add_deflections(row, &mut evaluation.deviation);
            let q = &ride.inputs[row].q;
            evaluation.real = Chain::real(arm, q, &evaluation.deviation);
        }
    }

    /// Displacement due to a mode or spike at each pose.
    pub(crate) fn column(
        &self,
        model: &Model,
        effect: &OverPath,
        poses: usize,
    ) -> ElementDisplacement {
        let mut moved = (VibratingPart::Joint(0), vec![0.0; poses]);
        for (run, ride) in &self.paths {
            if let Some((rings, by)) = ride.effect_deflection(model, effect) {
                moved.0 = rings;
                moved.1[run.clone()].copy_from_slice(&by);
            }
        }
        moved
    }

    /// Derivatives of the motion of joints and base by each free parameter of a dynamic effect; empty for other parameters.
    pub(crate) fn derivatives(
        &self,
        hypothesis: &Hypothesis,
        campaign: &Campaign,
    ) -> DynamicDerivatives {
        let effects: Vec<&AnyEffect> = hypothesis.model.effects().collect();
        let derivative_of = |(place, free): (usize, &FreeParameter)| match effects.get(free.effect)
        {
            Some(AnyEffect::OverPath(effect)) => {
                Some((place, self.slope(hypothesis, campaign, (free, effect))))
            }
            _ => None,
        };
        DynamicDerivatives {
            of_free: hypothesis.free.iter().enumerate().filter_map(derivative_of).collect(),
        }
    }

    fn slope(
        &self,
        hypothesis: &Hypothesis,
        campaign: &Campaign,
        (free, effect): (&FreeParameter, &OverPath),
    ) -> Vec<ElementDisplacement> {
        let whole = AnyEffect::OverPath(*effect);
        let value = effect.values()[free.value];
        let step = STEP * plausible_size(&whole, free.value);
        // A time constant cannot be negative, so at zero the difference is one-sided.
        let below = if effect.spec().kind == "servo_lag" { step.min(value) } else { step };
        let with_value = |value: f64| {
            let mut effect = *effect;
            effect.values_mut()[free.value] = value;
            effect
        };
        let (low, high) = (with_value(value - below), with_value(value + step));
        let width = step + below;
        let mut moved: Vec<ElementDisplacement> = Vec::new();
        for (run, ride) in &self.paths {
            let model = &hypothesis.model;
            let of_one = |effect| ride.effect_deflection(model, effect);
            if let (Some((rings, low)), Some((_, high))) = (of_one(&low), of_one(&high)) {
                let into = series(&mut moved, rings, campaign.poses.len());
                let both = low.iter().zip(&high);
                into[run.clone()].iter_mut().zip(both).for_each(|(d, (l, h))| *d = (h - l) / width);
                continue;
            }
            let rows = rows(campaign, run);
            let ridden = |effect: &OverPath| {
                let mut model = *hypothesis.model;
                model.change(free.effect, |place| *place = AnyEffect::OverPath(*effect));
                ExecutedPath::of(&model, &Dynamics::from_model(&model), &rows)
            };
            let (low, high) = (ridden(&low), ridden(&high));
            let joints = effect.joint().map_or(0..model.arm.count(), |joint| joint..joint + 1);
            for rings in joints.map(VibratingPart::Joint) {
                let into = series(&mut moved, rings, campaign.poses.len());
                for (row, d) in into[run.clone()].iter_mut().enumerate() {
                    *d = (high.position(rings, row) - low.position(rings, row)) / width;
                }
            }
        }
        moved
    }
}

/// The commanded inputs of a run.
fn rows(campaign: &Campaign, run: &Range<usize>) -> Vec<Inputs> {
    campaign.poses[run.clone()].iter().map(|pose| pose.inputs).collect()
}

/// The series of one moving element (joint or base), one value per pose; added if missing.
fn series(
    moved: &mut Vec<ElementDisplacement>,
    part: VibratingPart,
    poses: usize,
) -> &mut Vec<f64> {
    let place = moved.iter().position(|(rings, _)| *rings == part).unwrap_or_else(|| {
        moved.push((part, vec![0.0; poses]));
        moved.len() - 1
    });
    &mut moved[place].1
}

/// The moving element, and its displacement at each pose.
pub(crate) type ElementDisplacement = (VibratingPart, Vec<f64>);

/// For each free parameter of a dynamic effect: the displacement at each pose per unit of the parameter.
pub(crate) struct DynamicDerivatives {
    of_free: Vec<(usize, Vec<ElementDisplacement>)>,
}

impl DynamicDerivatives {
    /// Writes the motions at a pose to the entries of their parameters.
    pub(crate) fn fill(
        &self,
        arm: &Arm,
        evaluation: &Evaluation,
        pose: usize,
        motions: &mut [ToolMotion],
    ) {
        for (place, moved) in &self.of_free {
            let mut sum = ToolMotion::default();
            for (rings, by) in moved {
                let one = match *rings {
                    VibratingPart::Joint(joint) => {
                        Some(ToolMotion::of_joint(arm, &evaluation.real, joint))
                    }
                    VibratingPart::Base(axis) => {
                        ToolMotion::of(arm, evaluation, &Contribution::BaseTurn { turn: axis })
                    }
                };
                sum = sum.plus(&one.unwrap_or_default().scaled(by[pose]));
            }
            motions[*place] = sum;
        }
    }
}
