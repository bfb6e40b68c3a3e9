//! Outlier and jump detection: a measurement is accepted if it agrees with the preceding ones.
//!
//! It is refused if it differs from their exponential mean by more than the model's error can change from one measurement to the next.
//! [`OutlierRules::consecutive`] refused in a row are a jump of the instrument: measurements are then refused until as many in a row agree with
//! the earlier ones, or the new registration is confirmed.
//! A jump is never followed.

use glam::DVec3;

/// When measurements agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlierRules {
    /// Consecutive measurements required for a start, a jump or a return; 2 to 100. Default 5: if one measurement in fifty is an outlier, five consecutive outliers occur by chance once in 3e8.
    pub consecutive: u32,
    /// Weight of the newest measurement in the exponential mean; no unit, above 0 to 1. Default
    /// 0.25: as the mean of seven (`2/w − 1`), which leaves 0.4 of the noise.
    pub newest_weight: f64,
}

impl Default for OutlierRules {
    fn default() -> Self {
        Self { consecutive: 5, newest_weight: 0.25 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GateStage {
    /// The first ones, which must agree with each other.
    Starting,
    /// Measurements that agree are accepted.
    Steady,
    /// The instrument has jumped.
    Jumped,
}

/// Result for a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MeasurementVerdict {
    Accepted,
    /// One of the first: more are needed.
    Starting,
    Refused,
}

/// The gate.
#[derive(Clone, Copy, Debug)]
pub(super) struct OutlierGate {
    rules: OutlierRules,
    state: GateStage,
    mean_m: DVec3,
    in_a_row: u32,
}

impl OutlierGate {
    /// Without measurements.
    pub(super) const fn new(rules: OutlierRules) -> Self {
        Self { rules, state: GateStage::Starting, mean_m: DVec3::ZERO, in_a_row: 0 }
    }

    /// Validates a deviation that may differ by up to `deviation_max_m` from the previous ones.
    pub(super) fn judge(&mut self, deviation_m: DVec3, most_m: f64) -> MeasurementVerdict {
        let agrees = (deviation_m - self.mean_m).length() <= most_m;
        match (self.state, agrees) {
            (GateStage::Starting, _) => self.start(deviation_m, agrees),
            (GateStage::Steady, true) => {
                self.mean_m += self.rules.newest_weight * (deviation_m - self.mean_m);
                self.in_a_row = 0;
            }
            (GateStage::Jumped, false) => self.in_a_row = 0,
            (GateStage::Steady, false) => self.step(GateStage::Jumped),
            (GateStage::Jumped, true) => self.step(GateStage::Steady),
        }
        match self.state {
            GateStage::Steady if agrees => MeasurementVerdict::Accepted,
            GateStage::Starting => MeasurementVerdict::Starting,
            _ => MeasurementVerdict::Refused,
        }
    }

    /// Whether measurements are accepted.
    pub(super) fn is_steady(&self) -> bool {
        self.state == GateStage::Steady
    }

    /// Whether the instrument has jumped.
    pub(super) fn has_jumped(&self) -> bool {
        self.state == GateStage::Jumped
    }

    fn start(&mut self, deviation_m: DVec3, agrees: bool) {
        if self.in_a_row == 0 || !agrees {
            (self.mean_m, self.in_a_row) = (deviation_m, 1);
            return;
        }
        self.step(GateStage::Steady);
        let count = if self.in_a_row == 0 { self.rules.consecutive } else { self.in_a_row };
        self.mean_m += (deviation_m - self.mean_m) / f64::from(count);
    }

    /// One more measurement in a row; enough of them change the state.
    fn step(&mut self, to: GateStage) {
        self.in_a_row += 1;
        if self.in_a_row == self.rules.consecutive {
            (self.state, self.in_a_row) = (to, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOST_M: f64 = 3e-4;

    fn passes(gate: &mut OutlierGate, deviation_m: DVec3) -> bool {
        gate.judge(deviation_m, MOST_M) == MeasurementVerdict::Accepted
    }

    fn steady() -> OutlierGate {
        let mut gate = OutlierGate::new(OutlierRules::default());
        (0..5).for_each(|_| _ = passes(&mut gate, DVec3::X * 2e-3));
        assert!(gate.is_steady(), "however large the first deviation is");
        gate
    }

    #[test]
    fn a_single_jump_is_refused_and_the_next_sound_one_believed() {
        let mut gate = steady();
        assert!(!passes(&mut gate, DVec3::X * 3e-3));
        assert!(passes(&mut gate, DVec3::X * 2.1e-3));
    }

    #[test]
    fn a_jump_that_stays_is_never_followed_and_a_return_is_believed_again() {
        let mut gate = steady();
        for k in 0..1000 {
            assert!(!passes(&mut gate, DVec3::X * 3e-3));
            assert_eq!(gate.has_jumped(), k >= 4, "after {k}");
        }
        let back = [(); 6].map(|()| passes(&mut gate, DVec3::X * 2e-3));
        assert_eq!(back, [false, false, false, false, true, true]);
    }

    #[test]
    fn a_change_that_is_slow_is_followed_however_far() {
        let mut gate = steady();
        for k in 0..1000 {
            assert!(passes(&mut gate, DVec3::X * (2e-3 + 5e-5 * f64::from(k))), "{k}");
        }
    }

    #[test]
    fn first_measurements_that_differ_are_no_start() {
        let mut gate = OutlierGate::new(OutlierRules::default());
        for k in 0..100 {
            assert!(!passes(&mut gate, DVec3::Y * 1e-3 * f64::from(k % 2)));
        }
        assert!(!gate.is_steady() && !gate.has_jumped());
    }
}
