//! Lines and dots over two axes: signals, spectra, paths, scatter.

use crate::axis::Axis;
use crate::canvas::{Area, Canvas, Px, Svg};
use crate::decimation::{self, Spot};
use crate::frame::{self, Frame, Mark, Ranged};
use crate::legend::{self, Entry, Swatch};
use crate::number::quantity;
use crate::role::Appearance;
use crate::scale::Span;
use crate::series::{Series, Shape, looks};

/// Up to this number, dots are drawn larger.
const FEW: usize = 12;
/// A line with more points is drawn solid, because its dashes would look like gaps in the data.
const DASHED_MAX: usize = 400;

/// A plot of one or more series.
#[derive(Debug, Clone)]
pub struct Plot {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) series: Vec<Series>,
    marks_x: Vec<Mark>,
    marks_y: Vec<Mark>,
    equal_scale: bool,
    height_px: f64,
}

impl Plot {
    /// An empty plot; the title is for screen readers and not drawn, since a figure has a caption.
    #[must_use]
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            series: Vec::new(),
            marks_x: Vec::new(),
            marks_y: Vec::new(),
            equal_scale: false,
            height_px: 300.0,
        }
    }

    /// Adds a series; without a role it takes the next colour.
    #[must_use]
    pub fn series(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// A vertical line at `value`, in the unit of x, e.g. an event; not drawn outside the range.
    #[must_use]
    pub fn mark_x(mut self, value: f64, label: impl Into<String>) -> Self {
        self.marks_x.push(Mark { value, label: label.into() });
        self
    }

    /// A horizontal line at `value`, in the unit of y, e.g. a limit; the range is extended to show
    /// it.
    #[must_use]
    pub fn mark_y(mut self, value: f64, label: impl Into<String>) -> Self {
        self.marks_y.push(Mark { value, label: label.into() });
        self
    }

    /// Gives both axes the same scale, for paths in the plane. Ignored if an axis is logarithmic.
    #[must_use]
    pub fn equal_scale(mut self) -> Self {
        self.equal_scale = true;
        self
    }

    /// The height of the plot without its legend, in pixels at a width of 832; limited to 120 to
    /// 900.
    #[must_use]
    pub fn height(mut self, height_px: f64) -> Self {
        self.height_px = if height_px.is_nan() { 300.0 } else { height_px.clamp(120.0, 900.0) };
        self
    }

    /// Draws it.
    #[must_use]
    pub fn render(&self) -> Svg {
        Svg::laid_out(|width| {
            let mut canvas = Canvas::new(width);
            let top = legend::draw(&mut canvas, &self.legend());
            let outer = Area { left: 0.0, top, width, height: self.height_px };
            let (mut x, mut y) = (self.span_x(), self.span_y());
            let mut y_axis = self.y.clone();
            if self.equal_scale && !x.log && !y.log {
                (x, y) = equalised(x, y, frame::inside(outer, frame::label_px(outer, y)));
                // Rounding to whole ticks would undo it.
                y_axis = y_axis.range(y.low, y.high);
            }
            let left = frame::label_px(outer, y);
            self.draw(&mut canvas, frame::Place { outer, left }, (&self.x, x), (&y_axis, y));
            canvas.finish(top + self.height_px, &self.title, &self.describe(x, y))
        })
    }

    pub(crate) fn draw(
        &self,
        canvas: &mut Canvas,
        place: frame::Place,
        x: Ranged<'_>,
        y: Ranged<'_>,
    ) {
        let frame = frame::draw(canvas, place, x, y);
        let inner = frame.inner;
        let air = Area { top: inner.top - 2.0, height: inner.height + 3.0, ..inner };
        canvas.clipped(air, |canvas| {
            for (appearance, series) in looks(&self.series).into_iter().zip(&self.series) {
                draw_series(canvas, &frame, series, appearance);
            }
        });
        frame::mark_x(canvas, &frame, &self.marks_x, frame::ON_PAPER);
        frame::mark_y(canvas, &frame, &self.marks_y, frame::ON_PAPER);
    }

    pub(crate) fn legend(&self) -> Vec<Entry> {
        let entry = |(appearance, series): (Appearance, &Series)| Entry {
            appearance,
            swatch: if series.shape == Shape::Line { Swatch::Line } else { Swatch::Dot },
            name: series.name.clone(),
        };
        looks(&self.series).into_iter().zip(&self.series).map(entry).collect()
    }

    pub(crate) fn span_x(&self) -> Span {
        let values = self.series.iter().flat_map(|series| &series.points).map(|point| point.0);
        let found = || Span::of(values, self.x.log).unwrap_or(Span::unit(self.x.log));
        let dotted = self.series.iter().any(|series| series.shape == Shape::Dots);
        let air = if dotted || self.equal_scale { 0.03 } else { 0.0 };
        self.x.fixed_span().unwrap_or_else(|| found().padded(air))
    }

    pub(crate) fn span_y(&self) -> Span {
        let data = self.series.iter().flat_map(|series| &series.points).map(|point| point.1);
        let marks = self.marks_y.iter().map(|mark| mark.value);
        let found = || Span::of(data.chain(marks), self.y.log).unwrap_or(Span::unit(self.y.log));
        self.y.fixed_span().unwrap_or_else(|| breathing(found()))
    }

    pub(crate) fn describe(&self, x: Span, y: Span) -> String {
        let range = |axis: &Axis, span: Span| {
            let (low, high) = (quantity(span.low, &axis.unit), quantity(span.high, &axis.unit));
            format!("{} from {low} to {high}", axis.label)
        };
        let mut description = format!("{}; {}.", range(&self.x, x), range(&self.y, y));
        for series in self.series.iter().filter(|series| !series.name.is_empty()) {
            let values =
                series.points.iter().map(|point| point.1).filter(|value| value.is_finite());
            let (low, high) =
                values.fold((f64::NAN, f64::NAN), |(low, high), v| (v.min(low), v.max(high)));
            let unit = &self.y.unit;
            description +=
                &format!(" {}: {} to {}", series.name, quantity(low, unit), quantity(high, unit));
            if series.points.len() > decimation::POINTS_MAX {
                description += &format!(", {} points, thinned for drawing", series.points.len());
            }
            description.push('.');
        }
        description
    }
}

/// A range of data with a margin; it starts at zero if its values are positive and zero is near.
pub(crate) fn breathing(span: Span) -> Span {
    let grounded = span.grounded_if_near();
    let padded = grounded.padded(0.05);
    if !grounded.log && grounded.low >= 0.0 {
        Span { low: padded.low.max(0.0), ..padded }
    } else {
        padded
    }
}

/// The ranges extended so that both axes of `inner` have the same scale.
pub(crate) fn equalised(x: Span, y: Span, inner: Area) -> (Span, Span) {
    let per_px = ((x.high - x.low) / inner.width).max((y.high - y.low) / inner.height);
    let grown = |span: Span, px: f64| {
        let extra = (per_px * px - (span.high - span.low)) / 2.0;
        Span { low: span.low - extra, high: span.high + extra, log: false }
    };
    (grown(x, inner.width), grown(y, inner.height))
}

fn draw_series(canvas: &mut Canvas, frame: &Frame, series: &Series, appearance: Appearance) {
    let spots: Vec<Spot> =
        series.points.iter().map(|(x, y)| frame.x.at(*x).zip(frame.y.at(*y))).collect();
    match series.shape {
        Shape::Line => {
            let dash = match (series.dashed, spots.len() > DASHED_MAX) {
                (true, _) => " dash",
                (false, true) => " whole",
                (false, false) => "",
            };
            canvas.path(
                &format!("{}{dash}", appearance.line()),
                &line_data(&decimation::line(&spots)),
            );
        }
        Shape::Dots => {
            let spots = decimation::dots(&spots);
            let few = if spots.iter().flatten().count() <= FEW { " few" } else { "" };
            canvas.path(&format!("{}{few}", appearance.dots()), &dots_data(&spots, appearance));
        }
    }
}

fn line_data(spots: &[Spot]) -> String {
    let mut data = String::with_capacity(spots.len() * 12);
    let mut command = 'M';
    for (i, spot) in spots.iter().enumerate() {
        let Some((x, y)) = spot else {
            command = 'M';
            continue;
        };
        data.push_str(&format!("{command}{} {}", Px(*x), Px(*y)));
        let alone = command == 'M' && spots.get(i + 1).copied().flatten().is_none();
        if alone {
            data.push_str("h0");
        }
        command = 'L';
    }
    data
}

fn dots_data(spots: &[Spot], appearance: Appearance) -> String {
    spots.iter().flatten().map(|spot| appearance.marker(*spot)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_is_no_number_breaks_the_line() {
        let spots = [Some((0.0, 1.0)), None, Some((2.0, 1.0)), Some((3.0, 1.0))];
        assert_eq!(line_data(&spots), "M0 1h0M2 1L3 1");
    }

    #[test]
    fn equal_scales_are_equal() {
        let unit = |high| Span { low: 0.0, high, log: false };
        let inner = Area { left: 0.0, top: 0.0, width: 800.0, height: 300.0 };
        let (x, y) = equalised(unit(100.0), unit(100.0), inner);
        assert!(((x.high - x.low) / 800.0 - (y.high - y.low) / 300.0).abs() < 1e-12);
        assert!(x.low <= 0.0 && x.high >= 100.0 && y.low <= 0.0 && y.high >= 100.0);
    }
}
