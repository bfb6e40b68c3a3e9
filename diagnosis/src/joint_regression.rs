//! The thesis' models of single joints (3.7 to 3.18) as special cases of the effects, and their parameters from sweeps.
//!
//! | thesis, as a deflection (actual minus commanded) | effects |
//! | --- | --- |
//! | joint 2: `A sin θ2 + B cos(θ2+θ3)` (3.7 to 3.10) | `gravity_sag`, upper arm and forearm |
//! | joint 3: `B (cos(θ2+θ3) − 1)` (3.14 with joint 3's own reference) | `gravity_sag`, forearm; the `−1` is the zero of the sweep |
//! | joint 4: `−B cos(θ2+θ3) sin θ4 sin θ5 + k θ4` (3.15, 3.16, signed) | `gravity_sag`, hand; `joint_ratio` |
//! | joint 5: `B (cos(θ2+θ3) cos θ4 cos θ5 − sin(θ2+θ3) sin θ5) + k θ5` (3.17, 3.18 corrected) | `gravity_sag`, hand; `joint_ratio` |
//!
//! Parameters that sweeps do not determine are listed; each sweep has its own zero, so offsets are not estimated. Masses are not used: if they are
//! known, `gravity_compliance` is equivalent with one parameter.

use crate::hypothesis::{FreeParameter, Hypothesis, PriorSource};
use crate::identifiability::split_identifiable;
use crate::joint_error::JointErrors;
use crate::qr::QrFactor;
use glam::DVec3;
use physics::deviation::Contribution;
use physics::{AnyEffect, Arm, BuildError, Memories, Model, ParameterValues};

/// Largest number of Gauss-Newton steps: one is exact if all parameters are linear, phases take a few.
const STEPS_MAX: usize = 20;
/// Nuisance parameters per sweep: a constant and two shifts of the axis.
const NUISANCES: usize = 3;

/// Parameters of a hypothesis estimated from the sweeps of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct SingleJointRegression {
    /// The hypothesis with the estimated values, each determined parameter with its prior for a global fit.
    pub hypothesis: Hypothesis,
    /// Whether the sweeps determine each free parameter; the others are unchanged.
    pub determined: Vec<bool>,
    /// Root mean square residual, in units of the stated noise.
    pub residual_rms: f64,
}

/// The thesis' model of `joint` (0-based, 1 to 4) for an arm like its robot (upper arm and forearm on parallel axes, wrist of three joints), with all
/// parameters free and initially zero. Joints without gravity deflection in the thesis get only `joint_ratio`.
///
/// # Errors
/// An arm with too few joints, or with a structure other than that of the thesis.
pub fn thesis_model(arm: &Arm, joint: usize) -> Result<Hypothesis, BuildError> {
    let mut hypothesis = Hypothesis::fixed(Model::nominal(*arm));
    let first = |link: usize| (link - joint) * 3;
    // Deflection depends on the first mass moment of a body along its link: upper arm (body 2), forearm (3), hand (5).
    let along = |from: usize, to: usize| {
        let point = |i: usize| arm.joints().get(i).map_or(arm.tool.tcp, |joint| joint.point);
        largest_entry(point(to) - point(from))
    };
    let sag: Vec<usize> = match joint {
        1 => vec![first(1) + along(1, 2), first(2) + along(2, 4)],
        2 => vec![along(2, 4)],
        3 => vec![first(4) + along(4, arm.count())],
        4 => vec![along(4, arm.count())],
        _ => Vec::new(),
    };
    if !sag.is_empty() {
        let zeros = vec![0.0; 3 * arm.count().saturating_sub(joint)];
        let effect =
            AnyEffect::build("gravity_sag", arm, Some(joint), ParameterValues(&[("sag", &zeros)]))?;
        push(&mut hypothesis, effect, &sag, 5e-3);
    }
    if ![1, 2].contains(&joint) {
        let effect = AnyEffect::build(
            "joint_ratio",
            arm,
            Some(joint),
            ParameterValues(&[("ratio", &[0.0])]),
        )?;
        push(&mut hypothesis, effect, &[0], 5e-4);
    }
    Ok(hypothesis)
}

/// Estimates the free parameters of `hypothesis` from sweeps, with a constant and a shift of the axis per sweep as nuisance parameters: Gauss-Newton
/// on the joint errors, from the present values. The priors only scale the test whether a parameter is determined.
#[must_use]
pub fn regress(hypothesis: &Hypothesis, sweeps: &[JointErrors]) -> SingleJointRegression {
    let mut hypothesis = hypothesis.clone();
    let numbers = hypothesis.free.len();
    let nuisances = NUISANCES * sweeps.len();
    // Nuisance parameters come first: what a constant or a shifted axis explains is assigned to them. Shifts are in units of their uncertainty, and
    // always included.
    let mut widths = [0.1, 1e3, 1e3].repeat(sweeps.len());
    widths.extend(hypothesis.free.iter().map(|free| free.sigma));
    let mut steps = 0;
    loop {
        let triangle = linearised(&hypothesis, sweeps);
        let (kept, _) = split_identifiable(&triangle, &widths);
        let part = triangle.of_columns(&kept);
        let mut step = vec![0.0; numbers];
        for (column, by) in kept.iter().zip(part.solve(&[])) {
            if let Some(number) = column.checked_sub(nuisances) {
                step[number] = by;
            }
        }
        hypothesis = hypothesis.stepped(&step);
        steps += 1;
        let still =
            step.iter().zip(&hypothesis.free).all(|(by, free)| by.abs() <= 1e-9 * free.sigma);
        if still || steps == STEPS_MAX {
            return finish(hypothesis, &part, &kept, nuisances);
        }
    }
}

fn finish(
    mut hypothesis: Hypothesis,
    part: &QrFactor,
    kept: &[usize],
    nuisances: usize,
) -> SingleJointRegression {
    let inverse = part.inverse();
    let values = hypothesis.values();
    let mut determined = vec![false; hypothesis.free.len()];
    for (row, column) in inverse.iter().zip(kept) {
        if let Some(number) = column.checked_sub(nuisances) {
            determined[number] = true;
            hypothesis.free[number].mean = values[number];
            hypothesis.free[number].sigma = row.iter().map(|x| x * x).sum::<f64>().sqrt();
            hypothesis.free[number].prior_source = PriorSource::Stated;
        }
    }
    let free = part.rows().saturating_sub(kept.len()).max(1);
    SingleJointRegression {
        hypothesis,
        determined,
        residual_rms: (part.rest() / free as f64).sqrt(),
    }
}

/// Rows: one per step, in units of its noise, and one per shift with its prior from the uncertainty of the axis. Columns: the nuisance parameters of
/// each sweep, then the free parameters.
fn linearised(hypothesis: &Hypothesis, sweeps: &[JointErrors]) -> QrFactor {
    let wanted: Vec<(usize, usize)> =
        hypothesis.free.iter().map(|free| (free.effect, free.value)).collect();
    let memories = Memories::default();
    let first = NUISANCES * sweeps.len();
    let mut triangle = QrFactor::new(first + wanted.len());
    for (place, sweep) in sweeps.iter().enumerate() {
        let of_joint = |contribution: &Contribution| match *contribution {
            Contribution::Joint { joint, delta } if joint == sweep.joint => delta,
            _ => 0.0,
        };
        let nuisance = NUISANCES * place;
        let root = square_root(sweep.shift_covariance);
        for step in &sweep.steps {
            let mut row = vec![0.0; first + wanted.len()];
            row[nuisance] = 1.0;
            row[nuisance + 1] = step.by_shift[0] * root[0][0] + step.by_shift[1] * root[1][0];
            row[nuisance + 2] = step.by_shift[1] * root[1][1];
            hypothesis.model.derivatives(&step.inputs, &memories, &wanted, |k, derivative| {
                row[first + k] = of_joint(derivative);
            });
            let mut predicted = 0.0;
            hypothesis
                .model
                .contributions(&step.inputs, &memories, |_, c| predicted += of_joint(c));
            // Steps without noise get a standard uncertainty of one nanoradian.
            let sigma = step.sigma_rad.max(1e-9);
            row.iter_mut().for_each(|x| *x /= sigma);
            triangle.push(&row, (step.mean_rad - predicted) / sigma);
        }
        (1..NUISANCES).for_each(|shift| triangle.push_one(nuisance + shift, 1.0, 0.0));
    }
    triangle.reduce();
    triangle
}

/// Lower Cholesky factor `L` with `L Lᵀ` equal to the covariance.
fn square_root(covariance: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    let [[xx, _], [yx, yy]] = covariance;
    let first = xx.max(0.0).sqrt();
    let across = if first > 0.0 { yx / first } else { 0.0 };
    [[first, 0.0], [across, (yy - across * across).max(0.0).sqrt()]]
}

fn push(hypothesis: &mut Hypothesis, effect: AnyEffect, values: &[usize], sigma: f64) {
    let index = hypothesis.model.effects().len();
    // Cannot fail: a nominal model has room for two effects.
    if hypothesis.model.push(effect).is_ok() {
        let free = |value: &usize| FreeParameter {
            effect: index,
            value: *value,
            mean: 0.0,
            sigma,
            prior_source: PriorSource::WideDefault,
        };
        hypothesis.free.extend(values.iter().map(free));
    }
}

/// Index (0 to 2) of the component with the largest absolute value.
fn largest_entry(v: DVec3) -> usize {
    (0..3).max_by(|a, b| v[*a].abs().total_cmp(&v[*b].abs())).unwrap_or(0)
}

#[cfg(test)]
mod tests;
