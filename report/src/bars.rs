//! Horizontal bars: rankings, comparisons before and after, parameters with intervals.

use crate::axis::Axis;
use crate::canvas::{Anchor, Area, Canvas, Svg, shortened, text_width, wrapped};
use crate::legend::{self, Entry, Swatch};
use crate::number::{common_decimals, fixed, quantity, significant};
use crate::role::{Appearance, Role};
use crate::scale::{Scale, Span, drawable, ticks};

const LABEL_PX_MAX: f64 = 280.0;
const VALUE_PX: f64 = 90.0;
const BAR_PX: f64 = 15.0;
/// Height of a name above its bars.
const OVER_PX: f64 = 17.0;
const ROW_GAP_PX: f64 = 13.0;
/// Height of the ticks, and of the caption's first line.
const BELOW_PX: f64 = 44.0;
const LINE_PX: f64 = 15.0;

/// One value, with an optional interval.
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

/// Row of a bar, and its position in it.
#[derive(Clone, Copy)]
struct BarPosition<'a> {
    name: &'a str,
    place: usize,
    appearance: Appearance,
}

/// A chart of horizontal bars: one row for each name, one bar in it for each group.
#[derive(Debug, Clone)]
pub struct Bars {
    title: String,
    axis: Axis,
    groups: Vec<String>,
    roles: Vec<Role>,
    rows: Vec<(String, Vec<Bar>)>,
}

impl Bars {
    /// An empty chart; the axis is drawn linear and always shows zero.
    #[must_use]
    pub fn new(title: impl Into<String>, axis: Axis) -> Self {
        Self { title: title.into(), axis, groups: Vec::new(), roles: Vec::new(), rows: Vec::new() }
    }

    /// Names of the bars in each row, in their order.
    #[must_use]
    pub fn groups<T: Into<String>>(mut self, names: impl IntoIterator<Item = T>) -> Self {
        self.groups = names.into_iter().map(Into::into).collect();
        self
    }

    /// Roles of the bars in each row, in the order of the groups.
    #[must_use]
    pub fn roles(mut self, roles: impl IntoIterator<Item = Role>) -> Self {
        self.roles = roles.into_iter().collect();
        self
    }

    /// Adds a row of one bar for each group. A value that is not finite leaves its place empty.
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
        Svg::laid_out(|width| self.laid_out(width))
    }

    /// Names are next to their bars; on a phone, above them.
    fn laid_out(&self, width: f64) -> String {
        let mut canvas = Canvas::new(width);
        let looks = self.looks();
        let entries =
            self.groups.iter().zip(&looks).map(|(name, appearance)| entry(name, *appearance));
        let top = legend::draw(&mut canvas, &entries.collect::<Vec<Entry>>());
        let is_narrow = canvas.is_narrow();
        let longest = self.rows.iter().map(|row| text_width(&row.0)).fold(40.0, f64::max);
        let left = if is_narrow { 4.0 } else { longest.min(LABEL_PX_MAX) + 14.0 };
        let over = if is_narrow { OVER_PX } else { 0.0 };
        let taken = |bars: &[Bar]| over + BAR_PX * bars.len().max(1) as f64 + ROW_GAP_PX;
        let height = self.rows.iter().map(|row| taken(&row.1)).sum::<f64>().max(BAR_PX);
        let value_px = if is_narrow { 64.0 } else { VALUE_PX };
        let inner = Area { left, top, width: width - left - value_px, height };
        let scale = Scale { span: self.span(), from_px: inner.left, to_px: inner.right() };
        let below = self.draw_axis(&mut canvas, inner, &scale);
        let mut row_top = top + ROW_GAP_PX / 2.0;
        for (name, bars) in &self.rows {
            let first = row_top + over;
            if is_narrow {
                canvas.text("label", (0.0, row_top + 11.0), Anchor::Start, &shortened(name, width));
            } else {
                let middle = first + BAR_PX * bars.len().max(1) as f64 / 2.0 + 4.0;
                let label = shortened(name, LABEL_PX_MAX);
                canvas.text("label", (left - 12.0, middle), Anchor::End, &label);
            }
            for (place, bar) in bars.iter().enumerate() {
                let appearance =
                    looks.get(place).copied().unwrap_or(Appearance { role: Role::Other, place });
                let top = first + BAR_PX * place as f64;
                self.draw_bar(
                    &mut canvas,
                    &scale,
                    top,
                    BarPosition { name, place, appearance },
                    *bar,
                );
            }
            row_top += taken(bars);
        }
        let zero = scale.held(0.0);
        canvas.line("rule", (zero, top), (zero, inner.bottom()));
        canvas.finish(inner.bottom() + below, &self.title, &self.describe())
    }

    /// Appearance of the bars in a row: by their roles, otherwise by their order.
    fn looks(&self) -> Vec<Appearance> {
        let bars_max = self.rows.iter().map(|row| row.1.len()).max().unwrap_or(0);
        let role = |place: usize| self.roles.get(place).copied().unwrap_or_default();
        Appearance::each((0..bars_max.max(self.groups.len())).map(role))
    }

    fn span(&self) -> Span {
        let bars = || self.rows.iter().flat_map(|row| &row.1);
        let ends = bars().filter_map(|bar| bar.interval).flat_map(|(low, high)| [low, high]);
        let values = bars().map(|bar| bar.value).chain(ends).chain([0.0]);
        let found = || Span::of(values, false).unwrap_or(Span::unit(false));
        self.axis.fixed_span().filter(|span| !span.log).unwrap_or_else(found)
    }

    /// Draws ticks and caption, and returns their height.
    fn draw_axis(&self, canvas: &mut Canvas, inner: Area, scale: &Scale) -> f64 {
        let found = ticks(scale.span, if canvas.is_narrow() { 3 } else { 6 });
        for (value, label) in &found.marks {
            let x_px = scale.held(*value);
            canvas.line("grid", (x_px, inner.top), (x_px, inner.bottom()));
            canvas.text("tick", (x_px, inner.bottom() + 16.0), Anchor::Middle, label);
        }
        let caption = wrapped(&self.axis.caption(&found.power), canvas.width_px());
        for (i, line) in caption.iter().enumerate() {
            let level = inner.bottom() + 36.0 + LINE_PX * i as f64;
            canvas.text("axis", (inner.right(), level), Anchor::End, line);
        }
        BELOW_PX + LINE_PX * caption.len().saturating_sub(1) as f64
    }

    fn draw_bar(
        &self,
        canvas: &mut Canvas,
        scale: &Scale,
        top: f64,
        whose: BarPosition<'_>,
        bar: Bar,
    ) {
        if !drawable(bar.value, false) {
            return;
        }
        let (from, to) = (scale.held(0.0), scale.held(bar.value));
        let (left, width) = (from.min(to), (to - from).abs());
        let area = Area { left, top: top + 1.0, width, height: BAR_PX - 2.0 };
        let hint = format!("{}: {}", whose.name, self.worded(whose.place, bar));
        canvas.bar(&format!("fill {}", whose.appearance.colour()), area, &hint);
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
        let mut description = format!("{}.", self.axis.caption(""));
        for (name, bars) in &self.rows {
            let bars = bars.iter().enumerate().map(|(place, bar)| self.worded(place, *bar));
            description += &format!(" {name}: {}.", bars.collect::<Vec<_>>().join(", "));
        }
        description
    }
}

fn entry(name: &str, appearance: Appearance) -> Entry {
    Entry { appearance, swatch: Swatch::Block, name: name.to_owned() }
}
