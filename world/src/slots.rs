//! The thesis' slots: U-shaped, +Y then +X then −Y in a horizontal plane, next to each other along
//! +X.
//!
//! Every leg is a separate cut (0-based, three per slot); between slots the tool is lifted.

use crate::path::{PathError, ToolPath, Waypoint};
use crate::profile::Limits;
use glam::{DMat3, DVec3};

/// One U-shaped slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slot {
    /// Feed, m/s; the thesis mills at 0.001 to 0.01.
    pub feed_m_s: f64,
    /// Length of each of its three legs, m.
    pub leg_m: f64,
}

/// A row of U-shaped slots.
#[derive(Clone, Debug, PartialEq)]
pub struct Slots {
    /// Start of the first slot, at the depth of cut, base frame, m.
    pub start_base: DVec3,
    /// The slots, in order.
    pub slots: Vec<Slot>,
    /// Radius of the corners, m.
    pub blend_m: f64,
    /// Height by which the tool is lifted between slots, m.
    pub lift_m: f64,
    /// Gap between two slots along x, m.
    pub gap_m: f64,
    /// Feed in air, m/s.
    pub rapid_m_s: f64,
    /// Bounds along the path.
    pub limits: Limits,
}

impl Slots {
    /// Slots starting at `start_base` (m), with 1 mm corners, lifted by 2 mm, 8 mm apart.
    pub fn u_shaped(start_base: DVec3, slots: &[Slot]) -> Self {
        Self {
            start_base,
            slots: slots.to_vec(),
            blend_m: 1e-3,
            lift_m: 2e-3,
            gap_m: 8e-3,
            rapid_m_s: 0.03,
            limits: Limits::default(),
        }
    }

    /// Four slots at 1, 2, 5 and 10 mm/s, the slower ones shorter: 39 s.
    pub fn thesis(start_base: DVec3) -> Self {
        let slot =
            |feed_mm_s: f64, leg_mm: f64| Slot { feed_m_s: 1e-3 * feed_mm_s, leg_m: 1e-3 * leg_mm };
        let slots = [slot(1.0, 4.0), slot(2.0, 6.0), slot(5.0, 14.0), slot(10.0, 25.0)];
        Self::u_shaped(start_base, &slots)
    }

    /// One slot at 10 mm/s: 5 s.
    pub fn quick(start_base: DVec3) -> Self {
        Self::u_shaped(start_base, &[Slot { feed_m_s: 0.01, leg_m: 0.015 }])
    }

    /// The path with the tool's orientation `base_from_tool`; it begins and ends lifted.
    ///
    /// # Errors
    /// Values that do not form a path.
    pub fn tool_path(&self, base_from_tool: DMat3) -> Result<ToolPath, PathError> {
        let lift = DVec3::new(0.0, 0.0, self.lift_m);
        let air = |to_base| [Waypoint { to_base, cut: None }];
        let mut path = ToolPath::new(self.start_base + lift, base_from_tool);
        let mut corner = self.start_base;
        for (i, slot) in self.slots.iter().enumerate() {
            if i > 0 {
                path.stroke(&air(corner + lift), self.rapid_m_s, self.blend_m, self.limits)?;
            }
            path.stroke(&air(corner), self.rapid_m_s, self.blend_m, self.limits)?;
            let legs = [DVec3::Y, DVec3::X, -DVec3::Y];
            let mut cuts = [Waypoint { to_base: corner, cut: None }; 3];
            for (leg, waypoint) in cuts.iter_mut().enumerate() {
                corner += legs[leg] * slot.leg_m;
                *waypoint = Waypoint { to_base: corner, cut: Some(3 * i + leg) };
            }
            path.stroke(&cuts, slot.feed_m_s, self.blend_m, self.limits)?;
            path.stroke(&air(corner + lift), self.rapid_m_s, self.blend_m, self.limits)?;
            corner += DVec3::new(self.gap_m, 0.0, 0.0);
        }
        Ok(path)
    }

    /// Description of a cut (0-based).
    pub fn cut_name(cut: usize) -> String {
        let leg = ["+Y", "+X", "−Y"][cut % 3];
        format!("slot {}, {leg}", cut / 3 + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_leg_is_cut_in_its_direction_in_one_plane_at_most_at_its_feed() {
        let start = DVec3::new(0.8, -0.1, 0.4);
        let slots = Slots::thesis(start);
        let path = slots.tool_path(DMat3::IDENTITY).expect("a sound path");
        let mut longest = [0.0_f64; 12];
        let mut t = 0.0;
        while t < path.duration_s() {
            let point = path.at(t);
            if let Some(cut) = point.cut {
                assert!((point.base_from_tool.origin.z - start.z).abs() < 1e-15);
                longest[cut] = longest[cut].max(point.feed_m_s);
                let leg = [DVec3::Y, DVec3::X, -DVec3::Y][cut % 3];
                assert!(point.direction_base.dot(leg) > -1e-9);
            }
            t += 1e-3;
        }
        for (cut, feed) in longest.iter().enumerate() {
            let stated = slots.slots[cut / 3].feed_m_s;
            assert!((feed - stated).abs() < 1e-12, "{} ran at {feed}", Slots::cut_name(cut));
        }
        assert!((35.0..50.0).contains(&path.duration_s()), "takes {} s", path.duration_s());
        let quick = Slots::quick(start).tool_path(DMat3::IDENTITY).expect("a sound path");
        assert!((4.0..7.0).contains(&quick.duration_s()), "takes {} s", quick.duration_s());
    }
}
