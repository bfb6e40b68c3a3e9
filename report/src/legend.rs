//! Legend above a plot, in one or several rows.

use crate::canvas::{Anchor, Area, Canvas, Px, shortened, text_width};
use crate::role::Appearance;

const ROW_PX: f64 = 20.0;
const SWATCH_PX: f64 = 18.0;
const GAP_PX: f64 = 22.0;

/// Symbol of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Swatch {
    Line,
    Dot,
    Block,
}

/// One entry: its appearance, its symbol, its name.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) appearance: Appearance,
    pub(crate) swatch: Swatch,
    pub(crate) name: String,
}

/// Draws the named entries from the top left, and returns the height used.
pub(crate) fn draw(canvas: &mut Canvas, entries: &[Entry]) -> f64 {
    let whole = canvas.width_px();
    let mut cursor = (0.0, 0.0);
    let mut any = false;
    for entry in entries.iter().filter(|entry| !entry.name.is_empty()) {
        let name = shortened(&entry.name, (whole - SWATCH_PX - 7.0).min(500.0));
        let width = SWATCH_PX + 7.0 + text_width(&name);
        if cursor.0 > 0.0 && cursor.0 + width > whole {
            cursor = (0.0, cursor.1 + ROW_PX);
        }
        swatch(canvas, entry, cursor);
        canvas.text("label", (cursor.0 + SWATCH_PX + 7.0, cursor.1 + 12.0), Anchor::Start, &name);
        cursor.0 += width + GAP_PX;
        any = true;
    }
    if any { cursor.1 + ROW_PX + 8.0 } else { 0.0 }
}

fn swatch(canvas: &mut Canvas, entry: &Entry, place: (f64, f64)) {
    let (middle, appearance) = (place.1 + 8.0, entry.appearance);
    match entry.swatch {
        Swatch::Line => {
            let line =
                format!("M{} {}H{}", Px(place.0 + 1.0), Px(middle), Px(place.0 + SWATCH_PX + 3.0));
            canvas.path(&format!("{} key", appearance.line()), &line);
        }
        Swatch::Dot => {
            let dot = appearance.marker((place.0 + SWATCH_PX / 2.0, middle));
            canvas.path(&format!("{} key", appearance.dots()), &dot);
        }
        Swatch::Block => {
            let area = Area { left: place.0 + 4.0, top: middle - 5.0, width: 12.0, height: 10.0 };
            canvas.bar(&format!("fill {}", appearance.colour()), area, &entry.name);
        }
    }
}
