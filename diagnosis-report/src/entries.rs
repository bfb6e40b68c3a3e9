//! The effects of a fit with their parameters in file units.
//!
//! Promises: an effect that the base model has keeps its entry, numbers and uncertainties renewed; others get one of their own.
//! Never: a number that the data did not tell counted as found.

use diagnosis::hypothesis::{Named, named, without_axial_part};
use diagnosis::{Chosen, Fit};
use glam::DVec3;
use physics::spec::Count;
use physics::{AnyEffect, Arm, JointKind};
use recording::model::{EffectEntry, ModelFile, Numbers, Parameter, RobotModel, SiParameter};

use crate::error::Error;

/// Cosine from which an axis lies along a direction.
pub const ALONG: f64 = 0.999_999;

/// One number of an effect.
pub struct Number {
    /// Key in the file.
    pub key: String,
    /// Place in the key's list, from 1; none where it is no list.
    pub index: Option<usize>,
    /// In the unit of the key.
    pub value: f64,
    /// In the unit of the key; none where it was not fitted.
    pub sigma: Option<f64>,
    /// Whether a fit might have changed it.
    pub free: bool,
}

/// One effect.
pub struct Entry {
    /// The effect as it was fitted, SI.
    pub effect: AnyEffect,
    /// Place in the base model's file; none where it is new.
    pub of_base: Option<usize>,
    /// Its numbers in the units of files.
    pub numbers: Vec<Number>,
    /// By how much it moves the tool, m, root of the mean square.
    pub share_m: f64,
    /// As it stands in the file.
    pub written: EffectEntry,
}

impl Entry {
    /// Whether there is nothing to write: new, and nothing of it was told.
    pub fn is_empty(&self) -> bool {
        let is_nothing = |number: &Number| number.sigma.is_none() && number.value == 0.0;
        self.of_base.is_none() && self.numbers.iter().filter(|n| n.free).all(is_nothing)
    }

    /// From 1.
    pub fn joint(&self) -> Option<usize> {
        self.effect.joint().map(|joint| joint + 1)
    }

    /// Its name, as in model files.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        self.effect.spec().kind
    }
}

/// The file of `base` with these effects: those that it has renewed, new ones of which something is known appended.
pub(crate) fn renewed_file(base: &RobotModel, entries: &[Entry]) -> ModelFile {
    let mut file = base.file.clone();
    for entry in entries {
        match entry.of_base.and_then(|at| file.effects.get_mut(at)) {
            Some(there) => *there = entry.written.clone(),
            None if entry.is_empty() => {}
            None => file.effects.push(entry.written.clone()),
        }
    }
    file
}

/// The effects of `last`, in its order.
pub fn entries(
    base: &RobotModel,
    last: &Fit,
    chosen: &[Chosen],
    shares_m: &[f64],
) -> Result<Vec<Entry>, Error> {
    let model = &last.hypothesis.model;
    let mut entries = Vec::new();
    for (place, effect) in model.effects().enumerate() {
        let effect = &across(effect, &base.physics.arm);
        let sigma = sigma_of(last, place, effect);
        let of_base = base.entry_of.get(place).copied();
        let settings = chosen.iter().find(|chosen| chosen.effect == place);
        let settings = settings.map_or(&[][..], |chosen| chosen.settings.as_slice());
        let written = match of_base.and_then(|at| base.file.effects.get(at)) {
            Some(entry) => Some(renewed(entry, effect, &sigma, kind_of(base, effect))),
            None => made(base, effect, &sigma, settings),
        };
        let written = written.ok_or_else(|| {
            Error::internal(format!("{} cannot be written into a model", effect.spec().kind))
        })?;
        let numbers = numbers(base, last, place, effect, &sigma);
        let share_m = shares_m.get(place).copied().unwrap_or(0.0);
        entries.push(Entry { effect: *effect, of_base, numbers, share_m, written });
    }
    Ok(entries)
}

fn kind_of(base: &RobotModel, effect: &AnyEffect) -> JointKind {
    let joint = effect.joint().and_then(|joint| base.physics.arm.joints().get(joint));
    joint.map_or(JointKind::Revolute, |joint| joint.kind)
}

/// The axis along which an `axis_shift` does nothing: its own, but for the last joint's.
pub fn barred(effect: &AnyEffect, arm: &Arm) -> Option<DVec3> {
    let joint = effect.joint().filter(|joint| joint + 1 < arm.count())?;
    let axis = arm.joints().get(joint)?.axis;
    (effect.spec().kind == "axis_shift").then_some(axis)
}

/// The effect without what does nothing: a fit may leave a part of a shift along its axis, a file may not.
fn across(effect: &AnyEffect, arm: &Arm) -> AnyEffect {
    let mut next = *effect;
    if let (Some(axis), [x, y, z]) = (barred(effect, arm), effect.values()) {
        let shift = without_axial_part(axis, DVec3::new(*x, *y, *z));
        next.values_mut().copy_from_slice(&shift.to_array());
    }
    next
}

/// The standard uncertainty of each value of the effect in place `place`, SI.
fn sigma_of(last: &Fit, place: usize, effect: &AnyEffect) -> Vec<Option<f64>> {
    let mut columns = vec![None; effect.values().len()];
    for (k, free) in last.hypothesis.free.iter().enumerate().filter(|(_, f)| f.effect == place) {
        columns[free.value] = Some(last.column_of(k)).filter(|c| last.sigma(*c).is_some());
    }
    let barred = barred(effect, &last.hypothesis.model.arm).filter(|axis| is_slanted(*axis));
    let Some(axis) = barred else {
        return columns.into_iter().map(|column| last.sigma(column?)).collect();
    };
    // What is left of the shift across its axis, `s − a (a·s)`: the same rows of the covariance.
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

/// Whether an axis lies along none of x, y, z.
fn is_slanted(axis: DVec3) -> bool {
    axis.abs().max_element() < ALONG
}

fn numbers(
    base: &RobotModel,
    last: &Fit,
    place: usize,
    effect: &AnyEffect,
    sigma: &[Option<f64>],
) -> Vec<Number> {
    let kind = kind_of(base, effect);
    let number = |value: usize| {
        let Named { parameter, index } = named(effect, value)?;
        let si = parameter.unit.suffix_and_si(kind).1;
        let is_free = |free: &diagnosis::Free| free.effect == place && free.value == value;
        Some(Number {
            key: parameter.key(kind).to_string(),
            index: (parameter.count != Count::One).then_some(index + 1),
            value: effect.values()[value] / si,
            sigma: sigma[value].map(|sigma| sigma / si),
            free: last.hypothesis.free.iter().any(is_free),
        })
    };
    (0..effect.values().len()).filter_map(number).collect()
}

/// The values of each entry of an effect, with their uncertainties, 0 where unknown; those only where any is known.
type Group = (&'static str, Vec<f64>, Option<Vec<f64>>);

fn groups(effect: &AnyEffect, sigma: &[Option<f64>]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (value, sigma) in effect.values().iter().zip(sigma) {
        let at = groups.iter().map(|(_, values, _)| values.len()).sum();
        let Some(named) = named(effect, at) else { continue };
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

fn made(
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

/// The entry with what was found; what no fit changes stays as it is written.
fn renewed(
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
        match next.parameters.iter_mut().find(|there| there.key == key) {
            Some(there) => *there = found,
            None => next.parameters.push(found),
        }
    }
    next
}
