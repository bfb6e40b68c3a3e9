//! Check whether a model still holds: few poses that reveal damage, and the test of the measurements there.
//!
//! Damage is a joint's offset, a tilt of its axis, or a shifted or rotated tool. Nuisance parameters are an unknown measuring frame and targets,
//! and the model's parameters within their stated uncertainty (correlations are not stated, so this is conservative).
//! Each damage is tested by a likelihood ratio: the reduction of the sum of squares is χ² for an undamaged robot, noncentral χ² for a damaged one (Kay,
//! Fundamentals of Statistical Signal Processing II, 6.5 and 7.6), combined by Bonferroni correction; a test of the whole sum detects other damage.
//! The lower tail of the sum is tested with all nuisance parameters fitted freely: a sum far too small raises no alarm, but is reported, since overstated noise
//! can mask damage.
//!
//! Promises: the requested false-alarm rate for an undamaged robot, if the form of the model and the stated noise are right. Never: a reported damage that the
//! poses cannot show.

mod evidence;

use super::bank::rows_of;
use super::choose::{choose, exchange};
use super::{NoPlan, Task, Wish, order};
use crate::campaign::Campaign;
use crate::fit::{Effort, Settings, fit};
use crate::hypothesis::{Belief, Free, Hypothesis};
use crate::problem::State;
use crate::robust::Influence;
use evidence::{Evidence, Look, least_seen};
use nalgebra::DMatrix;
use physics::{AnyEffect, Given, JointKind, Joints, Model};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// The unit in which damage is counted: 1 mrad or 1 mm.
const UNIT: f64 = 1e-3;
/// Damage that shows less than a noise at this many units cannot be seen.
const UNSEEN: f64 = 30.0;
/// Rivals are named within this much of the best explanation's gain.
const RIVAL: f64 = 6.0;

/// What may have been damaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// A joint stands off by an angle (a length), from 0.
    Offset(usize),
    /// A joint's axis is tilted, or the link before it bent, from 0.
    Tilt(usize),
    /// The tool was shifted.
    ToolShift,
    /// The tool was turned.
    ToolTurn,
}

/// How often a sound robot may alarm, and how surely damage is to be seen.
#[derive(Clone, Copy, Debug)]
pub struct Terms {
    /// Share of sound robots that alarm.
    pub alarm: f64,
    /// Share of damaged robots that alarm.
    pub power: f64,
}

/// How small a damage shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detectable {
    /// Which.
    pub damage: Damage,
    /// The least that is seen as surely as asked, in its worst direction, rad or m; none where some direction cannot be seen at all.
    pub least: Option<f64>,
}

/// Poses for a check.
#[derive(Clone, Debug)]
pub struct Checkup {
    /// In an order that keeps moves short, rad or m.
    pub poses: Vec<Joints>,
    /// What they show.
    pub detectable: Vec<Detectable>,
}

/// A damage that explains what was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspect {
    /// Which.
    pub damage: Damage,
    /// How large, rad or m: one number for an offset, two for a tilt, three for a tool (tool axes).
    pub size: Vec<f64>,
    /// The length's standard uncertainty, rad or m.
    pub sigma: f64,
    /// By how much it lowers the sum of squares, in noises.
    pub gain: f64,
}

/// What was measured against the model.
#[derive(Clone, Debug)]
pub struct Judgement {
    /// Whether the model still holds.
    pub holds: bool,
    /// Sum of squares in noises, the model's own uncertainty allowed for.
    pub sum: f64,
    /// What it is expected to be.
    pub freedom: usize,
    /// How probable such a sum, or a larger one, is for a sound robot.
    pub p: f64,
    /// The noise that explains the residuals, as a share of the stated one; given where they scatter less than chance allows: overstated noise hides damage.
    pub scatter: Option<f64>,
    /// Damage that explains it, best first; none where the model holds.
    pub suspects: Vec<Suspect>,
    /// Whether one of the suspects explains all of it.
    pub is_explained: bool,
    /// What these poses could show.
    pub detectable: Vec<Detectable>,
}

impl Judgement {
    /// Whether damage of any kind would have been detected; else nothing is known of the robot.
    #[must_use]
    pub fn is_informative(&self) -> bool {
        self.detectable.iter().any(|found| found.least.is_some())
    }
}

impl Damage {
    /// What it is called, for users.
    #[must_use]
    pub fn says(&self) -> String {
        match self {
            Self::Offset(joint) => format!("joint {} has a zero offset", joint + 1),
            Self::Tilt(joint) => format!("the axis of joint {} is tilted", joint + 1),
            Self::ToolShift => "the tool was shifted".to_owned(),
            Self::ToolTurn => "the tool was rotated".to_owned(),
        }
    }

    /// Whether it is an angle; else a length.
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

    /// The effect that stands for it, at zero; none where the arm has no such joint.
    #[must_use]
    pub fn effect(self, model: &Model) -> Option<AnyEffect> {
        let zeros = [0.0; 3];
        let (kind, joint, stem, count) = match self {
            Self::Offset(joint) => ("joint_offset", Some(joint), "offset", 1),
            Self::Tilt(joint) => ("axis_tilt", Some(joint), "tilt", 2),
            Self::ToolShift => ("tool_offset", None, "shift", 3),
            Self::ToolTurn => ("tool_offset", None, "turn", 3),
        };
        AnyEffect::build(kind, &model.arm, joint, Given(&[(stem, &zeros[..count])])).ok()
    }
}

/// A model, what may differ of it in a sound robot, and damages with their columns.
struct Watch {
    hypothesis: Hypothesis,
    /// How many of the free numbers may differ in a sound robot: the first ones.
    stated: usize,
    /// Damage, its first free number, how many.
    damages: Vec<(Damage, usize, usize)>,
}

impl Watch {
    fn of(model: &Model, sigma: &[Vec<f64>]) -> Self {
        let mut hypothesis = Hypothesis::fixed(*model);
        for ((effect, found), sigma) in model.effects().enumerate().zip(sigma) {
            for ((value, mean), sigma) in found.values().iter().enumerate().zip(sigma) {
                if *sigma > 0.0 {
                    hypothesis.free.push(Free {
                        effect,
                        value,
                        mean: *mean,
                        sigma: *sigma,
                        belief: Belief::Stated,
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
                hypothesis.free[first..].iter_mut().for_each(|free| free.sigma = UNIT);
                damages.push((damage, first, hypothesis.free.len() - first));
            }
        }
        Self { hypothesis, stated, damages }
    }

    fn state(&self, surroundings: &crate::Surroundings) -> State {
        State { surroundings: surroundings.clone(), hypothesis: self.hypothesis.clone() }
    }

    /// What each damage's columns are, after the surroundings' and the stated ones.
    fn looks(&self) -> Vec<Look> {
        self.damages
            .iter()
            .map(|(_, first, count)| Look { first: first - self.stated, count: *count })
            .collect()
    }

    fn detectable(&self, evidence: &Evidence, terms: &Terms) -> Vec<Detectable> {
        let tests = self.tests();
        let each = self.damages.iter().zip(self.looks());
        each.map(|((damage, ..), look)| {
            let weakest = evidence.weakest(look);
            let seen = weakest.filter(|noises| *noises > 1.0 / (UNSEEN * UNSEEN));
            let noises = least_seen(look.count, terms.alarm / tests, terms.power);
            Detectable { damage: *damage, least: seen.map(|seen| (noises / seen).sqrt() * UNIT) }
        })
        .collect()
    }

    /// Among how many tests the false alarms are shared: one per damage, and as much again for the sum.
    fn tests(&self) -> f64 {
        2.0 * self.damages.len().max(1) as f64
    }
}

/// The poses that show any damage best, to be measured as `task` says; its hypothesis is not looked at beyond the model, whose stated uncertainty is `sigma`.
/// `wish.criterion` is not looked at: what counts is the worst direction of each damage.
///
/// # Errors
/// Where fewer poses than wanted pass the constraints, or they show no damage.
pub fn poses(
    task: &Task,
    sigma: &[Vec<f64>],
    wish: &Wish,
    terms: &Terms,
) -> Result<Checkup, NoPlan> {
    let watch = Watch::of(&task.hypothesis.model, sigma);
    let mut rng = ChaCha8Rng::seed_from_u64(wish.seed);
    let drawn = task.draw(&mut rng, wish.candidates, wish.count)?;
    let state = watch.state(&task.surroundings);
    let all: Vec<usize> = (0..state.width()).collect();
    let rows = rows_of(&state, &drawn, &all);
    let nuisance = state.surroundings.numbers().len() + watch.stated;
    let widths = state.priors();
    let rows: Vec<DMatrix<f64>> = rows.into_iter().map(|rows| scaled(rows, &widths)).collect();
    let of = |picks: &[usize]| {
        let mut evidence = Evidence::new(nuisance, widths.len() - nuisance);
        picks.iter().for_each(|pick| evidence.add(&rows[*pick], &[]));
        evidence
    };
    let looks = watch.looks();
    let worths = |picks: &[usize]| of(picks).worths(&rows, &looks);
    let mut picks = choose(&worths, wish.count);
    exchange(&worths, &mut picks);
    let detectable = watch.detectable(&of(&picks), terms);
    if detectable.iter().all(|found| found.least.is_none()) {
        return Err(NoPlan::Nothing);
    }
    let arm = &task.hypothesis.model.arm;
    let stops: Vec<Joints> = picks.iter().map(|pick| drawn[*pick].q).collect();
    let order = order::visit(arm, &order::home(arm, &task.reach), &stops);
    Ok(Checkup { poses: order.into_iter().map(|place| stops[place]).collect(), detectable })
}

/// Whether `model`, its stated uncertainty `sigma`, still holds for what was measured in `campaign`; what the campaign's surroundings leave open is found
/// along. The noise is taken as stated.
#[must_use]
pub fn judge(campaign: &Campaign, model: &Model, sigma: &[Vec<f64>], terms: &Terms) -> Judgement {
    let watch = Watch::of(model, sigma);
    let used = vec![true; campaign.poses.len()];
    let settings =
        Settings { used: &used, influence: Influence::Equal, from: None, effort: Effort::Full };
    let around = fit(campaign, &Hypothesis::fixed(*model), &settings).surroundings;
    let state = watch.state(&around);
    let nuisance = state.surroundings.numbers().len() + watch.stated;
    let evidence = Evidence::of(campaign, &state, nuisance);
    let tests = watch.tests();
    let (sum, freedom) = (evidence.sum(), evidence.freedom(state.surroundings.numbers().len()));
    let p = evidence::p_above(freedom, sum);
    let (noise, noises) = evidence.noise();
    let is_quiet = evidence::p_below(noises, noise) < 0.5 * terms.alarm;
    // The noise, as a share of the stated one, at which the whole sum of squares has its expected value: the model's own error counts as noise.
    let share = (sum.max(0.0) / freedom.max(1) as f64).sqrt();
    let scatter = Some(share).filter(|share| is_quiet && *share < 1.0);
    let mut suspects = Vec::new();
    for ((damage, ..), look) in watch.damages.iter().zip(watch.looks()) {
        let Some(found) = evidence.explained(look) else { continue };
        let size: Vec<f64> = found.size.iter().map(|size| size * UNIT).collect();
        let suspect =
            Suspect { damage: *damage, size, sigma: found.sigma * UNIT, gain: found.gain };
        suspects.push((suspect, found.count));
    }
    let alarms = |(suspect, count): &&(Suspect, usize)| {
        evidence::p_above(*count, suspect.gain) < terms.alarm / tests
    };
    let holds = p >= 0.5 * terms.alarm && !suspects.iter().any(|suspect| alarms(&suspect));
    let detectable = watch.detectable(&evidence, terms);
    let price = |count: usize| count as f64 * (freedom.max(2) as f64).ln();
    suspects.retain(|suspect| !holds && alarms(&suspect));
    suspects.sort_by(|a, b| (b.0.gain - price(b.1)).total_cmp(&(a.0.gain - price(a.1))));
    let best = suspects.first().map_or(0.0, |(suspect, count)| suspect.gain - price(*count));
    suspects.retain(|(suspect, count)| suspect.gain - price(*count) > best - RIVAL);
    let rest = suspects.first().map(|(suspect, count)| {
        evidence::p_above(freedom.saturating_sub(*count), sum - suspect.gain)
    });
    let is_explained = rest.is_some_and(|p| p >= 0.5 * terms.alarm);
    let suspects = suspects.into_iter().map(|(suspect, _)| suspect).collect();
    Judgement { holds, sum, freedom, p, scatter, suspects, is_explained, detectable }
}

fn scaled(mut rows: DMatrix<f64>, widths: &[f64]) -> DMatrix<f64> {
    rows.column_iter_mut().zip(widths).for_each(|(mut column, width)| column *= *width);
    rows
}

#[cfg(test)]
mod tests;
