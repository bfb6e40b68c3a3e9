//! Conversion of values to pixels, and positions of ticks.
//!
//! No result is NaN or infinite; the number of ticks is bounded; a degenerate range is widened.

use crate::number::{fixed, power_of_ten, significant};

/// Beyond this, and closer to zero than its inverse, arithmetic on a range would overflow or
/// underflow.
const LARGEST: f64 = 1e300;
/// The narrowest range drawn, as a share of its values: less is rounding, not data.
const NARROWEST: f64 = 1e-9;

/// A range of values, wide enough to be drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span {
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) log: bool,
}

/// Whether a value can be shown on such an axis.
pub(crate) fn drawable(value: f64, log: bool) -> bool {
    value.abs() <= LARGEST && (!log || value >= 1.0 / LARGEST)
}

impl Span {
    /// The range of the values that can be drawn; `None` if there are none.
    pub(crate) fn of(values: impl IntoIterator<Item = f64>, log: bool) -> Option<Self> {
        let mut range: Option<(f64, f64)> = None;
        for value in values.into_iter().filter(|value| drawable(*value, log)) {
            let (low, high) = range.unwrap_or((value, value));
            range = Some((low.min(value), high.max(value)));
        }
        range.map(|(low, high)| Self { low, high, log }.widened())
    }

    /// The range of an axis without data.
    pub(crate) fn unit(log: bool) -> Self {
        if log { Self { low: 1.0, high: 10.0, log } } else { Self { low: 0.0, high: 1.0, log } }
    }

    pub(crate) fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high), log: self.log }
    }

    /// The range with a margin, as a share of its width.
    pub(crate) fn padded(self, share: f64) -> Self {
        if self.log {
            let factor = (self.high / self.low).min(LARGEST).powf(share);
            let (low, high) = (self.low / factor, self.high * factor);
            return Self { low: low.max(1.0 / LARGEST), high: high.min(LARGEST), log: true };
        }
        let air = (self.high - self.low) * share;
        Self { low: self.low - air, high: self.high + air, log: false }
    }

    /// A range of positive values starts at zero if zero is near, so that heights can be compared.
    pub(crate) fn grounded_if_near(self) -> Self {
        let is_near = !self.log && self.low > 0.0 && self.low < 0.35 * self.high;
        if is_near { Self { low: 0.0, ..self } } else { self }
    }

    /// The range extended to the ticks around it, about `wanted` in number; a logarithmic range of
    /// several decades is extended upwards to a whole decade.
    pub(crate) fn to_ticks(self, wanted: usize) -> Self {
        let grown = if self.log {
            let decades = self.high.log10() - self.low.log10();
            let high = 10f64.powf((self.high.log10() - 1e-9).ceil());
            if decades < 2.0 { self } else { Self { high: high.min(LARGEST), ..self } }
        } else {
            let (step, _) = step(self, wanted.clamp(2, 12));
            let low = ((self.low / step) + 1e-6).floor() * step;
            let high = ((self.high / step) - 1e-6).ceil() * step;
            Self { low, high, log: false }
        };
        let drawable = drawable(grown.low, self.log) && drawable(grown.high, self.log);
        if drawable && grown.low <= self.low + 1e-9 * self.low.abs() { grown } else { self }
    }

    fn widened(self) -> Self {
        let size = self.low.abs().max(self.high.abs());
        if size < 1.0 / LARGEST {
            return Self { low: 0.0, high: 1.0, log: self.log };
        }
        if self.high - self.low > size * NARROWEST {
            return self;
        }
        if self.log {
            return Self { low: self.low / 2.0, high: self.high * 2.0, log: true };
        }
        Self { low: self.low - 0.05 * size, high: self.high + 0.05 * size, log: false }
    }

    fn position(&self, value: f64) -> f64 {
        if self.log {
            (value.ln() - self.low.ln()) / (self.high.ln() - self.low.ln())
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }
}

/// Mapping of a range of values to pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    pub(crate) span: Span,
    pub(crate) from_px: f64,
    pub(crate) to_px: f64,
}

impl Scale {
    /// The position of the value; `None` if it cannot be drawn. May be outside the range.
    pub(crate) fn at(&self, value: f64) -> Option<f64> {
        if !drawable(value, self.span.log) {
            return None;
        }
        let px = self.from_px + self.span.position(value) * (self.to_px - self.from_px);
        px.is_finite().then_some(px)
    }

    /// The position of a value, clamped to the range.
    pub(crate) fn held(&self, value: f64) -> f64 {
        let held = value.clamp(self.span.low, self.span.high);
        self.at(held).unwrap_or(self.from_px)
    }
}

/// Ticks, and the power of ten that their labels share (empty for one).
#[derive(Debug, Default)]
pub(crate) struct Ticks {
    pub(crate) marks: Vec<(f64, String)>,
    pub(crate) power: String,
}

/// About `wanted` ticks at round values inside the range.
pub(crate) fn ticks(span: Span, wanted: usize) -> Ticks {
    let wanted = wanted.clamp(2, 12);
    if span.log { log_ticks(span, wanted) } else { linear_ticks(span, wanted) }
}

/// The distance of about `wanted` ticks, and its power of ten.
fn step(span: Span, wanted: usize) -> (f64, i32) {
    let raw = (span.high - span.low) / wanted as f64;
    let mut magnitude = raw.log10().floor() as i32;
    let factor = match raw / 10f64.powi(magnitude) {
        f if f <= 1.5 => 1.0,
        f if f <= 3.5 => 2.0,
        f if f <= 7.5 => 5.0,
        _ => {
            magnitude += 1;
            1.0
        }
    };
    (factor * 10f64.powi(magnitude), magnitude)
}

fn linear_ticks(span: Span, wanted: usize) -> Ticks {
    let (step, magnitude) = step(span, wanted);
    let shared = shared_power(span);
    let unit = 10f64.powi(shared);
    let decimals = usize::try_from(shared - magnitude).unwrap_or(0);
    let first = (span.low / step - 1e-6).ceil();
    let marks = (0..24)
        .map(|i| (first + f64::from(i)) * step)
        .take_while(|value| *value <= span.high + 1e-6 * step)
        .map(|value| (value, fixed(value / unit, decimals)))
        .collect();
    let power = if shared == 0 { String::new() } else { power_of_ten(shared) };
    Ticks { marks, power }
}

/// The power of ten, a multiple of three, removed from labels that would be long.
fn shared_power(span: Span) -> i32 {
    let size = span.low.abs().max(span.high.abs());
    if (1e-2..1e5).contains(&size) { 0 } else { (size.log10() / 3.0).floor() as i32 * 3 }
}

fn log_ticks(span: Span, wanted: usize) -> Ticks {
    let (first, last) = (span.low.log10().floor() as i32, span.high.log10().ceil() as i32);
    let inside = |value: f64| value >= span.low * 0.999_999 && value <= span.high * 1.000_001;
    let decades: Vec<i32> = (first..=last).filter(|k| inside(10f64.powi(*k))).collect();
    if decades.len() >= 3 {
        let stride = decades.len().div_ceil(wanted);
        let marks = decades.into_iter().step_by(stride).map(|k| (10f64.powi(k), decade_label(k)));
        return Ticks { marks: marks.collect(), power: String::new() };
    }
    let between = (first..=last)
        .flat_map(|k| [1.0, 2.0, 5.0].map(|factor| factor * 10f64.powi(k)))
        .filter(|value| inside(*value))
        .map(|value| (value, significant(value, 1)));
    let marks: Vec<_> = between.collect();
    if marks.len() >= 2 {
        return Ticks { marks, power: String::new() };
    }
    linear_ticks(span, wanted)
}

fn decade_label(exponent: i32) -> String {
    if (-3..=4).contains(&exponent) {
        significant(10f64.powi(exponent), 1)
    } else {
        power_of_ten(exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn labels(span: Span, wanted: usize) -> Vec<String> {
        ticks(span, wanted).marks.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_stand_at_round_values() {
        let span = Span { low: 0.0, high: 1.0, log: false };
        assert_eq!(labels(span, 5), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        let span = Span { low: -3.2, high: 7.9, log: false };
        assert_eq!(labels(span, 6), ["−2", "0", "2", "4", "6"]);
    }

    #[test]
    fn large_values_share_a_power_of_ten() {
        let found = ticks(Span { low: 0.0, high: 2.0e6, log: false }, 4);
        assert_eq!(found.power, "10⁶");
        assert_eq!(found.marks.last().map(|mark| mark.1.as_str()), Some("2.0"));
    }

    #[test]
    fn decades_are_ticked_on_a_logarithmic_axis() {
        let span = Span { low: 0.5, high: 2e5, log: true };
        assert_eq!(labels(span, 8), ["1", "10", "100", "1000", "10\u{202f}000", "10⁵"]);
    }

    #[test]
    fn an_empty_range_is_widened() {
        assert_eq!(Span::of([f64::NAN, f64::INFINITY], false), None);
        assert!(Span::of([5.0], false).is_some_and(|span| span.low < 5.0 && span.high > 5.0));
        assert!(Span::of([0.0], false).is_some_and(|span| span.low < span.high));
        assert_eq!(Span::of([-1.0, 0.0], true), None);
    }

    proptest! {
        #[test]
        fn ticks_are_few_ordered_and_inside(a in any::<f64>(), b in any::<f64>(), log in any::<bool>(), n in 0usize..30) {
            if let Some(span) = Span::of([a, b], log) {
                let found = ticks(span.padded(0.04), n);
                prop_assert!(found.marks.len() <= 24);
                prop_assert!(found.marks.windows(2).all(|pair| pair[0].0 < pair[1].0));
                prop_assert!(found.marks.iter().all(|mark| mark.0.is_finite()));
            }
        }

        #[test]
        fn a_scale_never_gives_what_cannot_be_drawn(a in any::<f64>(), b in any::<f64>(), v in any::<f64>(), log in any::<bool>()) {
            if let Some(span) = Span::of([a, b], log) {
                let scale = Scale { span, from_px: 0.0, to_px: 800.0 };
                prop_assert!(scale.at(v).is_none_or(f64::is_finite));
                prop_assert!((-0.01..=800.01).contains(&scale.held(v)) || v.is_nan());
            }
        }
    }
}
