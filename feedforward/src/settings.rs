//! Thresholds of a feedforward, each with unit, range, default and origin.

use crate::FeedforwardError;
use envelope::{Limits, LimitsError};

/// Settings of a feedforward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Frequency at which the weight of the correction's third derivative equals that of the path's
    /// error, Hz, 1 to 100. Default 40: several times the first modes of industrial arms (5 to 20
    /// Hz), and a sixth of the rate of a controller with 4 ms.
    pub bandwidth_hz: f64,
    /// Relative deviation of the plant's parameters up to which the root mean square error does not
    /// increase, 0 to 0.5. Default 0.3: the change of a delay or a natural frequency over an arm's
    /// workspace.
    pub robust_to: f64,
    /// Relative standard uncertainty of parameters without a stated one, 0 to 1. Default 0.1.
    pub unstated: f64,
    /// Limits of the correction, which is added to the static commands, rad or m: position, rate,
    /// jerk. Default 0.2, 1 /s, 5000 /s³: a lag of 0.1 s at 2 rad/s, and the jerk of the joints of
    /// the FR3 (libfranka, `rate_limiting.h`).
    pub limits: Limits,
    /// Larger measured errors are refused, rad or m, above 0. Default 0.2, as the position limit.
    pub error_max: f64,
    /// Share of the learned change that is used, above 0 to 1. Default 1; halved each time that a run
    /// is worse than the one before and learning goes back.
    pub learning_share: f64,
    /// A run counts as worse than the one before if the root mean square of the tool's tracking error
    /// is larger by more than this share, 0 to 1. Default 0.1: changes of a converged run by noise and by
    /// the robot's repeatability are smaller.
    pub worse_share: f64,
    /// A tracking error of more than this multiple of the model's prediction, its parameters within
    /// `sigmas`, is reported, 1 to 100. Default 3: friction and errors at rest are not predicted.
    pub unexplained_max: f64,
    /// Deviation of the model's parameters, in standard uncertainties, within which a run counts as predicted,
    /// 0 to 10. Default 2: 95 %.
    pub sigmas: f64,
    /// A measurement that is late or early by less than this is not reported, s, 0 to 0.01. Default 5e-4: half
    /// the period of a controller of 1 kHz, by which stamps of two computers differ.
    pub late_floor_s: f64,
    /// Distances from the path below this count as zero where two are compared, m, 0 to 1e-3. Default
    /// 2e-6: below the resolution of trackers and of joint encoders at the tool.
    pub path_floor_m: f64,
    /// The same as a share of the largest tracking error without correction, 0 to 0.2. Default 0.02: a tool that
    /// turns round on a line is never off it while it is late; compensated, it may overshoot a little.
    pub path_floor_share: f64,
}

impl Settings {
    /// Default of `bandwidth_hz`.
    pub const BANDWIDTH_HZ: f64 = 40.0;
    /// Default of `robust_to`.
    pub const ROBUST_TO: f64 = 0.3;
    /// Default limits of the correction: position, rad or m; rate, per s; jerk, per s³.
    pub const LIMITS: [f64; 3] = [0.2, 1.0, 5000.0];

    /// The defaults with other limits: position (rad or m), rate (per s), jerk (per s³).
    ///
    /// # Errors
    /// A limit that is not a finite number above 0.
    pub fn with_limits(position: f64, rate: f64, jerk: f64) -> Result<Self, FeedforwardError> {
        let limits = Limits::new(position, rate, jerk).map_err(|error| {
            let LimitsError { bound: name, value } = error;
            FeedforwardError::Setting { name, value, expected: "a finite number above 0" }
        })?;
        Ok(Self {
            bandwidth_hz: Self::BANDWIDTH_HZ,
            robust_to: Self::ROBUST_TO,
            unstated: 0.1,
            limits,
            error_max: 0.2,
            learning_share: 1.0,
            worse_share: 0.1,
            unexplained_max: 3.0,
            sigmas: 2.0,
            late_floor_s: 5e-4,
            path_floor_m: 2e-6,
            path_floor_share: 0.02,
        })
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), FeedforwardError> {
        let ranges = [
            ("bandwidth", self.bandwidth_hz, 1.0..=100.0, "1 to 100 Hz"),
            ("robust-to", self.robust_to, 0.0..=0.5, "0 to 0.5"),
            ("unstated", self.unstated, 0.0..=1.0, "0 to 1"),
            ("error-max", self.error_max, f64::MIN_POSITIVE..=10.0, "above 0, at most 10"),
            ("learning share", self.learning_share, f64::MIN_POSITIVE..=1.0, "above 0, at most 1"),
            ("worse share", self.worse_share, 0.0..=1.0, "0 to 1"),
            ("unexplained-max", self.unexplained_max, 1.0..=100.0, "1 to 100"),
            ("sigmas", self.sigmas, 0.0..=10.0, "0 to 10"),
            ("late floor", self.late_floor_s, 0.0..=0.01, "0 to 0.01 s"),
            ("path floor", self.path_floor_m, 0.0..=1e-3, "0 to 1e-3 m"),
            ("path floor share", self.path_floor_share, 0.0..=0.2, "0 to 0.2"),
        ];
        for (name, value, range, expected) in ranges {
            if !range.contains(&value) {
                return Err(FeedforwardError::Setting { name, value, expected });
            }
        }
        Ok(())
    }

    /// Checks that samples are close enough for the band: four per period of its edge.
    ///
    /// # Errors
    /// [`FeedforwardError::Sampling`].
    pub fn check_step(&self, what: &'static str, step_s: f64) -> Result<(), FeedforwardError> {
        let (bandwidth_hz, most_s) = (self.bandwidth_hz, 0.25 / self.bandwidth_hz);
        if step_s <= most_s {
            return Ok(());
        }
        let (step_ms, most_ms) = (step_s * 1e3, most_s * 1e3);
        Err(FeedforwardError::Sampling { what, step_ms, most_ms, bandwidth_hz })
    }
}

/// The defaults.
#[cfg(test)]
pub(crate) fn settings() -> Settings {
    let [position, rate, jerk] = Settings::LIMITS;
    Settings::with_limits(position, rate, jerk).expect("sound")
}
