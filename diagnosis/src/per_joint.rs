//! The thesis' models of single joints (3.7 to 3.18) as special cases of the effects, and their parameters from sweeps.
//!
//! | thesis, as a deflection (actual minus commanded) | effects |
//! | --- | --- |
//! | joint 2: `A sin θ2 + B cos(θ2+θ3)` (3.7 to 3.10) | `gravity_sag`, upper arm and forearm |
//! | joint 3: `B (cos(θ2+θ3) − 1)` (3.14 with joint 3's own reference) | `gravity_sag`, forearm; the `−1` is the zero of the sweep |
//! | joint 4: `−B cos(θ2+θ3) sin θ4 sin θ5 + k θ4` (3.15, 3.16, signed) | `gravity_sag`, hand; `joint_ratio` |
//! | joint 5: `B (cos(θ2+θ3) cos θ4 cos θ5 − sin(θ2+θ3) sin θ5) + k θ5` (3.17, 3.18 corrected) | `gravity_sag`, hand; `joint_ratio` |
//!
//! Promises: parameters that sweeps do not determine are listed; each sweep has its own zero, so offsets are not estimated.
//! Never: torques from masses: if these are known, `gravity_compliance` is equivalent with one parameter.

use crate::hypothesis::{Belief, Free, Hypothesis};
use crate::independent::sort;
use crate::joint_error::JointErrors;
use crate::triangle::Triangle;
use glam::DVec3;
use physics::deviation::Contribution;
use physics::{AnyEffect, Arm, BuildError, Given, Memories, Model};

/// Gauss-Newton steps: one is exact where all numbers are linear, phases take a few.
const STEPS_MAX: usize = 20;
/// A constant and two shifts of the axis for each sweep.
const NUISANCES: usize = 3;

/// What sweeps of one joint say of a hypothesis' free numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct PerJoint {
    /// The hypothesis with what was found put in, each determined number with its prior for a global fit.
    pub hypothesis: Hypothesis,
    /// For each free number whether the sweeps determine it; the others stay as they were.
    pub determined: Vec<bool>,
    /// What stays, as root of the mean square in units of the stated noise.
    pub left: f64,
}

/// The thesis' model of `joint` (0-based, 1 to 4) for an arm like its own (upper arm and forearm turn about parallel axes, a wrist of three), all its numbers
/// free from zero. Joints that the thesis gives no sag get `joint_ratio` alone.
///
/// # Errors
/// An arm of too few joints, or of others.
pub fn thesis_model(arm: &Arm, joint: usize) -> Result<Hypothesis, BuildError> {
    let mut hypothesis = Hypothesis::fixed(Model::nominal(*arm));
    let first = |link: usize| (link - joint) * 3;
    // Bodies hang on their first moment along the link: upper arm (body 2), forearm (3), hand (5).
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
        let effect = AnyEffect::build("gravity_sag", arm, Some(joint), Given(&[("sag", &zeros)]))?;
        push(&mut hypothesis, effect, &sag, 5e-3);
    }
    if ![1, 2].contains(&joint) {
        let effect =
            AnyEffect::build("joint_ratio", arm, Some(joint), Given(&[("ratio", &[0.0])]))?;
        push(&mut hypothesis, effect, &[0], 5e-4);
    }
    Ok(hypothesis)
}

/// The free numbers of `hypothesis` from sweeps, each sweep with a constant and a shift of its axis of its own: Gauss-Newton on the joints' errors,
/// from where the numbers stand. Their priors only say how large they may be.
#[must_use]
pub fn regress(hypothesis: &Hypothesis, sweeps: &[JointErrors]) -> PerJoint {
    let mut at = hypothesis.clone();
    let numbers = at.free.len();
    let nuisances = NUISANCES * sweeps.len();
    // Nuisances first: what a constant or a shifted axis explains is theirs. Shifts are in units of their uncertainty, and always in.
    let mut widths = [0.1, 1e3, 1e3].repeat(sweeps.len());
    widths.extend(at.free.iter().map(|free| free.sigma));
    let mut steps = 0;
    loop {
        let triangle = linearised(&at, sweeps);
        let (kept, _) = sort(&triangle, &widths);
        let part = triangle.of_columns(&kept);
        let mut step = vec![0.0; numbers];
        for (column, by) in kept.iter().zip(part.solve(&[])) {
            if let Some(number) = column.checked_sub(nuisances) {
                step[number] = by;
            }
        }
        at = at.stepped(&step);
        steps += 1;
        let still = step.iter().zip(&at.free).all(|(by, free)| by.abs() <= 1e-9 * free.sigma);
        if still || steps == STEPS_MAX {
            return finish(at, &part, &kept, nuisances);
        }
    }
}

fn finish(mut at: Hypothesis, part: &Triangle, kept: &[usize], nuisances: usize) -> PerJoint {
    let inverse = part.inverse();
    let values = at.values();
    let mut determined = vec![false; at.free.len()];
    for (row, column) in inverse.iter().zip(kept) {
        if let Some(number) = column.checked_sub(nuisances) {
            determined[number] = true;
            at.free[number].mean = values[number];
            at.free[number].sigma = row.iter().map(|x| x * x).sum::<f64>().sqrt();
            at.free[number].belief = Belief::Stated;
        }
    }
    let free = part.rows().saturating_sub(kept.len()).max(1);
    PerJoint { hypothesis: at, determined, left: (part.rest() / free as f64).sqrt() }
}

/// Rows: one for each step, in units of its noise, and what the axes' uncertainty says of their shifts. Columns: the nuisances of each sweep, then the
/// free numbers.
fn linearised(at: &Hypothesis, sweeps: &[JointErrors]) -> Triangle {
    let wanted: Vec<(usize, usize)> =
        at.free.iter().map(|free| (free.effect, free.value)).collect();
    let memories = Memories::default();
    let first = NUISANCES * sweeps.len();
    let mut triangle = Triangle::new(first + wanted.len());
    for (place, sweep) in sweeps.iter().enumerate() {
        let of_joint = |contribution: &Contribution| match *contribution {
            Contribution::Joint { joint, delta } if joint == sweep.joint => delta,
            _ => 0.0,
        };
        let nuisance = NUISANCES * place;
        let root = square_root(sweep.shift_covariance);
        for seen in &sweep.steps {
            let mut row = vec![0.0; first + wanted.len()];
            row[nuisance] = 1.0;
            row[nuisance + 1] = seen.by_shift[0] * root[0][0] + seen.by_shift[1] * root[1][0];
            row[nuisance + 2] = seen.by_shift[1] * root[1][1];
            at.model.derivatives(&seen.inputs, &memories, &wanted, |k, derivative| {
                row[first + k] = of_joint(derivative);
            });
            let mut said = 0.0;
            at.model.contributions(&seen.inputs, &memories, |_, c| said += of_joint(c));
            // Steps without any noise count as measured to a nanoradian.
            let sigma = seen.sigma_rad.max(1e-9);
            row.iter_mut().for_each(|x| *x /= sigma);
            triangle.push(&row, (seen.mean_rad - said) / sigma);
        }
        (1..NUISANCES).for_each(|shift| triangle.push_one(nuisance + shift, 1.0, 0.0));
    }
    triangle.reduce();
    triangle
}

/// The lower triangle `L` of `L Lᵀ`.
fn square_root(covariance: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    let [[xx, _], [yx, yy]] = covariance;
    let first = xx.max(0.0).sqrt();
    let across = if first > 0.0 { yx / first } else { 0.0 };
    [[first, 0.0], [across, (yy - across * across).max(0.0).sqrt()]]
}

fn push(hypothesis: &mut Hypothesis, effect: AnyEffect, values: &[usize], sigma: f64) {
    let index = hypothesis.model.effects().len();
    // A nominal model has room for two effects.
    if hypothesis.model.push(effect).is_ok() {
        let free = |value: &usize| Free {
            effect: index,
            value: *value,
            mean: 0.0,
            sigma,
            belief: Belief::Guard,
        };
        hypothesis.free.extend(values.iter().map(free));
    }
}

/// Which of x, y, z (0 to 2) a vector has most of.
fn largest_entry(v: DVec3) -> usize {
    (0..3).max_by(|a, b| v[*a].abs().total_cmp(&v[*b].abs())).unwrap_or(0)
}

#[cfg(test)]
mod tests;
