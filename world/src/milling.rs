//! A recorded cut: state of the cutter in each row, and forces measured by the sensor.
//!
//! The same rows give the same bits; tooth 0 is at angle 0 at the start of a segment; there is no
//! cut while spindle or feed are at rest. No noise; a row is an instant, without averaging by the
//! sensor.

use glam::DVec3;
use physics::{Cutter, Inputs, Joints, Memories, Model};
use std::f64::consts::TAU;

/// State of the process in a row; NaN where unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Time, s.
    pub t_s: f64,
    /// Rows with the same number belong together.
    pub segment: i64,
    /// Spindle speed, rev/min.
    pub spindle_rpm: f64,
    /// Feed rate, m/s.
    pub feed_m_s: f64,
}

/// State of the cutter in a row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CutterState {
    /// Time since the start of the segment, s.
    pub time_s: f64,
    /// Rotation of the spindle since the start of the segment, rad.
    pub angle_rad: f64,
    /// Feed per tooth, m; 0 outside the cut.
    pub feed_per_tooth_m: f64,
    /// Feed travel of the tool in the cut since the start of the segment, m.
    pub cut_m: f64,
}

impl CutterState {
    /// Whether the tool is in the cut.
    #[must_use]
    pub fn is_cutting(&self) -> bool {
        self.feed_per_tooth_m > 0.0
    }
}

/// State of the cutter in each row.
#[must_use]
pub fn cutter_states(cutter: &Cutter, rows: &[Row]) -> Vec<CutterState> {
    let known = |x: f64| if x.is_finite() { x.max(0.0) } else { 0.0 };
    let mut all: Vec<CutterState> = Vec::with_capacity(rows.len());
    let mut start_s = 0.0;
    for (k, row) in rows.iter().enumerate() {
        let (spindle_hz, feed) = (known(row.spindle_rpm) / 60.0, known(row.feed_m_s));
        let mut state = CutterState::default();
        match k.checked_sub(1).and_then(|k| Some((rows.get(k)?, all.get(k)?))) {
            Some((before, last)) if before.segment == row.segment => {
                let step_s = row.t_s - before.t_s;
                let mean = |a: f64, b: f64| 0.5 * (known(a) + known(b)) * step_s;
                state.time_s = row.t_s - start_s;
                state.angle_rad =
                    last.angle_rad + TAU / 60.0 * mean(before.spindle_rpm, row.spindle_rpm);
                state.cut_m = last.cut_m + mean(before.feed_m_s, row.feed_m_s);
            }
            _ => start_s = row.t_s,
        }
        if spindle_hz > 0.0 {
            state.feed_per_tooth_m = cutter.feed_per_tooth_m(feed, spindle_hz);
        }
        all.push(state);
    }
    all
}

/// Force measured by the sensor in each row, N, cut axes: the cutter's force with all changes by
/// the model's effects.
#[must_use]
pub fn measured_forces(model: &Model, cutter: &Cutter, rows: &[Row]) -> Vec<DVec3> {
    let mut inputs = Inputs::at_rest(Joints::default());
    let memories = Memories::default();
    let one = |state: CutterState| {
        inputs.time_s = state.time_s;
        let force = model.cut_force(&inputs, &memories);
        let acting = if state.is_cutting() {
            let bite = cutter.tooth_forces(state.angle_rad, state.feed_per_tooth_m);
            force.acting(cutter, &bite, state.cut_m)
        } else {
            DVec3::ZERO
        };
        force.measured_force(acting)
    };
    cutter_states(cutter, rows).into_iter().map(one).collect()
}
