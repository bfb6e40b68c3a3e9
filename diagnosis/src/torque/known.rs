//! What the model already knows of the drives: its torque, and how far its numbers may be off by their stated uncertainty.
//!
//! The physics' own effects say it, at the rate of the runs; what they add to the rigid body then passes the filter of the torque.
//!
//! Promises: a number within its stated uncertainty is no finding, since it is fitted along, held by what is believed of it. Never: a law of its own.

use physics::dynamics::inverse_dynamics;
use physics::{AnyEffect, Inputs, JOINTS_MAX, Memories, Model};

use super::columns::{Column, Law, STANDING, usual_speed};
use super::motion::{Motion, Run};

/// What a model states of an arm and its drives.
#[derive(Clone, Copy, Debug)]
pub struct Stated<'a> {
    /// With the effects that drives feel.
    pub model: &'a Model,
    /// For each effect: the standard uncertainty of each of its values, SI; 0 where none is stated.
    pub sigma: &'a [Vec<f64>],
    /// By how much torques are recorded late, s.
    pub delay_s: f64,
}

/// What effects add to the rigid body, row by row.
pub(super) struct Known {
    /// Per joint, N m or N.
    pub(super) torque: Vec<Vec<f64>>,
    /// A column for each number of stated uncertainty, with that uncertainty.
    pub(super) open: Vec<(Column, f64)>,
}

impl Stated<'_> {
    /// Whether the model has an effect of this name there, one whose found numbers are differences to its own.
    pub(super) fn has(&self, kind: &str, joint: Option<usize>) -> bool {
        let same = |effect: &AnyEffect| effect.spec().kind == kind && effect.joint() == joint;
        match kind {
            "torque_delay" => self.delay_s != 0.0,
            "coulomb_friction" | "viscous_friction" | "load_friction" | "inertia"
            | "drive_gain" => self.model.effects().any(same),
            _ => false,
        }
    }

    /// The viscous friction of a joint, N m s/rad or N s/m.
    pub(super) fn viscous(&self, joint: usize) -> f64 {
        let effects = self.model.effects().filter(|effect| effect.joint() == Some(joint));
        let viscous = effects.filter(|effect| matches!(effect, AnyEffect::ViscousFriction(_)));
        viscous.map(|effect| effect.values()[0]).sum()
    }

    /// Where the spring of a joint rests, rad or m; 0 where it has none.
    pub(super) fn rest(&self, joint: usize) -> f64 {
        let effects = self.model.effects().filter(|effect| effect.joint() == Some(joint));
        let springs = effects.filter(|effect| matches!(effect, AnyEffect::Spring(_)));
        springs.map(|effect| effect.values()[1]).sum()
    }

    /// Runs the model's effects over the motion.
    pub(super) fn known(&self, motion: &Motion) -> Known {
        let count = self.model.arm.count();
        let wanted: Vec<(usize, usize, f64)> = self
            .sigma
            .iter()
            .enumerate()
            .flat_map(|(effect, sigma)| {
                let open = sigma.iter().enumerate().filter(|(_, sigma)| **sigma > 0.0);
                open.map(move |(value, sigma)| (effect, value, *sigma))
            })
            .collect();
        let mut known = Known { torque: vec![Vec::new(); count], open: Vec::new() };
        let mut columns = vec![vec![Vec::new(); count]; wanted.len()];
        let standing: Vec<f64> = (0..count).map(|j| STANDING * usual_speed(motion, j)).collect();
        for run in &motion.runs {
            let (torque, slopes) = self.over(run, &standing, &wanted);
            for joint in 0..count {
                known.torque[joint].extend(run.at_rows(&torque[joint]));
                for (column, slopes) in columns.iter_mut().zip(&slopes) {
                    column[joint].extend(run.at_rows(&slopes[joint]));
                }
            }
        }
        for (column, (_, _, sigma)) in columns.into_iter().zip(&wanted) {
            let felt = |values: &Vec<f64>| values.iter().any(|x| *x != 0.0);
            let parts: Vec<(usize, Vec<f64>)> =
                column.into_iter().enumerate().filter(|(_, values)| felt(values)).collect();
            if !parts.is_empty() {
                known.open.push((Column { parts }, *sigma));
            }
        }
        known
    }

    /// Per joint and sample of one run: what effects add, and by how much it changes with each number that is wanted.
    fn over(
        &self,
        run: &Run,
        standing: &[f64],
        wanted: &[(usize, usize, f64)],
    ) -> (Vec<Vec<f64>>, Vec<Vec<Vec<f64>>>) {
        let count = self.model.arm.count();
        let samples = run.joints.first().map_or(0, |track| track.q.len());
        let mut torque = vec![Vec::with_capacity(samples); count];
        let mut slopes = vec![vec![vec![0.0; samples]; count]; wanted.len()];
        if self.model.effects().len() == 0 {
            return (vec![vec![0.0; samples]; count], slopes);
        }
        let places: Vec<(usize, usize)> = wanted.iter().map(|(e, v, _)| (*e, *v)).collect();
        let mut memories = Memories::default();
        let mut before = None;
        for sample in 0..samples {
            let inputs = inputs(run, sample, standing, before);
            before = Some(inputs.q);
            if sample == 0 {
                self.model.settle(&inputs, &mut memories);
            } else {
                self.model.advance(&inputs, &mut memories);
            }
            let drive = self.model.drive(&inputs, &memories);
            let rigid = inverse_dynamics(&self.model.arm, &inputs);
            for (joint, list) in torque.iter_mut().enumerate() {
                list.push(drive.recorded(joint) - rigid[joint]);
            }
            self.model.drive_slopes(&inputs, &memories, &places, |place, slope| {
                for (joint, list) in slopes[place].iter_mut().enumerate() {
                    list[sample] = slope[joint];
                }
            });
        }
        (torque, slopes)
    }
}

/// The state of the arm at one sample; a joint that moves less than `standing` stands.
fn inputs(run: &Run, sample: usize, standing: &[f64], before: Option<[f64; JOINTS_MAX]>) -> Inputs {
    let mut inputs = run.inputs(sample);
    inputs.q_before = before.unwrap_or(inputs.q);
    inputs.dt_s = if sample == 0 { 0.0 } else { run.step_s };
    inputs.time_s = sample as f64 * run.step_s;
    for (joint, track) in run.joints.iter().enumerate() {
        if inputs.velocity[joint].abs() < standing[joint] {
            inputs.velocity[joint] = 0.0;
        }
        if let Some(celsius) = track.temperature.get(sample) {
            inputs.joint_celsius[joint] = *celsius;
        }
    }
    inputs
}

/// `|τ| sign(v)`, the rigid body's torque given row by row.
pub(super) fn load_column(motion: &Motion, joint: usize, load: &[f64]) -> Column {
    let direction = Law::Direction.column(motion, joint);
    let times = |(joint, sign): &(usize, Vec<f64>)| {
        (*joint, sign.iter().zip(load).map(|(sign, load)| sign * load.abs()).collect())
    };
    Column { parts: direction.parts.iter().map(times).collect() }
}
