//! An arm with small deviations at known places: exact forward kinematics and tangent.
//!
//! With zero deviations it is the nominal arm; the tangent is exact at zero deviation.

use crate::arm::{Arm, Joints};
use crate::transform::{
    Transform, Vector3, add, column, cross, inverse, mul, norm, origin, rotate, rotation,
    rotation_z, scaled, sub, translation,
};

/// Deviations per joint: 0 joint angle; 1, 2 rotation of the axis alone about x and y of its frame; 3, 4 rotation of all that it carries; 5 to 7
/// translation of all that it carries along the axes of its frame; 8 extension of the vector to the next pivot.
pub const PER_JOINT: usize = 9;
/// Index of the first component of the base's rotation (base axes).
pub const BASE: usize = 7 * PER_JOINT;
/// Index of the first component of the tool's translation (tool axes).
pub const TOOL: usize = BASE + 3;
/// Total number of deviations.
pub const COUNT: usize = TOOL + 3;

/// Deviations of an arm, rad and m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation(pub [f64; COUNT]);

impl Default for Deviation {
    fn default() -> Self {
        Self([0.0; COUNT])
    }
}

impl Deviation {
    /// Mutable access to deviation `k` of joint `i`.
    pub fn component_mut(&mut self, i: usize, k: usize) -> &mut f64 {
        &mut self.0[i * PER_JOINT + k]
    }

    /// Adds the x and y components of a vector in joint `i`'s frame to deviations `k` and `k + 1`.
    pub fn add_rotation(&mut self, i: usize, k: usize, vector: Vector3) {
        *self.component_mut(i, k) += vector[0];
        *self.component_mut(i, k + 1) += vector[1];
    }

    /// Difference of two deviations.
    #[must_use]
    pub fn minus(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] - other.0[k]))
    }
}

fn three(parameters: &[f64], from: usize) -> Vector3 {
    [parameters[from], parameters[from + 1], parameters[from + 2]]
}

/// Pose of the tool at `q` with the deviations `bend`.
#[must_use]
pub fn tool_pose(arm: &Arm, q: &Joints, deviation: &Deviation) -> Transform {
    let parameters = &deviation.0;
    let mut carried = rotation(three(parameters, BASE));
    for i in 0..arm.joint_count() {
        let joint_parameters = &parameters[i * PER_JOINT..(i + 1) * PER_JOINT];
        let grown = if i == 0 { 0.0 } else { parameters[(i - 1) * PER_JOINT + 8] };
        carried = mul(&carried, &extended_link(&arm.links[i], grown));
        if joint_parameters[5] != 0.0 || joint_parameters[6] != 0.0 || joint_parameters[7] != 0.0 {
            carried = mul(&carried, &translation(three(joint_parameters, 5)));
        }
        if joint_parameters[3] != 0.0 || joint_parameters[4] != 0.0 {
            carried = mul(&carried, &rotation([joint_parameters[3], joint_parameters[4], 0.0]));
        }
        let spin = rotation_z(q[i] + joint_parameters[0]);
        if joint_parameters[1] != 0.0 || joint_parameters[2] != 0.0 {
            let tilted = rotation([joint_parameters[1], joint_parameters[2], 0.0]);
            carried = mul(&mul(&mul(&carried, &tilted), &spin), &inverse(&tilted));
        } else {
            carried = mul(&carried, &spin);
        }
    }
    let last = arm.joint_count();
    carried =
        mul(&carried, &extended_link(&arm.links[last], parameters[(last - 1) * PER_JOINT + 8]));
    mul(&carried, &translation(three(parameters, TOOL)))
}

fn extended_link(link: &Transform, by: f64) -> Transform {
    if by == 0.0 {
        return *link;
    }
    let vector = origin(link);
    mul(&translation(scaled(vector, by / norm(vector))), link)
}

/// Motion of the tool per unit of a deviation, base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolMotion {
    /// Rotation vector, rad per unit.
    pub rotation: Vector3,
    /// Displacement of the TCP, m per unit.
    pub displacement: Vector3,
}

impl ToolMotion {
    /// Rotation by `axis` about a point that the vector `lever` leads from to the TCP.
    fn about(axis: Vector3, lever: Vector3) -> Self {
        Self { rotation: axis, displacement: cross(axis, lever) }
    }

    /// A displacement without rotation.
    fn along(displacement: Vector3) -> Self {
        Self { displacement, ..Self::default() }
    }

    /// Displacement of a point on the tool, at `lever` from the TCP.
    #[must_use]
    pub fn of_point(&self, lever: Vector3) -> Vector3 {
        add(self.displacement, cross(self.rotation, lever))
    }
}

/// Motion of the tool by each deviation.
#[must_use]
pub fn tool_jacobian(arm: &Arm, q: &Joints) -> Vec<ToolMotion> {
    let frames = arm.frames(q);
    let tcp = origin(&frames[arm.joint_count()]);
    let mut all = vec![ToolMotion::default(); COUNT];
    let about = |w: Vector3, o: Vector3| ToolMotion::about(w, sub(tcp, o));
    for i in 0..arm.joint_count() {
        let (frame, o) = (&frames[i], origin(&frames[i]));
        let after = mul(frame, &rotation_z(q[i]));
        let first = i * PER_JOINT;
        all[first] = about(column(frame, 2), o);
        for k in 0..2 {
            let w = column(frame, k);
            // Rotation of the axis alone: applied before the joint's motion, reversed after it.
            let net = sub(w, column(&after, k));
            all[first + 1 + k] = about(net, o);
            all[first + 3 + k] = about(w, o);
        }
        for k in 0..3 {
            all[first + 5 + k] = ToolMotion::along(column(frame, k));
        }
        let to_next = arm.to_next(i);
        if norm(to_next) > 1e-9 {
            let along = scaled(to_next, 1.0 / norm(to_next));
            all[first + 8] = ToolMotion::along(rotate(&after, along));
        }
    }
    for k in 0..3 {
        let mut w = [0.0; 3];
        w[k] = 1.0;
        all[BASE + k] = about(w, [0.0; 3]);
        all[TOOL + k] = ToolMotion::along(column(&frames[arm.joint_count()], k));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::JOINTS;
    use crate::rng::Rng;
    use crate::transform::transform_point;

    #[test]
    fn the_tangent_is_the_slope_of_the_bent_arm_in_every_number() {
        for seed in 0..6 {
            let mut rng = Rng::new(seed, 0);
            let arm = Arm::random(&mut rng, true);
            let q: Joints = std::array::from_fn(|i| {
                if i < arm.joint_count() { rng.uniform_between(-1.0, 1.0) } else { 0.0 }
            });
            let slopes = tool_jacobian(&arm, &q);
            let place = [0.03, -0.05, 0.08];
            let lever = rotate(&arm.tool_pose(&q), place);
            for (k, motion) in slopes.iter().enumerate() {
                let joint = k / PER_JOINT;
                if joint >= arm.joint_count() && k < BASE
                    || k < BASE && k % PER_JOINT == 8 && !arm.has_thermal_growth(joint)
                {
                    continue;
                }
                let position_at = |by: f64| {
                    let mut deviation = Deviation::default();
                    deviation.0[k] = by;
                    transform_point(&tool_pose(&arm, &q, &deviation), place)
                };
                let h = 1e-6;
                let slope = scaled(sub(position_at(h), position_at(-h)), 0.5 / h);
                let found = motion.of_point(lever);
                assert!(norm(sub(slope, found)) < 1e-8, "parameter {k}: {slope:?} {found:?}");
            }
        }
    }

    #[test]
    fn no_bend_is_the_arm_itself() {
        let arm = Arm::random(&mut Rng::new(1, 0), true);
        assert_eq!(
            tool_pose(&arm, &[0.3; JOINTS], &Deviation::default()),
            arm.tool_pose(&[0.3; JOINTS])
        );
    }
}
