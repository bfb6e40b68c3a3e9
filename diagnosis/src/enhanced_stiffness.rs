//! Enhanced stiffness: change of an arm's stiffness by load-induced changes of its geometry (thesis 1.8 to 1.10).
//!
//! Equilibrium `K_θ δ = τ(q + δ)` gives `(K_θ − K_C − K_G) δ = τ(q)` with `K_C = ∂(JᵀW)/∂q`, `K_G = ∂τ_grav/∂q` (Chen and Kao 2000; Alici and
//! Shirinzadeh 2005), for any number of joints, including rigid ones.
//!
//! Valid for a wrench fixed in space; one that rotates with the tool has a further term. Closed forms, tested against central differences of `JᵀW`.
//! `K_C` is NOT symmetric under a moment (a moment fixed in space is not a conservative load) and is not symmetrised here. Size of the effect
//! ([`enhanced_effect`]): well below a micrometre for 100 N on an arm of this class.

use glam::DVec3;
use nalgebra::{SMatrix, SVector};
use physics::{Arm, Chain, JOINTS_MAX, JointKind, Joints, Loads, Wrench};

/// One row and column per joint, zero beyond the arm's joints; Nm/rad, for prismatic joints with N and m instead of Nm and rad.
pub type JointMatrix = SMatrix<f64, JOINTS_MAX, JOINTS_MAX>;

/// Effect of the load-induced change of geometry at one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnhancedEffect {
    /// Deflection of the TCP under the wrench, m.
    pub deflection_m: f64,
    /// Change of the deflection due to `K_C`, m.
    pub by_wrench_m: f64,
    /// Additional change of the deflection due to `K_G`, m.
    pub by_gravity_m: f64,
}

/// `K_C`: row `i`, column `j` is the derivative of `(JᵀW)_i` by `q_j`, for a wrench fixed in base axes at the TCP.
///
/// With `z` the angular and `v` the linear column of `J`: `(z_j × v_i)·F + (z_j × z_i)·M` for `j ≤ i`, `(z_i × v_j)·F` for `j > i`.
#[must_use]
pub fn wrench_stiffness(arm: &Arm, chain: &Chain, wrench: &Wrench) -> JointMatrix {
    let jacobian = chain.jacobian(arm);
    let part = |i: usize, row: usize| {
        DVec3::new(jacobian[(row, i)], jacobian[(row + 1, i)], jacobian[(row + 2, i)])
    };
    let mut stiffness = JointMatrix::zeros();
    for i in 0..arm.count() {
        for j in 0..arm.count() {
            stiffness[(i, j)] = if j <= i {
                let turned = part(j, 3);
                turned.cross(part(i, 0)).dot(wrench.force)
                    + turned.cross(part(i, 3)).dot(wrench.moment)
            } else {
                part(i, 3).cross(part(j, 0)).dot(wrench.force)
            };
        }
    }
    stiffness
}

/// `K_G`: row `i`, column `j` is the derivative of `τ_grav,i` by `q_j`, computed from the arm's known masses. Symmetric, because gravity has a
/// potential.
#[must_use]
pub fn gravity_stiffness(arm: &Arm, chain: &Chain) -> JointMatrix {
    let mut stiffness = JointMatrix::zeros();
    for (carrier, body) in arm.bodies() {
        let centre = chain.body(carrier).point(body.centre);
        let weight = arm.gravity * body.mass;
        let columns = |i: usize| match arm.joints()[i].kind {
            JointKind::Revolute => (chain.axis(i).cross(centre - chain.point(i)), chain.axis(i)),
            JointKind::Prismatic => (chain.axis(i), DVec3::ZERO),
        };
        for i in 0..=carrier {
            for j in 0..=i {
                let derivative = columns(j).1.cross(columns(i).0).dot(weight);
                stiffness[(i, j)] += derivative;
                if i != j {
                    stiffness[(j, i)] += derivative;
                }
            }
        }
    }
    stiffness
}

/// Effect of `K_C` and `K_G` at `q` (rad or m) under `wrench` (at the TCP, base axes, N and Nm), with `compliance` per joint (rad/Nm or m/N). `None`
/// if the arm buckles under the load.
#[must_use]
pub fn enhanced_effect(
    arm: &Arm,
    q: &Joints,
    wrench: Wrench,
    compliance: &Joints,
) -> Option<EnhancedEffect> {
    let chain = Chain::nominal(arm, q);
    let torque = SVector::from(Loads::on(arm, &chain, wrench).wrench_torque);
    let linear = chain.jacobian(arm).fixed_rows::<3>(0).into_owned();
    let moved = |softening: &JointMatrix| -> Option<SVector<f64, 3>> {
        Some(linear * (joint_compliance(compliance, softening)? * torque))
    };
    let by_wrench = wrench_stiffness(arm, &chain, &wrench);
    let classical = moved(&JointMatrix::zeros())?;
    let enhanced = moved(&by_wrench)?;
    let full = moved(&(by_wrench + gravity_stiffness(arm, &chain)))?;
    Some(EnhancedEffect {
        deflection_m: classical.norm(),
        by_wrench_m: (enhanced - classical).norm(),
        by_gravity_m: (full - enhanced).norm(),
    })
}

/// `(K_θ − S)⁻¹ = (1 − C S)⁻¹ C`, which is also valid for rigid joints (`C = 0`).
fn joint_compliance(compliance: &Joints, softening: &JointMatrix) -> Option<JointMatrix> {
    let rigid = JointMatrix::from_diagonal(&SVector::from(*compliance));
    (JointMatrix::identity() - rigid * softening).try_inverse().map(|inverse| inverse * rigid)
}

#[cfg(test)]
mod tests;
