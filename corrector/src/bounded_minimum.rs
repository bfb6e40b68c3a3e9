//! Minimises a strictly convex quadratic function within bounds on each joint, by a primal
//! active-set method.
//!
//! Invariant: the result is within the bounds for any matrix. No heap; independent of the robot.

use libm::sqrt;
use physics::{JOINTS_MAX, Joints};

/// A symmetric matrix of the joints.
pub(crate) type JointMatrix = [Joints; JOINTS_MAX];

/// Limit on changes of the active set, per joint: random problems take fewer than two.
const CHANGES_PER_JOINT: usize = 6;
/// A multiplier counts as violated beyond this share of the largest gradient component; less is
/// rounding.
const MULTIPLIER_TOLERANCE: f64 = 1e-12;

/// Range of each joint, rad or m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) low: Joints,
    pub(crate) high: Joints,
}

/// The minimum of `½ xᵀ A x − gᵀ x` within bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Minimum {
    pub(crate) x: Joints,
    /// Joints at an active bound.
    pub(crate) at_bound: [bool; JOINTS_MAX],
}

/// Minimises from `start`; `None` if the matrix is not positive definite or holds a value that is
/// not finite.
pub(crate) fn minimize(
    count: usize,
    a: &JointMatrix,
    g: &Joints,
    bounds: &Bounds,
    start: &Joints,
) -> Option<Minimum> {
    let mut x = *start;
    let mut at_bound = [false; JOINTS_MAX];
    for i in 0..count {
        x[i] = x[i].max(bounds.low[i]).min(bounds.high[i]);
        at_bound[i] = x[i] == bounds.low[i] || x[i] == bounds.high[i];
    }
    let scale = g[..count].iter().fold(0.0_f64, |most, g| most.max(g.abs()));
    for _ in 0..CHANGES_PER_JOINT * count {
        let slope = negative_gradient(count, a, g, &x);
        let step = free_step(count, a, &slope, &at_bound)?;
        let (share, blocking) = longest_feasible_step(count, &x, &step, &at_bound, bounds);
        for i in (0..count).filter(|i| !at_bound[*i]) {
            x[i] = (x[i] + share * step[i]).max(bounds.low[i]).min(bounds.high[i]);
        }
        if let Some(i) = blocking {
            x[i] = if step[i] > 0.0 { bounds.high[i] } else { bounds.low[i] };
            at_bound[i] = true;
            continue;
        }
        let slope = negative_gradient(count, a, g, &x);
        let inward = |i: usize| {
            let up = if x[i] < bounds.high[i] { slope[i] } else { 0.0 };
            let down = if x[i] > bounds.low[i] { -slope[i] } else { 0.0 };
            up.max(down)
        };
        let freed =
            (0..count).filter(|i| at_bound[*i]).max_by(|i, k| inward(*i).total_cmp(&inward(*k)));
        match freed.filter(|i| inward(*i) > MULTIPLIER_TOLERANCE * scale) {
            Some(i) => at_bound[i] = false,
            None => return Some(Minimum { x, at_bound }),
        }
    }
    // Rounding repeats changes of the active set without end: the point reached is within the
    // bounds and minimal up to rounding.
    Some(Minimum { x, at_bound })
}

/// `g − A x`.
fn negative_gradient(count: usize, a: &JointMatrix, g: &Joints, x: &Joints) -> Joints {
    let mut slope = *g;
    for i in 0..count {
        for k in 0..count {
            slope[i] -= a[i][k] * x[k];
        }
    }
    slope
}

/// The largest share of a step that stays within the bounds, and the joint whose bound limits it.
fn longest_feasible_step(
    count: usize,
    x: &Joints,
    step: &Joints,
    at_bound: &[bool; JOINTS_MAX],
    bounds: &Bounds,
) -> (f64, Option<usize>) {
    let (mut share, mut blocking) = (1.0, None);
    for i in (0..count).filter(|i| !at_bound[*i] && step[*i] != 0.0) {
        let room = if step[i] > 0.0 { bounds.high[i] - x[i] } else { bounds.low[i] - x[i] };
        let reached = (room / step[i]).max(0.0);
        if reached < share {
            (share, blocking) = (reached, Some(i));
        }
    }
    (share, blocking)
}

/// The Newton step of the free joints, by Cholesky factorisation; rows of joints at a bound become
/// rows of the unit matrix.
pub(crate) fn free_step(
    count: usize,
    a: &JointMatrix,
    slope: &Joints,
    at_bound: &[bool; JOINTS_MAX],
) -> Option<Joints> {
    let mut l = [[0.0; JOINTS_MAX]; JOINTS_MAX];
    let mut step = [0.0; JOINTS_MAX];
    for i in 0..count {
        for k in 0..=i {
            let entry = match (at_bound[i] || at_bound[k], i == k) {
                (false, _) => a[i][k],
                (true, true) => 1.0,
                (true, false) => 0.0,
            };
            let rest = entry - (0..k).map(|j| l[i][j] * l[k][j]).sum::<f64>();
            if i == k {
                // Also false for NaN.
                if !(rest > 0.0 && rest < f64::INFINITY) {
                    return None;
                }
                l[i][i] = sqrt(rest);
            } else {
                l[i][k] = rest / l[k][k];
            }
        }
        let right = if at_bound[i] { 0.0 } else { slope[i] };
        step[i] = (right - (0..i).map(|j| l[i][j] * step[j]).sum::<f64>()) / l[i][i];
    }
    for i in (0..count).rev() {
        step[i] = (step[i] - (i + 1..count).map(|j| l[j][i] * step[j]).sum::<f64>()) / l[i][i];
    }
    step.iter().all(|x| x.is_finite()).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_lowest_point_is_within_bounds_and_stationary(
            count in 1..=JOINTS_MAX,
            rows in prop::collection::vec(prop::array::uniform16(-1.0..1.0_f64), 6),
            g in prop::array::uniform16(-1.0..1.0_f64),
            low in prop::array::uniform16(-1.0..=0.0_f64),
            high in prop::array::uniform16(0.0..1.0_f64),
            damping in -6.0..0.0_f64,
        ) {
            let mut a = [[0.0; JOINTS_MAX]; JOINTS_MAX];
            for (i, k) in (0..count).flat_map(|i| (0..count).map(move |k| (i, k))) {
                a[i][k] = rows.iter().map(|row| row[i] * row[k]).sum();
                a[i][k] += if i == k { 10.0_f64.powf(damping) } else { 0.0 };
            }
            let bounds = Bounds { low, high };
            let found = minimize(count, &a, &g, &bounds, &[0.0; JOINTS_MAX]).expect("positive definite");
            let slope = negative_gradient(count, &a, &g, &found.x);
            for i in 0..count {
                prop_assert!((low[i]..=high[i]).contains(&found.x[i]));
                prop_assert!(found.x[i] == high[i] || slope[i] < 1e-8, "joint {i}: {}", slope[i]);
                prop_assert!(found.x[i] == low[i] || slope[i] > -1e-8, "joint {i}: {}", slope[i]);
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_or_no_number_has_no_lowest_point() {
        let bounds = Bounds { low: [-1.0; JOINTS_MAX], high: [1.0; JOINTS_MAX] };
        for entry in [0.0, -1.0, f64::NAN] {
            let a = [[entry; JOINTS_MAX]; JOINTS_MAX];
            assert!(minimize(3, &a, &[1.0; JOINTS_MAX], &bounds, &[0.0; JOINTS_MAX]).is_none());
        }
    }
}
