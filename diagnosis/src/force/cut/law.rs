//! Predicted sensor reading of each row for given parameters of cutter and sensor: the stated cut plus effects.
//!
//! Parameters are in SI units and in one list ([`Slot`]), as differences to the model, so that 0 is the model as given. Forces are computed by
//! `physics::CutForce` only; angles in rad, forces in N.

use glam::{DMat3, DVec3};
use physics::{Bite, Contribution, CutForce, Cutter, ForceTerm, Wrench};
use std::f64::consts::TAU;

/// Range of an effect's parameters in the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Slot {
    pub(super) from: usize,
    pub(super) count: usize,
}

impl Slot {
    const fn after(before: Self, count: usize) -> Self {
        Self { from: before.from + before.count, count }
    }

    pub(super) fn of<'a>(&self, numbers: &'a [f64]) -> &'a [f64] {
        &numbers[self.from..self.from + self.count]
    }
}

/// Shear coefficients: tangential, radial, axial, N/m².
pub(super) const CHIP: Slot = Slot { from: 0, count: 3 };
/// Edge-force coefficients: tangential, radial, axial, N/m.
pub(super) const EDGE: Slot = Slot::after(CHIP, 3);
/// Relative growth of the edge forces by wear per metre of feed travel, 1/m.
pub(super) const WEAR: Slot = Slot::after(EDGE, 1);
/// Runout towards tooth 0 and perpendicular to it, m.
pub(super) const RUNOUT: Slot = Slot::after(WEAR, 2);
/// Sensor bias, N.
pub(super) const BIAS: Slot = Slot::after(RUNOUT, 3);
/// Relative scale errors of the sensor axes.
pub(super) const SCALE: Slot = Slot::after(BIAS, 3);
/// Rotation of the sensor axes, rad.
pub(super) const TURN: Slot = Slot::after(SCALE, 3);
/// Cross-talk matrix, row by row.
pub(super) const LEAK: Slot = Slot::after(TURN, 9);
/// Sine and cosine amplitude per axis of an oscillation while the tool cuts, N.
pub(super) const RING: Slot = Slot::after(LEAK, 6);
/// Sine and cosine amplitude per axis of an oscillation at all times, added to the reading, N.
pub(super) const HUM: Slot = Slot::after(RING, 6);
/// Total number of parameters.
pub(super) const NUMBERS: usize = HUM.from + HUM.count;

/// State of the tool in one row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stood {
    /// Time since the start of the segment, s.
    pub(super) time_s: f64,
    /// Spindle angle at the stated speed, rad.
    pub(super) angle_rad: f64,
    pub(super) feed_per_tooth_m: f64,
    pub(super) cut_m: f64,
    /// Index of the segment.
    pub(super) segment: usize,
    pub(super) cuts: bool,
    /// Relative position in the segment, 0 to 1.
    pub(super) along: f64,
}

/// Deviation of the spindle from the recorded speed and from angle 0 at the start of each segment.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spindle {
    /// Angle at the start of each segment, rad.
    pub(super) phases: Vec<f64>,
    /// Relative excess of the speed over the recorded one.
    pub(super) faster: f64,
}

impl Spindle {
    pub(super) fn angle(&self, stood: &Stood) -> f64 {
        self.phases[stood.segment] + stood.angle_rad * (1.0 + self.faster)
    }
}

/// Cutting-force model of one recording.
#[derive(Clone)]
pub(super) struct Law {
    pub(super) cutter: Cutter,
    pub(super) rows: Vec<Stood>,
    /// Changes by the model's effects: one for all rows, or one per row.
    pub(super) base: Vec<CutForce>,
    /// Frequency of the candidate oscillation, Hz.
    pub(super) tone_hz: f64,
}

impl Law {
    pub(super) fn bites(&self, spindle: &Spindle) -> Vec<Bite> {
        self.rows.iter().map(|stood| self.bite(spindle, stood, 0.0)).collect()
    }

    /// Engagement of the teeth in a row, with the spindle rotated further by an angle, rad.
    pub(super) fn bite(&self, spindle: &Spindle, stood: &Stood, by: f64) -> Bite {
        // At a given feed rate, a faster spindle feeds less per tooth.
        let feed_per_tooth_m = stood.feed_per_tooth_m / (1.0 + spindle.faster);
        let angle = spindle.angle(stood) + by;
        if stood.cuts { self.cutter.bite(angle, feed_per_tooth_m) } else { Bite::NONE }
    }

    /// The sensor model for given parameters.
    pub(super) fn reader(&self, numbers: &[f64]) -> Reader<'_> {
        let swings = [RING, HUM].map(|slot| std::array::from_fn(|k| slot.of(numbers)[k]));
        let each = self.base.iter().map(|base| Felt::of(with(*base, numbers))).collect();
        let is_loud = swings.iter().flatten().any(|number: &f64| *number != 0.0);
        Reader { law: self, each, swings, swings_at_all: is_loud && self.tone_hz > 0.0 }
    }

    /// Derivative of each row's reading with respect to each of the `wanted` parameters, by central differences: three axes per parameter.
    pub(super) fn slopes(
        &self,
        bites: &[Bite],
        numbers: &[f64],
        wanted: &[usize],
    ) -> Vec<[Vec<f64>; 3]> {
        let steps = steps();
        let mut at = numbers.to_vec();
        let column = |k: &usize| {
            let k = *k;
            at[k] = numbers[k] + steps[k];
            let high = self.reader(&at);
            at[k] = numbers[k] - steps[k];
            let low = self.reader(&at);
            at[k] = numbers[k];
            let mut all: [Vec<f64>; 3] = Default::default();
            for (row, bite) in bites.iter().enumerate() {
                let slope = (high.reading(row, bite) - low.reading(row, bite)) / (2.0 * steps[k]);
                all.iter_mut().zip(slope.to_array()).for_each(|(list, x)| list.push(x));
            }
            all
        };
        wanted.iter().map(column).collect()
    }
}

/// Predicts the reading of rows for given parameters.
pub(super) struct Reader<'a> {
    law: &'a Law,
    /// One for all rows, or one per row.
    each: Vec<Felt>,
    /// Amplitudes of the oscillation in the cut, and of that at all times.
    swings: [[f64; 6]; 2],
    /// Whether any amplitude differs from zero.
    swings_at_all: bool,
}

/// A cutting force and the sensor's affine response to it.
struct Felt {
    force: CutForce,
    off: DVec3,
    matrix: DMat3,
}

impl Felt {
    fn of(force: CutForce) -> Self {
        let off = force.read(DVec3::ZERO);
        let along = |axis: DVec3| force.read(axis) - off;
        let matrix = DMat3::from_cols(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
        Self { force, off, matrix }
    }
}

impl Reader<'_> {
    /// Reading without a force, N.
    pub(super) fn in_air(&self) -> [f64; 3] {
        self.each.first().map_or([0.0; 3], |felt| felt.off.to_array())
    }

    /// Reading in a row, N.
    pub(super) fn reading(&self, row: usize, bite: &Bite) -> DVec3 {
        let stood = &self.law.rows[row];
        let felt = if self.each.len() == 1 { &self.each[0] } else { &self.each[row] };
        let mut acting = DVec3::ZERO;
        if stood.cuts {
            acting = felt.force.acting(&self.law.cutter, bite, stood.cut_m);
        }
        let mut hum = DVec3::ZERO;
        if self.swings_at_all {
            let (sin, cos) = libm::sincos(TAU * self.law.tone_hz * stood.time_s);
            if bite.engaged > 0.0 {
                acting += swing(&self.swings[0], sin, cos);
            }
            hum = swing(&self.swings[1], sin, cos);
        }
        felt.off + felt.matrix * acting + hum
    }
}

fn swing(numbers: &[f64], sin: f64, cos: f64) -> DVec3 {
    let axis = |k: usize| numbers[2 * k] * sin + numbers[2 * k + 1] * cos;
    DVec3::new(axis(0), axis(1), axis(2))
}

/// Step sizes for derivatives: readings are linear in all parameters but the rotation.
fn steps() -> [f64; NUMBERS] {
    let mut steps = [1e-3; NUMBERS];
    for (slot, step) in [(CHIP, 1e6), (EDGE, 1e2), (WEAR, 1e-2), (RUNOUT, 1e-7), (BIAS, 1.0)] {
        steps[slot.from..slot.from + slot.count].fill(step);
    }
    for slot in [RING, HUM] {
        steps[slot.from..slot.from + slot.count].fill(1.0);
    }
    steps
}

/// A cutting-force model with parameters added.
fn with(mut force: CutForce, numbers: &[f64]) -> CutForce {
    let three = |slot: Slot| DVec3::from_slice(slot.of(numbers));
    let leak: [f64; 9] = std::array::from_fn(|k| numbers[LEAK.from + k]);
    for term in [
        ForceTerm::Chip(three(CHIP)),
        ForceTerm::Edge(three(EDGE)),
        ForceTerm::Wear(numbers[WEAR.from]),
        ForceTerm::Runout([numbers[RUNOUT.from], numbers[RUNOUT.from + 1]]),
        ForceTerm::Leak(DMat3::from_cols_array(&leak).transpose()),
    ] {
        force.add(&Contribution::ToolForce(term));
    }
    let of_force = |slot: Slot| Wrench { force: three(slot), moment: DVec3::ZERO };
    force.add(&Contribution::Sensor {
        bias: of_force(BIAS),
        scale: of_force(SCALE),
        turn: three(TURN),
    });
    force
}
