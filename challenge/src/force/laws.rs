//! Laws of the effects on the forces of the teeth and on the sensor, and laws outside the catalogue.
//!
//! Outside the catalogue: a tooth whose lower edge broke off, so that the next one cuts a double chip there (`BrokenTooth`); edge forces that grow
//! with speed (`PloughingSpeed`); a built-up edge that grows and breaks off (`BuiltUpEdge`); friction of the table guides against the feed
//! (`TableFriction`); a sensor that creeps after its reset at the beginning of a pass (`SensorCreep`).
//!
//! The sensor applies misalignment, cross-talk, scale and bias, in this order. No noise is added here.

use std::cell::RefCell;
use std::f64::consts::TAU;
use std::rc::Rc;

use crate::transform::{IDENTITY, Transform, Vector3, rotate_inverse, rotation};

use super::cut::Cut;
use super::kinds::{Effect, Kind};
use super::passes::{Passes, ToolState};
use super::teeth::{ToolShape, ToothForces, tooth_forces};

/// Number of tool shapes whose forces are cached; the first one is always kept.
const CACHE_SIZE: usize = 6;
/// Frequency at which a built-up edge breaks off, in milling and in turning.
const BUILT_UP_EDGE_HZ: [f64; 2] = [9.0, 2.3];

/// A scene with the forces of its teeth.
pub struct SimulatedPasses<'a> {
    cut: &'a Cut,
    /// The scene.
    pub scene: &'a Passes,
    /// Its rows.
    pub rows: Vec<ToolState>,
    cache: RefCell<Vec<(ToolShape, Rc<Vec<ToothForces>>)>>,
    speed_hz: f64,
}

impl<'a> SimulatedPasses<'a> {
    /// Prepares a cutter on its scene.
    #[must_use]
    pub fn of(cut: &'a Cut, scene: &'a Passes) -> Self {
        let speeds = scene.passes.iter().map(|pass| pass.spindle_hz);
        let speed_hz = speeds.sum::<f64>() / scene.passes.len().max(1) as f64;
        Self { cut, scene, rows: scene.rows(), cache: RefCell::default(), speed_hz }
    }

    fn cached_tooth_forces(&self, shape: ToolShape) -> Rc<Vec<ToothForces>> {
        if let Some((_, known)) = self.cache.borrow().iter().find(|(cached, _)| *cached == shape) {
            return Rc::clone(known);
        }
        let made = Rc::new(tooth_forces(self.cut, self.scene, &self.rows, shape));
        let mut shaped = self.cache.borrow_mut();
        if shaped.len() >= CACHE_SIZE {
            shaped.remove(1);
        }
        shaped.push((shape, Rc::clone(&made)));
        made
    }

    /// Measured forces without noise, row by row, N.
    #[must_use]
    pub fn measured_forces(&self, effects: &[Effect]) -> Vec<Vector3> {
        self.measured_forces_with_shape(effects, ToolShape::default())
    }

    /// The same for a tool with an additional deviation of shape or angle.
    #[must_use]
    pub fn measured_forces_with_shape(
        &self,
        effects: &[Effect],
        mut shape: ToolShape,
    ) -> Vec<Vector3> {
        for effect in effects {
            let x = &effect.parameters;
            match effect.kind {
                Kind::Runout => {
                    shape.runout[0] += x[0] * x[1].cos();
                    shape.runout[1] += x[0] * x[1].sin();
                }
                Kind::BrokenTooth => shape.broken += x[0],
                _ => {}
            }
        }
        let sensor = Sensor::of(effects);
        let all = self.cached_tooth_forces(shape);
        let one = |(row, bite): (&ToolState, &ToothForces)| {
            sensor.read(self.force_on_tool(effects, row, bite))
        };
        let mut read: Vec<Vector3> = self.rows.iter().zip(all.iter()).map(one).collect();
        for creep in effects.iter().filter(|effect| effect.kind == Kind::SensorCreep) {
            for (row, read) in self.rows.iter().zip(&mut read) {
                let lasts_s = self.scene.passes[row.pass].times_s.last().copied().unwrap_or(1.0);
                read[2] += creep.parameters[0] * (1.0 - (-3.0 * row.t_s / lasts_s).exp());
            }
        }
        read
    }

    /// Force on the tool in a row, cut axes, N.
    fn force_on_tool(&self, effects: &[Effect], row: &ToolState, bite: &ToothForces) -> Vector3 {
        let (mut chip, mut edge) = (self.cut.chip, self.cut.edge);
        let mut force = [0.0; 3];
        let (mut wear, mut harder) = (0.0, 0.0);
        let pass = &self.scene.passes[row.pass];
        for effect in effects {
            let x = &effect.parameters;
            match effect.kind {
                Kind::EdgeForce => (0..3).for_each(|k| edge[k] += x[k]),
                Kind::CuttingForce => (0..3).for_each(|k| chip[k] += x[k]),
                Kind::ToolWear => wear += x[0] * row.feed_position_m,
                Kind::PloughingSpeed => wear += x[0] * (pass.spindle_hz / self.speed_hz - 1.0),
                Kind::BuiltUpEdge => {
                    let builds = BUILT_UP_EDGE_HZ[usize::from(self.cut.turning)] * row.t_s;
                    harder += x[0] * (builds - builds.floor() - 0.5);
                }
                Kind::Chatter if bite.is_engaged => force[1] += x[0] * (TAU * x[1] * row.t_s).sin(),
                Kind::TableFriction if row.feed_m_s > 0.0 => force[0] -= x[0],
                _ => {}
            }
        }
        for (axis, force) in force.iter_mut().enumerate() {
            for k in 0..3 {
                *force += bite.edge[k][axis] * edge[k] * (1.0 + wear);
                *force += bite.chip[k][axis] * chip[k] * (1.0 + harder);
            }
        }
        force
    }
}

/// Errors of a force sensor.
struct Sensor {
    turn: Transform,
    cross_talk: [Vector3; 3],
    scale: Vector3,
    bias: Vector3,
}

impl Sensor {
    fn of(effects: &[Effect]) -> Self {
        let mut turned = [0.0; 3];
        let mut sensor =
            Self { turn: IDENTITY, cross_talk: [[0.0; 3]; 3], scale: [1.0; 3], bias: [0.0; 3] };
        for effect in effects {
            let add = |to: &mut Vector3, from: &[f64]| (0..3).for_each(|k| to[k] += from[k]);
            let x = effect.parameters.as_slice();
            match effect.kind {
                Kind::WrenchMisalignment => add(&mut turned, x),
                Kind::WrenchScale => add(&mut sensor.scale, x),
                Kind::WrenchBias => add(&mut sensor.bias, x),
                Kind::CrossTalk => {
                    sensor
                        .cross_talk
                        .iter_mut()
                        .zip(x.chunks(3))
                        .for_each(|(to, row)| add(to, row));
                }
                _ => {}
            }
        }
        sensor.turn = rotation(turned);
        sensor
    }

    fn read(&self, force: Vector3) -> Vector3 {
        // A misaligned sensor measures forces rotated by the inverse.
        let turned = rotate_inverse(&self.turn, force);
        let leaks = |row: &Vector3| row.iter().zip(&turned).map(|(m, f)| m * f).sum::<f64>();
        std::array::from_fn(|k| {
            self.bias[k] + self.scale[k] * (turned[k] + leaks(&self.cross_talk[k]))
        })
    }
}
