//! An independent formulation of the same robot: 4 × 4 matrices, loads from virtual work,
//! derivatives by differences, Gauss elimination.
//!
//! Shares only the parameters of the arm with the product: rotations are computed by quaternions,
//! the gravity load as the gradient of the potential energy, the wrench's load from its virtual
//! work.

use crate::support::{BASE_COMPLIANCE, TOOL_SHIFT, TOOL_TURN, errors_of};
use physics::{Arm, JointKind, Wrench};

pub(crate) type M4 = [[f64; 4]; 4];

const UNIT: M4 =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

fn times(a: &M4, b: &M4) -> M4 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

fn shift(p: [f64; 3]) -> M4 {
    let mut m = UNIT;
    for i in 0..3 {
        m[i][3] = p[i];
    }
    m
}

/// Rotation by `angle` about the unit vector `u`, by its quaternion.
fn turn(u: [f64; 3], angle: f64) -> M4 {
    let (s, w) = (angle / 2.0).sin_cos();
    let [x, y, z] = u.map(|c| c * s);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w), 0.0],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w), 0.0],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y), 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

fn turn_by(vector: [f64; 3]) -> M4 {
    let angle = vector.iter().map(|c| c * c).sum::<f64>().sqrt();
    if angle == 0.0 { UNIT } else { turn(vector.map(|c| c / angle), angle) }
}

fn moved(m: &M4, p: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| m[i][3] + (0..3).map(|k| m[i][k] * p[k]).sum::<f64>())
}

/// Pose of each body for joint positions `q`.
fn bodies(arm: &Arm, q: &[f64]) -> Vec<M4> {
    let mut frame = UNIT;
    let place = |(joint, &q): (&physics::Joint, &f64)| {
        let (axis, point) = (joint.axis.to_array(), joint.point.to_array());
        let motion = match joint.kind {
            JointKind::Prismatic => shift(axis.map(|c| c * q)),
            JointKind::Revolute => {
                times(&times(&shift(point), &turn(axis, q)), &shift(point.map(|c| -c)))
            }
        };
        frame = times(&frame, &motion);
        frame
    };
    arm.joints().iter().zip(q).map(place).collect()
}

fn tool_at_zero(arm: &Arm) -> M4 {
    let mut m = shift(arm.tool.tcp.to_array());
    for (i, row) in m.iter_mut().take(3).enumerate() {
        for (j, entry) in row.iter_mut().take(3).enumerate() {
            *entry = arm.tool.base_from_tool.col(j)[i];
        }
    }
    m
}

/// Tool pose by the nominal geometry.
pub(crate) fn nominal(arm: &Arm, q: &[f64]) -> M4 {
    times(bodies(arm, q).last().expect("a joint"), &tool_at_zero(arm))
}

/// Masses and their centres.
fn masses(arm: &Arm, q: &[f64]) -> Vec<(f64, [f64; 3])> {
    let bodies = bodies(arm, q);
    arm.bodies().map(|(i, body)| (body.mass, moved(&bodies[i], body.centre.to_array()))).collect()
}

fn energy(arm: &Arm, q: &[f64]) -> f64 {
    let g = arm.gravity.to_array();
    masses(arm, q).iter().map(|(m, c)| -m * (0..3).map(|k| g[k] * c[k]).sum::<f64>()).sum()
}

/// Load on each joint by virtual work: change of energy when this joint alone moves.
fn loads(arm: &Arm, q: &[f64], wrench: &Wrench) -> Vec<f64> {
    const STEP: f64 = 1e-4;
    let (force, moment) = (wrench.force.to_array(), wrench.moment.to_array());
    (0..arm.count())
        .map(|i| {
            let (mut up, mut down) = (q.to_vec(), q.to_vec());
            up[i] += STEP;
            down[i] -= STEP;
            let (a, b) = (nominal(arm, &up), nominal(arm, &down));
            let way: f64 = (0..3).map(|k| force[k] * (a[k][3] - b[k][3])).sum();
            let turned: f64 = half_turn(&b, &a).iter().zip(moment).map(|(t, m)| t * m).sum();
            (way + turned + energy(arm, &down) - energy(arm, &up)) / (2.0 * STEP)
        })
        .collect()
}

/// The sine of the rotation from `a` to `b` along its axis, base axes.
fn half_turn(a: &M4, b: &M4) -> [f64; 3] {
    let r = |i: usize, j: usize| (0..3).map(|k| b[i][k] * a[j][k]).sum::<f64>();
    [(r(2, 1) - r(1, 2)) / 2.0, (r(0, 2) - r(2, 0)) / 2.0, (r(1, 0) - r(0, 1)) / 2.0]
}

/// Tool pose of the robot with errors.
pub(crate) fn real(arm: &Arm, q: &[f64], direction: &[f64], wrench: &Wrench) -> M4 {
    let loads = loads(arm, q, wrench);
    let joint = |i: usize| {
        let e = errors_of(i);
        q[i] + e.offset + e.ratio * q[i] + e.amplitude * (e.cycles * q[i] + e.phase).sin()
            - direction[i] * e.width / 2.0
            + e.compliance * loads[i]
    };
    let bent: Vec<f64> = (0..arm.count()).map(joint).collect();
    let tool = times(&shift(TOOL_SHIFT), &turn_by(TOOL_TURN));
    let flange = nominal(arm, &bent);
    times(&times(&base(arm, q, wrench), &flange), &tool)
}

fn base(arm: &Arm, q: &[f64], wrench: &Wrench) -> M4 {
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let tcp = nominal(arm, q);
    let mut moment = wrench.moment.to_array();
    let mut add = |m: [f64; 3]| (0..3).for_each(|k| moment[k] += m[k]);
    add(cross([tcp[0][3], tcp[1][3], tcp[2][3]], wrench.force.to_array()));
    for (mass, centre) in masses(arm, q) {
        add(cross(centre, arm.gravity.to_array().map(|g| g * mass)));
    }
    turn_by([moment[0] * BASE_COMPLIANCE, moment[1] * BASE_COMPLIANCE, 0.0])
}

/// Position (m) and orientation (rad) error from `is` to `wanted`, base axes.
pub(crate) fn miss(is: &M4, wanted: &M4) -> [f64; 6] {
    let [a, b, c] = half_turn(is, wanted);
    [wanted[0][3] - is[0][3], wanted[1][3] - is[1][3], wanted[2][3] - is[2][3], a, b, c]
}

/// Derivative of the real tool's error by each joint, by differences.
pub(crate) fn slopes(miss_at: &dyn Fn(&[f64]) -> [f64; 6], q: &[f64]) -> Vec<[f64; 6]> {
    const STEP: f64 = 1e-6;
    (0..q.len())
        .map(|j| {
            let (mut up, mut down) = (q.to_vec(), q.to_vec());
            up[j] += STEP;
            down[j] -= STEP;
            let (a, b) = (miss_at(&down), miss_at(&up));
            std::array::from_fn(|i| (a[i] - b[i]) / (2.0 * STEP))
        })
        .collect()
}

/// Joint positions of a six-joint arm for which the real tool pose is the nominal one at `q_cmd`:
/// Newton's method with differences.
pub(crate) fn solved(arm: &Arm, q_cmd: &[f64], direction: &[f64], wrench: &Wrench) -> Vec<f64> {
    let wanted = nominal(arm, q_cmd);
    let miss_at = |q: &[f64]| miss(&real(arm, q, direction, wrench), &wanted);
    let mut q = q_cmd.to_vec();
    for _ in 0..8 {
        let columns = slopes(&miss_at, &q);
        let e = miss_at(&q);
        let mut rows: Vec<Vec<f64>> =
            (0..6).map(|i| columns.iter().map(|c| c[i]).chain([e[i]]).collect()).collect();
        for (q, step) in q.iter_mut().zip(eliminated(&mut rows)) {
            *q += step;
        }
    }
    q
}

/// Gauss elimination with pivoting; the last column is the right-hand side.
fn eliminated(rows: &mut [Vec<f64>]) -> Vec<f64> {
    let n = rows.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|a, b| rows[*a][k].abs().total_cmp(&rows[*b][k].abs()));
        rows.swap(k, pivot.expect("a row"));
        let above = rows[k].clone();
        for row in &mut rows[k + 1..] {
            let factor = row[k] / above[k];
            row.iter_mut().zip(&above).for_each(|(x, a)| *x -= factor * a);
        }
    }
    let mut x = vec![0.0; n];
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| rows[k][j] * x[j]).sum();
        x[k] = (rows[k][n] - known) / rows[k][k];
    }
    x
}
