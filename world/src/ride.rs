//! One path segment as executed by the motors: delay, lag, modes, reversal spikes.
//!
//! The same rows give the same bits; parameters of zero leave the path as commanded. Static
//! deflections are computed in [`crate::forward`].

use crate::curve::derivatives;
use crate::dynamics::{Dynamics, Mode, Rings, Spike, at_row};
use physics::effects::OverPath;
use physics::{Deviation, Evaluation, Inputs, Loads, Memories, Model};
use std::cell::OnceCell;

/// A path executed with [`Dynamics`].
#[derive(Clone, Debug)]
pub struct Ride {
    times_s: Vec<f64>,
    /// Samples of each joint, rad or m.
    motors: Vec<Vec<f64>>,
    /// The inputs, with the motors' motion instead of the command.
    pub inputs: Vec<Inputs>,
    /// Deflections of modes and spikes: rad or m per row.
    bends: Vec<(Rings, Vec<f64>)>,
    /// Loads at each row, computed on first use.
    loads: OnceCell<Vec<Loads>>,
}

impl Ride {
    /// `rows`: times strictly increase, `q` is the command, the first row's direction is that of
    /// the motion before it.
    #[must_use]
    pub fn of(model: &Model, dynamics: &Dynamics, rows: &[Inputs]) -> Self {
        let times_s: Vec<f64> = rows.iter().map(|row| row.time_s).collect();
        let joints = 0..model.arm.count();
        let commanded = joints.map(|i| rows.iter().map(|row| row.q[i]).collect()).collect();
        let motors = dynamics.motors(&times_s, commanded);
        let inputs = followed(rows, &times_s, &motors);
        let mut ride = Self { times_s, motors, inputs, bends: Vec::new(), loads: OnceCell::new() };
        let modes = dynamics.modes.iter().filter(|mode| mode.is_at_work());
        let rung = modes.map(|mode| (mode.rings, ride.of_mode(model, mode)));
        let snapped = dynamics.spikes.iter().filter(|spike| spike.amplitude != 0.0);
        let snapped = snapped.map(|spike| (Rings::Joint(spike.joint), ride.of_spike(spike)));
        ride.bends = rung.chain(snapped).collect();
        ride
    }

    /// Adds the deflections of modes and spikes at a row.
    pub fn bend(&self, row: usize, deviation: &mut Deviation) {
        for (rings, by) in &self.bends {
            rings.bend(deviation, by[row]);
        }
    }

    /// Whether there are any modes or spikes.
    #[must_use]
    pub fn bends(&self) -> bool {
        !self.bends.is_empty()
    }

    /// Position of a joint or the base at a row without static effects, rad or m: the motor plus
    /// all modes and spikes there.
    #[must_use]
    pub fn place(&self, of: Rings, row: usize) -> f64 {
        let motor = match of {
            Rings::Joint(joint) => self.motors[joint][row],
            Rings::Base(_) => 0.0,
        };
        let here = self.bends.iter().filter(|(rings, _)| *rings == of);
        motor + here.map(|(_, by)| by[row]).sum::<f64>()
    }

    /// Contribution of one mode or spike on this path; `None` for delays. `model`: the model of the
    /// path.
    #[must_use]
    pub fn of_effect(&self, model: &Model, effect: &OverPath) -> Option<(Rings, Vec<f64>)> {
        let mut alone = Dynamics::default();
        alone.add(effect);
        let mode = alone.modes.first().map(|mode| (mode.rings, self.of_mode(model, mode)));
        let snap = |spike: &Spike| (Rings::Joint(spike.joint), self.of_spike(spike));
        mode.or_else(|| alone.spikes.first().map(snap))
    }

    fn of_mode(&self, model: &Model, mode: &Mode) -> Vec<f64> {
        let loads: Vec<f64> = if mode.compliance > 0.0 {
            let all = self.loads.get_or_init(|| {
                let mut seen = Box::<Evaluation>::default();
                let pulled = |inputs: &Inputs| {
                    model.load_into(inputs, &Memories::default(), &mut seen);
                    seen.loads
                };
                self.inputs.iter().map(pulled).collect()
            });
            all.iter().map(|loads| mode.rings.load(loads)).collect()
        } else {
            Vec::new()
        };
        mode.deflection(&self.times_s, mode.rings.motor(&self.motors), &loads)
    }

    fn of_spike(&self, spike: &Spike) -> Vec<f64> {
        let before = self.inputs.first().map_or(0.0, |first| first.direction[spike.joint]);
        spike.deflection(&self.times_s, &self.motors[spike.joint], before)
    }
}

/// The inputs with the motors' motion instead of the command.
pub(crate) fn followed(rows: &[Inputs], times_s: &[f64], motors: &[Vec<f64>]) -> Vec<Inputs> {
    let rates: Vec<_> = motors.iter().map(|samples| derivatives(times_s, samples)).collect();
    let mut all: Vec<Inputs> = Vec::with_capacity(rows.len());
    for (k, row) in rows.iter().enumerate() {
        let mut inputs = *row;
        inputs.q = at_row(motors, k);
        for (i, rates) in rates.iter().enumerate() {
            (inputs.velocity[i], inputs.acceleration[i]) = rates[k];
        }
        let before = all.last();
        inputs.q_before = before.map_or(inputs.q, |before| before.q);
        inputs.dt_s = before.map_or(0.0, |before| inputs.time_s - before.time_s);
        if let Some(before) = before {
            inputs.direction = before.direction;
            for i in 0..motors.len() {
                let moved = inputs.q[i] - before.q[i];
                if moved != 0.0 {
                    inputs.direction[i] = moved.signum();
                }
            }
        }
        all.push(inputs);
    }
    all
}
