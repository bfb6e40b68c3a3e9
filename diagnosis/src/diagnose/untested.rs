//! Effects that this recording cannot show, with the reason. Every effect that moves the tool is either a candidate or listed here.

use super::covariates::Covariate;
use crate::candidates::Candidate;
use physics::effects::{OVER_PATHS, SPECS};
use physics::spec::{ActsOn, EffectScope, Need, Spec};
use physics::{Arm, JointKind};

/// An effect that was not a candidate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UntestedEffect {
    /// Name of the effect.
    pub effect: &'static str,
    /// Index of the joint, from 0; `None` for the whole robot.
    pub joint: Option<usize>,
    /// Reason, for the user.
    pub why: String,
}

/// Effects that are not in `dictionary`.
pub(super) fn untested_effects(
    arm: &Arm,
    library: &[Candidate],
    covariates: &[Covariate],
) -> Vec<UntestedEffect> {
    let tested: Vec<(&str, Option<usize>)> = library
        .iter()
        .filter_map(|candidate| candidate.probes.first())
        .map(|probe| (probe.effect.spec().kind, probe.effect.joint()))
        .collect();
    let mut list = Vec::new();
    for spec in SPECS.iter().chain(OVER_PATHS) {
        if matches!(spec.acts_on, ActsOn::DriveTorque | ActsOn::ToolForce) {
            continue;
        }
        let joints: Vec<Option<usize>> = match spec.scope {
            EffectScope::Robot => vec![None],
            _ => (0..arm.count()).map(Some).collect(),
        };
        for joint in joints.into_iter().filter(|joint| !tested.contains(&(spec.kind, *joint))) {
            list.extend(reason(arm, spec, joint, covariates).map(|why| UntestedEffect {
                effect: spec.kind,
                joint,
                why,
            }));
        }
    }
    for joint in 0..arm.count() {
        let still = !covariates.iter().any(|covariate| covariate.name == format!("q{}", joint + 1));
        if still {
            let why = format!("joint {} never moves", joint + 1);
            list.push(UntestedEffect { effect: "joint_ratio", joint: Some(joint), why });
        }
    }
    let mut unique: Vec<UntestedEffect> = Vec::new();
    for one in list {
        if !unique.iter().any(|s| s.effect == one.effect && s.joint == one.joint) {
            unique.push(one);
        }
    }
    unique
}

/// Why an effect cannot be identified; `None` if the joint type excludes it, or for no known reason.
fn reason(
    arm: &Arm,
    spec: &Spec,
    joint: Option<usize>,
    covariates: &[Covariate],
) -> Option<String> {
    let has = |name: &str| covariates.iter().any(|covariate| covariate.name.starts_with(name));
    let slides = joint.is_some_and(|j| arm.joints()[j].kind == JointKind::Prismatic);
    if spec.scope == EffectScope::RevoluteJoint && slides {
        return None;
    }
    let n = joint.map_or(0, |joint| joint + 1);
    if OVER_PATHS.contains(spec) {
        let why = "the recording contains no path, or measured joint positions";
        return Some(why.to_owned());
    }
    if joint.is_some() && !has(&format!("q{n}")) {
        return Some(format!("joint {n} never moves"));
    }
    let lacks = |need: &Need| match need {
        Need::Direction if !has(&format!("direction_{n}")) => Some(format!(
            "joint {n} never reverses, or the recording does not state its approach direction"
        )),
        Need::Wrench if !has("wrench") => {
            Some("the wrench never changes or was not recorded".into())
        }
        Need::Masses if arm.bodies().next().is_none() => Some("the model has no masses".into()),
        Need::Temperature if !has("temp") => {
            Some("the temperature never changes or was not recorded".into())
        }
        Need::SpindleSpeed if !has("spindle") => {
            Some("the spindle speed never changes or was not recorded".into())
        }
        _ => None,
    };
    spec.needs.iter().find_map(lacks)
}
