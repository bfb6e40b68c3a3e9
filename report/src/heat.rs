//! Values over a plane by colour: waterfall spectra, error maps.
//!
//! Bounded size: a grid finer than 208 × 104 is pooled, each cell then shows the LARGEST of its
//! values, so that a narrow line stays visible. Colours have even lightness steps (viridis),
//! readable without colour vision.

use crate::axis::Axis;
use crate::canvas::{Anchor, Area, Canvas, Px, Svg, shortened, text_width};
use crate::frame::{self, Frame, Mark};
use crate::number::quantity;
use crate::scale::{Scale, Span, drawable, ticks};

const COLUMNS_MAX: usize = 208;
const ROWS_MAX: usize = 104;
const HEIGHT_PX: f64 = 340.0;
const KEY_PX: f64 = 84.0;
/// Number of colour levels.
pub(crate) const LEVELS: usize = 32;
/// The viridis colour map (van der Walt and Smith, CC0), every tenth of it.
const VIRIDIS: [[u8; 3]; 11] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x24, 0x75],
    [0x41, 0x44, 0x87],
    [0x35, 0x5f, 0x8d],
    [0x2a, 0x78, 0x8e],
    [0x21, 0x91, 0x8c],
    [0x22, 0xa8, 0x84],
    [0x44, 0xbf, 0x70],
    [0x7a, 0xd1, 0x51],
    [0xbd, 0xdf, 0x26],
    [0xfd, 0xe7, 0x25],
];

/// A grid of values drawn as colours; x and y are linear.
#[derive(Debug, Clone)]
pub struct HeatMap {
    title: String,
    x: Axis,
    y: Axis,
    value: Axis,
    columns: usize,
    rows: usize,
    values: Vec<f64>,
    marks_x: Vec<Mark>,
    marks_y: Vec<Mark>,
    outlines: Vec<Outline>,
}

/// A frame around a part of the map.
#[derive(Debug, Clone)]
struct Outline {
    x: (f64, f64),
    y: (f64, f64),
    label: String,
}

impl HeatMap {
    /// An empty map. The ranges of x and y are those of the grid's outer edges (0 to its number of cells unless set);
    /// the value's axis may be logarithmic.
    #[must_use]
    pub fn new(title: impl Into<String>, x: Axis, y: Axis, value: Axis) -> Self {
        let (columns, rows, values) = (0, 0, Vec::new());
        let (marks_x, marks_y, outlines) = (Vec::new(), Vec::new(), Vec::new());
        Self { title: title.into(), x, y, value, columns, rows, values, marks_x, marks_y, outlines }
    }

    /// A vertical line at `value`, in the unit of x, e.g. an event; not drawn outside the range.
    #[must_use]
    pub fn mark_x(mut self, value: f64, label: impl Into<String>) -> Self {
        self.marks_x.push(Mark { value, label: label.into() });
        self
    }

    /// A horizontal line at `value`, in the unit of y, e.g. a known frequency; omitted outside the
    /// range.
    #[must_use]
    pub fn mark_y(mut self, value: f64, label: impl Into<String>) -> Self {
        self.marks_y.push(Mark { value, label: label.into() });
        self
    }

    /// A frame around these ranges of x and y, e.g. an event in time and frequency; clipped to the
    /// map.
    #[must_use]
    pub fn outline(mut self, x: (f64, f64), y: (f64, f64), label: impl Into<String>) -> Self {
        self.outlines.push(Outline { x, y, label: label.into() });
        self
    }

    /// The cells, row by row from the lowest y, each row from the lowest x. An incomplete row is
    /// omitted; a value that cannot be drawn leaves its cell empty.
    #[must_use]
    pub fn cells(mut self, columns: usize, values: Vec<f64>) -> Self {
        self.columns = columns;
        self.rows = values.len().checked_div(columns).unwrap_or(0);
        self.values = values;
        self
    }

    /// Draws it.
    #[must_use]
    pub fn render(&self) -> Svg {
        Svg::laid_out(|width| self.laid_out(width))
    }

    fn laid_out(&self, width: f64) -> String {
        let mut canvas = Canvas::new(width);
        let outer = Area { left: 0.0, top: 0.0, width: width - KEY_PX, height: HEIGHT_PX };
        let edges = |axis: &Axis, cells: usize| {
            let linear = Axis { log: false, ..axis.clone() };
            let all = Span { low: 0.0, high: cells.max(1) as f64, log: false };
            linear.fixed_span().unwrap_or(all)
        };
        let (x, y) = (edges(&self.x, self.columns), edges(&self.y, self.rows));
        let values = self.values.iter().copied();
        let found = self.value.fixed_span().or_else(|| Span::of(values, self.value.log));
        let value = found.unwrap_or(Span::unit(self.value.log));
        let y_axis = self.y.clone().range(y.low, y.high);
        let place = frame::Place { outer, left: frame::label_px(outer, y) };
        let frame = frame::draw(&mut canvas, place, (&self.x, x), (&y_axis, y));
        self.draw_cells(&mut canvas, &frame, value);
        self.draw_outlines(&mut canvas, &frame);
        frame::mark_x(&mut canvas, &frame, &self.marks_x, frame::ON_COLOURS);
        frame::mark_y(&mut canvas, &frame, &self.marks_y, frame::ON_COLOURS);
        self.draw_key(&mut canvas, frame.inner, value);
        canvas.finish(HEIGHT_PX, &self.title, &self.describe(value))
    }

    fn draw_cells(&self, canvas: &mut Canvas, frame: &Frame, value: Span) {
        let inner = frame.inner;
        let (columns, rows) = (self.columns.min(COLUMNS_MAX), self.rows.min(ROWS_MAX));
        let mut levels = vec![String::new(); LEVELS];
        for row in 0..rows {
            let edge = |row: usize| inner.bottom() - inner.height * row as f64 / rows as f64;
            let (top, bottom) = (edge(row + 1), edge(row));
            let shades: Vec<_> = (0..columns)
                .map(|column| shade(self.pooled((column, columns), (row, rows), value.log), value))
                .collect();
            let mut column = 0;
            while column < columns {
                let run = shades[column..].iter().take_while(|s| **s == shades[column]).count();
                let x_px =
                    |column: usize| inner.left + inner.width * column as f64 / columns as f64;
                if let Some(level) = shades[column] {
                    let (left, right) = (Px(x_px(column)), Px(x_px(column + run)));
                    let (top, bottom) = (Px(top), Px(bottom));
                    levels[level] += &format!("M{left} {top}H{right}V{bottom}H{left}z");
                }
                column += run;
            }
        }
        for (level, data) in levels.iter().enumerate() {
            canvas.cells(&colour(level), data);
        }
    }

    /// Frames of at least a visible size; each label above its frame, on the next level up where it would overlap another, or omitted.
    fn draw_outlines(&self, canvas: &mut Canvas, frame: &Frame) {
        let inner = frame.inner;
        let mut taken: Vec<Area> = Vec::new();
        let apart = |x: &(f64, f64), span: Span| x.1 < span.low || x.0 > span.high;
        let is_visible =
            |one: &&Outline| !apart(&one.x, frame.x.span) && !apart(&one.y, frame.y.span);
        for one in self.outlines.iter().filter(is_visible) {
            let (left, right) = (frame.x.held(one.x.0), frame.x.held(one.x.1));
            let (bottom, top) = (frame.y.held(one.y.0), frame.y.held(one.y.1));
            let (left, right) = (left - 2.0, right.max(left + 3.0) + 2.0);
            let (top, bottom) = (top - 5.0, bottom + 5.0);
            let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
            for (k, from) in corners.iter().enumerate() {
                canvas.line(frame::ON_COLOURS, *from, corners[(k + 1) % 4]);
            }
            let label = shortened(&one.label, inner.width * 0.6);
            let width = text_width(&label);
            let label_left = left.min(inner.right() - width).max(inner.left);
            let place = |level: usize| {
                let top = top - 15.0 * (level + 1) as f64;
                Area { left: label_left, top, width, height: 14.0 }
            };
            let is_free = |place: &Area| {
                place.top >= inner.top && !taken.iter().any(|other| place.overlaps(other))
            };
            let below = Area { left: label_left, top: bottom + 2.0, width, height: 14.0 };
            let fits_below = below.bottom() <= inner.bottom()
                && !taken.iter().any(|other| below.overlaps(other));
            let found = (0..3).map(place).find(is_free).or(fits_below.then_some(below));
            if let Some(place) = found.filter(|_| !label.is_empty()) {
                canvas.text("note", (place.left, place.top + 11.0), Anchor::Start, &label);
                taken.push(place);
            }
        }
    }

    /// The largest value of one drawn cell, given as (index, number of cells).
    fn pooled(&self, column: (usize, usize), row: (usize, usize), log: bool) -> Option<f64> {
        let reach = |(place, of): (usize, usize), all: usize| {
            let first = place * all / of;
            first..((place + 1) * all / of).max(first + 1)
        };
        let inside = reach(row, self.rows)
            .flat_map(|row| reach(column, self.columns).map(move |column| (row, column)))
            .map(|(row, column)| self.values[row * self.columns + column]);
        inside.filter(|value| drawable(*value, log)).reduce(f64::max)
    }

    fn draw_key(&self, canvas: &mut Canvas, beside: Area, value: Span) {
        let (left, right) = (beside.right() + 24.0, beside.right() + 36.0);
        let step = beside.height / LEVELS as f64;
        for level in 0..LEVELS {
            let (low, high) = (
                beside.bottom() - step * level as f64,
                beside.bottom() - step * (level + 1) as f64,
            );
            let (left, right, low, high) = (Px(left), Px(right), Px(low), Px(high));
            canvas.cells(&colour(level), &format!("M{left} {low}H{right}V{high}H{left}z"));
        }
        let scale = Scale { span: value, from_px: beside.bottom(), to_px: beside.top };
        let found = ticks(value, 6);
        for (value, label) in &found.marks {
            canvas.text("tick", (right + 6.0, scale.held(*value) + 4.0), Anchor::Start, label);
        }
        let caption = self.value.caption(&found.power);
        let width = canvas.width_px();
        canvas.text("axis", (width, beside.top - 13.0), Anchor::End, &caption);
    }

    fn describe(&self, value: Span) -> String {
        let unit = &self.value.unit;
        let (low, high) = (quantity(value.low, unit), quantity(value.high, unit));
        let pooled = self.columns > COLUMNS_MAX || self.rows > ROWS_MAX;
        let thinned =
            if pooled { ", pooled for drawing, the largest value of each cell shown" } else { "" };
        format!(
            "{} by colour, from {low} to {high}, over {} and {}; {} by {} cells{thinned}.",
            self.value.label, self.x.label, self.y.label, self.columns, self.rows
        )
    }
}

/// The colour level of a value; `None` without a value.
pub(crate) fn shade(value: Option<f64>, span: Span) -> Option<usize> {
    let scale = Scale { span, from_px: 0.0, to_px: LEVELS as f64 };
    value.map(|value| (scale.held(value) as usize).min(LEVELS - 1))
}

/// The colour of a level.
pub(crate) fn colour(level: usize) -> String {
    let place = level as f64 / (LEVELS - 1) as f64 * (VIRIDIS.len() - 1) as f64;
    let below = (place as usize).min(VIRIDIS.len() - 2);
    let share = place - below as f64;
    let mix = |part: usize| {
        let (low, high) = (f64::from(VIRIDIS[below][part]), f64::from(VIRIDIS[below + 1][part]));
        (low + (high - low) * share).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(label: &str) -> Axis {
        Axis::new(label, "")
    }

    #[test]
    fn one_hot_cell_in_a_large_grid_is_still_drawn_hot() {
        let mut values = vec![0.0; 2000 * 1000];
        values[777 * 2000 + 1234] = 1.0;
        let svg = HeatMap::new("t", axis("x"), axis("y"), axis("v")).cells(2000, values).render();
        let hot = format!("fill=\"{}\" d=\"M", colour(LEVELS - 1));
        assert_eq!(svg.as_str().matches(&hot).count(), 2, "the cell and the key");
    }

    #[test]
    fn marks_inside_the_range_are_drawn_over_the_colours() {
        let svg = HeatMap::new("t", axis("x"), axis("y"), axis("v"))
            .cells(2, vec![0.0, 1.0, 2.0, 3.0])
            .mark_x(1.0, "alarm")
            .mark_y(0.5, "mode")
            .mark_x(7.0, "outside")
            .render();
        assert_eq!(svg.as_str().matches("class=\"mark over\"").count(), 2);
        assert!(svg.as_str().contains("alarm") && !svg.as_str().contains("outside"));
    }

    #[test]
    fn an_outline_is_drawn_around_its_part_and_labels_that_would_overlap_are_apart() {
        let map = |outlines: &[(f64, f64)]| {
            let map = HeatMap::new("t", axis("x"), axis("y"), axis("v"));
            let map = map.cells(4, (0..16).map(f64::from).collect());
            let outline = |map: HeatMap, place: &(f64, f64)| {
                map.outline((place.0, place.0 + 1.0), (place.1, place.1), "684 Hz")
            };
            outlines.iter().fold(map, outline).render().as_str().to_owned()
        };
        let count = |svg: &str, what: &str| svg.matches(what).count();
        let one = map(&[(1.0, 2.0)]);
        assert_eq!((count(&one, "class=\"mark over\""), count(&one, ">684 Hz<")), (4, 1));
        assert_eq!(count(&map(&[(9.0, 2.0)]), "684 Hz"), 0, "outside");
        let two = map(&[(1.0, 2.0), (1.0, 2.0)]);
        let levels: Vec<&str> =
            two.split("class=\"note\"").skip(1).filter_map(|s| s.split('"').nth(3)).collect();
        assert!(levels.len() == 2 && levels[0] != levels[1], "{levels:?}");
    }

    #[test]
    fn noise_on_a_large_grid_stays_of_bounded_size() {
        let mut state = 1u32;
        let values = std::iter::repeat_with(|| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8)
        });
        let values = values.take(600 * 400).collect();
        let svg = HeatMap::new("t", axis("x"), axis("y"), axis("v")).cells(600, values).render();
        assert!(svg.as_str().len() < 700_000, "{}", svg.as_str().len());
    }

    #[test]
    fn a_grid_without_whole_rows_is_empty_but_drawn() {
        let svg =
            HeatMap::new("t", axis("x"), axis("y"), axis("v")).cells(5, vec![1.0; 3]).render();
        assert!(svg.as_str().ends_with("</svg>"));
        let svg =
            HeatMap::new("t", axis("x"), axis("y"), axis("v")).cells(0, vec![1.0; 3]).render();
        assert!(svg.as_str().ends_with("</svg>"));
    }
}
