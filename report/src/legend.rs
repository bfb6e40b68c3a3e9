//! Which colour is which series: one row, or several, above a plot.

use crate::canvas::{Anchor, Area, Canvas, WIDTH_PX, shortened, text_width};

const ROW_PX: f64 = 20.0;
const SWATCH_PX: f64 = 18.0;
const GAP_PX: f64 = 22.0;

/// How an entry's sample is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Swatch {
    Line,
    Dot,
    Block,
}

/// One entry: classes for its colour, its sample, its name.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) class: String,
    pub(crate) swatch: Swatch,
    pub(crate) name: String,
}

/// Draws the entries that have a name from the top left, and returns the height taken.
pub(crate) fn draw(canvas: &mut Canvas, entries: &[Entry]) -> f64 {
    let mut at = (0.0, 0.0);
    let mut any = false;
    for entry in entries.iter().filter(|entry| !entry.name.is_empty()) {
        let name = shortened(&entry.name, WIDTH_PX * 0.6);
        let width = SWATCH_PX + 7.0 + text_width(&name);
        if at.0 > 0.0 && at.0 + width > WIDTH_PX {
            at = (0.0, at.1 + ROW_PX);
        }
        swatch(canvas, entry, at);
        canvas.text("label", (at.0 + SWATCH_PX + 7.0, at.1 + 12.0), Anchor::Start, &name);
        at.0 += width + GAP_PX;
        any = true;
    }
    if any { at.1 + ROW_PX + 8.0 } else { 0.0 }
}

fn swatch(canvas: &mut Canvas, entry: &Entry, at: (f64, f64)) {
    let middle = at.1 + 8.0;
    match entry.swatch {
        Swatch::Line => canvas.line(
            &format!("line key {}", entry.class),
            (at.0 + 1.0, middle),
            (at.0 + SWATCH_PX - 1.0, middle),
        ),
        Swatch::Dot => canvas.line(
            &format!("dots key {}", entry.class),
            (at.0 + SWATCH_PX / 2.0, middle),
            (at.0 + SWATCH_PX / 2.0, middle),
        ),
        Swatch::Block => {
            let area = Area { left: at.0 + 4.0, top: middle - 5.0, width: 12.0, height: 10.0 };
            canvas.bar(&format!("fill {}", entry.class), area, &entry.name);
        }
    }
}
