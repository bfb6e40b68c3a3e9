//! The solution agrees with that of an independent formulation (`support/by_matrices.rs`).
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

#[path = "support/by_matrices.rs"]
mod by_matrices;
mod support;

use by_matrices::{miss, nominal, real, slopes, solved};
use corrector::{Task, solve};
use glam::DVec3;
use physics::{Arm, Inputs, JOINTS_MAX, Memories, Model, Wrench};
use proptest::prelude::*;
use support::{erring, first, portal, seven, six};

const REACH: [f64; JOINTS_MAX] = [0.05; JOINTS_MAX];

/// m per rad, with a radian of orientation counted as 0.2 m.
const WELL_CONDITIONED: f64 = 0.01;

fn pose(arm: &Arm, shares: &[f64]) -> Vec<f64> {
    let within = |(joint, share): (&physics::Joint, &f64)| {
        let (low, high) = joint.limits;
        low + (high - low) * (0.1 + 0.8 * share)
    };
    arm.joints().iter().zip(shares).map(within).collect()
}

struct Case {
    model: Model,
    inputs: Inputs,
    memories: Memories,
}

fn case(arm: Arm, shares: &[f64], signs: &[bool], load: &[f64]) -> Case {
    let model = erring(arm);
    let mut q = [0.0; JOINTS_MAX];
    q[..arm.count()].copy_from_slice(&pose(&arm, shares));
    let mut inputs = Inputs::at_rest(q);
    for (slot, up) in inputs.direction.iter_mut().zip(signs) {
        *slot = if *up { 1.0 } else { -1.0 };
    }
    let [fx, fy, fz, mx, my, mz] = std::array::from_fn(|i| load[i]);
    inputs.wrench_base = Wrench { force: DVec3::new(fx, fy, fz), moment: DVec3::new(mx, my, mz) };
    let mut memories = Memories::default();
    model.settle(&inputs, &mut memories);
    Case { model, inputs, memories }
}

impl Case {
    fn solve(&self, task: &Task) -> corrector::Solution {
        solve(&self.model, &self.inputs, &self.memories, task, &REACH)
    }

    /// Pose error of the real tool at `q`, by matrices.
    fn miss_at(&self, q: &[f64]) -> [f64; 6] {
        let Inputs { direction, wrench_base, .. } = &self.inputs;
        let wanted = nominal(&self.model.arm, &self.inputs.q[..q.len()]);
        miss(&real(&self.model.arm, q, direction, wrench_base), &wanted)
    }

    /// The least that the tool moves per unit of joint motion: near zero at a singular pose.
    fn least_gain(&self) -> f64 {
        let count = self.model.arm.count();
        let columns = slopes(&|q: &[f64]| self.miss_at(q), &self.inputs.q[..count]);
        let matrix = nalgebra::SMatrix::<f64, 6, 7>::from_fn(|i, j| {
            let scale = if i < 3 { 1.0 } else { 0.2 };
            columns.get(j).map_or(0.0, |column| column[i] * scale)
        });
        matrix.singular_values().min()
    }

    fn six_is_confirmed(&self) -> Result<(), TestCaseError> {
        let found = self.solve(&Task::default());
        prop_assume!(found.converged);
        let left = self.miss_at(&found.q[..6]);
        prop_assert!(left.iter().all(|x| x.abs() < 1e-9), "{left:?}");
        // Near a fold there are two neighbouring solutions; either is valid.
        prop_assume!(self.least_gain() > WELL_CONDITIONED);
        let Inputs { q, direction, wrench_base, .. } = &self.inputs;
        let other = solved(&self.model.arm, &q[..6], direction, wrench_base);
        for (i, other) in other.iter().enumerate() {
            prop_assert!((found.q[i] - other).abs() < 1e-9, "{i}: {} {other}", found.q[i]);
        }
        Ok(())
    }
}

fn places(n: usize) -> impl Strategy<Value = (Vec<f64>, Vec<bool>, Vec<f64>)> {
    (
        prop::collection::vec(0.0..1.0_f64, n),
        prop::collection::vec(any::<bool>(), n),
        prop::collection::vec(-100.0..100.0_f64, 6),
    )
}

/// Largest component along each joint's derivative: zero if no small motion of one joint reduces
/// the error.
fn steepest(columns: &[[f64; 6]], weighted: &[f64; 6]) -> f64 {
    let along = |c: &[f64; 6]| c.iter().zip(weighted).map(|(a, b)| a * b).sum::<f64>().abs();
    columns.iter().map(along).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig { max_global_rejects: 4000, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn six_revolute_joints_agree_to_1e_9((at, signs, load) in places(6)) {
        case(six(), &at, &signs, &load).six_is_confirmed()?;
    }

    #[test]
    fn a_portal_with_a_wrist_agrees_to_1e_9((at, signs, load) in places(6)) {
        case(portal(), &at, &signs, &load).six_is_confirmed()?;
    }

    #[test]
    fn seven_joints_put_the_tool_right_with_the_least_motion((at, signs, load) in places(7)) {
        let case = case(seven(), &at, &signs, &load);
        let found = case.solve(&Task::default());
        prop_assume!(found.converged);
        let left = case.miss_at(&found.q[..7]);
        prop_assert!(left.iter().all(|x| x.abs() < 1e-9), "{left:?}");
        prop_assume!(case.least_gain() > WELL_CONDITIONED);
        // Minimum norm to first order: the correction has no component along motions that do not
        // move the tool.
        let miss_at = |q: &[f64]| case.miss_at(q);
        let columns = slopes(&miss_at, &case.inputs.q[..7]);
        let change: Vec<f64> = (0..7).map(|i| found.q[i] - case.inputs.q[i]).collect();
        let length = change.iter().map(|c| c * c).sum::<f64>().sqrt();
        let idle = idle_direction(&columns);
        let along: f64 = idle.iter().zip(&change).map(|(a, b)| a * b).sum();
        prop_assert!(along.abs() < 0.05 * length, "{along} of {length}");
    }

    #[test]
    fn five_joints_leave_the_least_weighted_miss((at, signs, load) in places(5)) {
        let case = case(first(5), &at, &signs, &load);
        let task = Task::default();
        let found = case.solve(&task);
        prop_assume!(found.converged);
        let left = case.miss_at(&found.q[..5]);
        let l2 = task.length_m * task.length_m;
        let weighted = std::array::from_fn(|i| if i < 3 { left[i] } else { l2 * left[i] });
        let miss_at = |q: &[f64]| case.miss_at(q);
        let slope = steepest(&slopes(&miss_at, &found.q[..5]), &weighted);
        let size = weighted.iter().map(|x| x * x).sum::<f64>().sqrt();
        // Of an error that these joints can correct, a solution may leave what its last step
        // allows: 2.5e-11 rad, at a metre.
        prop_assert!(slope <= 0.05 * size + 2.5e-11, "{slope} of {size}");
    }

    #[test]
    fn a_free_tool_axis_is_left_to_turn((at, signs, load) in places(5)) {
        let case = case(first(5), &at, &signs, &load);
        let found = case.solve(&Task { free_tool_axis: true, ..Task::default() });
        prop_assume!(found.converged);
        let left = case.miss_at(&found.q[..5]);
        let wanted = nominal(&case.model.arm, &case.inputs.q[..5]);
        let spin: f64 = (0..3).map(|i| wanted[i][2] * left[3 + i]).sum();
        for i in 0..3 {
            prop_assert!(left[i].abs() < 1e-9, "{left:?}");
            prop_assert!((left[3 + i] - spin * wanted[i][2]).abs() < 1e-9, "{left:?}");
        }
    }
}

/// Unit vector of a joint motion that does not move the tool: seven columns, six rows.
fn idle_direction(columns: &[[f64; 6]]) -> Vec<f64> {
    let matrix = nalgebra::SMatrix::<f64, 6, 7>::from_fn(|i, j| columns[j][i]);
    let square = matrix.transpose() * matrix;
    let eigen = square.symmetric_eigen();
    eigen.eigenvectors.column(eigen.eigenvalues.imin()).iter().copied().collect()
}

#[test]
fn a_perfect_robot_is_left_alone_to_the_bit() {
    let model = Model::nominal(six());
    let mut q = [0.0; JOINTS_MAX];
    q[..6].copy_from_slice(&[0.3, -0.4, 0.5, 0.7, -0.6, 0.2]);
    let inputs = Inputs::at_rest(q);
    let found = solve(&model, &inputs, &Memories::default(), &Task::default(), &REACH);
    assert!(found.converged);
    assert_eq!(found.q, q);
}
