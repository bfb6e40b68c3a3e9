//! Converts the document to the physical model: units to SI, effects by name.

use glam::{DMat3, DVec3};
use physics::effects::{CUTTING, DRIVES, OVER_PATHS, SPECS, spec_for};
use physics::spec::{ActsOn, Count, Need, Role, Spec};
use physics::{AnyEffect, Arm, Body, Joint, JointKind, Model, ParameterValues, Tool};

use super::kinds;
use super::{BodyEntry, EffectEntry, JointEntry, ModelFile, Numbers, Parameter, RobotModel};
use crate::faults::Fault;
use crate::files::content_hash;

const MM: f64 = 1e-3;

/// A fault, and the place in `effects` of the entry that it is about.
pub(super) type EntryFault = (Option<usize>, Fault);

pub(super) fn build(file: ModelFile) -> Result<RobotModel, Vec<EntryFault>> {
    let physics = Model::nominal(arm(&file).map_err(|fault| vec![(None, *fault)])?);
    let hash = content_hash(file.to_toml().as_bytes());
    let (entry_of, sigma, not_compensated) = Default::default();
    let (drives, drives_sigma, cutting, cutting_sigma) = Default::default();
    let mut model = RobotModel {
        file,
        physics,
        entry_of,
        sigma,
        not_compensated,
        drives,
        drives_sigma,
        cutting,
        cutting_sigma,
        hash,
    };
    let mut faults = Vec::new();
    for index in 0..model.file.effects.len() {
        if let Err(fault) = model.take_effect(index) {
            faults.push((Some(index), *fault));
        }
    }
    if faults.is_empty() { Ok(model) } else { Err(faults) }
}

impl RobotModel {
    fn take_effect(&mut self, index: usize) -> Result<(), Box<Fault>> {
        let entry = &self.file.effects[index];
        check_beside(&self.file, index)?;
        let fault = |message: String| Box::new(Fault::new(path_of(index, entry), message));
        let arm = self.physics.arm;
        let has = |key: &str| entry.parameters.iter().any(|p| p.key == key);
        let Some(kind) = kinds::find(&entry.kind, kind_at(entry, &arm), has) else {
            return Err(fault("is not a known effect".to_owned()));
        };
        let Some(spec) = kind.spec else {
            self.not_compensated.push(index);
            return Ok(());
        };
        let effect = effect(entry, spec, &arm).map_err(fault)?;
        let sigma = entry.sigma_si(spec, kind_at(entry, &arm), effect.values().len());
        if compensated(spec) {
            self.physics.push(effect).map_err(|error| fault(error.to_string()))?;
            self.entry_of.push(index);
            self.sigma.push(sigma);
        } else {
            self.not_compensated.push(index);
            match spec.acts_on {
                ActsOn::DriveTorque => {
                    self.drives.push(effect);
                    self.drives_sigma.push(sigma);
                }
                ActsOn::ToolForce => {
                    self.cutting.push(effect);
                    self.cutting_sigma.push(sigma);
                }
                _ => {}
            }
        }
        Ok(())
    }
}

fn path_of(index: usize, entry: &EffectEntry) -> String {
    format!("effect[{}]: {}", index + 1, entry.title())
}

/// Effects that can be compensated: static in position, wrench, direction and temperature.
fn compensated(spec: &Spec) -> bool {
    let place = matches!(spec.acts_on, ActsOn::Loads | ActsOn::JointPosition | ActsOn::Geometry);
    let moving = |need: &Need| matches!(need, Need::Velocity | Need::Acceleration);
    place && !spec.needs.iter().any(moving)
}

/// Checks the combination of effects of a joint: a hardening without a linear compliance would
/// refuse every command.
fn check_beside(file: &ModelFile, index: usize) -> Result<(), Box<Fault>> {
    match file.effects.get(index) {
        Some(entry) if entry.kind == "joint_compliance" => check_stands_alone(file, index, entry),
        Some(entry) if entry.kind == "stiffness_hardening" => check_hardens(file, index, entry),
        _ => Ok(()),
    }
}

/// The hardening `C τ − D τ³` needs the linear compliance C of its joint.
fn check_hardens(file: &ModelFile, index: usize, entry: &EffectEntry) -> Result<(), Box<Fault>> {
    let is_linear = |kind: &str| physics::effects::LINEAR_COMPLIANCES.contains(&kind);
    let hardened = |other: &EffectEntry| other.joint == entry.joint && is_linear(&other.kind);
    if file.effects.iter().any(hardened) {
        return Ok(());
    }
    let message = "has no effect without a linear compliance of the joint";
    let fault = Fault::new(path_of(index, entry), message.to_owned());
    Err(Box::new(
        fault.expected("joint_compliance, gravity_compliance or load_compliance of the same joint"),
    ))
}

/// `joint_compliance` is both others with one C: in addition to them on one joint it would count
/// twice.
fn check_stands_alone(
    file: &ModelFile,
    index: usize,
    entry: &EffectEntry,
) -> Result<(), Box<Fault>> {
    let part = |other: &&EffectEntry| {
        let parts = ["gravity_compliance", "load_compliance", "gravity_sag"];
        other.joint == entry.joint && parts.contains(&other.kind.as_str())
    };
    match file.effects.iter().find(part) {
        None => Ok(()),
        Some(other) => {
            let message = format!("cannot be combined with {} of the same joint", other.kind);
            let fault = Fault::new(path_of(index, entry), message);
            Err(Box::new(
                fault.expected("one of the two; joint_compliance covers gravity and load"),
            ))
        }
    }
}

fn arm(file: &ModelFile) -> Result<Arm, Box<Fault>> {
    let joints: Vec<Joint> = file.joints.iter().map(joint).collect();
    let rows =
        file.tool.base_from_tool.unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let tool = Tool {
        tcp: millimetres(file.tool.tcp_mm),
        base_from_tool: DMat3::from_cols_array_2d(&rows).transpose(),
        body: file.tool.body.and_then(|entry| body(&entry)),
    };
    Arm::new(&joints, tool, DVec3::from_array(file.gravity_m_s2))
        .map_err(|error| Box::new(Fault::new("", error.to_string())))
}

fn joint(entry: &JointEntry) -> Joint {
    let si = match entry.kind {
        JointKind::Revolute => std::f64::consts::PI / 180.0,
        JointKind::Prismatic => MM,
    };
    Joint {
        kind: entry.kind,
        axis: DVec3::from_array(entry.axis),
        point: millimetres(entry.point_mm.unwrap_or_default()),
        limits: (entry.limits[0] * si, entry.limits[1] * si),
        max_speed: entry.max_speed.map_or(f64::INFINITY, |speed| speed * si),
        link: entry.link.and_then(|entry| body(&entry)),
    }
}

fn millimetres(vector: [f64; 3]) -> DVec3 {
    DVec3::from_array(vector) * MM
}

fn body(entry: &BodyEntry) -> Option<Body> {
    let [xx, yy, zz, xy, xz, yz] = entry.inertia_kgm2.unwrap_or_default();
    let columns = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    (entry.mass_kg > 0.0).then(|| Body {
        mass: entry.mass_kg,
        centre: millimetres(entry.com_mm),
        inertia: DMat3::from_cols_array_2d(&columns),
    })
}

fn kind_at(entry: &EffectEntry, arm: &Arm) -> JointKind {
    let joint = entry.joint.and_then(|joint| arm.joints().get(joint.checked_sub(1)?));
    joint.map_or(JointKind::Revolute, |joint| joint.kind)
}

fn effect(entry: &EffectEntry, spec: &Spec, arm: &Arm) -> Result<AnyEffect, String> {
    let given = given(entry, spec, kind_at(entry, arm))?;
    let given: Vec<(&str, &[f64])> = given.iter().map(|(s, v)| (*s, v.as_slice())).collect();
    let joint = match entry.joint {
        Some(0) => return Err("joint numbers start at 1, this one is 0".to_owned()),
        joint => joint.map(|joint| joint - 1),
    };
    AnyEffect::build(spec.kind, arm, joint, ParameterValues(&given))
        .map_err(|error| error.to_string())
}

/// The values of an entry in SI, by the stems of their keys.
fn given(
    entry: &EffectEntry,
    spec: &Spec,
    kind: JointKind,
) -> Result<Vec<(&'static str, Vec<f64>)>, String> {
    let number = |parameter: &Parameter| {
        let Some(known) = spec.parameters.iter().find(|p| p.key(kind) == *parameter.key) else {
            return Err(format!("`{}` is not a parameter of this effect", parameter.key));
        };
        let si = known.unit.suffix_and_si(kind).1;
        Ok((known.stem, parameter.value.as_slice().iter().map(|v| v * si).collect()))
    };
    entry.parameters.iter().map(number).collect()
}

/// A parameter in SI, by the stem of its key.
#[derive(Debug, Clone, Copy)]
pub struct SiParameter<'a> {
    /// Stem: the key without its unit's suffix.
    pub stem: &'a str,
    /// Values, SI.
    pub values: &'a [f64],
    /// Standard uncertainty of each value, SI, if known.
    pub sigma: Option<&'a [f64]>,
}

impl EffectEntry {
    /// The standard uncertainties in the order and number of the effect's values, SI.
    fn sigma_si(&self, spec: &Spec, kind: JointKind, count: usize) -> Vec<f64> {
        let mut flat = Vec::new();
        for known in spec.parameters.iter().filter(|p| p.role != Role::Setting) {
            let key = known.key(kind).to_string();
            let si = known.unit.suffix_and_si(kind).1;
            match self.parameters.iter().find(|p| p.key == key) {
                Some(parameter) => {
                    let zeros = parameter.value.map(|_| 0.0);
                    let sigma = parameter.sigma.as_ref().unwrap_or(&zeros);
                    flat.extend(sigma.as_slice().iter().map(|sigma| sigma * si));
                }
                None => match known.count {
                    Count::One => flat.push(0.0),
                    Count::Exactly(numbers) => flat.extend(std::iter::repeat_n(0.0, numbers)),
                    Count::UpTo(_) | Count::ThreePerCarriedBody => {}
                },
            }
        }
        flat.resize(count, 0.0);
        flat
    }

    /// Its values in SI by the stems of their keys, for [`physics::ParameterValues`]; `None` if `physics` has
    /// no such effect.
    #[must_use]
    pub fn to_si(&self, arm: &Arm) -> Option<Vec<(&'static str, Vec<f64>)>> {
        let kind = kind_at(self, arm);
        let keys: Vec<&str> = self.parameters.iter().map(|p| p.key.as_str()).collect();
        given(self, spec_for(&self.kind, kind, &keys)?, kind).ok()
    }

    /// The entry of an effect with these parameters: stems of its spec with values and, if known,
    #[must_use]
    pub fn from_si(
        arm: &Arm,
        kind: &str,
        joint: Option<usize>,
        parameters: &[SiParameter<'_>],
    ) -> Option<Self> {
        let knows = |spec: &Spec, stem: &str| spec.parameters.iter().any(|p| p.stem == stem);
        let fits = |spec: &&Spec| {
            spec.kind == kind && parameters.iter().all(|given| knows(spec, given.stem))
        };
        let all = SPECS.iter().chain(OVER_PATHS).chain(DRIVES).chain(CUTTING);
        let spec = { all }.find(fits)?;
        let joint_kind = match joint {
            Some(joint) => arm.joints().get(joint)?.kind,
            None => JointKind::Revolute,
        };
        let mut entries = Vec::new();
        for SiParameter { stem, values, sigma } in parameters {
            let known = spec.parameters.iter().find(|p| p.stem == *stem)?;
            let si = known.unit.suffix_and_si(joint_kind).1;
            let numbers = |list: &[f64]| match (known.count, list) {
                (Count::One, [one]) => Numbers::One(one / si),
                _ => Numbers::List(list.iter().map(|value| value / si).collect()),
            };
            entries.push(Parameter {
                key: known.key(joint_kind).to_string(),
                value: numbers(values),
                sigma: sigma.map(numbers),
            });
        }
        Some(Self {
            kind: kind.to_owned(),
            joint: joint.map(|joint| joint + 1),
            channel: None,
            parameters: entries,
        })
    }
}
