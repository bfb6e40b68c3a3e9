//! Contribution of each pose in sequence: reduced uncertainty of parameters and of the tool position.
//!
//! Promises: the values of the last pose are those of a fit of all of them, assuming the right form of the model.

use super::bank::{Bank, state};
use super::choose::{inverse, log_det};
use super::task::Task;
use crate::hypothesis::named;
use crate::result::Names;
use nalgebra::DMatrix;
use physics::{JointKind, Joints};

/// Numbers that are named for one pose.
const NAMED: usize = 2;

/// A number that becomes surer.
#[derive(Clone, Debug, PartialEq)]
pub struct Falls {
    /// Its name.
    pub what: String,
    /// Its standard uncertainty before, SI.
    pub from: f64,
    /// And after, SI.
    pub to: f64,
    /// Suffix of its unit in files, and that unit in SI.
    pub unit: (&'static str, f64),
}

/// A pose with what it brings after all before it.
#[derive(Clone, Debug)]
pub struct Added {
    /// Joint positions, rad or m.
    pub q: Joints,
    /// Numbers read there.
    pub readings: usize,
    /// By how much the logarithm of the information's determinant rises.
    pub log_det_gain: f64,
    /// The O1 index with it; none as long as something is open.
    pub o1: Option<f64>,
    /// Expected error of the tool at the poses asked, root of the mean square, m: before and after.
    pub tool_m: [f64; 2],
    /// The numbers whose uncertainty falls most.
    pub falls: Vec<Falls>,
}

/// What is known at one moment.
struct Now {
    covariance: DMatrix<f64>,
    log_det: f64,
    tool_m: f64,
}

/// Every number that is found, its uncertainty without and with `picks`.
pub(super) fn numbers(task: &Task, bank: &Bank, picks: &[usize]) -> Vec<Falls> {
    let mut information = bank.before.clone();
    let before = now(bank, &information);
    picks.iter().for_each(|pick| information += square(bank, *pick));
    let after = now(bank, &information);
    let state = state(task);
    (bank.nuisance..bank.columns.len())
        .map(|k| falls(task, bank, &Names(&state), k, [&before, &after]))
        .collect()
}

fn falls(
    task: &Task,
    bank: &Bank,
    names: &Names<'_>,
    k: usize,
    [before, after]: [&Now; 2],
) -> Falls {
    let sigma = |now: &Now| (bank.inflation * now.covariance[(k, k)]).sqrt() * bank.widths[k];
    let column = bank.columns[k];
    Falls {
        what: names.of(column),
        from: sigma(before),
        to: sigma(after),
        unit: unit(task, column),
    }
}

pub(super) fn square(bank: &Bank, pick: usize) -> DMatrix<f64> {
    bank.rows[pick].transpose() * &bank.rows[pick]
}

/// Expected error of the tool at the poses asked, m.
pub(super) fn tool_m(bank: &Bank, information: &DMatrix<f64>) -> f64 {
    now(bank, information).tool_m
}

fn now(bank: &Bank, information: &DMatrix<f64>) -> Now {
    let covariance = inverse(information);
    let around = information.view((0, 0), (bank.nuisance, bank.nuisance)).into_owned();
    let log_det = log_det(information.clone()) - log_det(around);
    let tool_m = (bank.inflation * (&bank.focus * &covariance).trace()).max(0.0).sqrt();
    Now { covariance, log_det, tool_m }
}

/// What each pick brings, in this order.
pub(super) fn gains(task: &Task, bank: &Bank, picks: &[usize]) -> Vec<Added> {
    let state = state(task);
    let names = Names(&state);
    let mut information = bank.before.clone();
    let (mut data, mut read) = bank.measured.clone();
    let mut before = now(bank, &information);
    let mut added = Vec::with_capacity(picks.len());
    for pick in picks {
        let square = square(bank, *pick);
        information += &square;
        data += square;
        let readings = bank.rows[*pick].nrows();
        read += readings;
        let after = now(bank, &information);
        let mut order: Vec<(usize, f64)> = (bank.nuisance..bank.columns.len())
            .map(|k| (k, (before.covariance[(k, k)] / after.covariance[(k, k)]).ln()))
            .collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1));
        let falls =
            order.iter().take(NAMED).map(|(k, _)| falls(task, bank, &names, *k, [&before, &after]));
        added.push(Added {
            q: bank.candidates[*pick].q,
            readings,
            log_det_gain: after.log_det - before.log_det,
            o1: o1(bank, &data, read),
            tool_m: [before.tool_m, after.tool_m],
            falls: falls.collect(),
        });
        before = after;
    }
    added
}

/// The unit of a column of the hypothesis.
fn unit(task: &Task, column: usize) -> (&'static str, f64) {
    let first = task.surroundings.numbers().len();
    let free = column.checked_sub(first).and_then(|k| task.hypothesis.free.get(k));
    let found = free.and_then(|free| {
        let effect = task.hypothesis.effect_of(free)?;
        let joint = effect.joint().and_then(|joint| task.arm().joints().get(joint));
        let kind = joint.map_or(JointKind::Revolute, |joint| joint.kind);
        Some(named(effect, free.value)?.parameter.unit.suffix_and_si(kind))
    });
    found.unwrap_or(("_mm", 1e-3))
}

/// `(s₁ … s_L)^(1/L) / √n` of the readings alone, the surroundings projected out.
fn o1(bank: &Bank, data: &DMatrix<f64>, read: usize) -> Option<f64> {
    let nuisance = bank.nuisance;
    let found = bank.columns.len() - nuisance;
    let whole = log_det(data.clone());
    let around = log_det(data.view((0, 0), (nuisance, nuisance)).into_owned());
    let mean = (whole - around) / (2.0 * found as f64);
    (mean.is_finite() && read > 0).then(|| mean.exp() / (read as f64).sqrt())
}
