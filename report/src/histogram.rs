//! Histograms: overlapping distributions as shares, so that runs of different length can be compared.

use crate::axis::Axis;
use crate::canvas::{Area, Canvas, Px, Svg};
use crate::frame::{self, Frame, Mark};
use crate::legend::{self, Entry, Swatch};
use crate::number::quantity;
use crate::plot::breathing;
use crate::role::{Appearance, Role};
use crate::scale::{Scale, Span, drawable};

const HEIGHT_PX: f64 = 280.0;

#[derive(Debug, Clone)]
struct Sample {
    name: String,
    role: Role,
    counted: Vec<(f64, u64)>,
}

/// A histogram of one or more named samples.
#[derive(Debug, Clone)]
pub struct Histogram {
    title: String,
    x: Axis,
    samples: Vec<Sample>,
    marks: Vec<Mark>,
    bins: usize,
    log_share: bool,
}

impl Histogram {
    /// An empty histogram over this axis, of 64 bins.
    #[must_use]
    pub fn new(title: impl Into<String>, x: Axis) -> Self {
        let (samples, marks) = (Vec::new(), Vec::new());
        Self { title: title.into(), x, samples, marks, bins: 64, log_share: false }
    }

    /// Adds values; those that are not finite are ignored.
    #[must_use]
    pub fn values(self, name: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        self.counted(name, values.into_iter().map(|value| (value, 1)))
    }

    /// Adds counted values: `(value, count)`.
    #[must_use]
    pub fn counted(
        mut self,
        name: impl Into<String>,
        values: impl IntoIterator<Item = (f64, u64)>,
    ) -> Self {
        let log = self.x.log;
        let drawn = values.into_iter().filter(|(value, count)| drawable(*value, log) && *count > 0);
        self.samples.push(Sample {
            name: name.into(),
            role: Role::Other,
            counted: drawn.collect(),
        });
        self
    }

    /// The role of the sample added last.
    #[must_use]
    pub fn role(mut self, role: Role) -> Self {
        if let Some(sample) = self.samples.last_mut() {
            sample.role = role;
        }
        self
    }

    /// A vertical line at `value`, in the unit of x, e.g. a percentile or a limit.
    #[must_use]
    pub fn mark(mut self, value: f64, label: impl Into<String>) -> Self {
        self.marks.push(Mark { value, label: label.into() });
        self
    }

    /// The number of bins (limited to 2 to 400).
    #[must_use]
    pub fn bins(mut self, bins: usize) -> Self {
        self.bins = bins.clamp(2, 400);
        self
    }

    /// A logarithmic axis for the shares, for distributions with rare tails.
    #[must_use]
    pub fn log_share(mut self) -> Self {
        self.log_share = true;
        self
    }

    /// Draws it.
    #[must_use]
    pub fn render(&self) -> Svg {
        Svg::laid_out(|width| self.laid_out(width))
    }

    fn laid_out(&self, width: f64) -> String {
        let mut canvas = Canvas::new(width);
        let looks = Appearance::each(self.samples.iter().map(|sample| sample.role));
        let entries = looks.iter().zip(&self.samples);
        let entries: Vec<Entry> =
            entries.map(|(appearance, sample)| entry(*appearance, sample)).collect();
        let top = legend::draw(&mut canvas, &entries);
        let values = self.samples.iter().flat_map(|sample| &sample.counted).map(|pair| pair.0);
        let x = self.x.fixed_span().or_else(|| Span::of(values, self.x.log));
        let x = x.unwrap_or(Span::unit(self.x.log));
        let shares: Vec<Vec<f64>> =
            self.samples.iter().map(|s| self.shares(&s.counted, x)).collect();
        let y = self.span_y(&shares);
        let y_axis = Axis::new("Share of samples", "%");
        let outer = Area { left: 0.0, top, width, height: HEIGHT_PX };
        let place = frame::Place { outer, left: frame::label_px(outer, y) };
        let frame = frame::draw(&mut canvas, place, (&self.x, x), (&y_axis, y));
        for (appearance, shares) in looks.iter().zip(&shares) {
            let steps = outline(&frame, shares);
            canvas.path(&format!("area {}", appearance.colour()), &steps);
            canvas.path(&appearance.line(), &steps);
        }
        frame::mark_x(&mut canvas, &frame, &self.marks, frame::ON_PAPER);
        canvas.finish(top + HEIGHT_PX, &self.title, &self.describe())
    }

    fn span_y(&self, shares: &[Vec<f64>]) -> Span {
        let shares = shares.iter().flatten().copied().filter(|share| *share > 0.0);
        let span = Span::of(shares, self.log_share).unwrap_or(Span::unit(self.log_share));
        if self.log_share {
            return Span { low: span.low / 2.0, high: span.high * 1.5, log: true };
        }
        breathing(Span { low: 0.0, ..span })
    }

    /// The share of each bin, in %; values outside a fixed range count, but have no bin.
    fn shares(&self, sample: &[(f64, u64)], x: Span) -> Vec<f64> {
        let scale = Scale { span: x, from_px: 0.0, to_px: self.bins as f64 };
        let total = sample.iter().map(|pair| pair.1 as f64).sum::<f64>().max(1.0);
        let mut shares = vec![0.0; self.bins];
        for (value, count) in sample {
            let inside = (x.low..=x.high).contains(value);
            if let Some(bin) = scale.at(*value).filter(|_| inside) {
                shares[(bin as usize).min(self.bins - 1)] += *count as f64 / total * 100.0;
            }
        }
        shares
    }

    fn describe(&self) -> String {
        let mut description = format!("Distribution of {}.", self.x.label);
        for Sample { name, counted, .. } in &self.samples {
            let count = counted.iter().fold(0u64, |sum, pair| sum.saturating_add(pair.1));
            let (low, high) = counted.iter().fold((f64::NAN, f64::NAN), |(low, high), pair| {
                (pair.0.min(low), pair.0.max(high))
            });
            let (low, high) = (quantity(low, &self.x.unit), quantity(high, &self.x.unit));
            description += &format!(" {name}: {count} samples from {low} to {high}.");
        }
        for mark in &self.marks {
            description += &format!(" {}: {}.", mark.label, quantity(mark.value, &self.x.unit));
        }
        description
    }
}

fn entry(appearance: Appearance, sample: &Sample) -> Entry {
    Entry { appearance, swatch: Swatch::Line, name: sample.name.clone() }
}

fn outline(frame: &Frame, shares: &[f64]) -> String {
    let inner = frame.inner;
    let width = inner.width / shares.len().max(1) as f64;
    let ground = inner.bottom();
    let mut data = format!("M{} {}", Px(inner.left), Px(ground));
    for (i, share) in shares.iter().enumerate() {
        let top = if *share > 0.0 { frame.y.held(*share) } else { ground };
        data += &format!("V{}H{}", Px(top), Px(inner.left + width * (i + 1) as f64));
    }
    data + &format!("V{}", Px(ground))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_all_bins_make_the_whole() {
        let histogram = Histogram::new("", Axis::new("Error", "mm"));
        let sample: Vec<(f64, u64)> = (0..1000).map(|i| (f64::from(i).sqrt(), 3)).collect();
        let x = Span { low: 0.0, high: 999f64.sqrt(), log: false };
        assert!((histogram.shares(&sample, x).iter().sum::<f64>() - 100.0).abs() < 1e-9);
    }

    #[test]
    fn counted_values_are_the_same_as_repeated_ones() {
        let axis = || Axis::new("Latency", "ns").log();
        let counted = Histogram::new("t", axis()).counted("a", [(100.0, 3), (2000.0, 1)]).render();
        let repeated =
            Histogram::new("t", axis()).values("a", [100.0, 100.0, 100.0, 2000.0]).render();
        assert_eq!(counted, repeated);
    }
}
