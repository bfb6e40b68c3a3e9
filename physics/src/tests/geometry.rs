//! Forward kinematics and Jacobian.

use super::matrix::{Geometry, Matrix, denavit_hartenberg, identity};
use super::six_joints;
use crate::deviation::Deviation;
use crate::effects::conformance::{Scene, scene, sliding_scene};
use crate::frame::vector_from_rotation;
use crate::lanes::PortableLanes;
use crate::{Arm, Chain, Joint, JointKind, Joints, Loads, Tool};
use core::f64::consts::FRAC_PI_2;
use glam::{DMat3, DVec3};
use proptest::prelude::*;

fn arm(axes_and_points: [(DVec3, [f64; 3]); 6], tcp: [f64; 3], base_from_tool: DMat3) -> Arm {
    let joints = axes_and_points.map(|(axis, point)| Joint {
        kind: JointKind::Revolute,
        axis,
        point: DVec3::from_array(point),
        limits: (-3.0, 3.0),
        max_speed: 3.0,
        link: None,
    });
    let tool = Tool { tcp: DVec3::from_array(tcp), base_from_tool, body: None };
    Arm::new(&joints, tool, crate::arm::GRAVITY).expect("a sound arm")
}

/// ABB IRB 1600-6/1.45 to its flange, as axes and points.
fn irb1600() -> Arm {
    let joints = [
        (DVec3::Z, [0.0, 0.0, 0.4865]),
        (DVec3::Y, [0.15, 0.0, 0.4865]),
        (DVec3::Y, [0.15, 0.0, 1.1865]),
        (DVec3::X, [0.3, 0.0, 1.1865]),
        (DVec3::Y, [0.75, 0.0, 1.1865]),
        (DVec3::X, [0.8, 0.0, 1.1865]),
    ];
    let flange = DMat3::from_cols(DVec3::Z, -DVec3::Y, DVec3::X);
    arm(joints, [0.815, 0.0, 1.1865], flange)
}

/// The same robot as rows of theta, d, a, alpha (figures of ros-industrial/abb, `irb1600_8_145`).
const IRB1600: [[f64; 4]; 6] = [
    [0.0, 0.4865, 0.15, -FRAC_PI_2],
    [-FRAC_PI_2, 0.0, 0.7, 0.0],
    [0.0, 0.0, 0.0, -FRAC_PI_2],
    [0.0, 0.6, 0.0, FRAC_PI_2],
    [0.0, 0.0, 0.0, -FRAC_PI_2],
    [0.0, 0.065, 0.0, 0.0],
];

fn ur10e() -> Arm {
    let (down, back) = (-DVec3::Z, -DVec3::Y);
    let joints = [
        (DVec3::Z, [0.0, 0.0, 0.0]),
        (back, [0.0, 0.0, 0.1807]),
        (back, [-0.6127, 0.0, 0.1807]),
        (back, [-1.18425, 0.0, 0.1807]),
        (down, [-1.18425, -0.17415, 0.1]),
        (back, [-1.18425, 0.0, 0.06085]),
    ];
    let flange = DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y);
    arm(joints, [-1.18425, -0.2907, 0.06085], flange)
}

/// The manufacturer's table of the UR10e: theta, d, a, alpha.
const UR10E: [[f64; 4]; 6] = [
    [0.0, 0.1807, 0.0, FRAC_PI_2],
    [0.0, 0.0, -0.6127, 0.0],
    [0.0, 0.0, -0.57155, 0.0],
    [0.0, 0.17415, 0.0, FRAC_PI_2],
    [0.0, 0.11985, 0.0, -FRAC_PI_2],
    [0.0, 0.11655, 0.0, 0.0],
];

fn by_table(table: &[[f64; 4]; 6], q: &Joints) -> Matrix {
    table.iter().zip(q).fold(identity(), |carried, ([theta, d, a, alpha], q)| {
        carried.times(&denavit_hartenberg(theta + q, *d, *a, *alpha))
    })
}

#[test]
fn the_irb_1600_at_zero_has_its_flange_where_the_drawing_says() {
    let chain = Chain::nominal(&irb1600(), &[0.0; 16]);
    assert!((chain.base_from_tool.origin - DVec3::new(0.815, 0.0, 1.1865)).length() < 1e-15);
}

fn moved(mut q: Joints, i: usize, by: f64) -> Joints {
    q[i] += by;
    q
}

proptest! {
    #[test]
    fn the_product_of_rotations_is_the_irb_1600s_denavit_hartenberg_product(q in six_joints()) {
        let chain = Chain::nominal(&irb1600(), &q);
        prop_assert!(by_table(&IRB1600, &q).difference(&chain.base_from_tool) < 1e-14);
    }

    #[test]
    fn the_product_of_rotations_is_the_ur10es_denavit_hartenberg_product(q in six_joints()) {
        let chain = Chain::nominal(&ur10e(), &q);
        prop_assert!(by_table(&UR10E, &q).difference(&chain.base_from_tool) < 1e-14);
    }

    #[test]
    fn every_body_is_where_the_matrices_say(q in six_joints()) {
        for arm in [scene().arm, sliding_scene().arm] {
            let (chain, geometry) = (Chain::nominal(&arm, &q), Geometry::of(&arm));
            for i in 0..6 {
                prop_assert!(geometry.body(&q, Some(i)).difference(&chain.body(i)) < 1e-13);
            }
            prop_assert!(geometry.base_from_tool(&q).difference(&chain.base_from_tool) < 1e-13);
        }
    }

    #[test]
    fn a_deviation_of_zero_changes_no_bit(q in six_joints()) {
        for arm in [scene().arm, sliding_scene().arm] {
            prop_assert_eq!(Chain::real(&arm, &q, &Deviation::default()), Chain::nominal(&arm, &q));
        }
    }

    #[test]
    fn the_jacobian_is_the_slope_of_the_pose(q in six_joints()) {
        let h = 1e-5;
        for arm in [scene().arm, sliding_scene().arm] {
            let jacobian = Chain::nominal(&arm, &q).jacobian(&arm);
            for i in 0..6 {
                let pose = |by| Chain::nominal(&arm, &moved(q, i, by)).base_from_tool;
                let (above, below) = (pose(h), pose(-h));
                let linear = (above.origin - below.origin) / (2.0 * h);
                let angular =
                    vector_from_rotation(&(above.rotation * below.rotation.transpose())) / (2.0 * h);
                let column = jacobian.column(i);
                for k in 0..3 {
                    prop_assert!((column[k] - linear[k]).abs() < 1e-9);
                    prop_assert!((column[k + 3] - angular[k]).abs() < 1e-9);
                }
            }
            prop_assert!(jacobian.columns(6, 10).iter().all(|x| *x == 0.0));
        }
    }
}

/// Other lanes, or an arm of more joints, give the same geometry up to rounding.
#[test]
fn the_lanes_of_any_machine_say_the_same() {
    for scene in [scene(), sliding_scene()] {
        let Scene { arm, inputs, .. } = scene;
        let mut plain = [Chain::nominal(&arm, &inputs.q); 2];
        plain[0].set_nominal_in(PortableLanes::<2>, &arm, &inputs.q, None);
        plain[1].set_nominal_in(PortableLanes::<4>, &arm, &inputs.q, None);
        let wide = Chain::nominal(&arm, &inputs.q);
        assert_eq!(plain[0].bodies, plain[1].bodies);
        for i in 0..arm.count() {
            let axis = plain[0].axis(i) - wide.axis(i);
            let point = plain[0].point(i) - wide.point(i);
            assert!(axis.length() < 1e-15 && point.length() < 1e-15, "joint {i}");
            let loads = |chain: &Chain| Loads::on(&arm, chain, inputs.wrench_base);
            let (a, b) = (loads(&plain[0]).torque(i), loads(&wide).torque(i));
            assert!((a - b).abs() < 1e-12 * (1.0 + a.abs()), "joint {i}: {a} {b}");
        }
        let tcp = plain[0].base_from_tool.origin - wide.base_from_tool.origin;
        assert!(tcp.length() < 4e-15, "{tcp}");
    }
}
