//! Outlier and jump detection: a measurement is accepted if it agrees with the preceding ones.
//!
//! It is refused if it differs from their exponential mean by more than the model's error can change from one measurement to the next.
//! [`GateRules::in_a_row`] refused in a row are a jump of the instrument: measurements are then refused until as many in a row agree with
//! the earlier ones, or the new registration is confirmed.
//! A jump is never followed.

use glam::DVec3;

/// When measurements agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GateRules {
    /// Consecutive measurements required for a start, a jump or a return; 2 to 100. Default 5: if one measurement in fifty is an outlier, five consecutive outliers occur by chance once in 3e8.
    pub in_a_row: u32,
    /// Weight of the newest measurement in the exponential mean; no unit, above 0 to 1. Default
    /// 0.25: as the mean of seven (`2/w − 1`), which leaves 0.4 of the noise.
    pub newest: f64,
}

impl Default for GateRules {
    fn default() -> Self {
        Self { in_a_row: 5, newest: 0.25 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// The first ones, which must agree with each other.
    Starting,
    /// Measurements that agree are accepted.
    Steady,
    /// The instrument has jumped.
    Jumped,
}

/// Result for a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Believed,
    /// One of the first: more are needed.
    Starting,
    Refused,
}

/// The gate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gate {
    rules: GateRules,
    state: State,
    mean_m: DVec3,
    in_a_row: u32,
}

impl Gate {
    /// Without measurements.
    pub(super) const fn new(rules: GateRules) -> Self {
        Self { rules, state: State::Starting, mean_m: DVec3::ZERO, in_a_row: 0 }
    }

    /// Judges a deviation that may differ by `most_m` from the previous ones.
    pub(super) fn judge(&mut self, deviation_m: DVec3, most_m: f64) -> Verdict {
        let agrees = (deviation_m - self.mean_m).length() <= most_m;
        match (self.state, agrees) {
            (State::Starting, _) => self.start(deviation_m, agrees),
            (State::Steady, true) => {
                self.mean_m += self.rules.newest * (deviation_m - self.mean_m);
                self.in_a_row = 0;
            }
            (State::Jumped, false) => self.in_a_row = 0,
            (State::Steady, false) => self.step(State::Jumped),
            (State::Jumped, true) => self.step(State::Steady),
        }
        match self.state {
            State::Steady if agrees => Verdict::Believed,
            State::Starting => Verdict::Starting,
            _ => Verdict::Refused,
        }
    }

    /// Whether measurements are accepted.
    pub(super) fn is_steady(&self) -> bool {
        self.state == State::Steady
    }

    /// Whether the instrument has jumped.
    pub(super) fn has_jumped(&self) -> bool {
        self.state == State::Jumped
    }

    fn start(&mut self, deviation_m: DVec3, agrees: bool) {
        if self.in_a_row == 0 || !agrees {
            (self.mean_m, self.in_a_row) = (deviation_m, 1);
            return;
        }
        self.step(State::Steady);
        let count = if self.in_a_row == 0 { self.rules.in_a_row } else { self.in_a_row };
        self.mean_m += (deviation_m - self.mean_m) / f64::from(count);
    }

    /// One more measurement in a row; enough of them change the state.
    fn step(&mut self, to: State) {
        self.in_a_row += 1;
        if self.in_a_row == self.rules.in_a_row {
            (self.state, self.in_a_row) = (to, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOST_M: f64 = 3e-4;

    fn passes(gate: &mut Gate, deviation_m: DVec3) -> bool {
        gate.judge(deviation_m, MOST_M) == Verdict::Believed
    }

    fn steady() -> Gate {
        let mut gate = Gate::new(GateRules::default());
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
        let mut gate = Gate::new(GateRules::default());
        for k in 0..100 {
            assert!(!passes(&mut gate, DVec3::Y * 1e-3 * f64::from(k % 2)));
        }
        assert!(!gate.is_steady() && !gate.has_jumped());
    }
}
