//! Level bars by name: rankings, comparisons before and after, parameters with their intervals.

use crate::axis::Axis;
use crate::canvas::{Anchor, Area, Canvas, Svg, WIDTH_PX, shortened, text_width};
use crate::legend::{self, Entry, Swatch};
use crate::number::{common_decimals, fixed, quantity, significant};
use crate::scale::{Scale, Span, drawable, ticks};
use crate::series::colour_class;

const LABEL_PX_MAX: f64 = 280.0;
const VALUE_PX: f64 = 90.0;
const BAR_PX: f64 = 15.0;
const ROW_GAP_PX: f64 = 13.0;
const BELOW_PX: f64 = 44.0;

/// One value, with an interval where it has one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    value: f64,
    interval: Option<(f64, f64)>,
}

impl Bar {
    /// A value in the unit of the axis.
    #[must_use]
    pub fn new(value: f64) -> Self {
        Self { value, interval: None }
    }

    /// The interval around the value, e.g. of 95 %.
    #[must_use]
    pub fn between(mut self, low: f64, high: f64) -> Self {
        self.interval = Some((low, high));
        self
    }
}

impl From<f64> for Bar {
    fn from(value: f64) -> Self {
        Self::new(value)
    }
}

/// A chart of level bars, one row for each name, one bar in it for each group.
#[derive(Debug, Clone)]
pub struct Bars {
    title: String,
    axis: Axis,
    groups: Vec<String>,
    rows: Vec<(String, Vec<Bar>)>,
}

impl Bars {
    /// An empty chart; the axis is drawn linear and always shows zero.
    #[must_use]
    pub fn new(title: impl Into<String>, axis: Axis) -> Self {
        Self { title: title.into(), axis, groups: Vec::new(), rows: Vec::new() }
    }

    /// Names what the bars of each row stand for, in their order.
    #[must_use]
    pub fn groups<T: Into<String>>(mut self, names: impl IntoIterator<Item = T>) -> Self {
        self.groups = names.into_iter().map(Into::into).collect();
        self
    }

    /// Adds a row of one bar for each group. What is not finite leaves its place empty.
    #[must_use]
    pub fn row<T: Into<Bar>>(
        mut self,
        name: impl Into<String>,
        bars: impl IntoIterator<Item = T>,
    ) -> Self {
        self.rows.push((name.into(), bars.into_iter().map(Into::into).collect()));
        self
    }

    /// Draws it.
    #[must_use]
    pub fn render(&self) -> Svg {
        let mut canvas = Canvas::default();
        let entries: Vec<Entry> = self.groups.iter().enumerate().map(entry).collect();
        let top = legend::draw(&mut canvas, &entries);
        let longest = self.rows.iter().map(|row| text_width(&row.0)).fold(40.0, f64::max);
        let left = longest.min(LABEL_PX_MAX) + 14.0;
        let inner = Area { left, top, width: WIDTH_PX - left - VALUE_PX, height: self.height() };
        let scale = Scale { span: self.span(), from_px: inner.left, to_px: inner.right() };
        self.draw_axis(&mut canvas, inner, &scale);
        let mut at = top + ROW_GAP_PX / 2.0;
        for (name, bars) in &self.rows {
            let middle = at + BAR_PX * bars.len().max(1) as f64 / 2.0 + 4.0;
            let label = shortened(name, LABEL_PX_MAX);
            canvas.text("label", (left - 12.0, middle), Anchor::End, &label);
            for (place, bar) in bars.iter().enumerate() {
                self.draw_bar(&mut canvas, &scale, at + BAR_PX * place as f64, (name, place), *bar);
            }
            at += BAR_PX * bars.len().max(1) as f64 + ROW_GAP_PX;
        }
        let zero = scale.held(0.0);
        canvas.line("rule", (zero, top), (zero, inner.bottom()));
        canvas.finish(inner.bottom() + BELOW_PX, &self.title, &self.describe())
    }

    fn height(&self) -> f64 {
        let rows = self.rows.iter().map(|row| BAR_PX * row.1.len().max(1) as f64 + ROW_GAP_PX);
        rows.sum::<f64>().max(BAR_PX)
    }

    fn span(&self) -> Span {
        let bars = || self.rows.iter().flat_map(|row| &row.1);
        let ends = bars().filter_map(|bar| bar.interval).flat_map(|(low, high)| [low, high]);
        let values = bars().map(|bar| bar.value).chain(ends).chain([0.0]);
        let found = || Span::of(values, false).unwrap_or(Span::unit(false));
        self.axis.fixed_span().filter(|span| !span.log).unwrap_or_else(found)
    }

    fn draw_axis(&self, canvas: &mut Canvas, inner: Area, scale: &Scale) {
        let found = ticks(scale.span, 6);
        for (value, label) in &found.marks {
            let at = scale.held(*value);
            canvas.line("grid", (at, inner.top), (at, inner.bottom()));
            canvas.text("tick", (at, inner.bottom() + 16.0), Anchor::Middle, label);
        }
        let caption = self.axis.caption(&found.power);
        canvas.text("axis", (inner.right(), inner.bottom() + 36.0), Anchor::End, &caption);
    }

    fn draw_bar(&self, canvas: &mut Canvas, scale: &Scale, top: f64, of: (&str, usize), bar: Bar) {
        if !drawable(bar.value, false) {
            return;
        }
        let (from, to) = (scale.held(0.0), scale.held(bar.value));
        let (left, width) = (from.min(to), (to - from).abs());
        let area = Area { left, top: top + 1.0, width, height: BAR_PX - 2.0 };
        let hint = format!("{}: {}", of.0, self.worded(of.1, bar));
        canvas.bar(&format!("fill {}", colour_class(of.1)), area, &hint);
        let mut end = left + width;
        if let Some((low, high)) = bar.interval.filter(|ends| ends.0 <= ends.1) {
            let (low, high) = (scale.held(low), scale.held(high));
            let middle = top + BAR_PX / 2.0;
            canvas.line("whisker", (low, middle), (high, middle));
            canvas.line("whisker", (low, middle - 3.5), (low, middle + 3.5));
            canvas.line("whisker", (high, middle - 3.5), (high, middle + 3.5));
            end = end.max(high);
        }
        let number = self.number(bar.value);
        canvas.text("tick", (end + 7.0, top + BAR_PX / 2.0 + 4.0), Anchor::Start, &number);
    }

    /// The value with the decimals that all bars share.
    fn number(&self, value: f64) -> String {
        let bars = self.rows.iter().flat_map(|row| &row.1);
        let values: Vec<f64> = bars.map(|bar| bar.value).collect();
        common_decimals(&values, 3)
            .map_or_else(|| significant(value, 3), |decimals| fixed(value, decimals))
    }

    fn worded(&self, place: usize, bar: Bar) -> String {
        let unit = &self.axis.unit;
        let group = self.groups.get(place).map(|name| format!("{name} ")).unwrap_or_default();
        let interval = bar.interval.map(|(low, high)| {
            format!(" (from {} to {})", quantity(low, unit), quantity(high, unit))
        });
        format!("{group}{}{}", quantity(bar.value, unit), interval.unwrap_or_default())
    }

    fn describe(&self) -> String {
        let mut words = format!("{}.", self.axis.caption(""));
        for (name, bars) in &self.rows {
            let bars = bars.iter().enumerate().map(|(place, bar)| self.worded(place, *bar));
            words += &format!(" {name}: {}.", bars.collect::<Vec<_>>().join(", "));
        }
        words
    }
}

fn entry((place, name): (usize, &String)) -> Entry {
    Entry { class: colour_class(place), swatch: Swatch::Block, name: name.clone() }
}
