//! One path segment as executed by the motors: delay, lag, modes, reversal spikes.
//!
//! The same rows give the same bits; parameters of zero leave the path as commanded. Static
//! deflections are computed in [`crate::forward`].

use crate::curve::derivatives;
use crate::dynamics::{Dynamics, Mode, Spike, VibratingPart, at_row};
use physics::effects::OverPath;
use physics::{Deviation, Evaluation, Inputs, Loads, Memories, Model};
use std::cell::OnceCell;

/// A path executed with [`Dynamics`].
#[derive(Clone, Debug)]
pub struct ExecutedPath {
    times_s: Vec<f64>,
    /// Samples of each joint, rad or m.
    motors: Vec<Vec<f64>>,
    /// The inputs, with the motors' motion instead of the command.
    pub inputs: Vec<Inputs>,
    /// Deflections of modes and spikes: rad or m per row.
    deflections: Vec<(VibratingPart, Vec<f64>)>,
    /// Loads at each row, computed on first use.
    loads: OnceCell<Vec<Loads>>,
}

impl ExecutedPath {
    /// `rows`: times strictly increase, `q` is the command, the first row's direction is that of
    /// the motion before it.
    #[must_use]
    pub fn of(model: &Model, dynamics: &Dynamics, rows: &[Inputs]) -> Self {
        let times_s: Vec<f64> = rows.iter().map(|row| row.time_s).collect();
        let joints = 0..model.arm.count();
        let commanded = joints.map(|i| rows.iter().map(|row| row.q[i]).collect()).collect();
        let motors = dynamics.motor_positions(&times_s, commanded);
        let inputs = executed_inputs(rows, &times_s, &motors);
        let mut executed =
            Self { times_s, motors, inputs, deflections: Vec::new(), loads: OnceCell::new() };
        let modes = dynamics.modes.iter().filter(|mode| mode.has_effect());
        let vibrated = modes.map(|mode| (mode.part, executed.mode_deflection(model, mode)));
        let spikes = dynamics.spikes.iter().filter(|spike| spike.amplitude != 0.0);
        let spike_deflections = spikes
            .map(|spike| (VibratingPart::Joint(spike.joint), executed.spike_deflection(spike)));
        executed.deflections = vibrated.chain(spike_deflections).collect();
        executed
    }

    /// Adds the deflections of modes and spikes at a row.
    pub fn add_deflections(&self, row: usize, deviation: &mut Deviation) {
        for (rings, by) in &self.deflections {
            rings.add_deflection(deviation, by[row]);
        }
    }

    /// Whether there are any modes or spikes.
    #[must_use]
    pub fn has_deflections(&self) -> bool {
        !self.deflections.is_empty()
    }

    /// Position of a joint or the base at a row without static effects, rad or m: the motor plus
    /// all modes and spikes there.
    #[must_use]
    pub fn position(&self, part: VibratingPart, row: usize) -> f64 {
        let motor = match part {
            VibratingPart::Joint(joint) => self.motors[joint][row],
            VibratingPart::Base(_) => 0.0,
        };
        let of_part = self.deflections.iter().filter(|(rings, _)| *rings == part);
        motor + of_part.map(|(_, by)| by[row]).sum::<f64>()
    }

    /// Contribution of one mode or spike on this path; `None` for delays. `model`: the model of the
    /// path.
    #[must_use]
    pub fn effect_deflection(
        &self,
        model: &Model,
        effect: &OverPath,
    ) -> Option<(VibratingPart, Vec<f64>)> {
        let mut alone = Dynamics::default();
        alone.add(effect);
        let mode = alone.modes.first().map(|mode| (mode.part, self.mode_deflection(model, mode)));
        let snap =
            |spike: &Spike| (VibratingPart::Joint(spike.joint), self.spike_deflection(spike));
        mode.or_else(|| alone.spikes.first().map(snap))
    }

    fn mode_deflection(&self, model: &Model, mode: &Mode) -> Vec<f64> {
        let loads: Vec<f64> = if mode.compliance > 0.0 {
            let all = self.loads.get_or_init(|| {
                let mut evaluation = Box::<Evaluation>::default();
                let pulled = |inputs: &Inputs| {
                    model.load_into(inputs, &Memories::default(), &mut evaluation);
                    evaluation.loads
                };
                self.inputs.iter().map(pulled).collect()
            });
            all.iter().map(|loads| mode.part.load(loads)).collect()
        } else {
            Vec::new()
        };
        mode.deflection(&self.times_s, mode.part.motor(&self.motors), &loads)
    }

    fn spike_deflection(&self, spike: &Spike) -> Vec<f64> {
        let before = self.inputs.first().map_or(0.0, |first| first.direction[spike.joint]);
        spike.deflection(&self.times_s, &self.motors[spike.joint], before)
    }
}

/// The inputs with the motors' motion instead of the command.
pub(crate) fn executed_inputs(
    rows: &[Inputs],
    times_s: &[f64],
    motors: &[Vec<f64>],
) -> Vec<Inputs> {
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
