//! Drive torques compared with energies, closed forms and the regressor, on arms of any joints.

use super::loads::energy as potential;
use crate::arm::GRAVITY;
use crate::dynamics::{InertialParameters, Regressor, inverse_dynamics};
use crate::frame::rotation_from_vector;
use crate::inertia::tests::energy as kinetic;
use crate::{Arm, Body, Chain, Inputs, JOINTS_MAX, Joint, JointKind, Joints, Tool, Wrench};
use glam::{DMat3, DVec3};
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

prop_compose! {
    fn vector(size: f64)(x in -size..size, y in -size..size, z in -size..size) -> DVec3 {
        DVec3::new(x, y, z)
    }
}

prop_compose! {
    /// A body with three different, physically possible moments of inertia.
    fn body()(mass in 0.1..20.0_f64, centre in vector(1.0), turn in vector(2.0), radii in prop::array::uniform3(0.02..0.3_f64)) -> Body {
        let [x, y, z] = radii.map(|r| mass * r * r);
        let turn = rotation_from_vector(turn);
        let inertia = turn * DMat3::from_diagonal(DVec3::new(y + z, x + z, x + y)) * turn.transpose();
        Body { inertia, ..Body::point_mass(mass, centre) }
    }
}

prop_compose! {
    fn joint()(
        slides in any::<bool>(), axis in vector(1.0).prop_filter("a direction", |a| a.length() > 0.1), point in vector(0.7), link in body(),
    ) -> Joint {
        let kind = if slides { JointKind::Prismatic } else { JointKind::Revolute };
        Joint { kind, axis: axis.normalize(), point, limits: (-9.0, 9.0), max_speed: 9.0, link: Some(link) }
    }
}

prop_compose! {
    /// An arm of 1 to 16 joints with a tool, in motion.
    fn in_motion()(
        joints in prop::collection::vec(joint(), 1..=JOINTS_MAX), tcp in vector(0.7), tool in body(), gravity in vector(10.0),
        q in prop::array::uniform16(-2.0..2.0_f64), velocity in prop::array::uniform16(-1.0..1.0_f64),
        acceleration in prop::array::uniform16(-2.0..2.0_f64),
    ) -> (Arm, Inputs) {
        let tool = Tool { tcp, base_from_tool: DMat3::IDENTITY, body: Some(tool) };
        let arm = Arm::new(&joints, tool, gravity).expect("sound");
        (arm, Inputs { velocity, acceleration, ..Inputs::at_rest(q) })
    }
}

type Matrix = SMatrix<f64, JOINTS_MAX, JOINTS_MAX>;

/// The mass matrix, column by column: torques for the acceleration of one joint alone. Zero beyond
/// the arm's joints.
fn mass_matrix(arm: &Arm, q: &Joints) -> Matrix {
    let mut weightless = *arm;
    weightless.gravity = DVec3::ZERO;
    let mut matrix = Matrix::zeros();
    for k in 0..arm.count() {
        let mut inputs = Inputs::at_rest(*q);
        inputs.acceleration[k] = 1.0;
        let torque = inverse_dynamics(&weightless, &inputs);
        matrix.column_mut(k).copy_from_slice(&torque);
    }
    matrix
}

/// Kinetic energy, J, by the mass matrix.
fn of_speeds(matrix: &Matrix, velocity: &Joints) -> f64 {
    let speeds = SVector::from(*velocity);
    0.5 * speeds.dot(&(matrix * speeds))
}

fn dot(a: &Joints, b: &Joints, count: usize) -> f64 {
    (0..count).map(|i| a[i] * b[i]).sum()
}

fn of_joint(kind: JointKind, axis: DVec3, link: Body) -> Arm {
    let joint = Joint {
        kind,
        axis,
        point: DVec3::ZERO,
        limits: (-9.0, 9.0),
        max_speed: 9.0,
        link: Some(link),
    };
    let tool = Tool { tcp: DVec3::X, base_from_tool: DMat3::IDENTITY, body: None };
    Arm::new(&[joint], tool, GRAVITY).expect("sound")
}

fn drive(arm: &Arm, q: f64, v: f64, a: f64) -> f64 {
    let mut inputs = Inputs::at_rest([q; JOINTS_MAX]);
    (inputs.velocity, inputs.acceleration) = ([v; JOINTS_MAX], [a; JOINTS_MAX]);
    inverse_dynamics(arm, &inputs)[0]
}

#[test]
fn a_pendulum_needs_its_moment_of_inertia_and_its_weights_moment() {
    let link = Body { inertia: DMat3::IDENTITY * 0.3, ..Body::point_mass(2.0, DVec3::X * 0.5) };
    // About −y the arm rises for a positive angle.
    let arm = of_joint(JointKind::Revolute, -DVec3::Y, link);
    for (q, v, a) in [(0.0, 0.0, 0.0), (0.7, 1.3, -2.0), (-2.0, 0.1, 4.0)] {
        let wanted = (2.0 * 0.25 + 0.3) * a + 2.0 * 9.80665 * 0.5 * f64::cos(q);
        assert!((drive(&arm, q, v, a) - wanted).abs() < 1e-12, "at {q}, {v}, {a}");
    }
}

#[test]
fn a_slider_on_an_incline_needs_its_mass_and_its_share_of_the_weight() {
    let arm = of_joint(
        JointKind::Prismatic,
        DVec3::new(0.8, 0.0, 0.6),
        Body::point_mass(95.0, DVec3::new(0.1, 0.2, 0.3)),
    );
    for (q, v, a) in [(0.0, 0.0, 0.0), (0.2, 0.4, 3.0), (-0.1, -0.4, -3.0)] {
        let wanted = 95.0 * (a + 9.80665 * 0.6);
        assert!((drive(&arm, q, v, a) - wanted).abs() < 1e-10, "at {q}, {v}, {a}");
    }
}

/// Two point masses on two links in a plane, compared with the textbook equations.
#[test]
fn a_double_pendulum_is_that_of_the_textbook() {
    let (l1, l2, m1, m2, g) = (0.6, 0.4, 3.0, 2.0, 9.80665);
    let joint = |x: f64, mass: f64, distance: f64| Joint {
        kind: JointKind::Revolute,
        axis: -DVec3::Y,
        point: DVec3::X * x,
        limits: (-9.0, 9.0),
        max_speed: 9.0,
        link: Some(Body::point_mass(mass, DVec3::X * distance)),
    };
    let tool = Tool { tcp: DVec3::X, base_from_tool: DMat3::IDENTITY, body: None };
    let joints = [joint(0.0, m1, l1), joint(l1, m2, l1 + l2)];
    let arm = Arm::new(&joints, tool, GRAVITY).expect("sound");
    let mut inputs = Inputs::at_rest([0.0; JOINTS_MAX]);
    let (q1, q2, v1, v2, a1, a2) = (0.4, -1.1, 0.9, -1.7, 2.0, 0.6);
    inputs.q[..2].copy_from_slice(&[q1, q2]);
    inputs.velocity[..2].copy_from_slice(&[v1, v2]);
    inputs.acceleration[..2].copy_from_slice(&[a1, a2]);
    let (s2, c2) = f64::sin_cos(q2);
    let coupled = m2 * l1 * l2;
    let wanted = [
        (m1 * l1 * l1 + m2 * (l1 * l1 + l2 * l2) + 2.0 * coupled * c2) * a1
            + (m2 * l2 * l2 + coupled * c2) * a2
            - coupled * s2 * (2.0 * v1 * v2 + v2 * v2)
            + (m1 + m2) * g * l1 * f64::cos(q1)
            + m2 * g * l2 * f64::cos(q1 + q2),
        (m2 * l2 * l2 + coupled * c2) * a1
            + m2 * l2 * l2 * a2
            + coupled * s2 * v1 * v1
            + m2 * g * l2 * f64::cos(q1 + q2),
    ];
    let found = inverse_dynamics(&arm, &inputs);
    assert!((found[0] - wanted[0]).abs() < 1e-12, "{found:?} not {wanted:?}");
    assert!((found[1] - wanted[1]).abs() < 1e-12, "{found:?} not {wanted:?}");
}

#[test]
fn a_wrench_on_the_tool_is_what_the_drives_are_spared() {
    let arm = of_joint(JointKind::Revolute, -DVec3::Y, Body::point_mass(2.0, DVec3::X * 0.5));
    let mut inputs = Inputs::at_rest([0.0; JOINTS_MAX]);
    inputs.wrench_base = Wrench { force: DVec3::Z * 7.0, moment: DVec3::ZERO };
    let spared = drive(&arm, 0.0, 0.0, 0.0) - inverse_dynamics(&arm, &inputs)[0];
    assert!((spared - 7.0).abs() < 1e-12, "{spared}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn at_rest_the_drives_hold_the_slope_of_the_potential_energy((arm, inputs) in in_motion()) {
        let torque = inverse_dynamics(&arm, &Inputs::at_rest(inputs.q));
        for (i, torque) in torque.iter().enumerate().take(arm.count()) {
            let energy_at = |step: f64| {
                let mut q = inputs.q;
                q[i] += step;
                potential(&arm, &q)
            };
            let slope = (energy_at(1e-5) - energy_at(-1e-5)) / 2e-5;
            prop_assert!((torque - slope).abs() < 1e-4, "joint {i}: {torque} not {slope}");
        }
    }

    #[test]
    fn the_mass_matrix_is_symmetric_positive_and_gives_the_kinetic_energy((arm, inputs) in in_motion()) {
        let matrix = mass_matrix(&arm, &inputs.q);
        let size = matrix.norm();
        prop_assert!((matrix - matrix.transpose()).norm() < 1e-12 * size);
        let padded = Matrix::from_fn(|r, c| if r == c && r >= arm.count() { 1.0 } else { matrix[(r, c)] });
        prop_assert!(padded.cholesky().is_some(), "not positive definite: {matrix}");
        let half = of_speeds(&matrix, &inputs.velocity);
        let wanted = kinetic(&arm, &inputs.q, &inputs.velocity);
        prop_assert!((half - wanted).abs() < 1e-6 * wanted, "{half} not {wanted}");
    }

    #[test]
    fn the_power_of_the_drives_is_what_the_energy_gains((arm, inputs) in in_motion()) {
        let energy = |s: f64| {
            let q = std::array::from_fn(|i| inputs.q[i] + s * (inputs.velocity[i] + 0.5 * s * inputs.acceleration[i]));
            let v: Joints = std::array::from_fn(|i| inputs.velocity[i] + s * inputs.acceleration[i]);
            potential(&arm, &q) + of_speeds(&mass_matrix(&arm, &q), &v)
        };
        let torque = inverse_dynamics(&arm, &inputs);
        let power = dot(&torque, &inputs.velocity, arm.count());
        let h = 1e-4;
        // Fourth-order difference: long chains move fast at their ends.
        let gained = (8.0 * (energy(h) - energy(-h)) - energy(2.0 * h) + energy(-2.0 * h)) / (12.0 * h);
        let size: f64 = torque.iter().zip(&inputs.velocity).map(|(t, v)| (t * v).abs()).sum();
        prop_assert!((power - gained).abs() < 1e-6 * size + 1e-4, "{power} not {gained}");
    }

    #[test]
    fn the_table_times_the_bodies_parameters_is_the_inverse_dynamics((arm, inputs) in in_motion()) {
        let chain = Chain::nominal(&arm, &inputs.q);
        let table = Regressor::new(&arm, &chain, &inputs, arm.gravity);
        let mut sum = [0.0; JOINTS_MAX];
        for (joint, body) in arm.bodies() {
            let parameters = InertialParameters::of(body).values();
            for (sum, row) in sum.iter_mut().zip(table.of_body(joint)) {
                *sum += row.iter().zip(parameters).map(|(y, p)| y * p).sum::<f64>();
            }
        }
        let wanted = inverse_dynamics(&arm, &inputs);
        let size = wanted.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        for (i, (found, wanted)) in sum.iter().zip(wanted).enumerate() {
            prop_assert!((found - wanted).abs() < 1e-11 * size, "joint {i}: {found} not {wanted}");
        }
    }

    #[test]
    fn bodies_on_one_joint_add_up((arm, inputs) in in_motion(), one in body(), other in body()) {
        let (a, b) = (InertialParameters::of(&one), InertialParameters::of(&other));
        let both = InertialParameters { mass: a.mass + b.mass, first_moment: a.first_moment + b.first_moment, inertia: a.inertia + b.inertia };
        let centre = both.first_moment / both.mass;
        // The joint body by the parallel axis theorem about its own centre.
        let carried = |body: &Body| {
            let r = body.centre - centre;
            let outer = DMat3::from_cols(r * r.x, r * r.y, r * r.z);
            body.inertia + (DMat3::from_diagonal(DVec3::splat(r.length_squared())) - outer) * body.mass
        };
        let body = Body { inertia: carried(&one) + carried(&other), ..Body::point_mass(both.mass, centre) };
        for (found, wanted) in InertialParameters::of(&body).values().iter().zip(both.values()) {
            prop_assert!((found - wanted).abs() < 1e-11);
        }
        let with = |body: Option<Body>| {
            let tool = Tool { body, ..arm.tool };
            inverse_dynamics(&Arm::new(arm.joints(), tool, arm.gravity).expect("sound"), &inputs)
        };
        let (without, joined) = (with(None), with(Some(body)));
        let (one, other) = (with(Some(one)), with(Some(other)));
        let size = joined.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        for i in 0..arm.count() {
            prop_assert!((joined[i] + without[i] - one[i] - other[i]).abs() < 1e-11 * size);
        }
    }
}
