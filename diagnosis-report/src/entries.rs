//! The effects of a fit with their parameters in file units.
//!
//! An effect of the base model keeps its entry, with updated parameters and uncertainties; other effects get new entries. Parameters that the data do
//! not determine do not count as found.

use diagnosis::hypothesis::{ParameterKey, parameter_key, without_axial_part};
use diagnosis::{AddedEffect, Fit};
use glam::DVec3;
use physics::spec::Count;
use physics::{AnyEffect, Arm, JointKind};
use recording::model::{EffectEntry, ModelFile, Numbers, Parameter, RobotModel, SiParameter};

use crate::error::Error;

/// Cosine above which an axis is considered parallel to a direction.
pub const PARALLEL_COSINE: f64 = 0.999_999;

/// One parameter of an effect.
pub struct EntryParameter {
    /// Key in the file.
    pub key: String,
    /// Index in the key's list, 1-based; `None` for a scalar.
    pub index: Option<usize>,
    /// Value in the unit of the key.
    pub value: f64,
    /// Standard uncertainty in the unit of the key; `None` if it was not fitted.
    pub sigma: Option<f64>,
    /// Whether it is a free parameter of the fit.
    pub free: bool,
}

/// One effect.
pub struct FittedEffect {
    /// The fitted effect, SI.
    pub effect: AnyEffect,
    /// Index in the base model's file; `None` for a new effect.
    pub base_index: Option<usize>,
    /// Its parameters in file units.
    pub parameters: Vec<EntryParameter>,
    /// RMS displacement of the measured points by this effect, after frames and targets are registered without it, m.
    pub share_m: f64,
    /// Its entry in the file.
    pub file_entry: EffectEntry,
}

impl FittedEffect {
    /// Whether there is nothing to write: a new effect without any determined or non-zero parameter.
    pub fn is_empty(&self) -> bool {
        let is_nothing = |number: &EntryParameter| number.sigma.is_none() && number.value == 0.0;
        self.base_index.is_none() && self.parameters.iter().filter(|n| n.free).all(is_nothing)
    }

    /// 1-based; `None` for effects of the whole robot.
    pub fn joint(&self) -> Option<usize> {
        self.effect.joint().map(|joint| joint + 1)
    }

    /// Kind of the effect, as in model files.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        self.effect.spec().kind
    }
}

/// The file of `base` with these effects: existing ones updated, new ones appended unless empty.
pub(crate) fn updated_file(base: &RobotModel, entries: &[FittedEffect]) -> ModelFile {
    let mut file = base.file.clone();
    for entry in entries {
        match entry.base_index.and_then(|index| file.effects.get_mut(index)) {
            Some(existing) => *existing = entry.file_entry.clone(),
            None if entry.is_empty() => {}
            None => file.effects.push(entry.file_entry.clone()),
        }
    }
    file
}

/// The effects of the fit `last`, in its order.
pub fn fitted_effects(
    base: &RobotModel,
    last: &Fit,
    chosen: &[AddedEffect],
    shares_m: &[f64],
) -> Result<Vec<FittedEffect>, Error> {
    let model = &last.hypothesis.model;
    let mut entries = Vec::new();
    for (place, effect) in model.effects().enumerate() {
        let effect = &without_ineffective_shift(effect, &base.physics.arm);
        let sigma = sigma_of(last, place, effect);
        let base_index = base.entry_of.get(place).copied();
        let settings = chosen.iter().find(|chosen| chosen.effect == place);
        let settings = settings.map_or(&[][..], |chosen| chosen.settings.as_slice());
        let written = match base_index.and_then(|index| base.file.effects.get(index)) {
            Some(entry) => Some(updated_entry(entry, effect, &sigma, joint_kind_of(base, effect))),
            None => new_entry(base, effect, &sigma, settings),
        };
        let file_entry = written.ok_or_else(|| {
            Error::internal(format!("{} cannot be written into a model", effect.spec().kind))
        })?;
        let parameters = effect_parameters(base, last, place, effect, &sigma);
        let share_m = shares_m.get(place).copied().unwrap_or(0.0);
        entries.push(FittedEffect { effect: *effect, base_index, parameters, share_m, file_entry });
    }
    Ok(entries)
}

fn joint_kind_of(base: &RobotModel, effect: &AnyEffect) -> JointKind {
    let joint = effect.joint().and_then(|joint| base.physics.arm.joints().get(joint));
    joint.map_or(JointKind::Revolute, |joint| joint.kind)
}

/// The axis along which an `axis_shift` has no effect: the joint's own, except at the last joint.
pub fn ineffective_axis(effect: &AnyEffect, arm: &Arm) -> Option<DVec3> {
    let joint = effect.joint().filter(|joint| joint + 1 < arm.count())?;
    let axis = arm.joints().get(joint)?.axis;
    (effect.spec().kind == "axis_shift").then_some(axis)
}

/// The effect without a component that has no effect: a fit may leave a shift along the axis, a file must not contain one.
fn without_ineffective_shift(effect: &AnyEffect, arm: &Arm) -> AnyEffect {
    let mut next = *effect;
    if let (Some(axis), [x, y, z]) = (ineffective_axis(effect, arm), effect.values()) {
        let shift = without_axial_part(axis, DVec3::new(*x, *y, *z));
        next.values_mut().copy_from_slice(&shift.to_array());
    }
    next
}

/// Standard uncertainty of each parameter of the effect at index `place`, SI.
fn sigma_of(last: &Fit, place: usize, effect: &AnyEffect) -> Vec<Option<f64>> {
    let mut columns = vec![None; effect.values().len()];
    for (k, free) in last.hypothesis.free.iter().enumerate().filter(|(_, f)| f.effect == place) {
        columns[free.value] = Some(last.column_of(k)).filter(|c| last.sigma(*c).is_some());
    }
    let barred =
        ineffective_axis(effect, &last.hypothesis.model.arm).filter(|axis| is_oblique(*axis));
    let Some(axis) = barred else {
        return columns.into_iter().map(|column| last.sigma(column?)).collect();
    };
    // The component of the shift perpendicular to its axis, `s − a (a·s)`: the same projection of the covariance.
    let across = |value: usize| {
        let row = without_axial_part(axis, DVec3::AXES[value]);
        let known = || columns.iter().enumerate().filter_map(|(k, column)| Some((k, (*column)?)));
        let pairs = known().flat_map(|(i, a)| known().map(move |(j, b)| (row[i] * row[j], a, b)));
        let variance: f64 =
            pairs.map(|(share, a, b)| share * last.covariance(a, b).unwrap_or(0.0)).sum();
        (variance > 0.0).then(|| variance.sqrt())
    };
    (0..columns.len()).map(across).collect()
}

/// Whether an axis is parallel to none of x, y, z.
fn is_oblique(axis: DVec3) -> bool {
    axis.abs().max_element() < PARALLEL_COSINE
}

fn effect_parameters(
    base: &RobotModel,
    last: &Fit,
    place: usize,
    effect: &AnyEffect,
    sigma: &[Option<f64>],
) -> Vec<EntryParameter> {
    let kind = joint_kind_of(base, effect);
    let number = |value: usize| {
        let ParameterKey { parameter, index } = parameter_key(effect, value)?;
        let si = parameter.unit.suffix_and_si(kind).1;
        let is_free = |free: &diagnosis::FreeParameter| free.effect == place && free.value == value;
        Some(EntryParameter {
            key: parameter.key(kind).to_string(),
            index: (parameter.count != Count::One).then_some(index + 1),
            value: effect.values()[value] / si,
            sigma: sigma[value].map(|sigma| sigma / si),
            free: last.hypothesis.free.iter().any(is_free),
        })
    };
    (0..effect.values().len()).filter_map(number).collect()
}

/// Key, values and standard uncertainties (0 where unknown; `None` if all are unknown) of an effect.
type ParameterGroup = (&'static str, Vec<f64>, Option<Vec<f64>>);

fn groups(effect: &AnyEffect, sigma: &[Option<f64>]) -> Vec<ParameterGroup> {
    let mut groups: Vec<ParameterGroup> = Vec::new();
    for (value, sigma) in effect.values().iter().zip(sigma) {
        let first = groups.iter().map(|(_, values, _)| values.len()).sum();
        let Some(named) = parameter_key(effect, first) else { continue };
        if named.index == 0 {
            groups.push((named.parameter.stem, Vec::new(), None));
        }
        let Some((_, values, sigmas)) = groups.last_mut() else { continue };
        if sigma.is_some() && sigmas.is_none() {
            *sigmas = Some(vec![0.0; values.len()]);
        }
        values.push(*value);
        if let Some(sigmas) = sigmas {
            sigmas.push(sigma.unwrap_or(0.0));
        }
    }
    groups
}

fn new_entry(
    base: &RobotModel,
    effect: &AnyEffect,
    sigma: &[Option<f64>],
    settings: &[(&'static str, Vec<f64>)],
) -> Option<EffectEntry> {
    let groups = groups(effect, sigma);
    let fitted = groups.iter().map(|(stem, values, sigma)| SiParameter {
        stem,
        values,
        sigma: sigma.as_deref(),
    });
    let settings = settings.iter().map(|(stem, values)| SiParameter { stem, values, sigma: None });
    let parameters: Vec<SiParameter<'_>> = fitted.chain(settings).collect();
    EffectEntry::from_si(&base.physics.arm, effect.spec().kind, effect.joint(), &parameters)
}

/// The entry with the fitted values; parameters that no fit changes keep their text.
fn updated_entry(
    entry: &EffectEntry,
    effect: &AnyEffect,
    sigma: &[Option<f64>],
    kind: JointKind,
) -> EffectEntry {
    let mut next = entry.clone();
    for (stem, values, sigma) in groups(effect, sigma) {
        let parameter = effect.fitted().iter().find(|parameter| parameter.stem == stem);
        let (Some(parameter), Some(sigma)) = (parameter, sigma) else { continue };
        let (key, si) = (parameter.key(kind).to_string(), parameter.unit.suffix_and_si(kind).1);
        let shaped = |list: &[f64]| match (parameter.count, list) {
            (Count::One, [one]) => Numbers::One(one / si),
            _ => Numbers::List(list.iter().map(|x| x / si).collect()),
        };
        let found =
            Parameter { key: key.clone(), value: shaped(&values), sigma: Some(shaped(&sigma)) };
        match next.parameters.iter_mut().find(|existing| existing.key == key) {
            Some(existing) => *existing = found,
            None => next.parameters.push(found),
        }
    }
    next
}
