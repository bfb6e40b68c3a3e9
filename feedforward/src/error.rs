//! Errors of paths and measured runs.

use std::fmt;

use diagnosis::campaign_import::CampaignError;
use thiserror::Error;

/// A row of a recording, as messages name it.
#[derive(Clone, Debug, PartialEq)]
pub struct PathRow {
    /// From 1, without the header.
    pub row: usize,
    /// s.
    pub t_s: f64,
}

impl fmt::Display for PathRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "row {} of the data (t_s = {})", self.row, self.t_s)
    }
}

/// Whoever reads the file names it. Each message states what was found, what was expected and what to do.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FeedforwardError {
    /// The model has nothing to compensate.
    #[error(
        "the model states no time_delay, servo_lag or flexible_mode of a joint, so there are no dynamics to compensate; \
         `trued diagnose` finds them in the recording of a path"
    )]
    NothingInTime,
    /// Rows of several runs.
    #[error("{0} segments were given, expected one; correct each run separately")]
    Segments(usize),
    /// Poses at rest.
    #[error(
        "the rows are poses at rest (kind = \"poses\"), expected a path: a pose has no delay and no lag"
    )]
    Poses,
    /// Too few rows.
    #[error(
        "{0} rows were given, expected 8 or more: export the motion row by row over time; a single pose has no dynamics, correct it without --dynamic"
    )]
    TooShort(usize),
    /// A gap in time.
    #[error(
        "{at}: {gap_s:.3} s after the row before, expected at most {most_s:.3} s (ten times the median): the motion between is not known; correct the parts separately"
    )]
    Gap {
        /// The row after the gap.
        at: PathRow,
        /// s.
        gap_s: f64,
        /// s.
        most_s: f64,
    },
    /// A row without commanded joints.
    #[error("{at}: joint {joint} has no commanded position, expected one in each row")]
    NoCommand {
        /// Its row.
        at: PathRow,
        /// From 1.
        joint: usize,
    },
    /// The sampling is too coarse for the bandwidth.
    #[error(
        "{what} is sampled every {step_ms:.1} ms, expected at most {most_ms:.1} ms for a bandwidth of {bandwidth_hz} Hz: increase the sampling rate or reduce the bandwidth"
    )]
    Sampling {
        /// The path, or the measurement.
        what: &'static str,
        /// ms.
        step_ms: f64,
        /// ms.
        most_ms: f64,
        /// Hz.
        bandwidth_hz: f64,
    },
    /// A setting out of its range.
    #[error("{name} is {value}, expected {expected}")]
    Setting {
        /// Its name.
        name: &'static str,
        /// The value given.
        value: f64,
        /// Its range.
        expected: &'static str,
    },
    /// A command outside the joint limits.
    #[error(
        "{at}: joint {joint} would be commanded to {position:.5} (rad or m), outside its limits {lower:.5} to {upper:.5}; move the path away from the limit"
    )]
    JointLimit {
        /// The row of the path that the robot passes at that time.
        at: PathRow,
        /// From 1.
        joint: usize,
        /// rad or m.
        position: f64,
        /// rad or m.
        lower: f64,
        /// rad or m.
        upper: f64,
    },
    /// Neither joint positions nor points of the tool.
    #[error(
        "no usable measurements, expected link-side or motor-side joint positions (ql1_deg …, qa1_deg …) or points of the tool (x_mm, y_mm, z_mm)"
    )]
    NothingMeasured,
    /// The measurement does not cover the motion.
    #[error(
        "measured from {from_s:.3} s to {to_s:.3} s, the path moves from {moves_from_s:.3} s to {moves_to_s:.3} s: record the whole motion, \
         or state the clock offset (--clock-offset-ms)"
    )]
    Uncovered {
        /// s.
        from_s: f64,
        /// s.
        to_s: f64,
        /// s.
        moves_from_s: f64,
        /// s.
        moves_to_s: f64,
    },
    /// The error is too large for a linear correction.
    #[error(
        "the error of joint {joint} is {error:.4} (rad or m) at {t_s:.3} s, expected less than {most:.4}; check that this is the recording of this path \
         and that the clocks agree (--clock-offset-ms)"
    )]
    TooFarOff {
        /// From 1.
        joint: usize,
        /// rad or m.
        error: f64,
        /// s.
        t_s: f64,
        /// rad or m.
        most: f64,
    },
    /// The measurement is later, or earlier, than the plant can be.
    #[error(
        "the measurement is {excess_ms:.1} ms {} than the model predicts from the commands, expected at most {most_ms:.1} ms (the share --robust-to of delay and lags, and their sigma): \
         if its clock is not that of the commands, estimate the offset with --clock-offset-ms unknown; if it is, correct delay or lags of the model",
        if *.is_late { "later" } else { "earlier" }
    )]
    ClockMismatch {
        /// ms, above 0.
        excess_ms: f64,
        /// Whether the measurement is late.
        is_late: bool,
        /// ms.
        most_ms: f64,
    },
    /// The measured joint moves like the commanded one, in another unit.
    #[error(
        "joint {joint} moves {factor:.4} times as far as commanded, expected about once: {mistaken}; rename the column, or convert the values"
    )]
    OtherUnit {
        /// From 1.
        joint: usize,
        /// Measured over commanded.
        factor: f64,
        /// What the column seems to contain.
        mistaken: &'static str,
    },
    /// A recording cannot be used.
    #[error(transparent)]
    Unusable(#[from] CampaignError),
    /// Rows of a table with corrected joints are not even in time.
    #[error(
        "time steps are uneven, expected the output of `trued correct --dynamic` or `trued learn`, or a path without corrected joints (c1_deg …)"
    )]
    UnevenTable,
    /// A corrected joint is not a number.
    #[error("{at}: {column} is not a number")]
    NoNumber {
        /// Its row.
        at: PathRow,
        /// Its name.
        column: String,
    },
    /// Some joints have a column, others not.
    #[error("has corrected positions (c1_deg …) of {found} joints, expected {expected}")]
    JointsLacking {
        /// Number of joints with a column.
        found: usize,
        /// Number of joints of the model.
        expected: usize,
    },
}
