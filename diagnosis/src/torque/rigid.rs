//! Rigid-body torques: the part stated by the model, and its unknown inertial parameters.
//!
//! The parameters of a body refer to a point near it (its centre of mass, or its joint's pivot if unknown), so that each can have its own uncertainty.
//!
//! Promises: ten numbers per body, the payload's four at the TCP. Never: identifiability of the parameters.

use glam::{DMat3, DVec3};
use physics::dynamics::{INERTIAL, Inertial, Regressor};
use physics::{Arm, Body, Chain, JOINTS_MAX};

use super::motion::{Motion, Run};
use crate::engine::table::Column;

/// What may be believed of masses that nothing is known of: kg, kg m, kg m².
const UNKNOWN: [f64; 3] = [100.0, 50.0, 50.0];
/// What stated masses may be off by: share of the mass, distance of its centre, m, and radius of gyration, m.
const DOUBT: (f64, f64, f64) = (0.05, 0.02, 0.1);

/// The arm's masses over the rows: what they ask for, and columns for what may be wrong in them.
pub(super) struct Rigid {
    /// Per joint, the stated masses' torque, row by row.
    pub(super) stated: Vec<Vec<f64>>,
    /// Per joint and run, the same at every sample, from motion in the band of what turns sharply; empty where that is the torque's band, or nothing is stated.
    pub(super) sharp: Vec<Vec<Vec<f64>>>,
    /// Ten columns per body, then mass and first moment of a payload about the TCP.
    pub(super) columns: Vec<Column>,
    /// What is believed of each number but the payload's: its standard deviation.
    pub(super) beliefs: Vec<f64>,
}

/// A unit mass at a point, and a unit of first moment about it along each axis, as inertial parameters.
fn at_point(point: DVec3) -> [[f64; INERTIAL]; 4] {
    let moment = |axis: DVec3| {
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        let inertia = DMat3::from_diagonal(DVec3::splat(2.0 * point.dot(axis)))
            - outer(point, axis)
            - outer(axis, point);
        Inertial { mass: 0.0, first_moment: axis, inertia }.values()
    };
    let [x, y, z] = DVec3::AXES.map(moment);
    [Inertial::of(&Body::point_mass(1.0, point)).values(), x, y, z]
}

/// Columns of one body about `point`, one joint after the other: mass, first moment, inertia.
fn about(table: &[[f64; INERTIAL]; JOINTS_MAX], point: DVec3, joint: usize) -> [f64; INERTIAL] {
    let row = &table[joint];
    let dot = |p: [f64; INERTIAL]| p.iter().zip(row).map(|(a, b)| a * b).sum::<f64>();
    let [mass, x, y, z] = at_point(point).map(dot);
    [mass, x, y, z, row[4], row[5], row[6], row[7], row[8], row[9]]
}

/// Mass and first moment of a body about a point, told about another that lies `by` from it, m; `columns`: its ten about the first.
pub(super) fn carried(columns: [&Column; INERTIAL], by: DVec3) -> [Column; 4] {
    at_point(by).map(|numbers| {
        let sum = |joint: usize, rows: usize| {
            let parts: Vec<(&Column, f64)> = columns.iter().copied().zip(numbers).collect();
            Column::sum(&parts, joint, rows)
        };
        let parts =
            columns[0].parts.iter().map(|(joint, old)| (*joint, sum(*joint, old.len()).into()));
        Column { parts: parts.collect() }
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
        let mut columns: Vec<Vec<Vec<f64>>> =
            (0..INERTIAL * count + 4).map(|k| vec![Vec::new(); felt_by(k, count)]).collect();
        let mut stated = vec![Vec::new(); count];
        let is_narrow = motion.quick_hz > motion.band_hz;
        for run in &motion.runs {
            let (of_columns, of_stated) = over(arm, run, &points, is_narrow);
            // What is not linear in motion is not what smoothed motion says of it: it is told from motion as recorded, and passes the torque's filter itself.
            let extend = |all: &mut Vec<Vec<f64>>, own: Vec<Vec<f64>>| {
                let own = if is_narrow { run.each_at_rows(&own) } else { own };
                all.iter_mut().zip(own).for_each(|(all, own)| all.extend(own));
            };
            columns.iter_mut().zip(of_columns).for_each(|(all, own)| extend(all, own));
            extend(&mut stated, of_stated);
        }
        let beliefs = arm.joints().iter().flat_map(|joint| match joint.link {
            None => doubts(UNKNOWN[0], UNKNOWN[1], UNKNOWN[2]),
            Some(Body { mass, .. }) => {
                let (share, off, gyration) = DOUBT;
                doubts(share * mass, off * mass, gyration * gyration * mass)
            }
        });
        let beliefs = beliefs.collect();
        let column = |parts: Vec<Vec<f64>>| Column {
            parts: parts.into_iter().map(Into::into).enumerate().collect(),
        };
        let columns = columns.into_iter().map(column).collect();
        let is_stated = arm.tool.body.is_some() || arm.joints().iter().any(|j| j.link.is_some());
        let sharp = if is_narrow && is_stated { sharp(arm, motion) } else { Vec::new() };
        Self { stated, sharp, columns, beliefs }
    }
}

/// Per joint and run, what stated masses ask for at every sample.
fn sharp(arm: &Arm, motion: &Motion) -> Vec<Vec<Vec<f64>>> {
    let mut all = vec![Vec::with_capacity(motion.runs.len()); arm.count()];
    for run in &motion.runs {
        let samples = run.joints.first().map_or(0, |track| track.q.len());
        let each: Vec<_> =
            (0..samples).map(|k| physics::dynamics::inverse_dynamics(arm, &run.quick(k))).collect();
        for (joint, runs) in all.iter_mut().enumerate() {
            runs.push(each.iter().map(|torque| torque[joint]).collect());
        }
    }
    all
}

/// How many joints, from the first on, feel the body of a column.
fn felt_by(column: usize, count: usize) -> usize {
    (column / INERTIAL).min(count - 1) + 1
}

/// Columns and stated torque of one run: at every sample as recorded, or at its rows in the band.
fn over(
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
    let none = |k: usize| vec![Vec::with_capacity(samples.len()); felt_by(k, count)];
    let mut columns: Vec<Vec<Vec<f64>>> = (0..INERTIAL * count + 4).map(none).collect();
    let mut stated = vec![Vec::with_capacity(samples.len()); count];
    for sample in samples {
        let inputs = if is_narrow { run.raw(sample) } else { run.inputs(sample) };
        let torque = physics::dynamics::inverse_dynamics(arm, &inputs);
        stated.iter_mut().zip(torque.iter()).for_each(|(list, torque)| list.push(*torque));
        let chain = Chain::nominal(arm, &inputs.q);
        let regressor = Regressor::new(arm, &chain, &inputs, arm.gravity);
        for (body, point) in points.iter().enumerate() {
            let table = regressor.of_body(body);
            for joint in 0..=body {
                let mut push = |from: usize, numbers: [f64; INERTIAL]| {
                    let columns = columns[from..].iter_mut();
                    columns.zip(numbers).for_each(|(column, x)| column[joint].push(x));
                };
                push(INERTIAL * body, about(&table, *point, joint));
                if body + 1 == count {
                    push(INERTIAL * count, about(&table, arm.tool.tcp, joint));
                }
            }
        }
    }
    (columns, stated)
}

fn doubts(mass: f64, moment: f64, inertia: f64) -> [f64; INERTIAL] {
    let [m, h, i] = [mass, moment, inertia];
    [m, h, h, h, i, i, i, i, i, i]
}
