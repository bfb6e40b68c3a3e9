//! Arms from Denavit–Hartenberg tables, as chains of homogeneous transforms.
//!
//! `T(q) = L₀ · Rz(q₁) · L₁ · Rz(q₂) · … · Lₙ`, `Lᵢ = Tz(dᵢ) Tx(aᵢ) Rx(αᵢ)` of the classical table with the next joint's offset about z; the
//! pivot of joint i is the origin of its frame. Masses are points.
//!
//! The model file is derived from these transforms. All joints are revolute.

use crate::chance::Chance;
use crate::space::{
    ONE, T4, V3, column, mul, norm, origin, point, rotate, rotate_back, shift, times, turn, turn_x,
    turn_z,
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
    pub at: V3,
    /// Whether it belongs to the tool.
    pub tool: bool,
}

/// An arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// Name for users.
    pub name: String,
    /// `L₀` to `Lₙ`.
    pub links: Vec<T4>,
    /// Point masses; empty if unknown.
    pub masses: Vec<Mass>,
    /// Gravity in the base, m/s².
    pub gravity: V3,
    /// Centre of each joint's useful range, rad.
    pub home: Joints,
    /// Half of that range, rad.
    pub reach: Joints,
}

/// A row of a table: d, a (m), α, offset (rad), mass moved by the joint (kg), home and half range (rad).
type Row = (f64, f64, f64, f64, f64, f64, f64);

const R: f64 = std::f64::consts::FRAC_PI_2;

/// Dimensions as published (UR10e, IRB 120) or of similar proportions; masses are rounded.
const FAMILIES: [(&str, &[Row]); 6] = [
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
    /// The arm of a table of `FAMILIES`, with lengths scaled by `stretch`, and a tool.
    #[must_use]
    pub fn family(number: usize, stretch: f64, tool: &T4, tool_kg: f64, with_masses: bool) -> Self {
        let (name, rows) = FAMILIES[number % FAMILIES.len()];
        let n = rows.len();
        let mut links = vec![turn_z(rows[0].3)];
        for (i, row) in rows.iter().enumerate() {
            let next = rows.get(i + 1).map_or(0.0, |next| next.3);
            let along =
                mul(&shift([0.0, 0.0, row.0 * stretch]), &shift([row.1 * stretch, 0.0, 0.0]));
            links.push(mul(&mul(&along, &turn_x(row.2)), &turn_z(next)));
        }
        let flange = links[n];
        links[n] = mul(&flange, tool);
        let mut arm = Self {
            name: name.to_owned(),
            links,
            masses: Vec::new(),
            gravity: [0.0, 0.0, -9.806_65],
            home: [0.0; JOINTS],
            reach: [0.0; JOINTS],
        };
        for (i, row) in rows.iter().enumerate() {
            (arm.home[i], arm.reach[i]) = (row.5, row.6);
            let to_next = if i + 1 == n { origin(&flange) } else { origin(&arm.links[i + 1]) };
            let aside = 0.06 * row.4 / (row.4 + 10.0);
            let at = [
                0.45 * to_next[0] + aside,
                0.45 * to_next[1] - 0.5 * aside,
                0.45 * to_next[2] + aside,
            ];
            arm.masses.push(Mass { joint: i, kg: row.4, at, tool: false });
        }
        let at = point(&flange, times(origin(tool), 0.5));
        arm.masses.push(Mass { joint: n - 1, kg: tool_kg, at, tool: true });
        if !with_masses {
            arm.masses.clear();
        }
        arm
    }

    /// A random arm.
    pub fn draw(chance: &mut Chance, with_masses: bool) -> Self {
        // Six-axis arms are most frequent.
        let number = [0, 0, 1, 1, 1, 2, 2, 2, 2, 3, 3, 4, 5][chance.pick(13)];
        let stretch = chance.between(0.9, 1.15);
        let mut around = || chance.between(-1.0, 1.0);
        let bent = turn([0.5 * around(), 0.5 * around(), around()]);
        let tool = mul(&shift([0.05 * around(), 0.05 * around(), 0.12 + 0.06 * around()]), &bent);
        let kg = chance.between(1.0, 6.0);
        Self::family(number, stretch, &tool, kg, with_masses)
    }

    /// Number of joints.
    #[must_use]
    pub fn count(&self) -> usize {
        self.links.len() - 1
    }

    /// Frame of each joint before its motion, followed by that of the tool.
    #[must_use]
    pub fn frames(&self, q: &Joints) -> Vec<T4> {
        let mut frames = Vec::with_capacity(self.links.len());
        let mut carried = ONE;
        for (i, link) in self.links.iter().enumerate() {
            carried = mul(&carried, link);
            frames.push(carried);
            if i < self.count() {
                carried = mul(&carried, &turn_z(q[i]));
            }
        }
        frames
    }

    /// Pose of the tool at `q`.
    #[must_use]
    pub fn tool(&self, q: &Joints) -> T4 {
        self.frames(q).pop().unwrap_or(ONE)
    }

    /// Vector from joint `i`'s pivot to the next, in its frame after its motion, m.
    #[must_use]
    pub fn to_next(&self, i: usize) -> V3 {
        origin(&self.links[i + 1])
    }

    /// Whether a link is long enough for thermal growth.
    #[must_use]
    pub fn grows(&self, i: usize) -> bool {
        norm(self.to_next(i)) > 0.02
    }

    /// The two normals of joint `i`'s axis as defined by the model format, base axes at the zero configuration, transformed to the joint's frame.
    #[must_use]
    pub fn normals(&self, i: usize) -> [V3; 2] {
        let zero = self.frames(&[0.0; JOINTS])[i];
        let e = column(&zero, 2);
        let mut axis = 0;
        for k in 1..3 {
            if e[k].abs() < e[axis].abs() - 1e-9 {
                axis = k;
            }
        }
        let mut first = times(e, -e[axis]);
        first[axis] += 1.0;
        let first = times(first, 1.0 / norm(first));
        let second = crate::space::cross(e, first);
        [rotate_back(&zero, first), rotate_back(&zero, second)]
    }

    /// A vector of the base axes at the zero configuration, in joint `i`'s frame.
    #[must_use]
    pub fn into_joint(&self, i: usize, v: V3) -> V3 {
        rotate_back(&self.frames(&[0.0; JOINTS])[i], v)
    }

    /// A vector of joint `i`'s frame in the base axes at the zero configuration.
    #[must_use]
    pub fn out_of_joint(&self, i: usize, v: V3) -> V3 {
        rotate(&self.frames(&[0.0; JOINTS])[i], v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::sub;

    fn tip(number: usize, q: Joints) -> V3 {
        origin(&Arm::family(number, 1.0, &ONE, 1.0, true).tool(&q))
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
        let arm = Arm::family(1, 1.0, &ONE, 1.0, true);
        // Joint 1 about z: x comes first. Joint 4 of the IRB 120 about x: y comes first.
        let base = |i: usize| arm.normals(i).map(|n| arm.out_of_joint(i, n));
        assert!(norm(sub(base(0)[0], [1.0, 0.0, 0.0])) < 1e-12);
        assert!(norm(sub(base(0)[1], [0.0, 1.0, 0.0])) < 1e-12);
        assert!(norm(sub(base(3)[0], [0.0, 1.0, 0.0])) < 1e-12);
    }
}
