//! Search for flexible modes of joints and base with unknown frequency.
//!
//! The response of each joint to its own acceleration and load, at every frequency of a grid, is a column; the grid is refined about the best
//! frequency. The gain is computed from the same rows and whitening as for any candidate. Only frequencies below the Nyquist limit are searched. The
//! best modes are further candidates; `selection` decides.

use super::jacobian_cache::JacobianCache;
use crate::campaign::Campaign;
use crate::candidates::{Candidate, ModeExcitation, is_physical, mode_candidate};
use crate::path_dynamics::{ElementDisplacement, PathDynamics, paths};
use crate::score_test::{CandidateScore, ColumnGroups, ScoreTest};
use crate::tool_motion::ToolMotion;
use physics::{AnyEffect, Arm, Chain, Contribution, Evaluation, Joints};
use world::dynamics::VibratingPart;

/// Ratio of neighbouring frequencies of the grid.
const STEP: f64 = 1.12;
/// Damping ratios of the coarse grid: one with a resonance wide enough for the spacing of frequencies, one for lightly damped modes.
const COARSE_DAMPINGS: [f64; 2] = [0.1, 0.02];
/// Damping ratios of the fine grid, and its frequencies relative to the best one.
const FINE_DAMPINGS: [f64; 3] = [0.01, 0.03, 0.1];
const FINE_FREQUENCIES: [f64; 7] = [0.94, 0.96, 0.98, 1.0, 1.02, 1.04, 1.06];
/// Lowest natural frequency of a robot, Hz.
const LOWEST_HZ: f64 = 1.0;
/// Highest frequency relative to the sampling rate, and least number of periods per path.
const FREQUENCY_SHARE_MAX: f64 = 0.45;
const PERIODS_MIN: f64 = 10.0;
/// Gain in the sum of squares below which the grid is not refined.
const REFINEMENT_GAIN_MIN: f64 = 15.0;
/// Standard deviations of the priors of participation (no unit) and dynamic compliance, rad/(N m) or m/N.
const SIGMA: [f64; 2] = [3.0, 2e-3];
/// Change of a load that excites no mode, N m or N.
const LOAD_CHANGE_MIN: f64 = 1e-6;

/// A joint or an axis of the base, and what excites it.
#[derive(Clone, Copy, Debug)]
struct Trial {
    joint: Option<usize>,
    axis: Option<[f64; 3]>,
    driven: ModeExcitation,
}

/// The best mode of every joint and of the base, if its gain is large enough. `cache` keeps the columns of the coarse grid.
pub(super) fn modes(fitted: &ScoreTest<'_>, cache: &JacobianCache) -> Vec<Candidate> {
    let Some((lowest, highest)) = band(fitted.campaign) else { return Vec::new() };
    let arm = &fitted.state.hypothesis.model.arm;
    let rides = PathDynamics::for_all_paths(&fitted.state.hypothesis.model, fitted.campaign);
    let mut list = Vec::new();
    let mut frequency = lowest;
    while frequency < highest {
        list.extend(COARSE_DAMPINGS.map(|damping| (frequency, damping)));
        frequency *= STEP;
    }
    let trials = trials(arm, fitted.campaign);
    let first: Vec<Candidate> =
        trials.iter().flat_map(|trial| mode_candidates(arm, trial, &list)).collect();
    let kept = cache.mode_columns(fitted, || columns(fitted, &rides, &first));
    let first = scored(fitted, &rides, &first, &kept);
    let gain_min = REFINEMENT_GAIN_MIN * fitted.fit.design_effect;
    let closer = trials.iter().filter_map(|trial| {
        let (candidate, gain) = strongest(&first, trial)?;
        let centre = candidate.probes.first()?.effect.values()[0];
        let refined = |by: &f64| FINE_DAMPINGS.map(|damping| (by * centre, damping));
        let refined: Vec<(f64, f64)> = FINE_FREQUENCIES.iter().flat_map(refined).collect();
        (gain > gain_min).then(|| mode_candidates(arm, trial, &refined))
    });
    let closer: Vec<Candidate> = closer.flatten().collect();
    let second = scored(fitted, &rides, &closer, &columns(fitted, &rides, &closer));
    trials.iter().filter_map(|trial| Some(strongest(&second, trial)?.0.clone())).collect()
}

fn strongest<'a>(scored: &'a [(Candidate, f64)], trial: &Trial) -> Option<(&'a Candidate, f64)> {
    let of_trial = scored.iter().filter(|(candidate, _)| is_of_trial(candidate, trial));
    of_trial.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(candidate, gain)| (candidate, *gain))
}

/// Lowest and highest frequency, Hz, that can be identified from the paths.
fn band(campaign: &Campaign) -> Option<(f64, f64)> {
    let times = |pose: usize| campaign.poses[pose].inputs.time_s;
    let longest = paths(campaign).max_by(|a, b| a.len().cmp(&b.len()))?;
    let length_s = times(longest.end - 1) - times(longest.start);
    let rate_hz = (longest.len() - 1) as f64 / length_s;
    (length_s > 0.0)
        .then_some(((PERIODS_MIN / length_s).max(LOWEST_HZ), FREQUENCY_SHARE_MAX * rate_hz))
}

/// Joints that move, and joints and base under a varying load.
fn trials(arm: &Arm, campaign: &Campaign) -> Vec<Trial> {
    let first = campaign.poses.first().map(|pose| pose.inputs);
    let changes = |quantity: &dyn Fn(&physics::Inputs) -> f64, minimum: f64| {
        let first = first.as_ref().map_or(0.0, quantity);
        campaign.poses.iter().any(|pose| (quantity(&pose.inputs) - first).abs() > minimum)
    };
    let wrench = changes(&|inputs| inputs.wrench_base.force.length(), LOAD_CHANGE_MIN)
        || changes(&|inputs| inputs.wrench_base.moment.length(), LOAD_CHANGE_MIN);
    let mut trials = Vec::new();
    for joint in 0..arm.count() {
        let moves = changes(&|inputs| inputs.q[joint], 1e-6);
        let mut add = |driven| trials.push(Trial { joint: Some(joint), axis: None, driven });
        if moves {
            add(ModeExcitation::Motion);
        }
        if wrench {
            add(if moves { ModeExcitation::Both } else { ModeExcitation::Load });
        }
    }
    if wrench || arm.bodies().next().is_some() {
        for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
            trials.push(Trial { joint: None, axis: Some(axis), driven: ModeExcitation::Load });
        }
    }
    trials
}

fn mode_candidates(arm: &Arm, trial: &Trial, list: &[(f64, f64)]) -> Vec<Candidate> {
    let candidate = |numbers: &(f64, f64)| {
        mode_candidate(arm, (trial.joint, trial.axis), *numbers, trial.driven)
    };
    list.iter().filter_map(candidate).collect()
}

fn is_of_trial(candidate: &Candidate, trial: &Trial) -> bool {
    let axis = candidate.settings.first().map(|(_, axis)| axis.as_slice());
    let same_axis = axis == trial.axis.as_ref().map(<[f64; 3]>::as_slice);
    let numbers = if trial.driven == ModeExcitation::Both { 2 } else { 1 };
    candidate.joint == trial.joint && same_axis && numbers == candidate.probes.len()
}

/// Displacement by each candidate's mode of unit size, pose by pose.
fn columns(
    fitted: &ScoreTest<'_>,
    rides: &PathDynamics,
    candidates: &[Candidate],
) -> Vec<ElementDisplacement> {
    let model = &fitted.state.hypothesis.model;
    let mut columns = Vec::new();
    for probe in candidates.iter().flat_map(|candidate| &candidate.probes) {
        let mut effect = probe.effect;
        effect.values_mut()[probe.value] = 1.0;
        let AnyEffect::OverPath(effect) = effect else { continue };
        columns.push(rides.column(model, &effect, fitted.campaign.poses.len()));
    }
    columns
}

/// Each candidate with the gain that it alone would bring; `columns` by [`columns()`].
fn scored(
    fitted: &ScoreTest<'_>,
    rides: &PathDynamics,
    candidates: &[Candidate],
    columns: &[ElementDisplacement],
) -> Vec<(Candidate, f64)> {
    let model = &fitted.state.hypothesis.model;
    let sigma = |value: usize| SIGMA[usize::from(value == 3)];
    let groups = ColumnGroups {
        column_counts: candidates.iter().map(|candidate| candidate.probes.len()).collect(),
        sigmas: candidates.iter().flat_map(|c| &c.probes).map(|p| sigma(p.value)).collect(),
    };
    let units = UnitDisplacements::of(&model.arm, columns);
    let (mut now, mut moved) = (usize::MAX, Vec::new());
    let scores = fitted.scores_along(&groups, |reading, into| {
        if now != reading.pose {
            now = reading.pose;
            moved = units.at(&rides.inputs(fitted.campaign, now).q);
        }
        let along = |((_, by), unit): (&ElementDisplacement, &usize)| {
            let (unit, by): (&ToolMotion, f64) = (&moved[*unit], by[now]);
            reading
                .rows
                .along_parts((unit.turn * by, unit.shift * by), |joint| unit.joints[joint] * by)
        };
        into.extend(columns.iter().zip(&units.of_column).map(along));
    });
    let sound = |score: &CandidateScore| is_physical(&candidates[score.candidate], &score.values);
    let sound = scores.into_iter().filter(sound);
    sound.map(|score| (candidates[score.candidate].clone(), score.gain)).collect()
}

/// Tool displacement per unit deflection of each joint or axis that oscillates.
struct UnitDisplacements<'a> {
    arm: &'a Arm,
    rings: Vec<VibratingPart>,
    /// Index in `rings` for each column.
    of_column: Vec<usize>,
}

impl<'a> UnitDisplacements<'a> {
    fn of(arm: &'a Arm, columns: &[ElementDisplacement]) -> Self {
        let mut rings: Vec<VibratingPart> = Vec::new();
        let mut place = |one: &VibratingPart| {
            rings.iter().position(|other| other == one).unwrap_or_else(|| {
                rings.push(*one);
                rings.len() - 1
            })
        };
        let of_column = columns.iter().map(|(one, _)| place(one)).collect();
        Self { arm, rings, of_column }
    }

    /// Displacements at the joint positions `q`, rad or m.
    fn at(&self, q: &Joints) -> Vec<ToolMotion> {
        let nominal = Chain::nominal(self.arm, q);
        let undeformed = Evaluation { nominal, real: nominal, ..Evaluation::default() };
        let unit = |rings: &VibratingPart| match *rings {
            VibratingPart::Joint(joint) => ToolMotion::of_joint(self.arm, &nominal, joint),
            VibratingPart::Base(axis) => {
                let turn = Contribution::BaseTurn { turn: axis };
                ToolMotion::of(self.arm, &undeformed, &turn).unwrap_or_default()
            }
        };
        self.rings.iter().map(unit).collect()
    }
}
