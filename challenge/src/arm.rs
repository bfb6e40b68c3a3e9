//! Arms from Denavit–Hartenberg tables, as chains of homogeneous transforms.
//!
//! `T(q) = L₀ · Rz(q₁) · L₁ · Rz(q₂) · … · Lₙ`, `Lᵢ = Tz(dᵢ) Tx(aᵢ) Rx(αᵢ)` of the classical table with the next joint's offset about z; the
//! pivot of joint i is the origin of its frame. Masses are points.
//!
//! The model file is derived from these transforms. All joints are revolute.

use crate::rng::Rng;
use crate::transform::{
    IDENTITY, Transform, Vector3, column, mul, norm, origin, rotate, rotate_inverse, rotation,
    rotation_x, rotation_z, scaled, transform_point, translation,
};

/// Largest number of joints.
pub const JOINTS: usize = 7;
/// One value per joint.
pub type Joints = [f64; JOINTS];

/// A point mass that a joint moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mass {
    /// The joint that moves it, 0-based.
    pub joint: usize,
    /// Mass, kg.
    pub kg: f64,
    /// Position in the frame of that joint, after its motion, m.
    pub position: Vector3,
    /// Whether it belongs to the tool.
    pub tool: bool,
}

/// An arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// Name for users.
    pub name: String,
    /// `L₀` to `Lₙ`.
    pub links: Vec<Transform>,
    /// Point masses; empty if unknown.
    pub masses: Vec<Mass>,
    /// Gravity in the base, m/s².
    pub gravity: Vector3,
    /// Centre of each joint's useful range, rad.
    pub home: Joints,
    /// Half of that range, rad.
    pub half_range: Joints,
}

/// A row of a table: d, a (m), α, offset (rad), mass moved by the joint (kg), home and half range (rad).
type DhRow = (f64, f64, f64, f64, f64, f64, f64);

const R: f64 = std::f64::consts::FRAC_PI_2;

/// Dimensions as published (UR10e, IRB 120) or of similar proportions; masses are rounded.
const TABLES: [(&str, &[DhRow]); 6] = [
    (
        "UR10e",
        &[
            (0.1807, 0.0, R, 0.0, 7.4, 0.0, 2.0),
            (0.0, -0.6127, 0.0, 0.0, 13.0, -1.2, 0.7),
            (0.0, -0.571_55, 0.0, 0.0, 4.0, 1.4, 0.9),
            (0.174_15, 0.0, R, 0.0, 2.0, -1.2, 1.2),
            (0.119_85, 0.0, -R, 0.0, 2.0, -1.3, 1.2),
            (0.116_55, 0.0, 0.0, 0.0, 0.6, 0.0, 2.0),
        ],
    ),
    (
        "IRB 120",
        &[
            (0.29, 0.0, -R, 0.0, 6.0, 0.0, 1.6),
            (0.0, 0.27, 0.0, -R, 4.0, 0.3, 0.7),
            (0.0, 0.07, -R, 0.0, 5.0, 0.1, 0.7),
            (0.302, 0.0, R, 0.0, 2.0, 0.2, 1.6),
            (0.0, 0.0, -R, 0.0, 1.0, 0.8, 0.9),
            (0.072, 0.0, 0.0, 0.0, 0.3, 0.0, 2.0),
        ],
    ),
    (
        "six axes, 1.45 m",
        &[
            (0.4865, 0.15, -R, 0.0, 70.0, 0.0, 1.5),
            (0.0, 0.7, 0.0, -R, 50.0, 0.2, 0.6),
            (0.0, 0.0, -R, 0.0, 40.0, 0.1, 0.6),
            (0.6, 0.0, R, 0.0, 18.0, 0.2, 1.6),
            (0.0, 0.0, -R, 0.0, 6.0, 0.9, 0.8),
            (0.065, 0.0, 0.0, 0.0, 1.5, 0.0, 2.0),
        ],
    ),
    (
        "seven axes",
        &[
            (0.34, 0.0, -R, 0.0, 5.0, 0.0, 1.6),
            (0.0, 0.0, R, 0.0, 6.0, 0.6, 0.6),
            (0.4, 0.0, R, 0.0, 4.0, 0.0, 1.4),
            (0.0, 0.0, -R, 0.0, 4.0, -1.3, 0.6),
            (0.4, 0.0, -R, 0.0, 2.5, 0.0, 1.6),
            (0.0, 0.0, R, 0.0, 2.0, 0.9, 0.7),
            (0.126, 0.0, 0.0, 0.0, 0.5, 0.0, 2.0),
        ],
    ),
    (
        "five axes",
        &[
            (0.35, 0.1, -R, 0.0, 20.0, 0.0, 1.6),
            (0.0, 0.45, 0.0, -R, 14.0, 0.2, 0.7),
            (0.0, 0.45, 0.0, 0.0, 10.0, 1.3, 0.6),
            (0.0, 0.1, -R, 0.0, 3.0, 0.3, 0.8),
            (0.1, 0.0, 0.0, 0.0, 1.0, 0.0, 2.0),
        ],
    ),
    (
        "three axes",
        &[
            (0.4, 0.1, -R, 0.0, 30.0, 0.0, 1.6),
            (0.0, 0.6, 0.0, -R, 20.0, 0.2, 0.7),
            (0.0, 0.55, 0.0, 0.0, 12.0, 1.2, 0.7),
        ],
    ),
];

impl Arm {
    /// The arm of a table of `TABLES`, with lengths scaled by `stretch`, and a tool.
    #[must_use]
    pub fn from_table(
        number: usize,
        stretch: f64,
        tool: &Transform,
        tool_kg: f64,
        with_masses: bool,
    ) -> Self {
        let (name, rows) = TABLES[number % TABLES.len()];
        let n = rows.len();
        let mut links = vec![rotation_z(rows[0].3)];
        for (i, row) in rows.iter().enumerate() {
            let next = rows.get(i + 1).map_or(0.0, |next| next.3);
            let along = mul(
                &translation([0.0, 0.0, row.0 * stretch]),
                &translation([row.1 * stretch, 0.0, 0.0]),
            );
            links.push(mul(&mul(&along, &rotation_x(row.2)), &rotation_z(next)));
        }
        let flange = links[n];
        links[n] = mul(&flange, tool);
        let mut arm = Self {
            name: name.to_owned(),
            links,
            masses: Vec::new(),
            gravity: [0.0, 0.0, -9.806_65],
            home: [0.0; JOINTS],
            half_range: [0.0; JOINTS],
        };
        for (i, row) in rows.iter().enumerate() {
            (arm.home[i], arm.half_range[i]) = (row.5, row.6);
            let to_next = if i + 1 == n { origin(&flange) } else { origin(&arm.links[i + 1]) };
            let aside = 0.06 * row.4 / (row.4 + 10.0);
            let position = [
                0.45 * to_next[0] + aside,
                0.45 * to_next[1] - 0.5 * aside,
                0.45 * to_next[2] + aside,
            ];
            arm.masses.push(Mass { joint: i, kg: row.4, position, tool: false });
        }
        let position = transform_point(&flange, scaled(origin(tool), 0.5));
        arm.masses.push(Mass { joint: n - 1, kg: tool_kg, position, tool: true });
        if !with_masses {
            arm.masses.clear();
        }
        arm
    }

    /// A random arm.
    pub fn random(rng: &mut Rng, with_masses: bool) -> Self {
        // Six-axis arms are most frequent.
        let number = [0, 0, 1, 1, 1, 2, 2, 2, 2, 3, 3, 4, 5][rng.uniform_index(13)];
        let stretch = rng.uniform_between(0.9, 1.15);
        let mut around = || rng.uniform_between(-1.0, 1.0);
        let bent = rotation([0.5 * around(), 0.5 * around(), around()]);
        let tool =
            mul(&translation([0.05 * around(), 0.05 * around(), 0.12 + 0.06 * around()]), &bent);
        let kg = rng.uniform_between(1.0, 6.0);
        Self::from_table(number, stretch, &tool, kg, with_masses)
    }

    /// Number of joints.
    #[must_use]
    pub fn joint_count(&self) -> usize {
        self.links.len() - 1
    }

    /// Frame of each joint before its motion, followed by that of the tool.
    #[must_use]
    pub fn frames(&self, q: &Joints) -> Vec<Transform> {
        let mut frames = Vec::with_capacity(self.links.len());
        let mut carried = IDENTITY;
        for (i, link) in self.links.iter().enumerate() {
            carried = mul(&carried, link);
            frames.push(carried);
            if i < self.joint_count() {
                carried = mul(&carried, &rotation_z(q[i]));
            }
        }
        frames
    }

    /// Pose of the tool at `q`.
    #[must_use]
    pub fn tool_pose(&self, q: &Joints) -> Transform {
        self.frames(q).pop().unwrap_or(IDENTITY)
    }

    /// Vector from joint `i`'s pivot to the next, in its frame after its motion, m.
    #[must_use]
    pub fn to_next(&self, i: usize) -> Vector3 {
        origin(&self.links[i + 1])
    }

    /// Whether a link is long enough for thermal growth.
    #[must_use]
    pub fn has_thermal_growth(&self, i: usize) -> bool {
        norm(self.to_next(i)) > 0.02
    }

    /// The two normals of joint `i`'s axis as defined by the model format, base axes at the zero configuration, transformed to the joint's frame.
    #[must_use]
    pub fn normals(&self, i: usize) -> [Vector3; 2] {
        let zero = self.frames(&[0.0; JOINTS])[i];
        let e = column(&zero, 2);
        let mut axis = 0;
        for k in 1..3 {
            if e[k].abs() < e[axis].abs() - 1e-9 {
                axis = k;
            }
        }
        let mut first = scaled(e, -e[axis]);
        first[axis] += 1.0;
        let first = scaled(first, 1.0 / norm(first));
        let second = crate::transform::cross(e, first);
        [rotate_inverse(&zero, first), rotate_inverse(&zero, second)]
    }

    /// A vector of the base axes at the zero configuration, in joint `i`'s frame.
    #[must_use]
    pub fn joint_from_base(&self, i: usize, v: Vector3) -> Vector3 {
        rotate_inverse(&self.frames(&[0.0; JOINTS])[i], v)
    }

    /// A vector of joint `i`'s frame in the base axes at the zero configuration.
    #[must_use]
    pub fn base_from_joint(&self, i: usize, v: Vector3) -> Vector3 {
        rotate(&self.frames(&[0.0; JOINTS])[i], v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transform::sub;

    fn tip(number: usize, q: Joints) -> Vector3 {
        origin(&Arm::from_table(number, 1.0, &IDENTITY, 1.0, true).tool_pose(&q))
    }

    #[test]
    fn published_arms_stand_where_their_makers_say() {
        // UR10e, all joints zero: a2 + a3, −(d4 + d6), d1 − d5 of the maker's table.
        let ur = tip(0, [0.0; JOINTS]);
        assert!(norm(sub(ur, [-1.184_25, -0.2907, 0.060_85])) < 1e-12, "{ur:?}");
        // IRB 120, all axes zero: 374 mm in front of the base and 630 mm above it (product specification).
        let irb = tip(1, [0.0; JOINTS]);
        assert!(norm(sub(irb, [0.374, 0.0, 0.63])) < 1e-12, "{irb:?}");
        // Axis 1 at a quarter turn: the same distance along y.
        let mut q = [0.0; JOINTS];
        q[0] = R;
        assert!(norm(sub(tip(1, q), [0.0, 0.374, 0.63])) < 1e-12);
        // IRB 120, axis 5 at a quarter turn: the flange, 72 mm from the wrist, points down at x = 302 mm.
        let mut q = [0.0; JOINTS];
        q[4] = R;
        assert!(norm(sub(tip(1, q), [0.302, 0.0, 0.558])) < 1e-12);
    }

    #[test]
    fn normals_are_the_contracts() {
        let arm = Arm::from_table(1, 1.0, &IDENTITY, 1.0, true);
        // Joint 1 about z: x comes first. Joint 4 of the IRB 120 about x: y comes first.
        let base = |i: usize| arm.normals(i).map(|n| arm.base_from_joint(i, n));
        assert!(norm(sub(base(0)[0], [1.0, 0.0, 0.0])) < 1e-12);
        assert!(norm(sub(base(0)[1], [0.0, 1.0, 0.0])) < 1e-12);
        assert!(norm(sub(base(3)[0], [0.0, 1.0, 0.0])) < 1e-12);
    }
}
