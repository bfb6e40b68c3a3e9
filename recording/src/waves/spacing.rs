//! Even steps from a column of times (or positions): rate, jitter, gaps.
//!
//! The step is the median one, refined over each run; a jump of more than 1.75 steps, or back, ends
//! a run. Jitter of more than 1 % of a step is noted; more than half of one is refused.

use std::ops::Range;

use crate::faults::{Fault, Setting};

/// A jump of more than this number of steps is a gap.
const GAP: f64 = 1.75;
/// Larger jitter (root mean square of single steps, in steps) is noted.
const SAID: f64 = 0.01;
/// Larger jitter is refused.
const REFUSED: f64 = 0.5;
/// A rate this close to an integer was rounded when its times were written.
const WHOLE: f64 = 1e-6;

/// Evenly spaced rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Run {
    pub(super) rows: Range<usize>,
    pub(super) start: f64,
}

/// The runs of a column, and their common step.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Spacing {
    pub(super) step: f64,
    pub(super) runs: Vec<Run>,
    pub(super) notes: Vec<String>,
}

impl Spacing {
    /// Finds the even steps of `x`; `breaks` states whether a new run begins at a row whatever its
    /// time.
    ///
    /// # Errors
    /// A missing or repeated value, with its row; too few or too uneven values.
    pub(super) fn of(
        x: &[f64],
        breaks: impl Fn(usize) -> bool,
    ) -> Result<Self, (usize, Box<Fault>)> {
        if let Some(row) = x.iter().position(|x| !x.is_finite()) {
            let fault = Fault::new("", "is empty or not a number");
            return Err((row, Box::new(fault.expected("a number in every row"))));
        }
        let steps = (1..x.len()).filter(|row| !breaks(*row)).map(|row| x[row] - x[row - 1]);
        let mut forward: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
        if forward.is_empty() {
            let decreases = x.windows(2).any(|pair| pair[1] < pair[0]);
            let fault = match x.len() {
                0 | 1 => Fault::new("", "has a single row").expected("two rows or more"),
                _ if decreases => {
                    Fault::new("", "decreases in every row").expected("increasing values")
                }
                _ => Fault::new("", "is the same in all rows").expected("increasing values"),
            };
            return Err((0, Box::new(fault.help(RATE_HELP).by(&[Setting::SamplingRate]))));
        }
        let median_index = forward.len() / 2;
        let step = *forward.select_nth_unstable_by(median_index, f64::total_cmp).1;
        let mut runs: Vec<Run> = Vec::new();
        let mut gaps = 0;
        let mut start = 0;
        for row in 1..=x.len() {
            let jump = x.get(row).map(|x_now| x_now - x[row - 1]);
            if jump == Some(0.0) && !breaks(row) {
                let fault = Fault::new("", format!("stays at {}", x[row]));
                let fault = fault.expected("increasing values").help(RATE_HELP);
                return Err((row, Box::new(fault.by(&[Setting::SamplingRate]))));
            }
            let gap = jump.is_some_and(|jump| jump > GAP * step);
            let back = jump.is_some_and(|jump| jump < 0.0);
            if jump.is_none() || gap || back || breaks(row) {
                gaps += usize::from(gap && !breaks(row));
                runs.push(Run { rows: start..row, start: x[start] });
                start = row;
            }
        }
        Self { step, runs, notes: Vec::new() }.refined(x, gaps)
    }

    fn refined(mut self, x: &[f64], gaps: usize) -> Result<Self, (usize, Box<Fault>)> {
        let before = self.runs.len();
        self.runs.retain(|run| run.rows.len() >= 2);
        let dropped = before - self.runs.len();
        let (mut span, mut steps, mut stray, mut worst) = (0.0, 0.0, 0.0, (0.0_f64, 0));
        for run in &self.runs {
            span += x[run.rows.end - 1] - x[run.rows.start];
            steps += (run.rows.len() - 1) as f64;
        }
        if steps > 0.0 && span > 0.0 {
            self.step = span / steps;
        }
        for run in &self.runs {
            for row in run.rows.clone().skip(1) {
                let deviation = ((x[row] - x[row - 1]) / self.step - 1.0).abs();
                stray += deviation * deviation;
                if deviation > worst.0 {
                    worst = (deviation, row);
                }
            }
        }
        let rms = if steps > 0.0 { (stray / steps).sqrt() } else { 0.0 };
        if !(rms <= REFUSED && self.step.is_finite() && self.step > 0.0) {
            let fault = Fault::new("", format!("deviates by {:.0} % of a step", 100.0 * rms));
            let fault = fault.expected("evenly spaced samples").help(RESAMPLE_HELP);
            return Err((worst.1, Box::new(fault)));
        }
        if rms > SAID {
            self.notes.push(format!(
                "single steps deviate by {:.1} % (at most {:.0} %) of a step; the samples are treated as evenly spaced",
                100.0 * rms,
                100.0 * worst.0
            ));
        }
        if gaps > 0 {
            self.notes.push(format!("a new record begins after each gap: {gaps}"));
        }
        if dropped > 0 {
            self.notes.push(format!("isolated samples between gaps, skipped: {dropped}"));
        }
        Ok(self)
    }

    /// Steps per unit; an integer if it is one up to rounding of written times.
    pub(super) fn rate(&self) -> f64 {
        tidy(1.0 / self.step, WHOLE)
    }
}

const RESAMPLE_HELP: &str = "resample it to even steps first; its spectrum would be wrong";
const RATE_HELP: &str = "give the sampling rate if the samples are evenly spaced";

/// The nearest integer, if it is nearer than a share `within` of the value.
pub(super) fn tidy(value: f64, within: f64) -> f64 {
    let whole = value.round();
    if whole >= 1.0 && (value - whole).abs() <= within * whole { whole } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_times_give_the_rate_they_were_rounded_from() {
        let x: Vec<f64> =
            (0..20_000).map(|i| (f64::from(i) / 3200.0 * 1e6).floor() * 1e-6).collect();
        let spacing = Spacing::of(&x, |_| false).unwrap();
        assert_eq!((spacing.rate(), spacing.runs.len()), (3200.0, 1));
        let coarse: Vec<f64> = x.iter().map(|x| (x * 1e4).round() * 1e-4).collect();
        let spacing = Spacing::of(&coarse, |_| false).unwrap();
        assert!((spacing.rate() - 3200.0).abs() < 0.1, "{}", spacing.rate());
        assert!(spacing.notes[0].contains("deviate"), "{:?}", spacing.notes);
    }

    #[test]
    fn a_gap_and_a_new_start_end_a_run() {
        let x = [0.0, 0.1, 0.2, 0.5, 0.6, 0.0, 0.1, 0.2];
        let spacing = Spacing::of(&x, |_| false).unwrap();
        let rows: Vec<_> = spacing.runs.iter().map(|run| run.rows.clone()).collect();
        assert_eq!(rows, [0..3, 3..5, 5..8]);
        assert_eq!(spacing.notes, ["a new record begins after each gap: 1"]);
    }

    #[test]
    fn uneven_and_standing_times_are_refused_with_their_row() {
        let uneven = [0.0, 0.1, 0.25, 0.26, 0.4, 0.41, 0.57];
        assert!(Spacing::of(&uneven, |_| false).is_err());
        assert_eq!(Spacing::of(&[0.0, 0.1, 0.1, 0.2], |_| false).unwrap_err().0, 2);
        assert_eq!(Spacing::of(&[0.0, f64::NAN], |_| false).unwrap_err().0, 1);
        assert!(Spacing::of(&[], |_| false).is_err());
    }
}
