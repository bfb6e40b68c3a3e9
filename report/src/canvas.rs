//! SVG elements with finite coordinates and escaped text; no other module writes SVG.
//!
//! Colours come from the page's stylesheet by class, so that one drawing serves light, dark and print.

use std::fmt;

use crate::MADE_BY;
use crate::escape::escape;
use crate::page::STYLE;

/// The width of a drawing on a wide screen and in print, in its own pixels: the width of a page's
/// text.
const WIDE_PX: f64 = 832.0;
/// The width of a drawing on a phone, in its own pixels: a screen of 375 px less its margins.
const NARROW_PX: f64 = 336.0;
/// Estimated width of a character of small text.
const CHARACTER_PX: f64 = 7.3;
/// Estimated width of a digit, which is as wide as any other.
const DIGIT_PX: f64 = 7.7;
/// Estimated width of a minus sign.
const MINUS_PX: f64 = 10.1;

/// A finished drawing, well-formed and with a description, for a [`crate::Page`]. It has two
/// layouts, for a wide screen and for a phone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Svg {
    wide: String,
    narrow: String,
}

impl Svg {
    /// Draws for both widths, px.
    pub(crate) fn laid_out(draw: impl Fn(f64) -> String) -> Self {
        Self { wide: draw(WIDE_PX), narrow: draw(NARROW_PX) }
    }

    /// The `<svg>` element for a wide screen and for print; it takes its colours from the stylesheet of the page.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.wide
    }

    /// The `<svg>` element for a phone.
    #[must_use]
    pub fn narrow(&self) -> &str {
        &self.narrow
    }

    /// Both elements, of which the stylesheet shows one.
    pub(crate) fn html(&self) -> String {
        let Self { wide, narrow } = self;
        format!("<div class=\"on-wide\">{wide}</div><div class=\"on-narrow\">{narrow}</div>")
    }

    /// The drawing of a rendered [`crate::Page`] whose caption starts with this (escaped) text;
    /// `None` if the page has no such figure.
    #[must_use]
    pub fn of_page(page: &str, caption: &str) -> Option<Self> {
        let caption = escape(caption);
        page.split("<figure><div class=\"on-wide\">").skip(1).find_map(|figure| {
            let (wide, rest) = figure.split_once("</div><div class=\"on-narrow\">")?;
            let (narrow, rest) = rest.split_once("</div><figcaption>")?;
            let (_, text) = rest.split_once("</b> ")?;
            let (wide, narrow) = (wide.to_owned(), narrow.to_owned());
            text.starts_with(&caption).then_some(Self { wide, narrow })
        })
    }

    /// A separate file: the drawing with the page's stylesheet and background.
    #[must_use]
    pub fn file(&self) -> String {
        let paper = "svg { background: var(--paper); font-family: system-ui, sans-serif; }";
        let (head, rest) = self.wide.split_at(self.wide.find('>').map_or(0, |end| end + 1));
        format!("{head}{MADE_BY}<style><![CDATA[\n{STYLE}{paper}\n]]></style>{rest}\n")
    }
}

/// A coordinate: rounded to a tenth of a pixel, and always finite.
pub(crate) struct Px(pub(crate) f64);

impl fmt::Display for Px {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = if self.0.is_nan() { 0.0 } else { self.0.clamp(-1e5, 1e5) };
        let tenths = (value * 10.0).round() as i64;
        let sign = if tenths < 0 { "-" } else { "" };
        let (whole, tenth) = (tenths.abs() / 10, tenths.abs() % 10);
        match tenth {
            0 => write!(f, "{sign}{whole}"),
            _ => write!(f, "{sign}{whole}.{tenth}"),
        }
    }
}

/// A rectangle, in pixels from the top left.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Area {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
}

impl Area {
    pub(crate) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(crate) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right()
            && other.left < self.right()
            && self.top < other.bottom()
            && other.top < self.bottom()
    }
}

/// Which end of a text is at its point.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A drawing under construction.
#[derive(Debug)]
pub(crate) struct Canvas {
    width_px: f64,
    body: String,
}

impl Canvas {
    pub(crate) fn new(width_px: f64) -> Self {
        Self { width_px, body: String::new() }
    }

    /// The width of the whole drawing.
    pub(crate) fn width_px(&self) -> f64 {
        self.width_px
    }

    /// Whether it is laid out for a phone.
    pub(crate) fn is_narrow(&self) -> bool {
        self.width_px < 0.5 * WIDE_PX
    }

    pub(crate) fn line(&mut self, class: &str, from: (f64, f64), to: (f64, f64)) {
        self.body.push_str(&format!(
            "<line class=\"{class}\" x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\"/>",
            Px(from.0),
            Px(from.1),
            Px(to.0),
            Px(to.1)
        ));
    }

    /// A filled rectangle; its hint is shown on hovering and read aloud.
    pub(crate) fn bar(&mut self, class: &str, area: Area, hint: &str) {
        self.body.push_str(&format!(
            "<rect class=\"{class}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"1.5\"><title>{}</title></rect>",
            Px(area.left),
            Px(area.top),
            Px(area.width.max(0.0)),
            Px(area.height.max(0.0)),
            escape(hint)
        ));
    }

    /// A text with one of its ends, or its middle, at a point; moved sideways where it would
    /// otherwise leave the drawing.
    pub(crate) fn text(&mut self, class: &str, point: (f64, f64), anchor: Anchor, text: &str) {
        let x = self.inside(point.0, anchor, text_width(text));
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        self.body.push_str(&format!(
            "<text class=\"{class}\" x=\"{}\" y=\"{}\"{anchor}>{}</text>",
            Px(x),
            Px(point.1),
            escape(text)
        ));
    }

    /// The position nearest to `x` at which a text of this width is inside the drawing.
    fn inside(&self, x: f64, anchor: Anchor, text_px: f64) -> f64 {
        let before = text_px
            * match anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => 0.5,
                Anchor::End => 1.0,
            };
        x.min(self.width_px - text_px + before).max(before)
    }

    /// A path; `data` contains only numbers written with [`Px`].
    pub(crate) fn path(&mut self, class: &str, data: &str) {
        if !data.is_empty() {
            self.body.push_str(&format!("<path class=\"{class}\" d=\"{data}\"/>"));
        }
    }

    pub(crate) fn circle(&mut self, class: &str, point: (f64, f64), radius_px: f64) {
        let (x, y, radius) = (Px(point.0), Px(point.1), Px(radius_px));
        self.body
            .push_str(&format!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"/>"));
    }

    /// A dot with a given colour.
    pub(crate) fn spot(&mut self, colour: &str, point: (f64, f64), radius_px: f64) {
        let (x, y, radius) = (Px(point.0), Px(point.1), Px(radius_px));
        self.body.push_str(&format!(
            "<circle class=\"spot\" fill=\"{colour}\" cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"/>"
        ));
    }

    /// A line with a given colour.
    pub(crate) fn coloured(&mut self, class: &str, colour: &str, data: &str) {
        self.body.push_str(&format!("<path class=\"{class}\" stroke=\"{colour}\" d=\"{data}\"/>"));
    }

    /// A path with a given colour, without antialiasing.
    pub(crate) fn cells(&mut self, colour: &str, data: &str) {
        if !data.is_empty() {
            self.body.push_str(&format!("<path class=\"cell\" fill=\"{colour}\" d=\"{data}\"/>"));
        }
    }

    /// Draws with clipping to the area. Coordinates stay those of the whole drawing.
    pub(crate) fn clipped(&mut self, area: Area, draw: impl FnOnce(&mut Self)) {
        let (x, y, width, height) = (Px(area.left), Px(area.top), Px(area.width), Px(area.height));
        self.body.push_str(&format!(
            "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" viewBox=\"{x} {y} {width} {height}\">"
        ));
        draw(self);
        self.body.push_str("</svg>");
    }

    /// The whole element, with its title and its description.
    pub(crate) fn finish(self, height: f64, title: &str, description: &str) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" role=\"img\" viewBox=\"0 0 {} {}\">\
             <title>{}</title><desc>{}</desc>{}</svg>",
            Px(self.width_px),
            Px(height),
            escape(title),
            escape(description),
            self.body
        )
    }
}

/// Approximate width of a small text.
pub(crate) fn text_width(text: &str) -> f64 {
    let width = |c: char| match c {
        '0'..='9' => DIGIT_PX,
        '−' => MINUS_PX,
        _ => CHARACTER_PX,
    };
    text.chars().map(width).sum()
}

/// The text, shortened with an ellipsis to fit into a width.
pub(crate) fn shortened(text: &str, width_px: f64) -> String {
    let room = (width_px / CHARACTER_PX).max(1.0) as usize;
    if text.chars().count() <= room {
        return text.to_owned();
    }
    text.chars().take(room.saturating_sub(1)).chain(std::iter::once('…')).collect()
}

/// The text in lines of at most this width, broken between words.
pub(crate) fn wrapped(text: &str, width_px: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(line) + text_width(word) + CHARACTER_PX <= width_px => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short_and_finite() {
        let written: Vec<String> =
            [1.0, -0.04, 2.26, f64::NAN, f64::INFINITY, -3.55].map(|v| Px(v).to_string()).into();
        assert_eq!(written, ["1", "0", "2.3", "0", "100000", "-3.6"]);
    }

    #[test]
    fn a_text_never_leaves_the_drawing() {
        let canvas = Canvas::new(100.0);
        assert_eq!(canvas.inside(0.0, Anchor::Middle, 20.0), 10.0);
        assert_eq!(canvas.inside(98.0, Anchor::Start, 20.0), 80.0);
        assert_eq!(canvas.inside(5.0, Anchor::End, 20.0), 20.0);
        assert_eq!(canvas.inside(50.0, Anchor::Middle, 20.0), 50.0);
    }

    #[test]
    fn long_captions_are_broken_between_words() {
        let lines = wrapped("The joint alone would have to be off by (mrad)", 180.0);
        assert_eq!(lines.join(" "), "The joint alone would have to be off by (mrad)");
        assert!(lines.len() == 2 && lines.iter().all(|line| text_width(line) <= 180.0));
    }

    #[test]
    fn long_labels_are_shortened() {
        assert_eq!(shortened("joint compliance of joint 2", 85.0), "joint comp…");
    }
}
