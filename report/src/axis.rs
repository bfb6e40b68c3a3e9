//! Label, unit and spacing of an axis.

use crate::scale::Span;

/// A labelled axis; linear and covering the data by default.
#[derive(Debug, Clone)]
pub struct Axis {
    pub(crate) label: String,
    pub(crate) unit: String,
    pub(crate) log: bool,
    pub(crate) range: Option<(f64, f64)>,
    pub(crate) captioned: bool,
}

impl Axis {
    /// An axis by label and unit; an empty unit for a dimensionless one.
    #[must_use]
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { label: label.into(), unit: unit.into(), log: false, range: None, captioned: true }
    }

    /// Logarithmic spacing; values of zero and below are then omitted.
    #[must_use]
    pub fn log(mut self) -> Self {
        self.log = true;
        self
    }

    /// A fixed range, in the axis' unit; data outside are clipped. A range that is empty, not
    /// finite, or not above zero on a logarithmic axis, is ignored.
    #[must_use]
    pub fn range(mut self, from: f64, to: f64) -> Self {
        self.range = Some((from, to));
        self
    }

    /// The fixed range, where it can be drawn.
    pub(crate) fn fixed_span(&self) -> Option<Span> {
        let (from, to) = self.range?;
        let span = Span::of([from, to], self.log)?;
        (from < to && span.low == from && span.high == to).then_some(span)
    }

    pub(crate) fn is_named_like(&self, other: &Self) -> bool {
        self.label == other.label && self.unit == other.unit
    }

    /// Label and unit as shown at the axis, e.g. `Time (s)`; includes the common power of ten of
    /// the ticks.
    pub(crate) fn caption(&self, power: &str) -> String {
        if !self.captioned {
            return String::new();
        }
        match (self.unit.as_str(), power) {
            ("", "") => self.label.clone(),
            (unit, "") => format!("{} ({unit})", self.label),
            ("", power) => format!("{} ({power})", self.label),
            (unit, power) => format!("{} ({power} {unit})", self.label),
        }
    }
}
