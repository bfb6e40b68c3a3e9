//! Random parameters of a hidden effect: leading parameters have size one and are scaled later, the others have the size found on real robots, within
//! the limits of the model format.

use crate::arm::JOINTS;
use crate::case::Case;
use crate::chance::Chance;
use crate::kinds::Kind;
use crate::law::Law;

/// Parameters of a kind on a joint, the leading ones of size one.
pub(super) fn of(case: &Case, kind: Kind, joint: usize, chance: &mut Chance) -> Vec<f64> {
    let full = std::f64::consts::TAU;
    let sign = if kind.facts().not_negative { 1.0 } else { chance.sign() };
    let mut around =
        |count: usize| -> Vec<f64> { (0..count).map(|_| chance.between(-1.0, 1.0)).collect() };
    match kind {
        Kind::TransmissionError => {
            let cycles = [1.0, 1.0, 2.0, 2.0, 3.0][chance.pick(5)];
            vec![1.0, cycles, chance.between(0.0, full)]
        }
        Kind::LostMotion => {
            let scale = typical_torque(case, joint);
            vec![1.0, scale * chance.log_between(0.2, 1.0)]
        }
        Kind::Hysteresis => vec![1.0, chance.log_between(2e-3, 2e-2)],
        Kind::ToolCompliance => around(3).iter().map(|x| 0.4 + 0.6 * x.abs()).collect(),
        Kind::Counterbalance => {
            let (a, l) = (chance.between(0.1, 0.25), chance.between(0.3, 0.6));
            vec![1.0, chance.between(0.6, 1.0) * (l - a).abs(), a, l, chance.between(0.0, full)]
        }
        Kind::AxisTilt | Kind::GravityTilt => around(2),
        Kind::AxisShift => {
            let [n1, n2] =
                case.scene.arm.normals(joint).map(|n| case.scene.arm.out_of_joint(joint, n));
            let share = around(2);
            (0..3).map(|k| share[0] * n1[k] + share[1] * n2[k]).collect()
        }
        Kind::ToolOffset | Kind::WrenchMisalignment => around(3),
        Kind::Payload => {
            let tcp = crate::space::origin(&case.scene.arm.tool(&[0.0; JOINTS]));
            let by = around(3);
            vec![sign, tcp[0] + 0.1 * by[0], tcp[1] + 0.1 * by[1], tcp[2] + 0.1 * by[2]]
        }
        Kind::ThermalGrowthLag | Kind::ThermalZeroLag => {
            vec![sign, chance.log_between(400.0, 1500.0)]
        }
        Kind::ThermalGrowthWarmUp | Kind::ThermalZeroWarmUp => {
            vec![sign, chance.log_between(600.0, 2500.0)]
        }
        Kind::AxisWobble => {
            let size = around(2);
            vec![
                0.3 + 0.7 * size[0].abs(),
                0.3 + 0.7 * size[1].abs(),
                chance.between(0.0, full),
                chance.between(0.0, full),
                [1.0, 2.0][chance.pick(2)],
            ]
        }
        Kind::FlexibleMode => vec![1.0, chance.log_between(5.0, 14.0), chance.between(0.02, 0.08)],
        Kind::ReversalSpike => vec![sign, chance.log_between(0.04, 0.15)],
        Kind::WrenchBias => {
            around(6).iter().enumerate().map(|(k, x)| if k < 3 { *x } else { 0.1 * x }).collect()
        }
        Kind::WrenchScale => around(6),
        _ => vec![sign],
    }
}

fn typical_torque(case: &Case, joint: usize) -> f64 {
    let loads = crate::ride::loads(&case.scene, &crate::ride::Fine::of(&case.scene, &[]), &[]);
    let squares: f64 = loads.iter().map(|load| load.torque(joint).powi(2)).sum();
    (squares / loads.len().max(1) as f64).sqrt().max(0.5)
}
