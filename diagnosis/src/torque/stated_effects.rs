//! Drive effects stated by the model: their torque, and columns for their parameters with stated uncertainty.
//!
//! Computed by the effects of `physics` at the sampling rate, from motion of a wider bandwidth, and then filtered as the torque is. A parameter with
//! a stated uncertainty is fitted with it as prior, so that a deviation within it is not a finding.

use physics::dynamics::inverse_dynamics;
use physics::spec::{Count, Range};
use physics::{AnyEffect, Arm, Inputs, JOINTS_MAX, Memories, Model, ParameterValues};

use super::motion::{Motion, Run};
use super::parameters::FittedParameter;
use super::regressors::{REST_VELOCITY_SHARE, rms_velocity};
use crate::engine::regression_data::Regressor;

/// What the model states of an arm and its drives.
#[derive(Clone, Copy, Debug)]
pub struct StatedModel<'a> {
    /// The model, with its drive effects.
    pub model: &'a Model,
    /// For each effect, the standard uncertainty of each of its values, SI units; 0 if none is stated.
    pub sigma: &'a [Vec<f64>],
    /// Delay of the recorded torques, s.
    pub delay_s: f64,
}

/// Torque of the stated effects, row by row.
pub(super) struct StatedTorque {
    /// Torque beyond the rigid body's, per joint, N m or N.
    pub(super) torque: Vec<Vec<f64>>,
    /// A column for each parameter with a stated uncertainty.
    pub(super) uncertain: Vec<UncertainParameter>,
}

/// Name and joint of an effect, identifying its first parameter.
pub(super) type EffectKey = (&'static str, Option<usize>);

/// A parameter with a stated uncertainty.
pub(super) struct UncertainParameter {
    pub(super) column: Regressor,
    pub(super) sigma: f64,
    /// The effect, if this is its first parameter.
    pub(super) first_parameter_of: Option<EffectKey>,
    /// Index among the model's effects, and among the effect's values.
    pub(super) location: (usize, usize),
}

/// A parameter that the model states with an uncertainty, as refitted.
#[derive(Clone, Debug, PartialEq)]
pub struct RefittedParameter {
    /// Name of the effect in docs/reference/effects.md.
    pub kind: &'static str,
    /// Joint from 0; `None` if the effect concerns the whole robot.
    pub joint: Option<usize>,
    /// Difference to the stated value, with the standard uncertainty after the fit; SI units.
    pub parameter: FittedParameter,
}

impl StatedModel<'_> {
    /// Whether the model states this effect at this joint, of a kind whose found parameters are differences to the stated ones.
    pub(super) fn states_correctable(&self, kind: &str, joint: Option<usize>) -> bool {
        let same = |effect: &AnyEffect| effect.spec().kind == kind && effect.joint() == joint;
        match kind {
            "torque_delay" => self.delay_s != 0.0,
            "coulomb_friction" | "viscous_friction" | "load_friction" | "inertia"
            | "drive_gain" => self.model.effects().any(same),
            _ => false,
        }
    }

    /// A refitted parameter that differs by `change` from the stated one, SI units, limited to its physical range; `None` for effects with list
    /// parameters or values outside a range that cannot be limited.
    pub(super) fn refit(
        &self,
        (effect, value): (usize, usize),
        change: f64,
        sigma: f64,
    ) -> Option<RefittedParameter> {
        let effect = self.model.effects().nth(effect)?;
        let (spec, fitted) = (effect.spec(), effect.fitted());
        if fitted.iter().any(|parameter| parameter.count != Count::One) {
            return None;
        }
        let (stated, parameter) = (*effect.values().get(value)?, fitted.get(value)?);
        let change = match parameter.range {
            Range::NotNegative => change.max(-stated),
            range if range.holds(stated + change) => change,
            _ => return None,
        };
        let number =
            FittedParameter { stem: parameter.stem, values: vec![change], sigma: vec![sigma] };
        Some(RefittedParameter { kind: spec.kind, joint: effect.joint(), parameter: number })
    }

    /// First parameter of a joint's effects of one kind, summed, SI units; 0 if it has none.
    pub(super) fn first_value(&self, kind: &str, joint: usize) -> f64 {
        self.effects_of(kind, joint).map(|effect| effect.values()[0]).sum()
    }

    /// Whether a joint has an effect of this kind whose first parameter has a stated uncertainty.
    pub(super) fn has_uncertain_first(&self, kind: &str, joint: usize) -> bool {
        let with_sigma = self.model.effects().zip(self.sigma);
        let mut same = with_sigma
            .filter(|(effect, _)| effect.spec().kind == kind && effect.joint() == Some(joint));
        same.any(|(_, sigma)| sigma.first().is_some_and(|sigma| *sigma > 0.0))
    }

    /// Rest position of the spring of a joint, rad or m; 0 if it has none.
    pub(super) fn spring_rest_position(&self, joint: usize) -> f64 {
        self.effects_of("spring", joint).map(|effect| effect.values()[1]).sum()
    }

    /// Whether the model states a spring at this joint.
    pub(super) fn has_spring(&self, joint: usize) -> bool {
        self.effects_of("spring", joint).next().is_some()
    }

    fn effects_of(&self, kind: &str, joint: usize) -> impl Iterator<Item = &AnyEffect> {
        let same =
            move |effect: &&AnyEffect| effect.spec().kind == kind && effect.joint() == Some(joint);
        self.model.effects().filter(same)
    }

    /// Evaluates the model's effects over the motion.
    pub(super) fn evaluate(&self, motion: &Motion) -> StatedTorque {
        let wanted: Vec<(usize, usize, f64)> = self
            .sigma
            .iter()
            .enumerate()
            .flat_map(|(effect, sigma)| {
                let open = sigma.iter().enumerate().filter(|(_, sigma)| **sigma > 0.0);
                open.map(move |(value, sigma)| (effect, value, *sigma))
            })
            .collect();
        let places: Vec<(usize, usize)> = wanted.iter().map(|(e, v, _)| (*e, *v)).collect();
        let (torque, columns) = self.torque_and_columns(motion, &places, true);
        let open = columns.into_iter().zip(&wanted);
        let open = open.filter(|(column, _)| !column.parts.is_empty());
        let effects: Vec<&AnyEffect> = self.model.effects().collect();
        let one = |(column, (effect, value, sigma)): (Regressor, &(usize, usize, f64))| {
            UncertainParameter {
                column,
                sigma: *sigma,
                location: (*effect, *value),
                first_parameter_of: (*value == 0)
                    .then(|| (effects[*effect].spec().kind, effects[*effect].joint())),
            }
        };
        StatedTorque { torque, uncertain: open.map(one).collect() }
    }

    /// Torque of the effects per joint at the rows (zero unless `torque`), and a column for each parameter in `wanted` (effect, value).
    fn torque_and_columns(
        &self,
        motion: &Motion,
        wanted: &[(usize, usize)],
        torque: bool,
    ) -> (Vec<Vec<f64>>, Vec<Regressor>) {
        let count = self.model.arm.count();
        let mut all = vec![Vec::new(); count];
        let mut columns = vec![vec![Vec::new(); count]; wanted.len()];
        let standing: Vec<f64> =
            (0..count).map(|j| REST_VELOCITY_SHARE * rms_velocity(motion, j)).collect();
        for run in &motion.runs {
            let (added, slopes) = self.at_samples(run, &standing, wanted, torque);
            let extend = |all: &mut [Vec<f64>], samples: &[Vec<f64>]| {
                let passed = run.all_at_rows(samples);
                all.iter_mut().zip(passed).for_each(|(all, filtered)| all.extend(filtered));
            };
            extend(&mut all, &added);
            columns.iter_mut().zip(&slopes).for_each(|(column, slopes)| extend(column, slopes));
        }
        let is_nonzero = |values: &Vec<f64>| values.iter().any(|x| *x != 0.0);
        let column = |parts: Vec<Vec<f64>>| Regressor {
            parts: parts
                .into_iter()
                .enumerate()
                .filter(|(_, values)| is_nonzero(values))
                .map(|(joint, values)| (joint, values.into()))
                .collect(),
        };
        (all, columns.into_iter().map(column).collect())
    }

    /// Per joint and sample of one run: torque of the effects, and its derivative with respect to each parameter in `wanted`, empty if always zero.
    fn at_samples(
        &self,
        run: &Run,
        standing: &[f64],
        wanted: &[(usize, usize)],
        torque: bool,
    ) -> (Vec<Vec<f64>>, Vec<Vec<Vec<f64>>>) {
        let count = self.model.arm.count();
        let samples = run.joints.first().map_or(0, |track| track.q.len());
        let mut added = vec![vec![0.0; samples]; count];
        let mut slopes = vec![vec![Vec::new(); count]; wanted.len()];
        if self.model.effects().len() == 0 {
            return (added, slopes);
        }
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
            if torque {
                let drive = self.model.drive(&inputs, &memories);
                let rigid = inverse_dynamics(&self.model.arm, &inputs);
                for (joint, list) in added.iter_mut().enumerate() {
                    list[sample] = drive.recorded(joint) - rigid[joint];
                }
            }
            self.model.drive_slopes(&inputs, &memories, wanted, |place, slope| {
                for (joint, list) in slopes[place].iter_mut().enumerate() {
                    if slope[joint] != 0.0 && list.is_empty() {
                        *list = vec![0.0; samples];
                    }
                    if let Some(slot) = list.get_mut(sample) {
                        *slot = slope[joint];
                    }
                }
            });
        }
        (added, slopes)
    }
}

/// Columns for the first moment of each body with stated masses, if any drive's torque depends on it.
pub(super) fn first_moment_columns(arm: &Arm, motion: &Motion) -> Vec<(usize, Vec<Regressor>)> {
    let is_stated = |joint: &usize| arm.joints()[*joint].link.is_some();
    let given: &[(&str, &[f64])] = &[("first_moment", &[0.0; 3])];
    let build =
        |joint| AnyEffect::build("gravity_torque", arm, Some(joint), ParameterValues(given)).ok();
    let joints: Vec<usize> = (0..arm.count()).filter(is_stated).collect();
    let effects: Vec<AnyEffect> = joints.iter().filter_map(|joint| build(*joint)).collect();
    let Ok(model) = Model::new(*arm, &effects) else { return Vec::new() };
    let stated = StatedModel { model: &model, sigma: &[], delay_s: 0.0 };
    // One body at a time, to limit memory.
    let each = joints.iter().enumerate().map(|(effect, joint)| {
        let wanted = [0, 1, 2].map(|value| (effect, value));
        (*joint, stated.torque_and_columns(motion, &wanted, false).1)
    });
    each.filter(|(_, three)| three.iter().any(|column| !column.parts.is_empty())).collect()
}

/// State of the arm at one sample; velocities below `standing` are set to zero.
fn inputs(run: &Run, sample: usize, standing: &[f64], before: Option<[f64; JOINTS_MAX]>) -> Inputs {
    let mut inputs = run.wide_band_inputs(sample);
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
