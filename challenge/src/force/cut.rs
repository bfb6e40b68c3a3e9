//! A random cut: workpiece and cutter, as described by a recording.
//!
//! Dimensions, coefficients and feeds are those of real milling and turning.

use std::f64::consts::PI;

use crate::rng::Rng;
use crate::transform::Vector3;

/// Chips are not thin at angles beyond this from the normal axis, rad.
const THIN: f64 = 0.35;

/// A cutter in its workpiece. SI; angles in rad from the normal axis, in the direction of rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Turning: the workpiece rotates, and the tool does not.
    pub turning: bool,
    /// Number of teeth.
    pub teeth: usize,
    /// Radius, m.
    pub radius_m: f64,
    /// Helix angle, rad.
    pub helix_rad: f64,
    /// Axial depth, m.
    pub depth_m: f64,
    /// Angle at which a tooth enters the workpiece.
    pub entry_rad: f64,
    /// Angle at which it exits.
    pub exit_rad: f64,
    /// Cutting force coefficients: tangential, radial, axial, N/m².
    pub chip: Vector3,
    /// Edge force coefficients: tangential, radial, axial, N/m.
    pub edge: Vector3,
}

impl Cut {
    /// A random milling cutter with at least this number of teeth; `thick`: chips are nowhere thin, so that every tooth cuts in spite of runout.
    #[must_use]
    pub fn mill(least_teeth: usize, thick: bool, rng: &mut Rng) -> Self {
        let teeth = [1, 2, 2, 3, 3, 4][rng.uniform_index(6)].max(least_teeth);
        let wide = rng.uniform_between(0.7, 2.2);
        let (entry_rad, exit_rad) = match rng.uniform_index(4) {
            _ if thick => {
                let middle = rng.uniform_between(1.2, 1.9);
                (THIN.max(middle - 0.5 * wide), (PI - THIN).min(middle + 0.5 * wide))
            }
            0 => (0.0, PI),
            1 => (0.0, wide),
            2 => (PI - wide, PI),
            _ => {
                let middle = rng.uniform_between(1.2, 1.9);
                (middle - 0.5 * wide, middle + 0.5 * wide)
            }
        };
        let (chip, edge) = coefficients(rng);
        Self {
            turning: false,
            teeth,
            radius_m: [3e-3, 4e-3, 5e-3, 6e-3, 8e-3][rng.uniform_index(5)],
            helix_rad: if rng.bernoulli(0.3) { 0.0 } else { rng.uniform_between(0.3, 0.7) },
            depth_m: rng.log_uniform_between(2.5e-4, 1.5e-3),
            entry_rad,
            exit_rad,
            chip,
            edge,
        }
    }

    /// A turning tool.
    #[must_use]
    pub fn lathe(rng: &mut Rng) -> Self {
        let (chip, edge) = coefficients(rng);
        Self {
            turning: true,
            teeth: 1,
            radius_m: rng.uniform_between(5e-3, 3e-2),
            helix_rad: 0.0,
            depth_m: rng.log_uniform_between(3e-4, 2e-3),
            entry_rad: 0.0,
            exit_rad: PI,
            chip,
            edge,
        }
    }

    /// Typical feed per tooth (milling) or per revolution (turning), m.
    #[must_use]
    pub fn feed_m(&self, rng: &mut Rng) -> f64 {
        if self.turning {
            rng.log_uniform_between(6e-5, 2.5e-4)
        } else {
            self.radius_m * rng.log_uniform_between(6e-4, 2.5e-3)
        }
    }
}

/// Cutting and edge force coefficients from aluminium to steel.
fn coefficients(rng: &mut Rng) -> (Vector3, Vector3) {
    let hard = rng.log_uniform_between(4e8, 2.5e9);
    let chip = [hard, hard * rng.uniform_between(0.2, 0.5), hard * rng.uniform_between(0.05, 0.3)];
    // The edge force equals the cutting force of a chip of this thickness.
    let rubs = hard * rng.log_uniform_between(4e-6, 1.5e-5);
    let edge = [rubs, rubs * rng.uniform_between(0.6, 1.3), rubs * rng.uniform_between(0.1, 0.4)];
    (chip, edge)
}
