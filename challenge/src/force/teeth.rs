//! Teeth stepped in time: position of each edge, its distance beyond the path of the preceding tooth, direction of its forces.
//!
//! Cut axes: x along the feed, z up out of the work, y = z × x. An edge at angle φ from y towards x stands at `C(t) + ρ + R (sin φ, cos φ)`: the tool's
//! centre moves on while it turns. The chip is measured along the ray from the centre: from the edge to where the edge before crossed that ray, found by
//! stepping back in time. Helical edges are slices.
//!
//! Promises: no chip is negative. Never: a coefficient.

use std::f64::consts::{PI, TAU};

use crate::space::V3;

use super::cut::Cut;
use super::scene::{Pass, Row, Scene};

/// A slice of a helical tooth lags the one below by at most this, rad.
const SLICE_RAD: f64 = 5e-3;
/// Slices at most.
const SLICES: f64 = 48.0;
/// Steps back in time until a ray is crossed.
const STEPS: usize = 3;

/// How the tool is made otherwise than it is told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shape {
    /// Where the tool's axis stands off the spindle's, towards tooth 0 and a quarter of a turn on towards the next, m.
    pub off: [f64; 2],
    /// Of the depth, from below, how much of tooth 0 is broken off.
    pub broken: f64,
    /// The spindle stands further on by this, rad.
    pub turned: f64,
    /// Chips are those of circles: feed times sine.
    pub ideal: bool,
}

/// What acts per unit of each coefficient, cut axes: tangential, radial, axial.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bite {
    /// N per N/m of edge coefficient.
    pub edge: [V3; 3],
    /// N per N/m² of cutting coefficient.
    pub chip: [V3; 3],
    /// Whether any edge is in the work.
    pub is_engaged: bool,
}

impl Bite {
    /// An edge at an angle, of a depth, with its chip.
    fn take(&mut self, [sin, cos]: [f64; 2], depth_m: f64, chip_m: f64) {
        let ways = [[-cos, sin, 0.0], [-sin, -cos, 0.0], [0.0, 0.0, 1.0]];
        for (k, way) in ways.iter().enumerate() {
            for (axis, x) in way.iter().enumerate() {
                self.edge[k][axis] += x * depth_m;
                self.chip[k][axis] += x * depth_m * chip_m;
            }
        }
        self.is_engaged |= depth_m > 0.0;
    }
}

/// What the teeth do in each row.
#[must_use]
pub fn bites(cut: &Cut, scene: &Scene, rows: &[Row], shape: Shape) -> Vec<Bite> {
    let one = |row: &Row| {
        let pass = &scene.passes[row.pass];
        let depth_m = cut.depth_m * pass.share(row.way_m);
        if depth_m <= 0.0 {
            return Bite::default();
        }
        if cut.turning {
            turned(pass, row, depth_m)
        } else {
            milled(cut, pass, row, shape, depth_m)
        }
    };
    rows.iter().map(one).collect()
}

/// A tool that stands: the chip is as wide as the work moved on in a turn, and no wider than the work.
fn turned(pass: &Pass, row: &Row, depth_m: f64) -> Bite {
    let before = pass.way(row.t_s - 1.0 / pass.spindle_hz).max(pass.work_m[0]);
    let mut bite = Bite::default();
    bite.take([1.0, 0.0], depth_m, (row.way_m - before).max(0.0));
    bite
}

/// Where edges are at any instant.
struct Edges<'a> {
    cut: &'a Cut,
    pass: &'a Pass,
    shape: Shape,
}

impl Edges<'_> {
    /// An edge `place` rad ahead of tooth 0, seen from where the centre is at `way_m`.
    fn at(&self, t_s: f64, place: f64, way_m: f64) -> [f64; 2] {
        let turned = TAU * self.pass.spindle_hz * t_s + self.shape.turned;
        let (sin, cos) = (turned + place).sin_cos();
        let moved = self.pass.way(t_s) - way_m;
        let mut at = [moved + self.cut.radius_m * sin, self.cut.radius_m * cos];
        if self.shape.off != [0.0; 2] {
            let [along, across] = self.shape.off;
            let (sin, cos) = turned.sin_cos();
            at[0] += along * sin + across * cos;
            at[1] += along * cos - across * sin;
        }
        at
    }

    /// How far from the centre the edge `back` teeth ahead crossed this ray.
    fn crossed(&self, row: &Row, place: f64, back: usize, [sin, cos]: [f64; 2]) -> f64 {
        let pitch = TAU / self.cut.teeth as f64 * back as f64;
        let rate = TAU * self.pass.spindle_hz;
        let mut t_s = row.t_s - pitch / rate;
        let mut seen = [0.0; 2];
        for _ in 0..STEPS {
            seen = self.at(t_s, place + pitch, row.way_m);
            t_s -= (seen[0] * cos - seen[1] * sin) / (rate * self.cut.radius_m);
        }
        seen[0] * sin + seen[1] * cos
    }
}

/// How much of a slice that is `wide` rad in angle is in the work, its middle being here.
fn inside(cut: &Cut, [x, y]: [f64; 2], wide: f64) -> f64 {
    // A border that moves past at `rate` m/rad, `beyond` m away.
    let share = |beyond: f64, rate: f64| {
        let width = rate.abs() * wide;
        if width > 0.0 { (0.5 + beyond / width).clamp(0.0, 1.0) } else { f64::from(beyond >= 0.0) }
    };
    let border = |angle: f64| angle.cos() * cut.radius_m;
    let mut inside = share(x, y);
    // Where a work is as wide as the tool, the tool's own front is the border.
    if cut.entry_rad > 0.0 {
        inside = inside.min(share(border(cut.entry_rad) - y, x));
    }
    if cut.exit_rad < PI {
        inside = inside.min(share(y - border(cut.exit_rad), x));
    }
    inside
}

fn milled(cut: &Cut, pass: &Pass, row: &Row, shape: Shape, depth_m: f64) -> Bite {
    let edges = Edges { cut, pass, shape };
    let lag = depth_m * cut.helix_rad.tan() / cut.radius_m;
    let slices = (lag / SLICE_RAD).ceil().clamp(1.0, SLICES);
    let feed_m = pass.feed_m_s / (pass.spindle_hz * cut.teeth as f64);
    let mut bite = Bite::default();
    for tooth in 0..cut.teeth {
        let place = TAU * tooth as f64 / cut.teeth as f64;
        for slice in 0..slices as usize {
            let place = place - lag * (slice as f64 + 0.5) / slices;
            let [x, y] = edges.at(row.t_s, place, row.way_m);
            let inside = inside(cut, [x, y], lag / slices);
            if inside <= 0.0 {
                continue;
            }
            let far = x.hypot(y);
            let ray = [x / far, y / far];
            let broken = (shape.broken * slices - slice as f64).clamp(0.0, 1.0);
            let beyond = |back: usize| (far - edges.crossed(row, place, back, ray)).max(0.0);
            let whole = if shape.ideal {
                feed_m * ray[0]
            } else if shape.off == [0.0; 2] {
                beyond(1)
            } else {
                // What the tooth before did not reach, the one before it left.
                beyond(1).min(beyond(2))
            };
            let follows = (tooth + 1) % cut.teeth == 0;
            let (depth, chip) = match broken {
                b if b > 0.0 && tooth == 0 => (1.0 - b, whole),
                b if b > 0.0 && follows => (1.0, (1.0 - b) * whole + b * beyond(2)),
                _ => (1.0, whole),
            };
            bite.take(ray, inside * depth * depth_m / slices, chip);
        }
    }
    bite
}
