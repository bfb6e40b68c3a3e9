//! The best correction within bounds is feasible, stationary, no worse than none, and continuous
//! through singular poses and onto bounds.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

#[path = "support/random.rs"]
mod random;
mod support;

use corrector::{Reason, Solution, Task, solve};
use physics::{Chain, Inputs, JOINTS_MAX, Joints, Memories, Model};
use proptest::prelude::*;
use random::{arm, erring, errors, places, pose};
use support::six;

/// Weight of a radian where position takes precedence, m: half of the task's length.
const LENGTH_M: f64 = 0.1;

fn filled(q: &[f64]) -> Joints {
    let mut all = [0.0; JOINTS_MAX];
    all[..q.len()].copy_from_slice(q);
    all
}

fn solved(model: &Model, q: &Joints, reach: f64) -> Solution {
    let reach = [reach; JOINTS_MAX];
    solve(model, &Inputs::at_rest(*q), &Memories::default(), &Task::default(), &reach)
}

/// Half the square of the remaining error with the joints at `q`, m².
fn left(model: &Model, command: &Joints, q: &Joints) -> f64 {
    let real = model.evaluate(&Inputs::at_rest(*q), &Memories::default()).real.base_from_tool;
    let wanted = Chain::nominal(&model.arm, command).base_from_tool;
    let turn = wanted.rotation * real.rotation.transpose();
    let half = |a: f64, b: f64| LENGTH_M * (a - b) / 2.0;
    let turned = [
        half(turn.y_axis.z, turn.z_axis.y),
        half(turn.z_axis.x, turn.x_axis.z),
        half(turn.x_axis.y, turn.y_axis.x),
    ];
    let square = (wanted.origin - real.origin).length_squared();
    (square + turned.iter().map(|x| x * x).sum::<f64>()) / 2.0
}

proptest! {
    #![proptest_config(ProptestConfig { max_global_rejects: 40_000, failure_persistence: None, ..ProptestConfig::with_cases(40) })]

    #[test]
    fn every_pose_gets_a_correction_within_bounds_that_is_no_worse_than_none(
        which in 0..3_u8, errors in errors(), places in places(), reach in -4.5..-1.7_f64,
    ) {
        let model = erring(arm(which), &errors, 1.0);
        let q = filled(&pose(&model.arm, &places));
        let reach = 10.0_f64.powf(reach);
        let found = solved(&model, &q, reach);
        prop_assert!(found.converged != found.limited.is_some(), "{found:?}");
        for (found, q) in found.q.iter().zip(q) {
            prop_assert!((found - q).abs() <= reach * (1.0 + 1e-9));
        }
        prop_assert!(model.arm.within_limits(&found.q));
        prop_assert!(left(&model, &q, &found.q) <= left(&model, &q, &q) * (1.0 + 1e-9) + 1e-24);
    }

    /// Karush-Kuhn-Tucker conditions: no free joint can reduce the error, and no joint at its bound
    /// can do so by moving inward. Damping affects only directions in which the tool hardly moves:
    /// at most 0.06 m/rad.
    #[test]
    fn a_limited_correction_is_a_stationary_point_of_the_bounded_problem(
        which in 0..3_u8, errors in errors(), places in places(), reach in -4.0..-2.5_f64,
    ) {
        let model = erring(arm(which), &errors, 1.0);
        let q = filled(&pose(&model.arm, &places));
        let reach = 10.0_f64.powf(reach);
        let found = solved(&model, &q, reach);
        prop_assume!(found.limited == Some(Reason::Envelope));
        const STEP: f64 = 1e-6;
        let most = (2.0 * left(&model, &q, &q)).sqrt();
        for i in 0..model.arm.count() {
            let (mut up, mut down) = (found.q, found.q);
            up[i] += STEP;
            down[i] -= STEP;
            let slope = (left(&model, &q, &up) - left(&model, &q, &down)) / (2.0 * STEP);
            let correction = found.q[i] - q[i];
            // The largest contribution of damping: its size, error · 0.03 / reach, times a
            // correction of at most reach per joint, in weak directions.
            let damped = most * 0.03 * (model.arm.count() as f64).sqrt();
            prop_assert!(correction >= reach * (1.0 - 1e-9) || slope > -damped - 1e-9, "joint {i}: {slope}, {damped}");
            prop_assert!(correction <= -reach * (1.0 - 1e-9) || slope < damped + 1e-9, "joint {i}: {slope}, {damped}");
        }
    }

    #[test]
    fn where_an_exact_correction_fits_into_the_bounds_they_change_no_bit_of_it(
        which in 0..3_u8, errors in errors(), places in places(),
    ) {
        let model = erring(arm(which), &errors, 1.0);
        let q = filled(&pose(&model.arm, &places));
        let (wide, narrow) = (solved(&model, &q, 0.04), solved(&model, &q, 0.02));
        let largest = (0..JOINTS_MAX).fold(0.0_f64, |most, i| most.max((wide.q[i] - q[i]).abs()));
        prop_assume!(wide.converged && largest < 0.005);
        prop_assert_eq!(wide.q, narrow.q);
    }

    /// Through the wrist's singular pose, and onto and off the position limits, for errors from a
    /// hundredth of their size on. Just before a bound an exact correction can change arbitrarily
    /// fast, so the largest change between two commands is subdivided down to commands 2e-11 rad
    /// apart: a jump remains, a steep slope vanishes.
    #[test]
    fn a_correction_is_continuous_through_a_singular_wrist(
        errors in errors(), size in -2.0..0.0_f64, at in prop::array::uniform6(-0.5..0.5_f64), reach in -4.0..-1.7_f64,
    ) {
        const STEP: f64 = 1e-4;
        // A hundredth of the widest position limit here: allows for rounding between neighbouring
        // commands close to a singular pose.
        const JUMP: f64 = 2e-4;
        let model = erring(six(), &errors, 10.0_f64.powf(size));
        let reach = 10.0_f64.powf(reach);
        let found = |at_wrist: f64| {
            let mut q = filled(&at);
            q[4] = at_wrist;
            (solved(&model, &q, reach), q)
        };
        let moved = |a: f64, b: f64| {
            let ((a, from), (b, to)) = (found(a), found(b));
            (0..6).fold(0.0_f64, |most, i| most.max((a.q[i] - from[i] - b.q[i] + to[i]).abs()))
        };
        let places: Vec<f64> = (-1500..=1500).map(|k| f64::from(k) * STEP).collect();
        let widest = places.windows(2).max_by(|a, b| moved(a[0], a[1]).total_cmp(&moved(b[0], b[1])));
        let (mut a, mut b) = widest.map(|pair| (pair[0], pair[1])).expect("pairs");
        for _ in 0..22 {
            let middle = (a + b) / 2.0;
            (a, b) = if moved(a, middle) > moved(middle, b) { (a, middle) } else { (middle, b) };
        }
        let jump = moved(a, b);
        prop_assert!(jump < JUMP, "{jump} rad at {a}: {:?} {:?}", found(a), found(b));
    }
}

#[test]
fn a_joint_at_its_limit_stays_inside_and_says_so() {
    let mut errors = (vec![[0.0; 5]; 7], [0.0; 7]);
    errors.0[1][0] = -1.0;
    let model = erring(six(), &errors, 1.0);
    let mut q = filled(&[0.3, 0.0, 0.5, 0.7, -0.6, 0.4]);
    q[1] = model.arm.joints()[1].limits.1;
    let found = solved(&model, &q, 0.02);
    assert_eq!(found.limited, Some(Reason::JointLimit), "{found:?}");
    assert!(model.arm.within_limits(&found.q) && found.residual.m > 1e-5, "{found:?}");
}
