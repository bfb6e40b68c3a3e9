//! Teeth stepped in time: position of each edge, its distance beyond the path of the preceding tooth, direction of its forces.
//!
//! Cut axes: x along the feed, z up out of the workpiece, y = z × x. An edge at angle φ from y towards x is at `C(t) + ρ + R (sin φ, cos φ)`, where
//! the tool's centre C moves during rotation. Chip thickness is measured along the ray from the centre: from the edge to the point at which a
//! preceding edge crossed that ray, found by stepping back in time. Helical edges are divided into slices. Chip thickness is never negative.

use std::f64::consts::{PI, TAU};

use crate::transform::Vector3;

use super::cut::Cut;
use super::passes::{Pass, Passes, ToolState};

/// Largest lag angle of a slice of a helical tooth relative to the one below, rad.
const SLICE_RAD: f64 = 5e-3;
/// Largest number of slices.
const SLICES: f64 = 48.0;
/// Iterations back in time until a ray is crossed.
const STEPS: usize = 3;

/// Deviations of the tool from its nominal shape.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolShape {
    /// Offset of the tool axis from the spindle axis, towards tooth 0 and perpendicular to it towards the next tooth, m.
    pub runout: [f64; 2],
    /// Fraction of the depth, from below, over which tooth 0 is broken off.
    pub broken: f64,
    /// Additional spindle angle, rad.
    pub turned: f64,
    /// Whether chip thickness is that of circular paths: feed times sine.
    pub circular_paths: bool,
}

/// Force per unit of each coefficient, cut axes: tangential, radial, axial.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToothForces {
    /// N per N/m of edge coefficient.
    pub edge: [Vector3; 3],
    /// N per N/m² of cutting coefficient.
    pub chip: [Vector3; 3],
    /// Whether any edge is engaged.
    pub is_engaged: bool,
}

impl ToothForces {
    /// Adds an edge at an angle, with its depth and chip thickness.
    fn add_edge(&mut self, [sin, cos]: [f64; 2], depth_m: f64, chip_m: f64) {
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

/// Forces of the teeth in each row, per unit of the coefficients.
#[must_use]
pub fn tooth_forces(
    cut: &Cut,
    scene: &Passes,
    rows: &[ToolState],
    shape: ToolShape,
) -> Vec<ToothForces> {
    let one = |row: &ToolState| {
        let pass = &scene.passes[row.pass];
        let depth_m = cut.depth_m * pass.depth_fraction(row.feed_position_m);
        if depth_m <= 0.0 {
            return ToothForces::default();
        }
        if cut.turning {
            turning_forces(pass, row, depth_m)
        } else {
            milling_forces(cut, pass, row, shape, depth_m)
        }
    };
    rows.iter().map(one).collect()
}

/// Turning: the chip thickness is the feed during one revolution, limited by the workpiece.
fn turning_forces(pass: &Pass, row: &ToolState, depth_m: f64) -> ToothForces {
    let before = pass.feed_position_m(row.t_s - 1.0 / pass.spindle_hz).max(pass.work_m[0]);
    let mut bite = ToothForces::default();
    bite.add_edge([1.0, 0.0], depth_m, (row.feed_position_m - before).max(0.0));
    bite
}

/// Edge positions at any instant.
struct CuttingEdges<'a> {
    cut: &'a Cut,
    pass: &'a Pass,
    shape: ToolShape,
}

impl CuttingEdges<'_> {
    /// Position of an edge `place` rad ahead of tooth 0, relative to the centre at `way_m`.
    fn at(&self, t_s: f64, place: f64, way_m: f64) -> [f64; 2] {
        let turned = TAU * self.pass.spindle_hz * t_s + self.shape.turned;
        let (sin, cos) = (turned + place).sin_cos();
        let moved = self.pass.feed_position_m(t_s) - way_m;
        let mut position = [moved + self.cut.radius_m * sin, self.cut.radius_m * cos];
        if self.shape.runout != [0.0; 2] {
            let [along, across] = self.shape.runout;
            let (sin, cos) = turned.sin_cos();
            position[0] += along * sin + across * cos;
            position[1] += along * cos - across * sin;
        }
        position
    }

    /// Distance from the centre at which the edge `back` teeth ahead crossed this ray.
    fn crossing_distance(
        &self,
        row: &ToolState,
        place: f64,
        back: usize,
        [sin, cos]: [f64; 2],
    ) -> f64 {
        let pitch = TAU / self.cut.teeth as f64 * back as f64;
        let rate = TAU * self.pass.spindle_hz;
        let mut t_s = row.t_s - pitch / rate;
        let mut tooth = [0.0; 2];
        for _ in 0..STEPS {
            tooth = self.at(t_s, place + pitch, row.feed_position_m);
            t_s -= (tooth[0] * cos - tooth[1] * sin) / (rate * self.cut.radius_m);
        }
        tooth[0] * sin + tooth[1] * cos
    }
}

/// Fraction of a slice of angular width `wide`, centred here, that is inside the workpiece.
fn engaged_fraction(cut: &Cut, [x, y]: [f64; 2], wide: f64) -> f64 {
    // A border at distance `beyond` m that moves at `rate` m/rad.
    let share = |beyond: f64, rate: f64| {
        let width = rate.abs() * wide;
        if width > 0.0 { (0.5 + beyond / width).clamp(0.0, 1.0) } else { f64::from(beyond >= 0.0) }
    };
    let border = |angle: f64| angle.cos() * cut.radius_m;
    let mut inside = share(x, y);
    // If the workpiece is as wide as the tool, the tool's own front is the border.
    if cut.entry_rad > 0.0 {
        inside = inside.min(share(border(cut.entry_rad) - y, x));
    }
    if cut.exit_rad < PI {
        inside = inside.min(share(y - border(cut.exit_rad), x));
    }
    inside
}

fn milling_forces(
    cut: &Cut,
    pass: &Pass,
    row: &ToolState,
    shape: ToolShape,
    depth_m: f64,
) -> ToothForces {
    let edges = CuttingEdges { cut, pass, shape };
    let lag = depth_m * cut.helix_rad.tan() / cut.radius_m;
    let slices = (lag / SLICE_RAD).ceil().clamp(1.0, SLICES);
    let feed_m = pass.feed_m_s / (pass.spindle_hz * cut.teeth as f64);
    let mut bite = ToothForces::default();
    for tooth in 0..cut.teeth {
        let place = TAU * tooth as f64 / cut.teeth as f64;
        for slice in 0..slices as usize {
            let place = place - lag * (slice as f64 + 0.5) / slices;
            let [x, y] = edges.at(row.t_s, place, row.feed_position_m);
            let inside = engaged_fraction(cut, [x, y], lag / slices);
            if inside <= 0.0 {
                continue;
            }
            let radius = x.hypot(y);
            let ray = [x / radius, y / radius];
            let broken = (shape.broken * slices - slice as f64).clamp(0.0, 1.0);
            let beyond =
                |back: usize| (radius - edges.crossing_distance(row, place, back, ray)).max(0.0);
            let whole = if shape.circular_paths {
                feed_m * ray[0]
            } else if shape.runout == [0.0; 2] {
                beyond(1)
            } else {
                // Material left by the preceding tooth was bounded by the one before it.
                beyond(1).min(beyond(2))
            };
            let follows = (tooth + 1) % cut.teeth == 0;
            let (depth, chip) = match broken {
                b if b > 0.0 && tooth == 0 => (1.0 - b, whole),
                b if b > 0.0 && follows => (1.0, (1.0 - b) * whole + b * beyond(2)),
                _ => (1.0, whole),
            };
            bite.add_edge(ray, inside * depth * depth_m / slices, chip);
        }
    }
    bite
}
