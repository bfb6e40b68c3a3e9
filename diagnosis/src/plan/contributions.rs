//! Contribution of each pose in sequence: reduced uncertainty of parameters and of the tool position.
//!
//! The values after the last pose are those of a fit of all poses, if the form of the model is right.

use super::candidate_jacobians::{CandidateJacobians, state};
use super::pose_selection::{inverse, log_det};
use super::task::Task;
use crate::fit_result::ColumnNames;
use crate::hypothesis::parameter_key;
use nalgebra::DMatrix;
use physics::{JointKind, Joints};

/// Number of parameters listed for each pose.
const PARAMETERS_LISTED: usize = 2;

/// A parameter whose uncertainty decreases.
#[derive(Clone, Debug, PartialEq)]
pub struct UncertaintyReduction {
    /// Name of the parameter.
    pub what: String,
    /// Standard uncertainty before, SI units.
    pub from: f64,
    /// Standard uncertainty after, SI units.
    pub to: f64,
    /// Suffix of its unit in files, and the value of that unit in SI.
    pub unit: (&'static str, f64),
}

/// A pose with its contribution in addition to all poses before it.
#[derive(Clone, Debug)]
pub struct PoseContribution {
    /// Joint positions, rad or m.
    pub q: Joints,
    /// Number of scalar readings.
    pub readings: usize,
    /// Increase of the log determinant of the information matrix.
    pub log_det_gain: f64,
    /// The O1 index including this pose; `None` while a parameter is undetermined.
    pub o1: Option<f64>,
    /// RMS of the expected tool error at the test poses, m: before and after.
    pub tool_m: [f64; 2],
    /// The parameters whose uncertainty decreases most.
    pub reductions: Vec<UncertaintyReduction>,
}

/// State of knowledge after a number of poses.
struct Now {
    covariance: DMatrix<f64>,
    log_det: f64,
    tool_m: f64,
}

/// Standard uncertainty of every parameter, without and with `picks`.
pub(super) fn parameter_uncertainties(
    task: &Task,
    jacobians: &CandidateJacobians,
    picks: &[usize],
) -> Vec<UncertaintyReduction> {
    let mut information = jacobians.prior_information.clone();
    let before = evaluate(jacobians, &information);
    picks.iter().for_each(|pick| information += information_of(jacobians, *pick));
    let after = evaluate(jacobians, &information);
    let state = state(task);
    (jacobians.nuisance_count..jacobians.columns.len())
        .map(|k| reduction(task, jacobians, &ColumnNames(&state), k, [&before, &after]))
        .collect()
}

fn reduction(
    task: &Task,
    jacobians: &CandidateJacobians,
    names: &ColumnNames<'_>,
    k: usize,
    [before, after]: [&Now; 2],
) -> UncertaintyReduction {
    let sigma =
        |now: &Now| (jacobians.design_effect * now.covariance[(k, k)]).sqrt() * jacobians.scales[k];
    let column = jacobians.columns[k];
    UncertaintyReduction {
        what: names.of(column),
        from: sigma(before),
        to: sigma(after),
        unit: unit(task, column),
    }
}

pub(super) fn information_of(jacobians: &CandidateJacobians, pick: usize) -> DMatrix<f64> {
    jacobians.jacobians[pick].transpose() * &jacobians.jacobians[pick]
}

/// RMS of the expected tool error at the test poses, m.
pub(super) fn tool_error_m(jacobians: &CandidateJacobians, information: &DMatrix<f64>) -> f64 {
    evaluate(jacobians, information).tool_m
}

fn evaluate(jacobians: &CandidateJacobians, information: &DMatrix<f64>) -> Now {
    let covariance = inverse(information);
    let around =
        information.view((0, 0), (jacobians.nuisance_count, jacobians.nuisance_count)).into_owned();
    let log_det = log_det(information.clone()) - log_det(around);
    let tool_m = (jacobians.design_effect * (&jacobians.tool_error_form * &covariance).trace())
        .max(0.0)
        .sqrt();
    Now { covariance, log_det, tool_m }
}

/// Contribution of each of `picks` in this order.
pub(super) fn contributions(
    task: &Task,
    jacobians: &CandidateJacobians,
    picks: &[usize],
) -> Vec<PoseContribution> {
    let state = state(task);
    let names = ColumnNames(&state);
    let mut information = jacobians.prior_information.clone();
    let (mut data, mut read) = jacobians.measured_information.clone();
    let mut before = evaluate(jacobians, &information);
    let mut added = Vec::with_capacity(picks.len());
    for pick in picks {
        let square = information_of(jacobians, *pick);
        information += &square;
        data += square;
        let readings = jacobians.jacobians[*pick].nrows();
        read += readings;
        let after = evaluate(jacobians, &information);
        let mut order: Vec<(usize, f64)> = (jacobians.nuisance_count..jacobians.columns.len())
            .map(|k| (k, (before.covariance[(k, k)] / after.covariance[(k, k)]).ln()))
            .collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1));
        let falls = order
            .iter()
            .take(PARAMETERS_LISTED)
            .map(|(k, _)| reduction(task, jacobians, &names, *k, [&before, &after]));
        added.push(PoseContribution {
            q: jacobians.candidates[*pick].q,
            readings,
            log_det_gain: after.log_det - before.log_det,
            o1: o1_index(jacobians, &data, read),
            tool_m: [before.tool_m, after.tool_m],
            reductions: falls.collect(),
        });
        before = after;
    }
    added
}

/// Unit of a parameter: suffix in files and value in SI.
fn unit(task: &Task, column: usize) -> (&'static str, f64) {
    let first = task.surroundings.parameters().len();
    let free = column.checked_sub(first).and_then(|k| task.hypothesis.free.get(k));
    let found = free.and_then(|free| {
        let effect = task.hypothesis.effect_of(free)?;
        let joint = effect.joint().and_then(|joint| task.arm().joints().get(joint));
        let kind = joint.map_or(JointKind::Revolute, |joint| joint.kind);
        Some(parameter_key(effect, free.value)?.parameter.unit.suffix_and_si(kind))
    });
    found.unwrap_or(("_mm", 1e-3))
}

/// O1 index of the readings alone, `(s₁ … s_L)^(1/L) / √n`, with the extrinsic parameters projected out.
fn o1_index(jacobians: &CandidateJacobians, data: &DMatrix<f64>, read: usize) -> Option<f64> {
    let nuisance = jacobians.nuisance_count;
    let found = jacobians.columns.len() - nuisance;
    let whole = log_det(data.clone());
    let around = log_det(data.view((0, 0), (nuisance, nuisance)).into_owned());
    let mean = (whole - around) / (2.0 * found as f64);
    (mean.is_finite() && read > 0).then(|| mean.exp() / (read as f64).sqrt())
}
