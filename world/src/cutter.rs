//! Cutting forces of a short-flute mill: the linear edge force model (thesis 4.7; Altintas, Manufacturing Automation, 2012, 2.8).
//!
//! One tooth at angle φ (from the normal axis, with the rotation), `φ_entry ≤ φ ≤ φ_exit`, chip `h = f_t sin φ`, depth `a`:
//! `F_t = (K_tc h + K_te) a`, `F_r = (K_rc h + K_re) a`, `F_a = (K_ac h + K_ae) a`;
//! on the tool: `F_x = −F_t cos φ − F_r sin φ`, `F_y = F_t sin φ − F_r cos φ`, `F_z = F_a`.
//! x: along the feed · z: up out of the work, against the tool's own z · y = z × x.
//!
//! A mean over any range of angle is exact (closed form), so that neither the sensor's samples nor
//! the mean force depend on a step size. Not modelled: helix (at 0.25 mm depth and 30° it lags
//! 2.8°), runout, deflection of the tool, variable depth.

use glam::DVec3;
use physics::cut::{ForceDirections, swept_tooth_forces};
use std::f64::consts::{PI, TAU};

/// A mill and its engagement. Angles in rad from the normal axis, with the rotation; `0 ≤ entry <
/// exit ≤ 2π`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutter {
    /// Number of teeth.
    pub teeth: u32,
    /// Spindle speed, rev/s.
    pub spindle_hz: f64,
    /// Axial depth of cut, m.
    pub axial_depth_m: f64,
    /// Where a tooth enters the work, rad.
    pub entry_rad: f64,
    /// Where a tooth leaves it, rad.
    pub exit_rad: f64,
    /// `K_tc, K_rc, K_ac`: tangential, radial, axial, N/m².
    pub chip_n_m2: DVec3,
    /// `K_te, K_re, K_ae`, N/m.
    pub edge_n_m: DVec3,
}

impl Default for Cutter {
    /// The thesis' slots: two teeth, 28 000 rpm, 0.25 mm deep, full width; coefficients as in
    /// `docs/reference/recording.md`.
    fn default() -> Self {
        Self {
            teeth: 2,
            spindle_hz: 28_000.0 / 60.0,
            axial_depth_m: 0.25e-3,
            entry_rad: 0.0,
            exit_rad: PI,
            chip_n_m2: DVec3::new(800e6, 300e6, 150e6),
            edge_n_m: DVec3::new(8e3, 10e3, 2e3),
        }
    }
}

impl Cutter {
    /// Tooth passing frequency, Hz.
    pub fn tooth_passing_hz(&self) -> f64 {
        self.spindle_hz * f64::from(self.teeth)
    }

    /// Feed per tooth, m, at a feed in m/s.
    pub fn feed_per_tooth_m(&self, feed_m_s: f64) -> f64 {
        feed_m_s / self.tooth_passing_hz()
    }

    /// Mean force on the tool over whole revolutions, N, in cut axes (feed, normal, up).
    pub fn mean_force(&self, feed_m_s: f64) -> DVec3 {
        let one_tooth = self.integral(feed_m_s, self.entry_rad, self.exit_rad);
        one_tooth * (f64::from(self.teeth) / TAU)
    }

    /// Mean force on the tool from `t_s` to `t_s + span_s` (above zero), N, in cut axes; tooth 0 is
    /// at angle 0 at time 0.
    pub fn force_over(&self, feed_m_s: f64, t_s: f64, span_s: f64) -> DVec3 {
        let span = TAU * self.spindle_hz * span_s;
        let turns = (self.spindle_hz * t_s) % 1.0;
        let mut sum = DVec3::ZERO;
        for tooth in 0..self.teeth {
            let pitch = f64::from(tooth) / f64::from(self.teeth);
            let from = TAU * ((turns + pitch) % 1.0);
            sum += self.engaged(feed_m_s, from, from + span);
        }
        sum / span
    }

    /// Integral over the engaged part of `from ..= to` (rad, `0 ≤ from < 2π`), over all turns in
    /// the range.
    fn engaged(&self, feed_m_s: f64, from: f64, to: f64) -> DVec3 {
        let mut sum = DVec3::ZERO;
        let mut turn = 0.0;
        while turn <= to {
            let low = from.max(self.entry_rad + turn);
            let high = to.min(self.exit_rad + turn);
            if low < high {
                sum += self.integral(feed_m_s, low, high);
            }
            turn += TAU;
        }
        sum
    }

    /// Integral of one tooth's force over a range of engagement, N rad.
    fn integral(&self, feed_m_s: f64, from: f64, to: f64) -> DVec3 {
        let ForceDirections { edge, chip } = swept_tooth_forces(from, to);
        let feed_per_tooth_m = self.feed_per_tooth_m(feed_m_s);
        (edge * self.edge_n_m + chip * (self.chip_n_m2 * feed_per_tooth_m)) * self.axial_depth_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Force of all teeth at one instant, directly from the equations.
    fn at(cutter: &Cutter, feed: f64, t: f64) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for tooth in 0..cutter.teeth {
            let phase = f64::from(tooth) / f64::from(cutter.teeth);
            let angle = TAU * ((cutter.spindle_hz * t + phase) % 1.0);
            if angle < cutter.entry_rad || angle > cutter.exit_rad {
                continue;
            }
            let h = cutter.feed_per_tooth_m(feed) * angle.sin();
            let f = (cutter.chip_n_m2 * h + cutter.edge_n_m) * cutter.axial_depth_m;
            let (s, c) = angle.sin_cos();
            sum += DVec3::new(-f.x * c - f.y * s, f.x * s - f.y * c, f.z);
        }
        sum
    }

    proptest! {
        #[test]
        fn a_mean_over_a_span_agrees_with_a_fine_sum(
            t in 0.0..50.0_f64, span in 2e-5..3e-3_f64, feed in 0.0..0.01_f64,
            entry_rad in 0.0..1.5_f64, exit_rad in 1.6..6.2_f64, teeth in 1_u32..5,
        ) {
            let cutter = Cutter { entry_rad, exit_rad, teeth, ..Cutter::default() };
            let n = 4000;
            let sum: DVec3 = (0..n)
                .map(|k| at(&cutter, feed, t + span * (f64::from(k) + 0.5) / f64::from(n)))
                .sum();
            let error = cutter.force_over(feed, t, span) - sum / f64::from(n);
            prop_assert!(error.length() < 0.02, "{error}");
        }

        #[test]
        fn the_force_repeats_with_the_tooth_passing(t in 0.0..20.0_f64, feed in 0.0..0.01_f64) {
            let cutter = Cutter::default();
            let now = cutter.force_over(feed, t, 1e-4);
            let next = cutter.force_over(feed, t + 1.0 / cutter.tooth_passing_hz(), 1e-4);
            prop_assert!((now - next).length() < 1e-9);
        }
    }

    #[test]
    fn the_mean_force_in_a_slot_is_the_closed_form() {
        let (cutter, feed) = (Cutter::default(), 0.01);
        let (n, a, f) = (2.0, cutter.axial_depth_m, cutter.feed_per_tooth_m(feed));
        let (c, e) = (cutter.chip_n_m2, cutter.edge_n_m);
        let expected = DVec3::new(
            -n * a / 4.0 * c.y * f - n * a / PI * e.y,
            n * a / 4.0 * c.x * f + n * a / PI * e.x,
            n * a / PI * c.z * f + n * a / 2.0 * e.z,
        );
        assert!((cutter.mean_force(feed) - expected).length() < 1e-12);
        let over_a_turn = cutter.force_over(feed, 0.123, 1.0 / cutter.spindle_hz);
        assert!((over_a_turn - expected).length() < 1e-9);
    }

    #[test]
    fn without_feed_only_the_edges_rub() {
        let cutter = Cutter::default();
        let blunt = Cutter { chip_n_m2: DVec3::ZERO, ..cutter };
        assert_eq!(cutter.mean_force(0.0), blunt.mean_force(0.01));
        let sharp = Cutter { edge_n_m: DVec3::ZERO, ..cutter };
        assert_eq!(sharp.mean_force(0.0), DVec3::ZERO);
    }

    #[test]
    fn the_cut_takes_power_and_resists_the_feed() {
        let force = Cutter::default().mean_force(0.005);
        assert!(force.x < 0.0, "against the feed");
        assert!(force.z > 0.0, "out of the work");
    }

    #[test]
    fn the_tooth_passing_of_the_thesis_is_933_hz() {
        assert!((Cutter::default().tooth_passing_hz() - 933.33).abs() < 0.01);
    }
}
