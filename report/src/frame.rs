//! Axes with ticks, grid and captions around an area of data; marks across it.

use crate::axis::Axis;
use crate::canvas::{Anchor, Area, Canvas, shortened, text_width};
use crate::scale::{Scale, Span, Ticks, ticks};

/// The area of a frame for the data, and the scales of its axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub(crate) inner: Area,
    pub(crate) x: Scale,
    pub(crate) y: Scale,
}

/// A value marked by a line across the plot.
#[derive(Debug, Clone)]
pub(crate) struct Mark {
    pub(crate) value: f64,
    pub(crate) label: String,
}

const CAPTION_PX: f64 = 24.0;
const BELOW_PX: f64 = 42.0;
const RIGHT_PX: f64 = 14.0;

/// An axis with the range it shows.
pub(crate) type Ranged<'a> = (&'a Axis, Span);

/// Position of a frame: its area, and the width of the labels of y.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub(crate) outer: Area,
    pub(crate) left: f64,
}

/// Draws grid, ticks and captions into `place`, and returns the area of the data. The range of y is
/// extended to whole ticks, unless the axis fixes it.
pub(crate) fn draw(canvas: &mut Canvas, place: Place, x: Ranged<'_>, y: Ranged<'_>) -> Frame {
    let outer = place.outer;
    let inner = inside(outer, place.left);
    let y_span = if y.0.fixed_span().is_some() { y.1 } else { whole(y.1, inner.height) };
    let frame = Frame {
        inner,
        x: Scale { span: x.1, from_px: inner.left, to_px: inner.right() },
        y: Scale { span: y_span, from_px: inner.bottom(), to_px: inner.top },
    };
    let y_ticks = y_ticks(y_span, inner.height);
    for (value, label) in &y_ticks.marks {
        let y_px = frame.y.held(*value);
        canvas.line("grid", (inner.left, y_px), (inner.right(), y_px));
        canvas.text("tick", (inner.left - 8.0, y_px + 4.0), Anchor::End, label);
    }
    let caption = shortened(&y.0.caption(&y_ticks.power), outer.width);
    canvas.text("axis", (outer.left, outer.top + 11.0), Anchor::Start, &caption);
    x_axis(canvas, &frame, x.0);
    frame
}

/// Width of the labels of y for a frame in `outer`.
pub(crate) fn label_px(outer: Area, y: Span) -> f64 {
    let height = inner_height(outer);
    // With and without the extension to whole ticks, which is not known here.
    let labels =
        y_ticks(y, height).marks.into_iter().chain(y_ticks(whole(y, height), height).marks);
    let widest = labels.map(|(_, label)| text_width(&label)).fold(0.0, f64::max);
    (widest + 10.0).clamp(28.0, outer.width / 2.0)
}

/// The area of the data in `outer`, with labels of width `left`.
pub(crate) fn inside(outer: Area, left: f64) -> Area {
    Area {
        left: outer.left + left,
        top: outer.top + CAPTION_PX,
        width: (outer.width - left - RIGHT_PX).max(10.0),
        height: inner_height(outer),
    }
}

fn inner_height(outer: Area) -> f64 {
    (outer.height - CAPTION_PX - BELOW_PX).max(10.0)
}

fn y_count(height: f64) -> usize {
    (height / 44.0).max(3.0) as usize
}

fn y_ticks(span: Span, height: f64) -> Ticks {
    ticks(span, y_count(height))
}

/// The range extended to whole ticks, so that no curve ends beyond the last tick.
fn whole(span: Span, height: f64) -> Span {
    span.to_ticks(y_count(height))
}

fn x_axis(canvas: &mut Canvas, frame: &Frame, axis: &Axis) {
    let inner = frame.inner;
    let x_ticks = spaced(frame.x.span, inner.width);
    canvas.line("rule", (inner.left, inner.bottom()), (inner.right(), inner.bottom()));
    for (value, label) in &x_ticks.marks {
        let x_px = frame.x.held(*value);
        canvas.line("rule", (x_px, inner.bottom()), (x_px, inner.bottom() + 4.0));
        canvas.text("tick", (x_px, inner.bottom() + 18.0), Anchor::Middle, label);
    }
    let caption = shortened(&axis.caption(&x_ticks.power), inner.width);
    canvas.text("axis", (inner.right(), inner.bottom() + 36.0), Anchor::End, &caption);
}

/// As many ticks as fit next to each other.
pub(crate) fn spaced(span: Span, width: f64) -> Ticks {
    let mut wanted = ((width / 72.0) as usize).clamp(4, 10);
    loop {
        let found = ticks(span, wanted);
        let widest = found.marks.iter().map(|(_, label)| text_width(label)).fold(0.0, f64::max);
        if wanted <= 2 || (widest + 12.0) * found.marks.len() as f64 <= width {
            return found;
        }
        wanted -= 1;
    }
}

/// CSS class of a mark on the background.
pub(crate) const ON_PAPER: &str = "mark";
/// CSS class of a mark on a colour map.
pub(crate) const ON_COLOURS: &str = "mark over";

/// Levels for the labels of vertical marks.
const LEVELS: usize = 6;
/// Height of such a level.
const LEVEL_PX: f64 = 15.0;

/// Vertical marks with their labels at the top, each on the highest level without overlap.
pub(crate) fn mark_x(canvas: &mut Canvas, frame: &Frame, marks: &[Mark], class: &str) {
    let inner = frame.inner;
    let mut taken: Vec<Area> = Vec::new();
    for mark in marks.iter().filter(|mark| shown(mark, frame.x.span)) {
        let x_px = frame.x.held(mark.value);
        canvas.line(class, (x_px, inner.top), (x_px, inner.bottom()));
        let label = shortened(&mark.label, inner.width * 0.6);
        let width = text_width(&label);
        let fits = x_px + 6.0 + width <= inner.right();
        let left = if fits { x_px + 5.0 } else { x_px - 5.0 - width };
        let place = |level: usize| {
            let top = inner.top + LEVEL_PX * level as f64;
            Area { left, top, width, height: LEVEL_PX - 1.0 }
        };
        let is_free = |place: &Area| !taken.iter().any(|other| place.overlaps(other));
        let place = (0..LEVELS).map(place).find(is_free).unwrap_or(place(0));
        let (x, anchor) = if fits { (left, Anchor::Start) } else { (x_px - 5.0, Anchor::End) };
        canvas.text("note", (x, place.top + 11.0), anchor, &label);
        taken.push(place);
    }
}

/// Horizontal marks with their labels at the right end.
pub(crate) fn mark_y(canvas: &mut Canvas, frame: &Frame, marks: &[Mark], class: &str) {
    let inner = frame.inner;
    for mark in marks.iter().filter(|mark| shown(mark, frame.y.span)) {
        let y_px = frame.y.held(mark.value);
        canvas.line(class, (inner.left, y_px), (inner.right(), y_px));
        let below = y_px - inner.top < 14.0;
        let level = if below { y_px + 14.0 } else { y_px - 5.0 };
        let label = shortened(&mark.label, inner.width * 0.6);
        canvas.text("note", (inner.right(), level), Anchor::End, &label);
    }
}

fn shown(mark: &Mark, span: Span) -> bool {
    (span.low..=span.high).contains(&mark.value)
}
