//! Conversion between URDF's three angles and rotations.
//!
//! `rpy` are rotations about the fixed x, y and z axes, in that order: `R = Rz(yaw) Ry(pitch)
//! Rx(roll)` (the URDF specification, joint origin). Accurate to rounding in both directions, also
//! at a pitch of 90°.

use glam::{DMat3, DVec3};
use physics::frame::rotation_about;

/// The rotation of roll, pitch and yaw, rad.
pub(super) fn rotation(rpy: DVec3) -> DMat3 {
    rotation_about(DVec3::Z, rpy.z)
        * rotation_about(DVec3::Y, rpy.y)
        * rotation_about(DVec3::X, rpy.x)
}

/// Roll, pitch and yaw of a rotation, rad; pitch within a quarter turn.
///
/// Pitch and roll are computed after undoing the yaw: near a pitch of a quarter turn, where the yaw
/// is arbitrary, they are then consistent with the computed yaw.
pub(super) fn angles(rotation: &DMat3) -> DVec3 {
    let (c0, c1, c2) = (rotation.x_axis, rotation.y_axis, rotation.z_axis);
    let yaw = c0.y.atan2(c0.x);
    let (sin, cos) = yaw.sin_cos();
    let pitch = (-c0.z).atan2(cos * c0.x + sin * c0.y);
    let roll = (sin * c2.x - cos * c2.y).atan2(cos * c1.y - sin * c1.x);
    DVec3::new(roll, pitch, yaw)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn apart(a: &DMat3, b: &DMat3) -> f64 {
        (*a - *b).to_cols_array().iter().fold(0.0, |most, x| most.max(x.abs()))
    }

    #[test]
    fn roll_comes_first_and_about_the_fixed_axis() {
        let turned = rotation(DVec3::new(FRAC_PI_2, 0.0, FRAC_PI_2)) * DVec3::Y;
        // Roll turns y to z, and the later yaw about the fixed z leaves it there.
        assert!((turned - DVec3::Z).length() < 1e-15, "{turned}");
    }

    proptest! {
        #[test]
        fn the_angles_of_a_rotation_are_that_rotation(roll in -PI..PI, pitch in -PI..PI, yaw in -PI..PI) {
            let wanted = rotation(DVec3::new(roll, pitch, yaw));
            prop_assert!(apart(&rotation(angles(&wanted)), &wanted) < 1e-15);
        }

        #[test]
        fn near_a_quarter_turn_of_pitch_nothing_is_lost(roll in -PI..PI, yaw in -PI..PI, exponent in -17..-5, up in any::<bool>()) {
            let pitch = FRAC_PI_2 + 10.0_f64.powi(exponent);
            let wanted = rotation(DVec3::new(roll, if up { pitch } else { -pitch }, yaw));
            prop_assert!(apart(&rotation(angles(&wanted)), &wanted) < 1e-15);
        }
    }
}
