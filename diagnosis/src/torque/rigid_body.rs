//! Rigid-body torques: the part predicted from stated masses, and the regressor of the inertial parameters.
//!
//! Ten parameters per body (mass, first moment, inertia) and four of a payload at the TCP. Those of a body refer to a point near it (its centre of
//! mass, or the joint's point if unknown), so that each can have an independent prior. Identifiability is not decided here.

use glam::{DMat3, DVec3};
use physics::dynamics::{self, INERTIAL_PARAMETERS, InertialParameters};
use physics::{Arm, Body, Chain, JOINTS_MAX};

use super::motion::{Motion, Run};
use crate::engine::regression_data::Regressor;

/// Prior standard deviations of unstated inertial parameters: mass in kg, first moment in kg m, inertia in kg m².
const UNSTATED_SIGMA: [f64; 3] = [100.0, 50.0, 50.0];
/// Prior standard deviations of stated masses, where they are fitted: share of the mass, shift of its centre, m, and radius of gyration of the inertia
/// error, m.
const STATED_MASS_SIGMA: (f64, f64, f64) = (0.05, 0.02, 0.1);

/// Rigid-body torque of the stated masses, and columns of the inertial parameters.
pub(super) struct Rigid {
    /// Torque of the stated masses per joint, row by row, N m or N.
    pub(super) stated_torque: Vec<Vec<f64>>,
    /// Torque of the stated masses per joint and run at every sample, from motion of the wider bandwidth; empty if the torque's band is as wide, or
    /// no masses are stated.
    pub(super) at_samples: Vec<Vec<Vec<f64>>>,
    /// Ten columns per body, then mass and first moment of a payload about the TCP.
    pub(super) columns: Vec<Regressor>,
    /// Prior standard deviation of each inertial parameter, without the payload's.
    pub(super) prior_sigma: Vec<f64>,
}

/// Inertial parameters of a unit mass at a point, and of unit first moments about it along each axis.
fn at_point(point: DVec3) -> [[f64; INERTIAL_PARAMETERS]; 4] {
    let moment = |axis: DVec3| {
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        let inertia = DMat3::from_diagonal(DVec3::splat(2.0 * point.dot(axis)))
            - outer(point, axis)
            - outer(axis, point);
        InertialParameters { mass: 0.0, first_moment: axis, inertia }.values()
    };
    let [x, y, z] = DVec3::AXES.map(moment);
    [InertialParameters::of(&Body::point_mass(1.0, point)).values(), x, y, z]
}

/// Regressor of one joint for the inertial parameters of a body about `point`: mass, first moment, inertia.
fn regressor_about(
    table: &[[f64; INERTIAL_PARAMETERS]; JOINTS_MAX],
    point: DVec3,
    joint: usize,
) -> [f64; INERTIAL_PARAMETERS] {
    let row = &table[joint];
    let dot = |p: [f64; INERTIAL_PARAMETERS]| p.iter().zip(row).map(|(a, b)| a * b).sum::<f64>();
    let [mass, x, y, z] = at_point(point).map(dot);
    [mass, x, y, z, row[4], row[5], row[6], row[7], row[8], row[9]]
}

/// Columns of mass and first moment about a point displaced by `by`, m, from the ten columns of a body about the original point.
pub(super) fn shifted_to(columns: [&Regressor; INERTIAL_PARAMETERS], by: DVec3) -> [Regressor; 4] {
    at_point(by).map(|numbers| {
        let sum = |joint: usize, rows: usize| {
            let parts: Vec<(&Regressor, f64)> = columns.iter().copied().zip(numbers).collect();
            Regressor::linear_combination(&parts, joint, rows)
        };
        let parts =
            columns[0].parts.iter().map(|(joint, old)| (*joint, sum(*joint, old.len()).into()));
        Regressor { parts: parts.collect() }
    })
}

impl Rigid {
    pub(super) fn new(arm: &Arm, motion: &Motion) -> Self {
        let count = arm.count();
        let points: Vec<DVec3> = arm
            .joints()
            .iter()
            .map(|joint| joint.link.map_or(joint.point, |link| link.centre))
            .collect();
        let mut columns: Vec<Vec<Vec<f64>>> = (0..INERTIAL_PARAMETERS * count + 4)
            .map(|k| vec![Vec::new(); joints_affected(k, count)])
            .collect();
        let mut stated_torque = vec![Vec::new(); count];
        let is_narrow = motion.wide_band_hz > motion.band_hz;
        for run in &motion.runs {
            let (of_columns, of_stated) = evaluate_run(arm, run, &points, is_narrow);
            // Terms that are nonlinear in the motion are computed from unfiltered motion and filtered afterwards, since they would differ if computed
            // from filtered motion.
            let extend = |all: &mut Vec<Vec<f64>>, samples: Vec<Vec<f64>>| {
                let samples = if is_narrow { run.all_at_rows(&samples) } else { samples };
                all.iter_mut().zip(samples).for_each(|(all, samples)| all.extend(samples));
            };
            columns.iter_mut().zip(of_columns).for_each(|(all, of_run)| extend(all, of_run));
            extend(&mut stated_torque, of_stated);
        }
        let sigmas = arm.joints().iter().flat_map(|joint| match joint.link {
            None => prior_sigmas(UNSTATED_SIGMA[0], UNSTATED_SIGMA[1], UNSTATED_SIGMA[2]),
            Some(Body { mass, .. }) => {
                let (share, distance, gyration) = STATED_MASS_SIGMA;
                prior_sigmas(share * mass, distance * mass, gyration * gyration * mass)
            }
        });
        let prior_sigma = sigmas.collect();
        let column = |parts: Vec<Vec<f64>>| Regressor {
            parts: parts.into_iter().map(Into::into).enumerate().collect(),
        };
        let columns = columns.into_iter().map(column).collect();
        let is_stated = arm.tool.body.is_some() || arm.joints().iter().any(|j| j.link.is_some());
        let at_samples =
            if is_narrow && is_stated { stated_torque_at_samples(arm, motion) } else { Vec::new() };
        Self { stated_torque, at_samples, columns, prior_sigma }
    }
}

/// Torque of the stated masses per joint and run, at every sample.
fn stated_torque_at_samples(arm: &Arm, motion: &Motion) -> Vec<Vec<Vec<f64>>> {
    let mut all = vec![Vec::with_capacity(motion.runs.len()); arm.count()];
    for run in &motion.runs {
        let samples = run.joints.first().map_or(0, |track| track.q.len());
        let each: Vec<_> = (0..samples)
            .map(|k| physics::dynamics::inverse_dynamics(arm, &run.wide_band_inputs(k)))
            .collect();
        for (joint, runs) in all.iter_mut().enumerate() {
            runs.push(each.iter().map(|torque| torque[joint]).collect());
        }
    }
    all
}

/// Number of joints, from the first on, whose torque depends on the body of a column.
fn joints_affected(column: usize, count: usize) -> usize {
    (column / INERTIAL_PARAMETERS).min(count - 1) + 1
}

/// Columns and predicted torque of one run: at every sample from unfiltered motion, or at its rows from filtered motion.
fn evaluate_run(
    arm: &Arm,
    run: &Run,
    points: &[DVec3],
    is_narrow: bool,
) -> (Vec<Vec<Vec<f64>>>, Vec<Vec<f64>>) {
    let count = arm.count();
    let samples: Vec<usize> = match is_narrow {
        true => (0..run.joints.first().map_or(0, |track| track.q.len())).collect(),
        false => run.rows.clone(),
    };
    let none = |k: usize| vec![Vec::with_capacity(samples.len()); joints_affected(k, count)];
    let mut columns: Vec<Vec<Vec<f64>>> = (0..INERTIAL_PARAMETERS * count + 4).map(none).collect();
    let mut stated = vec![Vec::with_capacity(samples.len()); count];
    for sample in samples {
        let inputs = if is_narrow { run.unfiltered_inputs(sample) } else { run.inputs(sample) };
        let torque = physics::dynamics::inverse_dynamics(arm, &inputs);
        stated.iter_mut().zip(torque.iter()).for_each(|(list, torque)| list.push(*torque));
        let chain = Chain::nominal(arm, &inputs.q);
        let regressor = dynamics::Regressor::new(arm, &chain, &inputs, arm.gravity);
        for (body, point) in points.iter().enumerate() {
            let table = regressor.of_body(body);
            for joint in 0..=body {
                let mut push = |from: usize, numbers: [f64; INERTIAL_PARAMETERS]| {
                    let columns = columns[from..].iter_mut();
                    columns.zip(numbers).for_each(|(column, x)| column[joint].push(x));
                };
                push(INERTIAL_PARAMETERS * body, regressor_about(&table, *point, joint));
                if body + 1 == count {
                    push(INERTIAL_PARAMETERS * count, regressor_about(&table, arm.tool.tcp, joint));
                }
            }
        }
    }
    (columns, stated)
}

fn prior_sigmas(mass: f64, moment: f64, inertia: f64) -> [f64; INERTIAL_PARAMETERS] {
    let [m, h, i] = [mass, moment, inertia];
    [m, h, h, h, i, i, i, i, i, i]
}
