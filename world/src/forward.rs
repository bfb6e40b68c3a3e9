//! A recorded motion run through a model: where the tool really goes, row by row.
//!
//! Order (contract `effects.md`): command → delay → lag → errors by position, and play → compliance → modes. On a path the loads have
//! their inertial part, from speeds and accelerations of the motors.
//!
//! Promises: the same rows give the same bits; a path begins settled. Never: an instrument; what it makes of this is the caller's.

use crate::curve::derivatives;
use crate::dynamics::{Dynamics, at_row, late};
use physics::{Chain, Deviation, Evaluation, Frame, Inputs, JOINTS_MAX, Joints, Memories, Model};

/// The arm at one row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Joint positions on the motors' side, rad or m.
    pub motor: Joints,
    /// Joint positions on the links' side, as late as their sensors are, rad or m.
    pub link: Joints,
    /// Where the tool is.
    pub base_from_tool: Frame,
    /// Whether a joint is loaded beyond what its `stiffness_hardening` holds for.
    pub beyond: bool,
}

/// The arm settled at each row; where `from_before` says so its memory follows from the row before, else see [`Model::arrive`].
#[must_use]
pub fn poses(model: &Model, rows: &[(Inputs, bool)]) -> Vec<Seen> {
    let mut memories = Memories::default();
    rows.iter()
        .map(|(inputs, from_before)| {
            if *from_before {
                model.advance(inputs, &mut memories);
            } else {
                model.arrive(inputs, &mut memories);
            }
            seen(&inputs.q, &model.evaluate(inputs, &memories), None, model)
        })
        .collect()
}

/// One segment of a path: times strictly increase, `q` is what was commanded; speeds, directions after the first row and what came
/// before each row are found here.
#[must_use]
pub fn path(model: &Model, dynamics: &Dynamics, rows: &[Inputs]) -> Vec<Seen> {
    let Some(first) = rows.first() else { return Vec::new() };
    let times_s: Vec<f64> = rows.iter().map(|row| row.time_s).collect();
    let joints = 0..model.arm.count();
    let commanded = joints.map(|i| rows.iter().map(|row| row.q[i]).collect()).collect();
    let motors = dynamics.motors(&times_s, commanded);
    let moved = followed(rows, &times_s, &motors);
    let bends = Bends::of(model, dynamics, &times_s, &motors, &moved, &first.direction);
    let mut memories = Memories::default();
    let mut all: Vec<Seen> = Vec::with_capacity(rows.len());
    for (k, inputs) in moved.iter().enumerate() {
        if k == 0 {
            model.settle(inputs, &mut memories);
        } else {
            model.advance(inputs, &mut memories);
        }
        let evaluation = model.evaluate(inputs, &memories);
        all.push(seen(&inputs.q, &evaluation, Some((&bends, k)), model));
    }
    if dynamics.link_delay_s != 0.0 {
        for joint in 0..model.arm.count() {
            let links = all.iter().map(|seen| seen.link[joint]).collect();
            let links = late(&times_s, links, dynamics.link_delay_s);
            all.iter_mut().zip(links).for_each(|(seen, link)| seen.link[joint] = link);
        }
    }
    all
}

/// The inputs with the motors' motion in place of the command's.
fn followed(rows: &[Inputs], times_s: &[f64], motors: &[Vec<f64>]) -> Vec<Inputs> {
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

/// What rings and snaps, row by row, in the order of [`Dynamics`].
struct Bends<'a> {
    dynamics: &'a Dynamics,
    modes: Vec<Vec<f64>>,
    spikes: Vec<Vec<f64>>,
}

impl<'a> Bends<'a> {
    fn of(
        model: &Model,
        dynamics: &'a Dynamics,
        times_s: &[f64],
        motors: &[Vec<f64>],
        rows: &[Inputs],
        direction: &[f64; JOINTS_MAX],
    ) -> Self {
        let mut loads: Vec<Vec<f64>> = vec![Vec::new(); dynamics.modes.len()];
        if dynamics.modes.iter().any(|mode| mode.compliance > 0.0) {
            for inputs in rows {
                let at_row = model.evaluate(inputs, &Memories::default()).loads;
                for (list, mode) in loads.iter_mut().zip(&dynamics.modes) {
                    list.push(mode.rings.load(&at_row));
                }
            }
        }
        let rung = |(mode, loads): (&crate::dynamics::Mode, &Vec<f64>)| {
            mode.deflection(times_s, mode.rings.motor(motors), loads)
        };
        let snapped = |spike: &crate::dynamics::Spike| {
            spike.deflection(times_s, &motors[spike.joint], direction[spike.joint])
        };
        Self {
            dynamics,
            modes: dynamics.modes.iter().zip(&loads).map(rung).collect(),
            spikes: dynamics.spikes.iter().map(snapped).collect(),
        }
    }

    fn add(&self, row: usize, deviation: &mut Deviation) {
        for (mode, bent) in self.dynamics.modes.iter().zip(&self.modes) {
            mode.rings.bend(deviation, bent[row]);
        }
        for (spike, bent) in self.dynamics.spikes.iter().zip(&self.spikes) {
            deviation.joints[spike.joint] += bent[row];
        }
    }
}

fn seen(
    q: &Joints,
    evaluation: &Evaluation,
    bends: Option<(&Bends<'_>, usize)>,
    model: &Model,
) -> Seen {
    let mut deviation = evaluation.deviation;
    let mut base_from_tool = evaluation.real.base_from_tool;
    if let Some((bends, row)) = bends
        && !(bends.modes.is_empty() && bends.spikes.is_empty())
    {
        bends.add(row, &mut deviation);
        base_from_tool = Chain::real(&model.arm, q, &deviation).base_from_tool;
    }
    let mut link = *q;
    for (link, delta) in link.iter_mut().zip(&deviation.joints) {
        *link += delta;
    }
    Seen { motor: *q, link, base_from_tool, beyond: evaluation.beyond.is_some() }
}

#[cfg(test)]
mod tests;
