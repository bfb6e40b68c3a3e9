//! The tool's held-out errors compared with the allowed error.
//!
//! An error is the distance between a measured and a predicted point, including the noise of the instrument; measuring frames and targets are fitted.

use diagnosis::diagnose::Diagnosis;
use diagnosis::hold_out::PositionErrors;
use report::significant;
use serde::Serialize;

/// From m to mm.
const MILLI: f64 = 1e3;
/// Fraction of the held-out errors that must be within the tolerance, as in a calibration.
const SHARE: f64 = 0.95;

/// Whether the tool is within a tolerance on held-out rows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Tolerance {
    /// Allowed error, mm.
    pub tolerance_mm: f64,
    /// The given model; null if no held-out row contains a tool position.
    pub before: Option<HeldOut>,
    /// The model with the findings.
    pub after: Option<HeldOut>,
}

/// Held-out errors of one model compared with the tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct HeldOut {
    /// 95 % quantile of the held-out errors, mm.
    pub p95_mm: f64,
    /// Whether it is within the tolerance.
    pub met: bool,
}

impl Tolerance {
    /// `None`: positions were not diagnosed.
    pub(crate) fn of(tolerance_mm: f64, diagnosis: Option<&Diagnosis>) -> Self {
        let judged = diagnosis.filter(|diagnosis| diagnosis.test_errors.is_length);
        let lists = judged.map(Diagnosis::held_out).unwrap_or_default();
        let [before, after] = lists.map(|errors_m| HeldOut::of(tolerance_mm, errors_m));
        Self { tolerance_mm, before, after }
    }

    /// Whether the tool was evaluated and is outside the tolerance with the findings.
    pub(crate) fn is_missed(&self) -> bool {
        self.after.is_some_and(|held| !held.met)
    }

    /// The evaluation, to follow the words "tolerance of".
    pub(crate) fn evaluation(&self) -> String {
        let tolerance = significant(self.tolerance_mm, 3);
        let (Some(before), Some(after)) = (self.before, self.after) else {
            return format!(
                "{tolerance} mm not evaluated: no held-out row contains a tool position"
            );
        };
        let outcome = |held: HeldOut| if held.met { "met" } else { "not met" };
        format!(
            "{tolerance} mm {} with the given model and {} with the findings: 95 % of the held-out tool errors are within {} and {} mm",
            outcome(before),
            outcome(after),
            significant(before.p95_mm, 3),
            significant(after.p95_mm, 3)
        )
    }
}

impl HeldOut {
    fn of(tolerance_mm: f64, mut sorted_m: Vec<f64>) -> Option<Self> {
        if sorted_m.is_empty() {
            return None;
        }
        sorted_m.sort_by(f64::total_cmp);
        let p95_mm = MILLI * PositionErrors { sorted_m }.quantile(SHARE);
        Some(Self { p95_mm, met: p95_mm <= tolerance_mm })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_of_a_hundred_errors_may_exceed_a_tolerance() {
        let errors_m = |beyond: usize| {
            let kept = (0..101 - beyond).map(|_| 0.9e-3);
            kept.chain((0..beyond).map(|_| 5e-3)).rev().collect::<Vec<f64>>()
        };
        assert_eq!(HeldOut::of(1.0, errors_m(5)).map(|held| held.met), Some(true));
        assert_eq!(HeldOut::of(1.0, errors_m(6)).map(|held| held.met), Some(false));
        assert_eq!(HeldOut::of(1.0, Vec::new()), None);
    }

    #[test]
    fn a_tolerance_that_nothing_tells_of_is_not_called_met() {
        let tolerance = Tolerance::of(0.1, None);
        assert_eq!((tolerance.before, tolerance.after), (None, None));
        assert!(tolerance.evaluation().contains("not evaluated"), "{}", tolerance.evaluation());
    }
}
