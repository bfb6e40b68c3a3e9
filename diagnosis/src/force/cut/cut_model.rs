//! Predicted sensor reading of each row for given parameters of cutter and sensor: the stated cut plus effects.
//!
//! Parameters are in SI units and in one list ([`Slot`]), as differences to the model, so that 0 is the model as given. Forces are computed by
//! `physics::CutForce` only; angles in rad, forces in N.

use glam::{DMat3, DVec3};
use physics::{Contribution, CutForce, Cutter, ForceTerm, ToothForces, Wrench};
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
pub(super) const ROTATION: Slot = Slot::after(SCALE, 3);
/// Cross-talk matrix, row by row.
pub(super) const CROSS_TALK: Slot = Slot::after(ROTATION, 9);
/// Sine and cosine amplitude per axis of an oscillation while the tool cuts, N.
pub(super) const CHATTER: Slot = Slot::after(CROSS_TALK, 6);
/// Sine and cosine amplitude per axis of an oscillation at all times, added to the reading, N.
pub(super) const PERMANENT_TONE: Slot = Slot::after(CHATTER, 6);
/// Total number of parameters.
pub(super) const PARAMETERS: usize = PERMANENT_TONE.from + PERMANENT_TONE.count;

/// State of the tool in one row.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowState {
    /// Time since the start of the segment, s.
    pub(super) time_s: f64,
    /// Spindle angle at the stated speed, rad.
    pub(super) angle_rad: f64,
    pub(super) feed_per_tooth_m: f64,
    pub(super) cut_m: f64,
    /// Index of the segment.
    pub(super) segment: usize,
    pub(super) is_cutting: bool,
    /// Relative position in the segment, 0 to 1.
    pub(super) relative_time: f64,
}

/// Deviation of the spindle from the recorded speed and from angle 0 at the start of each segment.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spindle {
    /// Angle at the start of each segment, rad.
    pub(super) phases: Vec<f64>,
    /// Relative excess of the speed over the recorded one.
    pub(super) excess_speed: f64,
}

impl Spindle {
    pub(super) fn angle(&self, state: &RowState) -> f64 {
        self.phases[state.segment] + state.angle_rad * (1.0 + self.excess_speed)
    }
}

/// Cutting-force model of one recording.
#[derive(Clone)]
pub(super) struct CutModel {
    pub(super) cutter: Cutter,
    pub(super) rows: Vec<RowState>,
    /// Changes by the model's effects: one for all rows, or one per row.
    pub(super) stated_forces: Vec<CutForce>,
    /// Frequency of the candidate oscillation, Hz.
    pub(super) tone_hz: f64,
}

impl CutModel {
    pub(super) fn all_tooth_forces(&self, spindle: &Spindle) -> Vec<ToothForces> {
        self.rows.iter().map(|state| self.tooth_forces(spindle, state, 0.0)).collect()
    }

    /// Engagement of the teeth in a row, with the spindle rotated further by an angle, rad.
    pub(super) fn tooth_forces(&self, spindle: &Spindle, state: &RowState, by: f64) -> ToothForces {
        // At a given feed rate, a faster spindle feeds less per tooth.
        let feed_per_tooth_m = state.feed_per_tooth_m / (1.0 + spindle.excess_speed);
        let angle = spindle.angle(state) + by;
        if state.is_cutting {
            self.cutter.tooth_forces(angle, feed_per_tooth_m)
        } else {
            ToothForces::NONE
        }
    }

    /// The sensor model for given parameters.
    pub(super) fn reading_model(&self, numbers: &[f64]) -> ReadingModel<'_> {
        let oscillation_amplitudes =
            [CHATTER, PERMANENT_TONE].map(|slot| std::array::from_fn(|k| slot.of(numbers)[k]));
        let each = self
            .stated_forces
            .iter()
            .map(|base| SensorResponse::of(with_parameters(*base, numbers)))
            .collect();
        let is_loud = oscillation_amplitudes.iter().flatten().any(|number: &f64| *number != 0.0);
        ReadingModel {
            cut: self,
            each,
            oscillation_amplitudes,
            has_oscillation: is_loud && self.tone_hz > 0.0,
        }
    }

    /// Derivative of each row's reading with respect to each of the `wanted` parameters, by central differences: three axes per parameter.
    pub(super) fn derivatives(
        &self,
        bites: &[ToothForces],
        numbers: &[f64],
        wanted: &[usize],
    ) -> Vec<[Vec<f64>; 3]> {
        let steps = steps();
        let mut varied = numbers.to_vec();
        let column = |k: &usize| {
            let k = *k;
            varied[k] = numbers[k] + steps[k];
            let high = self.reading_model(&varied);
            varied[k] = numbers[k] - steps[k];
            let low = self.reading_model(&varied);
            varied[k] = numbers[k];
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
pub(super) struct ReadingModel<'a> {
    cut: &'a CutModel,
    /// One for all rows, or one per row.
    each: Vec<SensorResponse>,
    /// Amplitudes of the oscillation in the cut, and of that at all times.
    oscillation_amplitudes: [[f64; 6]; 2],
    /// Whether any amplitude differs from zero.
    has_oscillation: bool,
}

/// A cutting force and the sensor's affine response to it.
struct SensorResponse {
    force: CutForce,
    offset: DVec3,
    matrix: DMat3,
}

impl SensorResponse {
    fn of(force: CutForce) -> Self {
        let offset = force.measured_force(DVec3::ZERO);
        let along = |axis: DVec3| force.measured_force(axis) - offset;
        let matrix = DMat3::from_cols(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
        Self { force, offset, matrix }
    }
}

impl ReadingModel<'_> {
    /// Reading without a force, N.
    pub(super) fn reading_in_air(&self) -> [f64; 3] {
        self.each.first().map_or([0.0; 3], |first| first.offset.to_array())
    }

    /// Reading in a row, N.
    pub(super) fn reading(&self, row: usize, bite: &ToothForces) -> DVec3 {
        let state = &self.cut.rows[row];
        let model = if self.each.len() == 1 { &self.each[0] } else { &self.each[row] };
        let mut acting = DVec3::ZERO;
        if state.is_cutting {
            acting = model.force.acting(&self.cut.cutter, bite, state.cut_m);
        }
        let mut hum = DVec3::ZERO;
        if self.has_oscillation {
            let (sin, cos) = libm::sincos(TAU * self.cut.tone_hz * state.time_s);
            if bite.engaged > 0.0 {
                acting += oscillation(&self.oscillation_amplitudes[0], sin, cos);
            }
            hum = oscillation(&self.oscillation_amplitudes[1], sin, cos);
        }
        model.offset + model.matrix * acting + hum
    }
}

fn oscillation(numbers: &[f64], sin: f64, cos: f64) -> DVec3 {
    let axis = |k: usize| numbers[2 * k] * sin + numbers[2 * k + 1] * cos;
    DVec3::new(axis(0), axis(1), axis(2))
}

/// Step sizes for derivatives: readings are linear in all parameters but the rotation.
fn steps() -> [f64; PARAMETERS] {
    let mut steps = [1e-3; PARAMETERS];
    for (slot, step) in [(CHIP, 1e6), (EDGE, 1e2), (WEAR, 1e-2), (RUNOUT, 1e-7), (BIAS, 1.0)] {
        steps[slot.from..slot.from + slot.count].fill(step);
    }
    for slot in [CHATTER, PERMANENT_TONE] {
        steps[slot.from..slot.from + slot.count].fill(1.0);
    }
    steps
}

/// A cutting-force model with parameters added.
fn with_parameters(mut force: CutForce, numbers: &[f64]) -> CutForce {
    let three = |slot: Slot| DVec3::from_slice(slot.of(numbers));
    let leak: [f64; 9] = std::array::from_fn(|k| numbers[CROSS_TALK.from + k]);
    for term in [
        ForceTerm::Chip(three(CHIP)),
        ForceTerm::Edge(three(EDGE)),
        ForceTerm::Wear(numbers[WEAR.from]),
        ForceTerm::Runout([numbers[RUNOUT.from], numbers[RUNOUT.from + 1]]),
        ForceTerm::CrossTalk(DMat3::from_cols_array(&leak).transpose()),
    ] {
        force.add(&Contribution::ToolForce(term));
    }
    let of_force = |slot: Slot| Wrench { force: three(slot), moment: DVec3::ZERO };
    force.add(&Contribution::Sensor {
        bias: of_force(BIAS),
        scale: of_force(SCALE),
        turn: three(ROTATION),
    });
    force
}
