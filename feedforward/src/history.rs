//! What the table of a run keeps of the run before: its commands, its measured tracking error, and the share of learned changes
//! that is used. A run that turns out worse is undone with it.
//!
//! Columns: `b1_deg` … (`b1_mm`), `before_rms_mm`, `learning_share`; the last two have the same value in every row.

use physics::JointKind;
use recording::series::Recording;
use recording::unit::Unit;

use crate::error::FeedforwardError;
use crate::learning::joint_columns;

/// Columns of numbers.
const RMS: &str = "before_rms_mm";
const SHARE: &str = "learning_share";

/// The runs before.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    /// The run before; none before the first, and after going back to one.
    pub before: Option<Before>,
    /// Share of a learned change that is used, above 0 to 1.
    pub learning_share: f64,
}

/// A run.
#[derive(Clone, Debug, PartialEq)]
pub struct Before {
    /// Its commands, rad or m, a list per joint.
    pub commanded: Vec<Vec<f64>>,
    /// Root mean square of the tool's measured tracking error, m.
    pub rms_m: f64,
}

impl Default for History {
    fn default() -> Self {
        Self { before: None, learning_share: 1.0 }
    }
}

impl History {
    /// As a table states it.
    pub(crate) fn of(recording: &Recording, kinds: &[JointKind]) -> Result<Self, FeedforwardError> {
        let number = |name: &str| -> Option<f64> {
            let (_, texts) = recording.other.iter().find(|(found, _)| found == name)?;
            let value: f64 = texts.first()?.trim().parse().ok()?;
            (value.is_finite() && value > 0.0).then_some(value)
        };
        let rms_m = number(RMS).map(|mm| mm * 1e-3);
        let commanded = rms_m.and(Some(joint_columns(recording, kinds, 'b'))).transpose()?;
        let before =
            rms_m.zip(commanded.flatten()).map(|(rms_m, commanded)| Before { commanded, rms_m });
        let learning_share = number(SHARE).unwrap_or(1.0).min(1.0);
        Ok(Self { before, learning_share })
    }

    /// Puts its columns into the table of the next run, in place of earlier ones.
    pub fn put(&self, recording: &mut Recording, kinds: &[JointKind]) {
        let rows = recording.len();
        let units =
            kinds.iter().map(|kind| if *kind == JointKind::Revolute { "deg" } else { "mm" });
        let names: Vec<String> =
            (1..).zip(units.clone()).map(|(joint, unit)| format!("b{joint}_{unit}")).collect();
        let is_ours = |name: &String| names.contains(name) || name == RMS || name == SHARE;
        recording.other.retain(|(name, _)| !is_ours(name));
        if let Some(Before { commanded, rms_m }) = &self.before {
            for ((name, unit), joint) in names.iter().zip(units).zip(commanded) {
                let in_unit = |q: &f64| Unit::from_name(unit).map_or(*q, |unit| unit.from_si(*q));
                let texts = joint.iter().map(|q| format!("{:?}", in_unit(q))).collect();
                recording.other.push((name.clone(), texts));
            }
            let rms_mm = rms_m * 1e3;
            recording.other.push((RMS.to_owned(), vec![format!("{rms_mm:?}"); rows]));
        }
        let share = self.learning_share;
        recording.other.push((SHARE.to_owned(), vec![format!("{share:?}"); rows]));
    }
}
