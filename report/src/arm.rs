//! Side and top view of an arm: links, relevant joints, and tool errors as vectors.
//!
//! Takes points in the base frame, m, and names; independent of a model. The side view shows the
//! vertical plane through the base in which most of the tool positions lie. Errors are exaggerated
//! by a round factor, which is shown; one factor and one colour scale for all panels of a drawing.

use crate::axis::Axis;
use crate::canvas::{Anchor, Area, Canvas, Px, Svg, text_width};
use crate::frame::{self, Frame, Place};
use crate::heat::{LEVELS, colour, shade};
use crate::number::{quantity, significant};
use crate::plot::equalised;
use crate::scale::{Scale, Span};

/// Limit on the errors drawn; of more, every n-th.
const VECTORS_MAX: usize = 300;
/// Drawn length of the longest error before the correction, as a share of a panel's width.
const LONGEST: f64 = 0.12;
/// Joints that lie closer together in a drawing share one name.
const APART_PX: f64 = 14.0;
const GAP_PX: f64 = 24.0;
const HEADING_PX: f64 = 22.0;
const KEY_PX: f64 = 44.0;
/// Height of a joint's name.
const NAME_PX: f64 = 12.0;
const MILLI: f64 = 1e3;

/// A point in the base frame, m.
pub type Point = [f64; 3];

/// A joint and its position.
#[derive(Debug, Clone)]
struct Joint {
    name: String,
    at: Point,
    is_lit: bool,
}

/// An error at a position of the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolError {
    /// Where the tool was, base frame, m.
    pub at: Point,
    /// The error with the model as it was, base axes, m.
    pub before: Point,
    /// The error with the new model, base axes, m.
    pub after: Point,
}

/// An arm with errors at its tool, before and after.
#[derive(Debug, Clone)]
pub struct ArmPicture {
    title: String,
    joints: Vec<Joint>,
    tool: Point,
    errors: Vec<ToolError>,
}

/// Direction of view.
#[derive(Debug, Clone, Copy)]
pub(crate) enum View {
    /// Vertical plane through the base at this angle about z, rad.
    Side {
        azimuth: f64,
    },
    Above,
}

impl View {
    /// The side view through the mean of these points.
    pub(crate) fn side(places: impl IntoIterator<Item = Point>) -> Self {
        let places = places.into_iter();
        let (x, y) = places.fold((0.0, 0.0), |(x, y), place| (x + place[0], y + place[1]));
        Self::Side { azimuth: if y == 0.0 && x == 0.0 { 0.0 } else { f64::atan2(y, x) } }
    }

    pub(crate) fn of(self, [x, y, z]: Point) -> (f64, f64) {
        match self {
            Self::Side { azimuth } => (x * azimuth.cos() + y * azimuth.sin(), z),
            Self::Above => (x, y),
        }
    }

    fn axes(self) -> [Axis; 2] {
        match self {
            Self::Side { .. } => [Axis::new("Outwards", "m"), Axis::new("Height", "m")],
            Self::Above => [Axis::new("x of the base", "m"), Axis::new("y of the base", "m")],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Side { .. } => "from the side",
            Self::Above => "from above",
        }
    }
}

/// Selects the error before or after.
type ErrorSelector = fn(&ToolError) -> Point;

/// What one panel shows.
struct Panel<'a> {
    heading: String,
    view: View,
    error: ErrorSelector,
    scale: VectorScale<'a>,
}

/// What all panels share.
#[derive(Clone, Copy)]
struct VectorScale<'a> {
    shown: &'a [ToolError],
    /// Factor by which errors are exaggerated.
    factor: f64,
    /// The range of colours, mm.
    span: Span,
}

impl ArmPicture {
    /// An arm without joints; `tool` is the tool's position in the pose drawn.
    #[must_use]
    pub fn new(title: impl Into<String>, tool: Point) -> Self {
        Self { title: title.into(), joints: Vec::new(), tool, errors: Vec::new() }
    }

    /// Adds the next joint from the base on; a highlighted one is the cause of the error.
    #[must_use]
    pub fn joint(mut self, name: impl Into<String>, at: Point, is_lit: bool) -> Self {
        self.joints.push(Joint { name: name.into(), at, is_lit });
        self
    }

    /// Adds errors at the tool.
    #[must_use]
    pub fn errors(mut self, errors: impl IntoIterator<Item = ToolError>) -> Self {
        let finite = |one: &ToolError| {
            one.at.iter().chain(&one.before).chain(&one.after).all(|x| x.is_finite())
        };
        self.errors.extend(errors.into_iter().filter(finite));
        self
    }

    /// How many times longer errors are drawn: 1, 2 or 5 times a power of ten.
    #[must_use]
    pub fn magnified(&self) -> f64 {
        let longest = self.errors.iter().map(|one| length(one.before)).fold(0.0, f64::max);
        let reach = self.points().flatten().map(f64::abs).fold(0.1, f64::max);
        if longest <= 0.0 { 1.0 } else { round_down(2.0 * LONGEST * reach / longest) }
    }

    /// Draws it: before above, after below, from the side and from above.
    #[must_use]
    pub fn render(&self) -> Svg {
        Svg::laid_out(|width| self.laid_out(width))
    }

    fn points(&self) -> impl Iterator<Item = Point> + '_ {
        let arm = self.joints.iter().map(|joint| joint.at).chain([self.tool]);
        arm.chain(self.errors.iter().map(|one| one.at))
    }

    fn laid_out(&self, whole_px: f64) -> String {
        let mut canvas = Canvas::new(whole_px);
        let stride = self.errors.len().div_ceil(VECTORS_MAX).max(1);
        let shown: Vec<ToolError> = self.errors.iter().step_by(stride).copied().collect();
        let sizes = shown.iter().flat_map(|e| [e.before, e.after]).map(|e| MILLI * length(e));
        let span = Span::of(sizes.chain([0.0]), false).unwrap_or(Span::unit(false));
        let scale = VectorScale { shown: &shown, factor: self.magnified(), span };
        let side = View::side(self.points());
        let sides: [(&str, ErrorSelector); 2] = [("Before", |e| e.before), ("After", |e| e.after)];
        let panels = sides.iter().flat_map(|(name, error)| {
            [side, View::Above].map(|view| Panel {
                heading: format!("{name}, {}", view.name()),
                view,
                error: *error,
                scale,
            })
        });
        let columns = if canvas.is_narrow() { 1 } else { 2 };
        let width = (whole_px - GAP_PX * (columns - 1) as f64) / columns as f64;
        // Low enough to fit on the first printed page together with what precedes it.
        let height = 0.42 * width + 62.0;
        self.draw_key(&mut canvas, scale);
        let mut bottom = KEY_PX;
        for (i, panel) in panels.enumerate() {
            let (row, column) = (i / columns, i % columns);
            let top = KEY_PX + row as f64 * (height + HEADING_PX) + HEADING_PX;
            let left = column as f64 * (width + GAP_PX);
            self.draw(&mut canvas, Area { left, top, width, height }, &panel);
            bottom = top + height;
        }
        canvas.finish(bottom, &self.title, &self.describe(scale, stride))
    }

    fn draw(&self, canvas: &mut Canvas, outer: Area, panel: &Panel<'_>) {
        let heading = (outer.left, outer.top - 7.0);
        canvas.text("heading", heading, Anchor::Start, &panel.heading);
        let projected: Vec<(f64, f64)> =
            self.points().chain([[0.0; 3]]).map(|point| panel.view.of(point)).collect();
        let frame = square_frame(canvas, outer, panel.view, &projected);
        self.draw_arm(canvas, &frame, panel.view);
        canvas.clipped(frame.inner, |canvas| draw_errors(canvas, &frame, panel));
    }

    fn draw_arm(&self, canvas: &mut Canvas, frame: &Frame, view: View) {
        let px = |point: Point| {
            let (x, y) = view.of(point);
            (frame.x.held(x), frame.y.held(y))
        };
        let places = self.joints.iter().map(|joint| joint.at);
        let line: Vec<(f64, f64)> =
            [[0.0; 3]].into_iter().chain(places).chain([self.tool]).map(px).collect();
        canvas.path("link", &polyline(&line));
        // Highlighted ones last, so that they are visible where several share a place.
        let (lit, plain): (Vec<&Joint>, Vec<&Joint>) = self.joints.iter().partition(|j| j.is_lit);
        plain.iter().for_each(|joint| canvas.circle("joint", px(joint.at), 4.5));
        lit.iter().for_each(|joint| canvas.circle("joint lit", px(joint.at), 4.5));
        let mut named: Vec<((f64, f64), Vec<&Joint>)> = Vec::new();
        for joint in &self.joints {
            let place = px(joint.at);
            let is_near =
                |other: &(f64, f64)| (other.0 - place.0).hypot(other.1 - place.1) < APART_PX;
            match named.iter_mut().find(|(other, _)| is_near(other)) {
                Some((_, joints)) => joints.push(joint),
                None => named.push((place, vec![joint])),
            }
        }
        let mut taken: Vec<Area> = Vec::new();
        for (place, joints) in named {
            let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
            let names = names.join(", ");
            let class =
                if joints.iter().any(|j| j.is_lit) { "joint-name lit" } else { "joint-name" };
            let name = free_place(place, text_width(&names), frame.inner.right(), &taken);
            canvas.text(class, (name.left, name.bottom()), Anchor::Start, &names);
            taken.push(name);
        }
    }

    /// The colour scale, and the exaggeration of the errors.
    fn draw_key(&self, canvas: &mut Canvas, scale: VectorScale<'_>) {
        let caption = format!("magnified {} times", significant(scale.factor, 1));
        let (left, top) = (0.0, 18.0);
        let width = (canvas.width_px() - text_width(&caption) - 16.0).clamp(40.0, 300.0);
        canvas.text("axis", (left, 11.0), Anchor::Start, "Error at the tool (mm)");
        let step = width / LEVELS as f64;
        for level in 0..LEVELS {
            let cell_left = left + step * level as f64;
            let (from, to, low, high) =
                (Px(cell_left), Px(cell_left + step), Px(top), Px(top + 9.0));
            canvas.cells(&colour(level), &format!("M{from} {low}H{to}V{high}H{from}z"));
        }
        let along = Scale { span: scale.span, from_px: left, to_px: left + width };
        for (value, label) in frame::spaced(scale.span, width).marks {
            canvas.text("tick", (along.held(value), top + 22.0), Anchor::Middle, &label);
        }
        canvas.text("label", (left + width + 16.0, top + 9.0), Anchor::Start, &caption);
    }

    fn describe(&self, scale: VectorScale<'_>, stride: usize) -> String {
        let mean = |error: ErrorSelector| {
            let sum: f64 = self.errors.iter().map(|one| length(error(one))).sum();
            quantity(MILLI * sum / self.errors.len().max(1) as f64, "mm")
        };
        let lit = self.joints.iter().filter(|joint| joint.is_lit);
        let lit: Vec<&str> = lit.map(|joint| joint.name.as_str()).collect();
        let thinned = if stride > 1 { format!(" (1 in {stride} is drawn)") } else { String::new() };
        let lit = if lit.is_empty() { "none".to_owned() } else { lit.join(", ") };
        format!(
            "Errors at {} tool positions{thinned}, magnified {} times; mean {} before and {} after. Highlighted joints: {lit}.",
            self.errors.len(),
            significant(scale.factor, 1),
            mean(|e| e.before),
            mean(|e| e.after),
        )
    }
}

/// Axes with equal scales around an area.
fn square_frame(canvas: &mut Canvas, outer: Area, view: View, points: &[(f64, f64)]) -> Frame {
    let span = |values: &mut dyn Iterator<Item = f64>| {
        Span::of(values, false).unwrap_or(Span::unit(false)).padded(0.06)
    };
    let (x, y) = (span(&mut points.iter().map(|p| p.0)), span(&mut points.iter().map(|p| p.1)));
    let left = frame::label_px(outer, y);
    let (x, y) = equalised(x, y, frame::inside(outer, left));
    let [x_axis, y_axis] = view.axes();
    let y_axis = y_axis.range(y.low, y.high);
    frame::draw(canvas, Place { outer, left }, (&x_axis, x), (&y_axis, y))
}

fn draw_errors(canvas: &mut Canvas, frame: &Frame, panel: &Panel<'_>) {
    let VectorScale { shown, factor, span } = panel.scale;
    let mut drawn: Vec<(usize, &ToolError)> = shown
        .iter()
        .filter_map(|one| Some((shade(Some(MILLI * length((panel.error)(one))), span)?, one)))
        .collect();
    // The largest last, so that none hides it.
    drawn.sort_by_key(|(level, _)| *level);
    let px = |point: Point| {
        let (x, y) = panel.view.of(point);
        frame.x.at(x).zip(frame.y.at(y))
    };
    for (level, one) in drawn {
        let error = (panel.error)(one);
        let end: Point = std::array::from_fn(|k| one.at[k] + factor * error[k]);
        let Some((from, to)) = px(one.at).zip(px(end)) else { continue };
        canvas.coloured("vector", &colour(level), &polyline(&[from, to]));
        canvas.spot(&colour(level), from, 2.6);
    }
}

/// Area for the name of a joint at `at` that overlaps no other: above or below it, on either side;
/// above to the right if all four are taken.
fn free_place(point: (f64, f64), width: f64, right_end: f64, taken: &[Area]) -> Area {
    let place =
        |left: f64, bottom: f64| Area { left, top: bottom - NAME_PX, width, height: NAME_PX };
    let (right, left) = (point.0 + 9.0, point.0 - 9.0 - width);
    let (above, below) = (point.1 - 7.0, point.1 + 17.0);
    let places = [place(right, above), place(left, above), place(right, below), place(left, below)];
    let is_free = |one: &&Area| {
        one.right() <= right_end
            && one.left >= 0.0
            && !taken.iter().any(|other| one.overlaps(other))
    };
    *places.iter().find(is_free).unwrap_or(&places[0])
}

/// A path through points in pixels.
pub(crate) fn polyline(points: &[(f64, f64)]) -> String {
    let step = |(i, (x, y)): (usize, &(f64, f64))| {
        format!("{}{} {}", if i == 0 { 'M' } else { 'L' }, Px(*x), Px(*y))
    };
    points.iter().enumerate().map(step).collect()
}

fn length([x, y, z]: Point) -> f64 {
    x.hypot(y).hypot(z)
}

/// The nearest of 1, 2 and 5 times a power of ten that is not larger.
fn round_down(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-12).log10().floor());
    let digit = value / power;
    power
        * if digit >= 5.0 {
            5.0
        } else if digit >= 2.0 {
            2.0
        } else {
            1.0
        }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> ArmPicture {
        let error = |x: f64, size: f64| ToolError {
            at: [x, 0.2, 0.5],
            before: [0.0, 0.0, size],
            after: [0.0, size / 10.0, 0.0],
        };
        ArmPicture::new("arm", [1.0, 0.0, 1.0])
            .joint("1", [0.0, 0.0, 0.4], false)
            .joint("2", [0.0, 0.0, 0.4], true)
            .joint("3", [0.1, 0.0, 1.1], false)
            .errors((0..40).map(|i| error(0.5 + 0.01 * f64::from(i), 1e-3)))
    }

    #[test]
    fn errors_are_exaggerated_by_a_round_factor_that_is_shown() {
        let picture = picture();
        let factor = picture.magnified();
        let digits = factor / 10f64.powf(factor.log10().floor());
        assert!([1.0, 2.0, 5.0].iter().any(|digit| (digits - digit).abs() < 1e-9), "{factor}");
        let caption = format!("magnified {} times", significant(factor, 1));
        let drawn = picture.render();
        assert!(drawn.as_str().contains(&caption) && drawn.narrow().contains(&caption));
    }

    #[test]
    fn joints_in_one_place_share_a_name_and_the_guilty_one_is_lit() {
        let drawn = picture().render();
        assert!(drawn.as_str().contains("joint-name lit"));
        assert!(drawn.as_str().contains(">1, 2<"), "two joints that lie in one place");
        assert!(drawn.as_str().contains("Highlighted joints: 2."));
    }

    #[test]
    fn names_of_joints_that_lie_close_together_do_not_overlap() {
        let mut taken = Vec::new();
        for point in [(100.0, 50.0), (115.0, 52.0), (108.0, 60.0)] {
            let name = free_place(point, 40.0, 300.0, &taken);
            assert!(!taken.iter().any(|other| name.overlaps(other)), "{name:?} {taken:?}");
            taken.push(name);
        }
    }

    #[test]
    fn a_metre_is_as_long_to_the_right_as_upwards() {
        let mut canvas = Canvas::new(400.0);
        let outer = Area { left: 0.0, top: 0.0, width: 400.0, height: 300.0 };
        let points = [(0.0, 0.0), (2.0, 0.5)];
        let frame = square_frame(&mut canvas, outer, View::Above, &points);
        let right = frame.x.held(1.0) - frame.x.held(0.0);
        let up = frame.y.held(0.0) - frame.y.held(0.5);
        assert!((right - 2.0 * up).abs() < 1e-6, "{right} {up}");
    }

    #[test]
    fn the_side_view_keeps_the_distance_from_the_base_and_the_height() {
        let view = View::side([[1.0, 1.0, 0.0]]);
        let (out, up) = view.of([1.0, 1.0, 0.7]);
        assert!((out - 2f64.sqrt()).abs() < 1e-12 && (up - 0.7).abs() < 1e-12);
    }
}
