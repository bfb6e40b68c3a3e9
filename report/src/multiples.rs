//! Small multiples: the same plot several times, once per joint or channel, on the same scales.

use crate::axis::Axis;
use crate::canvas::{Anchor, Area, Canvas, Svg, shortened};
use crate::frame::{self, Place};
use crate::legend;
use crate::plot::Plot;
use crate::scale::Span;

const GAP_PX: f64 = 20.0;
const HEADING_PX: f64 = 20.0;

/// A grid of plots; each plot's title is its heading, the first plot's names are the legend.
#[derive(Debug, Clone)]
pub struct Multiples {
    title: String,
    columns: usize,
    plots: Vec<Plot>,
    own_y: bool,
}

impl Multiples {
    /// An empty grid with a number of columns (limited to 1 to 4).
    #[must_use]
    pub fn new(title: impl Into<String>, columns: usize) -> Self {
        Self { title: title.into(), columns: columns.clamp(1, 4), plots: Vec::new(), own_y: false }
    }

    /// Adds a plot; its height and `equal_scale` are ignored here.
    #[must_use]
    pub fn plot(mut self, plot: Plot) -> Self {
        self.plots.push(plot);
        self
    }

    /// Gives each plot its own y range; otherwise all share one and can be compared.
    #[must_use]
    pub fn own_y(mut self) -> Self {
        self.own_y = true;
        self
    }

    /// Draws it; on a phone in one column.
    #[must_use]
    pub fn render(&self) -> Svg {
        Svg::laid_out(|width| self.laid_out(width))
    }

    fn laid_out(&self, whole_px: f64) -> String {
        let mut canvas = Canvas::new(whole_px);
        let columns = if canvas.is_narrow() { 1 } else { self.columns };
        let entries = self.plots.first().map(Plot::legend).unwrap_or_default();
        let top = legend::draw(&mut canvas, &entries);
        let width = (whole_px - GAP_PX * (columns - 1) as f64) / columns as f64;
        let height = 160.0 + 80.0 / self.columns as f64;
        let shared = self.shared();
        let spans: Vec<(Span, Span)> = self
            .plots
            .iter()
            .map(|plot| {
                let (x, y) = shared.unwrap_or((plot.span_x(), plot.span_y()));
                (x, if self.own_y { plot.span_y() } else { y })
            })
            .collect();
        let cell = |i: usize| {
            let (row, column) = (i / columns, i % columns);
            let cell_top = top + row as f64 * (height + HEADING_PX + GAP_PX) + HEADING_PX;
            Area { left: column as f64 * (width + GAP_PX), top: cell_top, width, height }
        };
        // Plots below each other are aligned.
        let left = |column: usize| {
            let cells = (column..self.plots.len()).step_by(columns);
            cells.map(|i| frame::label_px(cell(i), spans[i].1)).fold(0.0, f64::max)
        };
        let mut description = String::new();
        for (i, plot) in self.plots.iter().enumerate() {
            let (outer, (x, y)) = (cell(i), spans[i]);
            let heading = shortened(&plot.title, width);
            canvas.text("heading", (outer.left, outer.top - 8.0), Anchor::Start, &heading);
            let (x_axis, y_axis) = self.captioned_once(i, columns);
            let place = Place { outer, left: left(i % columns) };
            plot.draw(&mut canvas, place, (&x_axis, x), (&y_axis, y));
            description += &format!("{}: {} ", plot.title, plot.describe(x, y));
        }
        let rows = self.plots.len().div_ceil(columns);
        let total = top + rows as f64 * (height + HEADING_PX + GAP_PX);
        canvas.finish(total.max(20.0), &self.title, description.trim_end())
    }

    /// The axes of a plot without the captions that its left or lower neighbour has.
    fn captioned_once(&self, i: usize, columns: usize) -> (Axis, Axis) {
        let (mut x, mut y) = (self.plots[i].x.clone(), self.plots[i].y.clone());
        let left = (!i.is_multiple_of(columns)).then(|| &self.plots[i - 1]);
        let below = self.plots.get(i + columns);
        if left.is_some_and(|left| !self.own_y && left.y.is_named_like(&y)) {
            y.captioned = false;
        }
        if below.is_some_and(|below| below.x.is_named_like(&x)) {
            x.captioned = false;
        }
        (x, y)
    }

    /// The ranges that cover all plots, if their axes have the same spacing.
    fn shared(&self) -> Option<(Span, Span)> {
        let first = self.plots.first()?;
        let has_same_scales = |plot: &Plot| plot.x.log == first.x.log && plot.y.log == first.y.log;
        if !self.plots.iter().all(has_same_scales) {
            return None;
        }
        let x = self.plots.iter().map(Plot::span_x).reduce(Span::union)?;
        let y = self.plots.iter().map(Plot::span_y).reduce(Span::union)?;
        Some((x, y))
    }
}
