//! Hidden effects: one random effect that the calibrated model lacks, by seed.
//!
//! First the effect, then joint, sign, direction and phase are drawn (`templates`); then its size: so
//! that it affects the work, exceeds the instrument's noise on the measuring program, and stays
//! plausible. The same effect at the same place is removed from the calibrated model, so that the
//! hidden effect is missing and not merely inaccurate.
//!
//! A seed determines one effect, which moves the tool by the requested size. The draw does not
//! depend on a diagnosis.

pub mod templates;

use crate::random::{Purpose, stream};
use crate::robot::settled_path;
use crate::survey::REFLECTORS_TOOL;
use physics::{AnyEffect, Frame, Inputs, Model, ModelError};
use rand::RngExt;
use templates::{EffectTemplate, KINDS};
use thiserror::Error;

/// Range of its displacement of the tool on the work, root mean square, m.
const ON_WORK_M: (f64, f64) = (60e-6, 120e-6);
/// Least displacement if the largest size does not reach that range, m.
const ON_WORK_LEAST_M: f64 = 12e-6;
/// Largest displacement of a reflector on the measuring program, root mean square of single values,
/// m.
const ON_SURVEY_MOST_M: f64 = 4e-4;
/// Least displacement of a reflector, in standard uncertainties of the instrument.
const MIN_SIGNAL_TO_NOISE: f64 = 2.5;
/// Number of draws of joint and parameters for an effect, and of effects.
const DRAWS_PER_KIND: usize = 24;
const KIND_DRAWS: usize = 200;
/// Waves of one joint count as different if they are further apart than this, cycles per
/// revolution.
const MIN_CYCLES_DIFFERENCE: f64 = 0.5;

/// Model and motions for which an effect is drawn.
#[derive(Clone, Copy, Debug)]
pub struct HiddenEffectContext<'a> {
    /// The calibrated model.
    pub model: &'a Model,
    /// The work: consecutive rows.
    pub work: &'a [Inputs],
    /// The measuring program.
    pub survey: &'a [Inputs],
    /// Standard uncertainty of a measured value, m.
    pub noise_m: f64,
}

/// A hidden effect.
#[derive(Clone, Debug, PartialEq)]
pub struct HiddenEffect {
    /// The effect.
    pub effect: AnyEffect,
    /// Which effects of the calibrated model are kept in the daemon's model.
    pub kept: Vec<bool>,
    /// Its displacement of the tool on the work, root mean square, m.
    pub on_work_m: f64,
    /// Its displacement of a reflector on the measuring program, root mean square of single values,
    /// m.
    pub on_survey_m: f64,
}

/// Why no effect can be hidden.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum HideError {
    /// No draw had a suitable size.
    #[error(
        "no effect was found that is observable in this path and measuring program without collision or limit violation"
    )]
    Nothing,
    /// The model has no room.
    #[error(transparent)]
    Room(#[from] ModelError),
}

/// Draws the hidden effect of `seed`.
///
/// # Errors
/// See [`HideError`].
pub fn draw(stage: &HiddenEffectContext<'_>, seed: u64) -> Result<HiddenEffect, HideError> {
    let mut rng = stream(seed, Purpose::HiddenEffects, 0);
    for _ in 0..KIND_DRAWS {
        let kind = KINDS[rng.random_range(0..KINDS.len())];
        for _ in 0..DRAWS_PER_KIND {
            let wanted = rng.random_range(ON_WORK_M.0..ON_WORK_M.1);
            let Some(shape) = templates::draw(kind, stage.model, stage.survey, &mut rng) else {
                continue;
            };
            if let Some(hidden) = scaled_to_target(stage, &shape, wanted)? {
                return Ok(hidden);
            }
        }
    }
    Err(HideError::Nothing)
}

/// The effect with the requested size on the work; `None` if it cannot reach it.
fn scaled_to_target(
    stage: &HiddenEffectContext<'_>,
    shape: &EffectTemplate,
    wanted_m: f64,
) -> Result<Option<HiddenEffect>, HideError> {
    let arm = &stage.model.arm;
    let Some(largest) = shape.build(arm, 1.0) else { return Ok(None) };
    let kept: Vec<bool> =
        stage.model.effects().map(|other| !is_same_phenomenon(other, &largest)).collect();
    let known: Vec<AnyEffect> =
        stage.model.effects().zip(&kept).filter(|(_, kept)| **kept).map(|(e, _)| *e).collect();
    let known = Model::new(*arm, &known)?;
    let (work, survey) = (settled_path(&known, stage.work), settled_path(&known, stage.survey));
    let shows = |effect: AnyEffect| -> Result<[f64; 2], HideError> {
        let mut with = known;
        with.push(effect)?;
        let on_work = rms_distance(&work, &settled_path(&with, stage.work));
        Ok([on_work, rms_reflector_distance(&survey, &settled_path(&with, stage.survey))])
    };
    let [on_work, on_survey] = shows(largest)?;
    let share = (wanted_m / on_work).min(ON_SURVEY_MOST_M / on_survey).min(1.0);
    let Some(effect) = shape.build(arm, share).filter(|_| share.is_finite()) else {
        return Ok(None);
    };
    let [on_work_m, on_survey_m] = shows(effect)?;
    let is_seen =
        on_survey_m >= MIN_SIGNAL_TO_NOISE * stage.noise_m && on_work_m >= ON_WORK_LEAST_M;
    Ok(is_seen.then_some(HiddenEffect { effect, kept, on_work_m, on_survey_m }))
}

/// Root mean square distance of two tool positions, m.
fn rms_distance(one: &[Frame], other: &[Frame]) -> f64 {
    let squares = one.iter().zip(other).map(|(a, b)| (a.origin - b.origin).length_squared());
    libm::sqrt(squares.sum::<f64>() / one.len().max(1) as f64)
}

/// The same of the reflectors' single coordinates.
fn rms_reflector_distance(one: &[Frame], other: &[Frame]) -> f64 {
    let sum_of_squares = |(a, b): (&Frame, &Frame)| {
        REFLECTORS_TOOL.iter().map(|p| (a.point(*p) - b.point(*p)).length_squared()).sum::<f64>()
    };
    let squares: f64 = one.iter().zip(other).map(sum_of_squares).sum();
    libm::sqrt(squares / (3.0 * REFLECTORS_TOOL.len() as f64 * one.len().max(1) as f64))
}

/// Whether an effect of the model describes the same phenomenon at the same joint.
fn is_same_phenomenon(other: &AnyEffect, hidden: &AnyEffect) -> bool {
    let family = |effect: &AnyEffect| match effect.spec().kind {
        "joint_compliance" | "gravity_compliance" | "gravity_sag" | "load_compliance" => "load",
        "backlash" | "hysteresis" => "reversal",
        kind => kind,
    };
    let waves = matches!(hidden, AnyEffect::TransmissionError(_));
    let are_close = || (other.values()[1] - hidden.values()[1]).abs() < MIN_CYCLES_DIFFERENCE;
    other.joint() == hidden.joint() && family(other) == family(hidden) && (!waves || are_close())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::survey;
    use crate::test_arm::{effect, irb1600};
    use physics::effects::SPECS;
    use physics::spec::ActsOn;
    use std::collections::BTreeSet;

    fn calibrated() -> Model {
        let arm = irb1600();
        let effects = [
            effect(&arm, "joint_offset", 1, "offset", -3e-4),
            effect(&arm, "joint_compliance", 1, "compliance", 2.2e-6),
            effect(&arm, "joint_compliance", 2, "compliance", 1.1e-5),
            effect(&arm, "backlash", 4, "width", 2e-4),
        ];
        Model::new(arm, &effects).expect("room")
    }

    fn hidden(seed: u64) -> (Model, HiddenEffect) {
        let model = calibrated();
        let survey: Vec<Inputs> = survey(&model.arm).into_iter().step_by(5).collect();
        let work: Vec<Inputs> = survey.iter().step_by(10).copied().collect();
        let stage =
            HiddenEffectContext { model: &model, work: &work, survey: &survey, noise_m: 2e-5 };
        (model, draw(&stage, seed).expect("something shows"))
    }

    #[test]
    fn what_is_hidden_is_drawn_widely_shows_and_is_lacking() {
        let (mut kinds, mut joints) = (BTreeSet::new(), BTreeSet::new());
        for seed in 0..60 {
            let (model, hidden) = hidden(seed);
            kinds.insert(hidden.effect.spec().kind);
            joints.insert(hidden.effect.joint());
            assert!(hidden.on_survey_m >= 5e-5, "seed {seed}: {hidden:?}");
            assert!((ON_WORK_LEAST_M..=1.1 * ON_WORK_M.1).contains(&hidden.on_work_m));
            let kept = model.effects().zip(&hidden.kept).filter(|(_, kept)| **kept);
            let same = |e: &AnyEffect| {
                e.spec().kind == hidden.effect.spec().kind && e.joint() == hidden.effect.joint()
            };
            assert!(!kept.into_iter().any(|(e, _)| same(e)), "seed {seed}: {hidden:?}");
        }
        assert!(kinds.len() >= 14 && joints.len() == 7, "{kinds:?} {joints:?}");
    }

    #[test]
    fn a_seed_means_one_effect() {
        assert_eq!(hidden(11), hidden(11));
        assert_ne!(hidden(11).1.effect, hidden(12).1.effect);
    }

    #[test]
    fn every_effect_of_the_physics_that_moves_the_tool_may_be_hidden() {
        // A regression without physics; errors of the force sensor; dynamic effects, which need
        // speed.
        let not = ["joint_polynomial", "wrench_bias", "wrench_scale", "wrench_misalignment"];
        let moving = ["time_delay", "servo_lag", "flexible_mode", "reversal_spike"];
        for spec in SPECS {
            let torque = matches!(spec.acts_on, ActsOn::DriveTorque | ActsOn::ToolForce);
            let left_out = torque || not.contains(&spec.kind) || moving.contains(&spec.kind);
            assert_eq!(KINDS.contains(&spec.kind), !left_out, "{}", spec.kind);
        }
    }
}
