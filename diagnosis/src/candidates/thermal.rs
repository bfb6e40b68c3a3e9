//! Thermal candidates: growth and drift.
//!
//! Functions of temperature if it was recorded, otherwise of time as warm-up with a few trial time constants.

use super::CandidateList;

/// Trial time constants, as fractions of the longest segment.
const WARM_UPS: [f64; 4] = [0.03, 0.1, 0.25, 0.6];

impl CandidateList<'_> {
    /// By temperature if recorded, otherwise as a warm-up.
    pub(super) fn add_thermal(&mut self, joint: usize) {
        for (kind, per_kelvin) in [("thermal_zero", "drift"), ("thermal_growth", "growth")] {
            let laws: Vec<Vec<(&str, f64)>> = if self.signals.temperature {
                vec![vec![(per_kelvin, 0.0)]]
            } else {
                let times = WARM_UPS.map(|share| share * self.signals.longest_s);
                let law = |time| vec![("amplitude", 0.0), ("time_constant", time)];
                times.into_iter().filter(|time| *time > 0.0).map(law).collect()
            };
            for law in laws {
                let given: Vec<(&str, &[f64])> =
                    law.iter().map(|(stem, x)| (*stem, std::slice::from_ref(x))).collect();
                if kind == "thermal_growth" {
                    self.add_growth(joint, &given);
                } else {
                    self.add_effect(kind, Some(joint), &given);
                }
            }
        }
    }

    /// Growth of the link between a joint and the next; if a first joint's point coincides with that of the next, growth below it, along its axis.
    pub(crate) fn add_growth(&mut self, joint: usize, law: &[(&str, &[f64])]) {
        let plain = self.add_effect("thermal_growth", Some(joint), law);
        if !plain && joint == 0 {
            let axis = self.arm.joints()[joint].axis.to_array();
            let upwards = [law, &[("direction", &axis[..])]].concat();
            self.add_effect("thermal_growth", Some(joint), &upwards);
        }
    }
}
