//! Random parameters of a hidden effect: leading parameters have size one and are scaled later, the others have the size found on real robots, within
//! the limits of the model format.

use crate::arm::JOINTS;
use crate::case::PositionCase;
use crate::effect::EffectKind;
use crate::kinds::Kind;
use crate::rng::Rng;

/// Parameters of a kind on a joint, the leading ones of size one.
pub(super) fn of(case: &PositionCase, kind: Kind, joint: usize, rng: &mut Rng) -> Vec<f64> {
    let full = std::f64::consts::TAU;
    let sign = if kind.spec().non_negative { 1.0 } else { rng.random_sign() };
    let mut around =
        |count: usize| -> Vec<f64> { (0..count).map(|_| rng.uniform_between(-1.0, 1.0)).collect() };
    match kind {
        Kind::TransmissionError => {
            let cycles = [1.0, 1.0, 2.0, 2.0, 3.0][rng.uniform_index(5)];
            vec![1.0, cycles, rng.uniform_between(0.0, full)]
        }
        Kind::LostMotion => {
            let scale = typical_torque(case, joint);
            vec![1.0, scale * rng.log_uniform_between(0.2, 1.0)]
        }
        Kind::Hysteresis => vec![1.0, rng.log_uniform_between(2e-3, 2e-2)],
        Kind::ToolCompliance => around(3).iter().map(|x| 0.4 + 0.6 * x.abs()).collect(),
        Kind::Counterbalance => {
            let (a, l) = (rng.uniform_between(0.1, 0.25), rng.uniform_between(0.3, 0.6));
            vec![
                1.0,
                rng.uniform_between(0.6, 1.0) * (l - a).abs(),
                a,
                l,
                rng.uniform_between(0.0, full),
            ]
        }
        Kind::AxisTilt | Kind::GravityTilt => around(2),
        Kind::AxisShift => {
            let [n1, n2] =
                case.scene.arm.normals(joint).map(|n| case.scene.arm.base_from_joint(joint, n));
            let share = around(2);
            (0..3).map(|k| share[0] * n1[k] + share[1] * n2[k]).collect()
        }
        Kind::ToolOffset | Kind::WrenchMisalignment => around(3),
        Kind::Payload => {
            let tcp = crate::transform::origin(&case.scene.arm.tool_pose(&[0.0; JOINTS]));
            let by = around(3);
            vec![sign, tcp[0] + 0.1 * by[0], tcp[1] + 0.1 * by[1], tcp[2] + 0.1 * by[2]]
        }
        Kind::ThermalGrowthLag | Kind::ThermalZeroLag => {
            vec![sign, rng.log_uniform_between(400.0, 1500.0)]
        }
        Kind::ThermalGrowthWarmUp | Kind::ThermalZeroWarmUp => {
            vec![sign, rng.log_uniform_between(600.0, 2500.0)]
        }
        Kind::AxisWobble => {
            let size = around(2);
            vec![
                0.3 + 0.7 * size[0].abs(),
                0.3 + 0.7 * size[1].abs(),
                rng.uniform_between(0.0, full),
                rng.uniform_between(0.0, full),
                [1.0, 2.0][rng.uniform_index(2)],
            ]
        }
        Kind::FlexibleMode => {
            vec![1.0, rng.log_uniform_between(5.0, 14.0), rng.uniform_between(0.02, 0.08)]
        }
        Kind::ReversalSpike => vec![sign, rng.log_uniform_between(0.04, 0.15)],
        Kind::WrenchBias => {
            around(6).iter().enumerate().map(|(k, x)| if k < 3 { *x } else { 0.1 * x }).collect()
        }
        Kind::WrenchScale => around(6),
        _ => vec![sign],
    }
}

fn typical_torque(case: &PositionCase, joint: usize) -> f64 {
    let loads = crate::motion_and_loads::loads(
        &case.scene,
        &crate::motion_and_loads::FineMotion::from_scene(&case.scene, &[]),
        &[],
    );
    let squares: f64 = loads.iter().map(|load| load.torque(joint).powi(2)).sum();
    (squares / loads.len().max(1) as f64).sqrt().max(0.5)
}
