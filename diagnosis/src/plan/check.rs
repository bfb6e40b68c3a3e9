//! Test whether a model still holds: few poses that reveal damage, and the evaluation of measurements there.
//!
//! Damage is a joint's zero offset, a tilt of its axis, or a shifted or rotated tool. Nuisance parameters are an unknown measuring frame and targets,
//! and the model's parameters within their stated uncertainty (correlations are not stated, so this is conservative). Each damage is tested by a
//! likelihood ratio: the reduction of the sum of squares is χ² distributed for an undamaged robot and noncentral χ² for a damaged one (Kay,
//! Fundamentals of Statistical Signal Processing II, 6.5 and 7.6), combined by Bonferroni correction; a test of the whole sum detects other damage.
//!
//! The lower tail of the sum is tested with all nuisance parameters fitted freely: a sum far too small raises no alarm, but is reported, since
//! overstated noise can mask damage.
//!
//! Invariants: the false-alarm rate for an undamaged robot is the requested one, if the form of the model and the stated noise are right; damage that
//! the poses cannot show is not reported.

mod evidence;

use super::candidate_jacobians::whitened_jacobians;
use super::pose_selection::{exchange, select_greedily};
use super::{PlanError, PlanSettings, Task, pose_order};
use crate::campaign::Campaign;
use crate::fit::{FitSettings, fit};
use crate::hypothesis::{FreeParameter, Hypothesis, PriorSource};
use crate::least_squares::FitState;
use crate::robust_weights::Influence;
use evidence::{DamageColumns, Evidence, minimum_detectable};
use nalgebra::DMatrix;
use physics::{AnyEffect, JointKind, Joints, Model, ParameterValues};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Scale of the damage parameters: 1 mrad or 1 mm.
const DAMAGE_SCALE: f64 = 1e-3;
/// Largest damage, in units of [`DAMAGE_SCALE`], that must change the readings by their standard uncertainty for the damage to count as detectable.
const DAMAGE_MAX: f64 = 30.0;
/// Alternatives are listed if their penalised gain is within this much of the best one's.
const ALTERNATIVE_GAIN: f64 = 6.0;

/// Kinds of damage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// Zero offset of a joint, numbered from 0.
    Offset(usize),
    /// Tilted axis of a joint, numbered from 0, or bent link before it.
    Tilt(usize),
    /// Shifted tool.
    ToolShift,
    /// Rotated tool.
    ToolTurn,
}

/// Required error rates of the test.
#[derive(Clone, Copy, Debug)]
pub struct ErrorRates {
    /// Probability of an alarm for an undamaged robot.
    pub alarm: f64,
    /// Probability of an alarm for a damaged robot (power).
    pub power: f64,
}

/// Minimum detectable size of a damage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectableDamage {
    /// Kind of damage.
    pub damage: Damage,
    /// Size detected with the required power in the least observable direction, rad or m; `None` if a direction is not observable.
    pub least: Option<f64>,
}

/// Poses for a check.
#[derive(Clone, Debug)]
pub struct PlannedCheck {
    /// Joint positions in an order with short moves, rad or m.
    pub poses: Vec<Joints>,
    /// Minimum detectable damage with these poses.
    pub detectable: Vec<DetectableDamage>,
}

/// A damage that explains the measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct SuspectedDamage {
    /// Kind of damage.
    pub damage: Damage,
    /// Size, rad or m: one value for an offset, two for a tilt, three for a tool (tool axes).
    pub size: Vec<f64>,
    /// Standard uncertainty of the length of `size`, rad or m.
    pub sigma: f64,
    /// Reduction of the whitened sum of squares.
    pub gain: f64,
}

/// Result of a check.
#[derive(Clone, Debug)]
pub struct CheckResult {
    /// Whether the model still holds.
    pub holds: bool,
    /// Whitened sum of squares of the residuals, with nuisance parameters fitted within their priors.
    pub sum: f64,
    /// Its degrees of freedom.
    pub freedom: usize,
    /// p-value: probability of a sum at least as large for an undamaged robot.
    pub p: f64,
    /// Ratio of the noise that explains the residuals to the stated noise, if they scatter significantly less than stated: overstated noise masks
    /// damage.
    pub scatter: Option<f64>,
    /// Damages that explain the residuals, best first; empty if the model holds.
    pub suspects: Vec<SuspectedDamage>,
    /// Whether the best of them explains the residuals completely.
    pub is_explained: bool,
    /// Minimum detectable damage with these poses.
    pub detectable: Vec<DetectableDamage>,
}

impl CheckResult {
    /// Whether damage of any kind would have been detected; otherwise the check says nothing about the robot.
    #[must_use]
    pub fn is_informative(&self) -> bool {
        self.detectable.iter().any(|found| found.least.is_some())
    }
}

impl Damage {
    /// Description for users.
    #[must_use]
    pub fn says(&self) -> String {
        match self {
            Self::Offset(joint) => format!("joint {} has a zero offset", joint + 1),
            Self::Tilt(joint) => format!("the axis of joint {} is tilted", joint + 1),
            Self::ToolShift => "the tool was shifted".to_owned(),
            Self::ToolTurn => "the tool was rotated".to_owned(),
        }
    }

    /// Whether the size is an angle; otherwise a length.
    #[must_use]
    pub fn is_angle(&self, model: &Model) -> bool {
        match self {
            Self::Offset(joint) => model
                .arm
                .joints()
                .get(*joint)
                .is_some_and(|joint| joint.kind == JointKind::Revolute),
            Self::Tilt(_) | Self::ToolTurn => true,
            Self::ToolShift => false,
        }
    }

    /// The effect that represents it, with parameters of zero; `None` if the arm has no such joint.
    #[must_use]
    pub fn effect(self, model: &Model) -> Option<AnyEffect> {
        let zeros = [0.0; 3];
        let (kind, joint, stem, count) = match self {
            Self::Offset(joint) => ("joint_offset", Some(joint), "offset", 1),
            Self::Tilt(joint) => ("axis_tilt", Some(joint), "tilt", 2),
            Self::ToolShift => ("tool_offset", None, "shift", 3),
            Self::ToolTurn => ("tool_offset", None, "turn", 3),
        };
        AnyEffect::build(kind, &model.arm, joint, ParameterValues(&[(stem, &zeros[..count])])).ok()
    }
}

/// A model with its nuisance parameters and the parameters of all damages.
struct DamageModel {
    hypothesis: Hypothesis,
    /// Number of free parameters with a stated uncertainty; they precede those of the damages.
    stated: usize,
    /// Damage, index of its first free parameter, number of its parameters.
    damages: Vec<(Damage, usize, usize)>,
}

impl DamageModel {
    fn of(model: &Model, sigma: &[Vec<f64>]) -> Self {
        let mut hypothesis = Hypothesis::fixed(*model);
        for ((effect, found), sigma) in model.effects().enumerate().zip(sigma) {
            for ((value, mean), sigma) in found.values().iter().enumerate().zip(sigma) {
                if *sigma > 0.0 {
                    hypothesis.free.push(FreeParameter {
                        effect,
                        value,
                        mean: *mean,
                        sigma: *sigma,
                        prior_source: PriorSource::Stated,
                    });
                }
            }
        }
        let stated = hypothesis.free.len();
        let joints = 0..model.arm.count();
        let each = joints.clone().map(Damage::Offset).chain(joints.map(Damage::Tilt));
        let mut damages = Vec::new();
        for damage in each.chain([Damage::ToolShift, Damage::ToolTurn]) {
            let Some(effect) = damage.effect(model) else { continue };
            let first = hypothesis.free.len();
            if hypothesis.add(effect, &[]).is_ok() {
                hypothesis.free[first..].iter_mut().for_each(|free| free.sigma = DAMAGE_SCALE);
                damages.push((damage, first, hypothesis.free.len() - first));
            }
        }
        Self { hypothesis, stated, damages }
    }

    fn state(&self, surroundings: &crate::Extrinsics) -> FitState {
        FitState { surroundings: surroundings.clone(), hypothesis: self.hypothesis.clone() }
    }

    /// Columns of each damage, counted after those of the nuisance parameters.
    fn damage_columns(&self) -> Vec<DamageColumns> {
        self.damages
            .iter()
            .map(|(_, first, count)| DamageColumns { first: first - self.stated, count: *count })
            .collect()
    }

    fn detectable(&self, evidence: &Evidence, terms: &ErrorRates) -> Vec<DetectableDamage> {
        let tests = self.bonferroni_divisor();
        let each = self.damages.iter().zip(self.damage_columns());
        each.map(|((damage, ..), columns)| {
            let weakest = evidence.weakest(columns);
            let observable =
                weakest.filter(|information| *information > 1.0 / (DAMAGE_MAX * DAMAGE_MAX));
            let required = minimum_detectable(columns.count, terms.alarm / tests, terms.power);
            DetectableDamage {
                damage: *damage,
                least: observable.map(|observable| (required / observable).sqrt() * DAMAGE_SCALE),
            }
        })
        .collect()
    }

    /// Divisor of the false-alarm rate (Bonferroni): one test per damage, and the same share for the tests of the sum.
    fn bonferroni_divisor(&self) -> f64 {
        2.0 * self.damages.len().max(1) as f64
    }
}

/// Poses that best reveal any damage, with the measurement and constraints of `task`. Of its hypothesis only the model is used, with the stated
/// uncertainties `sigma`; `wish.criterion` is ignored, since the least observable direction of each damage counts.
///
/// # Errors
/// [`PlanError`] if fewer poses than required satisfy the constraints, or they reveal no damage.
pub fn plan_check(
    task: &Task,
    sigma: &[Vec<f64>],
    settings: &PlanSettings,
    terms: &ErrorRates,
) -> Result<PlannedCheck, PlanError> {
    let watch = DamageModel::of(&task.hypothesis.model, sigma);
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    let drawn = task.draw(&mut rng, settings.candidates, settings.count)?;
    let state = watch.state(&task.surroundings);
    let all: Vec<usize> = (0..state.width()).collect();
    let rows = whitened_jacobians(&state, &drawn, &all);
    let nuisance = state.surroundings.parameters().len() + watch.stated;
    let widths = state.prior_sigmas();
    let rows: Vec<DMatrix<f64>> = rows.into_iter().map(|rows| scaled(rows, &widths)).collect();
    let evidence_of = |picks: &[usize]| {
        let mut evidence = Evidence::new(nuisance, widths.len() - nuisance);
        picks.iter().for_each(|pick| evidence.add(&rows[*pick], &[]));
        evidence
    };
    let looks = watch.damage_columns();
    let worths = |picks: &[usize]| evidence_of(picks).worths(&rows, &looks);
    let mut picks = select_greedily(&worths, settings.count);
    exchange(&worths, &mut picks);
    let detectable = watch.detectable(&evidence_of(&picks), terms);
    if detectable.iter().all(|found| found.least.is_none()) {
        return Err(PlanError::NothingIdentifiable);
    }
    let arm = &task.hypothesis.model.arm;
    let stops: Vec<Joints> = picks.iter().map(|pick| drawn[*pick].q).collect();
    let order = pose_order::visit(arm, &pose_order::home(arm, &task.reach), &stops);
    Ok(PlannedCheck { poses: order.into_iter().map(|place| stops[place]).collect(), detectable })
}

/// Tests whether `model`, with its stated uncertainties `sigma`, still holds for the measurements of `campaign`. Unknown extrinsic parameters of the
/// campaign are fitted; the noise is taken as stated.
#[must_use]
pub fn check_model(
    campaign: &Campaign,
    model: &Model,
    sigma: &[Vec<f64>],
    terms: &ErrorRates,
) -> CheckResult {
    let watch = DamageModel::of(model, sigma);
    let used = vec![true; campaign.poses.len()];
    let settings = FitSettings::full(&used, Influence::Equal);
    let around = fit(campaign, &Hypothesis::fixed(*model), &settings).surroundings;
    let state = watch.state(&around);
    let nuisance = state.surroundings.parameters().len() + watch.stated;
    let evidence = Evidence::of(campaign, &state, nuisance);
    let tests = watch.bonferroni_divisor();
    let (sum, freedom) = (evidence.sum(), evidence.freedom(state.surroundings.parameters().len()));
    let p = evidence::p_above(freedom, sum);
    let (noise, freedom_of_noise) = evidence.noise();
    let is_quiet = evidence::p_below(freedom_of_noise, noise) < 0.5 * terms.alarm;
    // Relative noise at which the whole sum of squares has its expected value; it includes the error of the model.
    let share = (sum.max(0.0) / freedom.max(1) as f64).sqrt();
    let scatter = Some(share).filter(|share| is_quiet && *share < 1.0);
    let mut suspects = Vec::new();
    for ((damage, ..), columns) in watch.damages.iter().zip(watch.damage_columns()) {
        let Some(found) = evidence.explained(columns) else { continue };
        let size: Vec<f64> = found.size.iter().map(|size| size * DAMAGE_SCALE).collect();
        let suspect = SuspectedDamage {
            damage: *damage,
            size,
            sigma: found.sigma * DAMAGE_SCALE,
            gain: found.gain,
        };
        suspects.push((suspect, found.count));
    }
    let alarms = |(suspect, count): &&(SuspectedDamage, usize)| {
        evidence::p_above(*count, suspect.gain) < terms.alarm / tests
    };
    let holds = p >= 0.5 * terms.alarm && !suspects.iter().any(|suspect| alarms(&suspect));
    let detectable = watch.detectable(&evidence, terms);
    let penalty = |count: usize| count as f64 * (freedom.max(2) as f64).ln();
    suspects.retain(|suspect| !holds && alarms(&suspect));
    suspects.sort_by(|a, b| (b.0.gain - penalty(b.1)).total_cmp(&(a.0.gain - penalty(a.1))));
    let best = suspects.first().map_or(0.0, |(suspect, count)| suspect.gain - penalty(*count));
    suspects.retain(|(suspect, count)| suspect.gain - penalty(*count) > best - ALTERNATIVE_GAIN);
    let rest = suspects.first().map(|(suspect, count)| {
        evidence::p_above(freedom.saturating_sub(*count), sum - suspect.gain)
    });
    let is_explained = rest.is_some_and(|p| p >= 0.5 * terms.alarm);
    let suspects = suspects.into_iter().map(|(suspect, _)| suspect).collect();
    CheckResult { holds, sum, freedom, p, scatter, suspects, is_explained, detectable }
}

fn scaled(mut rows: DMatrix<f64>, widths: &[f64]) -> DMatrix<f64> {
    rows.column_iter_mut().zip(widths).for_each(|(mut column, width)| column *= *width);
    rows
}

#[cfg(test)]
mod tests;
