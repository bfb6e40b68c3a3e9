//! Detects that a model no longer holds, from occasional measurements of the tool: a sequential test (CUSUM).
//!
//! Each measurement gives a whitened residual `z = (measured − predicted)/σ`, three numbers that
//! are standard normal while the model holds. Over them run cumulative sums (Page, Biometrika 41,
//! 1954): the log-likelihood ratio of a change against no change, clipped at zero from below.
//!
//! ```text
//! shift along d:  S ← max(0, S + d·z − k)                            alarm if S > h
//! spread:         C ← max(0, C + |z|²/2 (1 − 1/κ²) − 3 ln κ)         alarm if C > c
//! ```
//!
//! d: 14 directions (axes and space diagonals, both ways): a drift in one direction, however small; k is half
//! the shift to be detected · C: a drift whose direction varies with the pose, so that only the size of the residuals shows it: N(0, κ²) against N(0, 1). Since when: the
//! measurement after that sum was last zero. |z| is clipped at 4, so that a single wrong measurement raises no alarm.
//!
//! Thresholds are set for more than 10⁴ measurements on average between false alarms of all sums (test
//! `a_model_that_holds_is_doubted_once_in_thousands_of_measurements`): at one measurement every ten minutes, months.
//!
//! Invariant: an alarm persists until the state is reset to [`AgeingTest::default`]. The test says
//! nothing about the cause.

use glam::DVec3;
use libm::log;

/// Half of the shift to be detected, σ.
const SHIFT: f64 = 0.5;
/// Alarm threshold of a shift.
const SHIFT_THRESHOLD: f64 = 10.5;
/// Directions: axes and space diagonals; each is also tested with the opposite sign.
const DIRECTIONS: [DVec3; 7] = [
    DVec3::X,
    DVec3::Y,
    DVec3::Z,
    DVec3::new(DIAGONAL, DIAGONAL, DIAGONAL),
    DVec3::new(DIAGONAL, DIAGONAL, -DIAGONAL),
    DVec3::new(DIAGONAL, -DIAGONAL, DIAGONAL),
    DVec3::new(DIAGONAL, -DIAGONAL, -DIAGONAL),
];
/// 1/√3.
const DIAGONAL: f64 = 0.577_350_269_189_625_8;
/// The standard deviation to be detected, relative to σ.
const SPREAD: f64 = 1.5;
/// Alarm threshold of a spread, log-likelihood ratio.
const SPREAD_THRESHOLD: f64 = 8.0;
/// Residuals are clipped at this multiple of σ.
const CLIP_SIGMAS: f64 = 4.0;
/// Memory of the exponentially weighted root mean square, in measurements.
const RMS_MEMORY: f64 = 20.0;

/// A cumulative sum that is never below zero, and the time since which it is above zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct CumulativeSum {
    height: f64,
    since_ns: u64,
}

impl CumulativeSum {
    fn add(&mut self, gain: f64, t_ns: u64) {
        if self.height == 0.0 {
            self.since_ns = t_ns;
        }
        self.height = (self.height + gain).max(0.0);
    }
}

/// State of the test for a change of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AgeingTest {
    shifts: [[CumulativeSum; 2]; DIRECTIONS.len()],
    spread: CumulativeSum,
    mean_square: f64,
    count: u64,
    broken_since_ns: Option<u64>,
}

impl AgeingTest {
    /// Adds a measurement: `residual` m, measured minus predicted; `sigma_m` above zero, standard
    /// uncertainty per axis of instrument and model together; `t_ns` not before the last one.
    /// Returns false, without effect, if a value is not finite or sigma is not above zero.
    pub fn add_measurement(&mut self, residual: DVec3, sigma_m: f64, t_ns: u64) -> bool {
        let z = residual / sigma_m;
        if !z.is_finite() || sigma_m <= 0.0 {
            return false;
        }
        self.count += 1;
        let share = (1.0 / self.count as f64).max(1.0 / RMS_MEMORY);
        self.mean_square += share * (residual.length_squared() - self.mean_square);
        let z = z.clamp_length_max(CLIP_SIGMAS);
        for ([ahead, back], direction) in self.shifts.iter_mut().zip(DIRECTIONS) {
            let along = direction.dot(z);
            ahead.add(along - SHIFT, t_ns);
            back.add(-along - SHIFT, t_ns);
        }
        let gain = 0.5 * z.length_squared() * (1.0 - 1.0 / (SPREAD * SPREAD));
        self.spread.add(gain - 3.0 * log(SPREAD), t_ns);
        if self.broken_since_ns.is_none() {
            let highest = self.shifts.iter().flatten().max_by(|a, b| a.height.total_cmp(&b.height));
            let shifted = highest.filter(|sum| sum.height > SHIFT_THRESHOLD);
            let spread = Some(&self.spread).filter(|sum| sum.height > SPREAD_THRESHOLD);
            self.broken_since_ns = shifted.or(spread).map(|sum| sum.since_ns);
        }
        true
    }

    /// Time of the measurement since which the model no longer holds; `None` while it holds.
    pub fn broken_since_ns(&self) -> Option<u64> {
        self.broken_since_ns
    }

    /// Number of measurements used.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Root mean square distance between recent measurements (about twenty) and predictions, m; NaN
    /// before the first.
    pub fn residual_m(&self) -> f64 {
        if self.count > 0 { libm::sqrt(self.mean_square) } else { f64::NAN }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGMA_M: f64 = 5e-5;
    const MINUTE_NS: u64 = 60_000_000_000;

    /// Standard normal numbers by the Box-Muller transform over a linear congruential generator.
    struct Rng(u64);

    impl Rng {
        fn unit(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        }

        fn normal(&mut self) -> f64 {
            let (radius, turn) = (self.unit(), self.unit());
            libm::sqrt(-2.0 * log(radius)) * libm::cos(core::f64::consts::TAU * turn)
        }

        fn noise(&mut self) -> DVec3 {
            DVec3::new(self.normal(), self.normal(), self.normal()) * SIGMA_M
        }
    }

    /// Number of measurements until the alarm, and the one from which the change is dated, counted
    /// from the first; `drift` in σ by the number of the measurement.
    fn run(rng: &mut Rng, most: u64, drift: &dyn Fn(u64) -> DVec3) -> Option<(u64, u64)> {
        let mut ageing = AgeingTest::default();
        for k in 0..most {
            assert!(ageing.add_measurement(
                rng.noise() + drift(k) * SIGMA_M,
                SIGMA_M,
                k * MINUTE_NS
            ));
            if let Some(since_ns) = ageing.broken_since_ns() {
                return Some((k, since_ns / MINUTE_NS));
            }
        }
        None
    }

    #[test]
    fn a_model_that_holds_is_doubted_once_in_thousands_of_measurements() {
        let (mut rng, mut alarms, mut left) = (Rng(3), 0_u64, 400_000_u64);
        let all = left;
        while let Some((count, _)) = run(&mut rng, left, &|_| DVec3::ZERO) {
            alarms += 1;
            left -= count.min(left);
        }
        let between = all / alarms.max(1);
        println!("{alarms} false words in {all} measurements: one in {between}");
        assert!(between > 8_000, "one in {between}");
    }

    #[test]
    fn a_drift_of_one_sigma_is_said_within_thirty_measurements_and_dated() {
        let mut rng = Rng(5);
        let (mut delays, mut dates) = (Vec::new(), Vec::new());
        for case in 0..200_u32 {
            let turn = f64::from(case);
            let direction = DVec3::new(libm::cos(turn), libm::sin(turn), 0.0);
            let drift = move |k: u64| if k >= 100 { direction } else { DVec3::ZERO };
            let (count, since) = run(&mut rng, 400, &drift).expect("said");
            delays.push(count.saturating_sub(100));
            dates.push(since.abs_diff(100));
        }
        delays.sort_unstable();
        dates.sort_unstable();
        println!(
            "said after {} in the middle, {} at 95 %; dated within {} and {}",
            delays[100], delays[190], dates[100], dates[190]
        );
        assert!(delays[100] <= 30 && delays[190] <= 45, "{delays:?}");
        assert!(dates[100] <= 6 && dates[190] <= 25, "{dates:?}");
    }

    #[test]
    fn a_drift_that_turns_with_the_pose_is_said_too() {
        let mut rng = Rng(7);
        for case in 0..50_u32 {
            let drift = move |k: u64| {
                let turn = 2.4 * k as f64 + f64::from(case);
                let direction = DVec3::new(libm::cos(turn), libm::sin(turn), libm::sin(3.0 * turn));
                if k >= 50 { 2.5 * direction } else { DVec3::ZERO }
            };
            let (count, since) = run(&mut rng, 400, &drift).expect("said");
            assert!((50..80).contains(&count) && since.abs_diff(50) < 25, "{count} {since}");
        }
    }

    #[test]
    fn one_wrong_measurement_says_nothing_and_nonsense_is_passed_over() {
        let mut ageing = AgeingTest::default();
        assert!(!ageing.add_measurement(DVec3::splat(f64::NAN), SIGMA_M, 0));
        assert!(
            !ageing.add_measurement(DVec3::ZERO, 0.0, 0)
                && !ageing.add_measurement(DVec3::ZERO, f64::NAN, 0)
        );
        assert_eq!((ageing.count(), ageing.residual_m().is_nan()), (0, true));
        assert!(ageing.add_measurement(DVec3::new(1.0, 0.0, 0.0), SIGMA_M, 1));
        assert_eq!(ageing.broken_since_ns(), None, "a reflector that was knocked off");
    }

    #[test]
    fn what_was_said_stays_said() {
        let mut ageing = AgeingTest::default();
        for k in 0..20 {
            ageing.add_measurement(DVec3::X * 4.0 * SIGMA_M, SIGMA_M, k);
        }
        let since = ageing.broken_since_ns();
        assert_eq!(since, Some(0));
        assert!((ageing.residual_m() - 4.0 * SIGMA_M).abs() < 1e-12);
        for k in 20..200 {
            ageing.add_measurement(DVec3::ZERO, SIGMA_M, k);
        }
        assert_eq!(ageing.broken_since_ns(), since);
    }
}
