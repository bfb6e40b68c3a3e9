//! Possible causes in the machine of a line in a surface spectrum.
//!
//! Joint rotations have a constant number of cycles per mm; spindle rotations and vibrations a
//! constant number per second, which the feed converts into cycles per mm. A short profile does not
//! resolve similar frequencies: all matching causes are listed, nearest first.

use super::Line;
use crate::config::{GearFrequency, Mode};
use crate::spatial::match_gears;

/// Machining conditions of the surface, as far as known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MachiningConditions {
    /// Speed of the tool along the profile, mm/s.
    pub feed_mm_s: Option<f64>,
    /// Spindle speed, rev/min.
    pub spindle_rpm: Option<f64>,
    /// Teeth of the tool; 0 if unknown.
    pub teeth: u32,
    /// Known natural frequencies.
    pub modes: Vec<Mode>,
    /// Gears by their cycles per mm along the profile.
    pub gear_frequencies: Vec<GearFrequency>,
}

/// Possible cause of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    /// Rotation of a gear shaft or a tooth mesh, or a multiple.
    Gear(GearFrequency, u32),
    /// The tooth passing of the cutter, or a multiple.
    Tooth(u32),
    /// The spindle rotation, or a multiple.
    Spindle(u32),
    /// A natural frequency, Hz.
    Mode(f64),
}

impl MachiningConditions {
    /// The line's frequency in time, Hz, if the feed is known.
    #[must_use]
    pub fn frequency_hz(&self, line: &Line) -> Option<f64> {
        self.feed_mm_s.map(|feed| feed * line.cycles_per_mm)
    }

    /// All causes that match a line of a profile of this length.
    #[must_use]
    pub fn causes(&self, line: &Line, length_mm: f64) -> Vec<Cause> {
        let tolerance = line.tolerance(length_mm) / line.cycles_per_mm;
        let wheels = match_gears(line.cycles_per_mm, &self.gear_frequencies, tolerance);
        let mut found: Vec<Cause> =
            wheels.into_iter().map(|(wheel, order)| Cause::Gear(wheel, order)).collect();
        let Some(frequency_hz) = self.frequency_hz(line) else { return found };
        if let Some(turns_hz) = self.spindle_rpm.map(|rpm| rpm / 60.0) {
            let multiple = |of_hz: f64| {
                let order = (frequency_hz / of_hz).round();
                let deviation = (order * of_hz / frequency_hz - 1.0).abs();
                ((1.0..=10.0).contains(&order) && deviation <= tolerance).then_some(order as u32)
            };
            let teeth = (self.teeth > 1).then(|| multiple(f64::from(self.teeth) * turns_hz));
            found.extend(match teeth.flatten() {
                Some(order) => Some(Cause::Tooth(order)),
                None => multiple(turns_hz).map(Cause::Spindle),
            });
        }
        let is_near = |mode: &&Mode| (mode.frequency_hz / frequency_hz - 1.0).abs() <= tolerance;
        found.extend(self.modes.iter().filter(is_near).map(|mode| Cause::Mode(mode.frequency_hz)));
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(cycles_per_mm: f64) -> Line {
        Line {
            cycles_per_mm,
            sigma_cycles_per_mm: 0.001,
            amplitude: 1.0,
            over_floor: 100.0,
            multiple_of: None,
        }
    }

    #[test]
    fn a_line_is_attributed_to_spindle_tooth_gear_and_mode_and_never_with_an_unknown_feed() {
        let wheel = GearFrequency { joint: 1, shaft: 1, teeth: 10, cycles_per_mm: 0.454 };
        let machining = MachiningConditions {
            feed_mm_s: Some(10.0),
            spindle_rpm: Some(1200.0),
            teeth: 2,
            modes: vec![Mode::at_hz(67.0)],
            gear_frequencies: vec![wheel],
        };
        let causes = |cycles: f64| machining.causes(&line(cycles), 50.0);
        assert_eq!(causes(2.0), [Cause::Spindle(1)]);
        assert_eq!(causes(4.0), [Cause::Tooth(1)]);
        assert_eq!(causes(8.002), [Cause::Tooth(2)]);
        assert_eq!(causes(0.9), [Cause::Gear(wheel, 2)]);
        assert_eq!(causes(6.7), [Cause::Mode(67.0)]);
        assert_eq!(causes(3.1), []);
        let blind = MachiningConditions { feed_mm_s: None, ..machining.clone() };
        assert_eq!(blind.causes(&line(4.0), 50.0), []);
        assert_eq!(machining.frequency_hz(&line(4.0)), Some(40.0));
        // A profile of 3 mm resolves no better than a sixth of a cycle per mm.
        let short = machining.causes(&line(6.55), 3.0);
        assert_eq!(short, [Cause::Mode(67.0)]);
    }
}
