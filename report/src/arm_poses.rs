//! Poses of an arm as small multiples: side and top view of each, on one scale.
//!
//! Takes points in the base frame, m, and names; independent of a model.

use crate::arm::{Point, View, polyline};
use crate::canvas::{Anchor, Canvas, Svg, shortened};
use crate::scale::{Scale, Span};

/// Number of poses per row, on a wide screen and on a phone.
const COLUMNS: [usize; 2] = [4, 2];
const GAP_PX: f64 = 14.0;
const HEADING_PX: f64 = 22.0;

#[derive(Debug, Clone)]
struct ArmPose {
    name: String,
    joints: Vec<Point>,
}

/// Poses of one arm, in their order.
#[derive(Debug, Clone)]
pub struct ArmPoses {
    title: String,
    poses: Vec<ArmPose>,
}

impl ArmPoses {
    /// No pose yet.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), poses: Vec::new() }
    }

    /// Adds a pose: the positions of its joints from the base on, and of its tool last.
    #[must_use]
    pub fn pose(
        mut self,
        name: impl Into<String>,
        joints: impl IntoIterator<Item = Point>,
    ) -> Self {
        let finite = |point: &Point| point.iter().all(|x| x.is_finite());
        let joints = joints.into_iter().filter(finite).collect();
        self.poses.push(ArmPose { name: name.into(), joints });
        self
    }

    /// Draws only these poses, on the scale of all, to distribute them over several sheets.
    #[must_use]
    pub fn render_part(&self, poses: std::ops::Range<usize>) -> Svg {
        let part: Vec<&ArmPose> = self.poses.iter().take(poses.end).skip(poses.start).collect();
        Svg::laid_out(|width| self.laid_out(&part, width))
    }

    /// Draws them all.
    #[must_use]
    pub fn render(&self) -> Svg {
        self.render_part(0..self.poses.len())
    }

    fn laid_out(&self, part: &[&ArmPose], whole_px: f64) -> String {
        let mut canvas = Canvas::new(whole_px);
        let columns = COLUMNS[usize::from(canvas.is_narrow())];
        let width = (whole_px - GAP_PX * (columns - 1) as f64) / columns as f64;
        let boxes = self.boxes();
        // Both views on one scale, next to each other.
        let across = (boxes[0].width() + boxes[1].width()).max(0.1);
        let px_per_m = (width - 6.0) / across;
        let height = px_per_m * boxes[0].height().max(boxes[1].height());
        let row_px = height + HEADING_PX + GAP_PX;
        for (i, pose) in part.iter().enumerate() {
            let left = (i % columns) as f64 * (width + GAP_PX);
            let top = (i / columns) as f64 * row_px;
            let name = shortened(&pose.name, width);
            canvas.text("label", (left, top + 12.0), Anchor::Start, &name);
            let floor = top + HEADING_PX + height;
            let beside = left + px_per_m * boxes[0].width() + 6.0;
            for (k, left) in [left, beside].into_iter().enumerate() {
                let scale = boxes[k].scale((left, floor), px_per_m);
                draw(&mut canvas, scale, [pose.side(), View::Above][k], pose);
            }
        }
        let bottom = part.len().div_ceil(columns) as f64 * row_px;
        canvas.finish(bottom.max(20.0), &self.title, &self.describe(part))
    }

    /// Extent of all poses in side view and top view, m.
    fn boxes(&self) -> [Extent; 2] {
        let mut boxes = [Extent::default(); 2];
        for pose in &self.poses {
            for point in &pose.joints {
                boxes[0].add(pose.side().of(*point));
                boxes[1].add(View::Above.of(*point));
            }
        }
        boxes
    }

    fn describe(&self, part: &[&ArmPose]) -> String {
        let names: Vec<&str> = part.iter().map(|pose| pose.name.as_str()).collect();
        format!("{} poses, each from the side and from above: {}.", part.len(), names.join("; "))
    }
}

impl ArmPose {
    /// The side view that shows the tool best.
    fn side(&self) -> View {
        View::side(self.joints.last().copied())
    }
}

/// A range in both directions of a view, with the base in it, m.
#[derive(Debug, Clone, Copy, Default)]
struct Extent {
    low: (f64, f64),
    high: (f64, f64),
}

/// Margin for a joint's circle, m.
const MARGIN_M: f64 = 0.06;

impl Extent {
    fn add(&mut self, (x, y): (f64, f64)) {
        let bounded = |v: f64| v.clamp(-1e3, 1e3);
        let (x, y) = (bounded(x), bounded(y));
        self.low = (self.low.0.min(x), self.low.1.min(y));
        self.high = (self.high.0.max(x), self.high.1.max(y));
    }

    fn width(&self) -> f64 {
        self.high.0 - self.low.0 + 2.0 * MARGIN_M
    }

    fn height(&self) -> f64 {
        self.high.1 - self.low.1 + 2.0 * MARGIN_M
    }

    /// The scale, from the lower left corner on.
    fn scale(&self, corner: (f64, f64), px_per_m: f64) -> [Scale; 2] {
        let span =
            |low: f64, high: f64| Span { low: low - MARGIN_M, high: high + MARGIN_M, log: false };
        let (x, y) = (span(self.low.0, self.high.0), span(self.low.1, self.high.1));
        [
            Scale { span: x, from_px: corner.0, to_px: corner.0 + px_per_m * self.width() },
            Scale { span: y, from_px: corner.1, to_px: corner.1 - px_per_m * self.height() },
        ]
    }
}

/// One view of one pose.
fn draw(canvas: &mut Canvas, [x, y]: [Scale; 2], view: View, pose: &ArmPose) {
    let px = |point: Point| {
        let (right, up) = view.of(point);
        (x.held(right), y.held(up))
    };
    canvas.line("grid", (x.from_px, y.held(0.0)), (x.to_px, y.held(0.0)));
    canvas.line("grid", (x.held(0.0), y.to_px), (x.held(0.0), y.from_px));
    let line: Vec<(f64, f64)> =
        [[0.0; 3]].into_iter().chain(pose.joints.iter().copied()).map(px).collect();
    canvas.path("link", &polyline(&line));
    for joint in line.iter().skip(1).take(line.len().saturating_sub(2)) {
        canvas.circle("joint", *joint, 2.6);
    }
    if let Some(tool) = line.last() {
        canvas.circle("joint lit", *tool, 3.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pose_is_drawn_and_named_once_for_each_width() {
        let poses = (0..9).fold(ArmPoses::new("plan"), |all, i| {
            let out = 0.5 + 0.05 * f64::from(i);
            all.pose(format!("pose {}", i + 1), [[0.0, 0.0, 0.3], [out, 0.1, 0.6]])
        });
        let drawn = poses.render();
        for svg in [drawn.as_str(), drawn.narrow()] {
            assert_eq!(svg.matches("class=\"link\"").count(), 2 * 9);
            assert!((1..=9).all(|i| svg.contains(&format!(">pose {i}<"))));
        }
    }
}
