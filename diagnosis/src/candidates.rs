//! Candidate effects from the list of `physics`, limited to those that the signals of a campaign can show.
//!
//! A candidate is evaluated by columns that are linear in its parameters: linear parameters of the effect, or the sine and cosine components of a
//! wave. Nonlinear parameters (a time constant, a load) are tried at a few values each.
//!
//! Invariant: no candidate needs a signal that the campaign lacks, and none duplicates an effect of the model. Residuals are not used here; see
//! [`crate::score_test`].

mod dynamics;
mod exclusions;
mod insertion;
mod loads;
mod relinearisation;
mod thermal;

pub(crate) use dynamics::{ModeExcitation, mode_candidate, path_candidates};
use exclusions::slot;
pub(crate) use insertion::{insert, is_physical};
pub(crate) use loads::{joint_polynomials, loaded_compliances, springs_at};

use crate::campaign::{Arrival, Campaign};
use physics::spec::{Need, Role};
use physics::{AnyEffect, Arm, JOINTS_MAX, JointKind, ParameterValues};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Reversal distances of a hysteresis that are tried, rad or m.
pub(crate) const REVERSALS: [f64; 3] = [2e-3, 1e-2, 5e-2];
/// Loads at which the soft zone ends that are tried, as fractions of the joint's largest load.
const SOFT_ZONE_LOADS: [f64; 3] = [0.05, 0.2, 0.6];
/// Numbers of bodies, the joint's own and those after it, of which the simpler sags consist: of an articulated arm, joint 3 carries the forearm, joint 2 the
/// upper arm too.
const NEAR_BODIES: [usize; 2] = [1, 2];

/// One parameter of an effect, evaluated by its column of the Jacobian.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CandidateParameter {
    pub(crate) effect: AnyEffect,
    pub(crate) value: usize,
}

/// How estimated parameters become effects.
#[derive(Clone, Copy, Debug)]
enum ParameterMapping {
    /// The effect of the probes with its linear parameters set.
    Values,
    /// Sine and cosine components of one wave of a joint's position.
    Wave { joint: usize, cycles: f64 },
    /// Sine and cosine components of two tilts of a joint's axis.
    Wobble { joint: usize, cycles: f64 },
    /// Changes to the parameters of an effect that the model already has, at index `place`.
    Change { place: usize },
    /// Some of the parameters of the effect of the probes; the others stay zero: in a joint error polynomial those that are equivalent to an offset and a
    /// ratio, in a sag those of bodies farther out.
    Part,
    /// A spring: one of its lengths stays fixed, since the data determine only their ratios.
    Spring,
    /// Masses at given positions, combined to their sum at their centre of mass.
    Masses,
    /// A natural mode of a joint or of the base.
    Mode(ModeExcitation),
}

/// An effect that the model may lack.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    /// Candidates of one slot exclude each other.
    pub(crate) slot: String,
    /// Joint of the effect, 0-based; `None` for effects of the whole arm.
    pub(crate) joint: Option<usize>,
    pub(crate) probes: Vec<CandidateParameter>,
    /// Parameters that no fit changes, with their values, SI.
    pub(crate) settings: Vec<(&'static str, Vec<f64>)>,
    mapping: ParameterMapping,
}

impl Candidate {
    /// The effect with `found` as the values of its probes; `None` if it cannot be built, or if the candidate is not an effect of its own.
    pub(crate) fn effect(&self, arm: &Arm, found: &[f64]) -> Option<AnyEffect> {
        match self.mapping {
            ParameterMapping::Change { .. } => None,
            ParameterMapping::Masses => loads::at_centre_of_mass(&self.probes, found),
            ParameterMapping::Values
            | ParameterMapping::Part
            | ParameterMapping::Spring
            | ParameterMapping::Mode(_) => {
                let mut effect = self.probes.first()?.effect;
                for (probe, value) in self.probes.iter().zip(found) {
                    effect.values_mut()[probe.value] = *value;
                }
                Some(effect)
            }
            ParameterMapping::Wave { joint, cycles } => {
                let [sine, cosine] = *found else { return None };
                wave(arm, joint, cycles, sine.hypot(cosine), libm::atan2(cosine, sine))
            }
            ParameterMapping::Wobble { joint, cycles } => {
                let [s1, s2, c1, c2] = *found else { return None };
                let phases = [libm::atan2(c1, s1), libm::atan2(c2, s2)];
                wobble(arm, joint, cycles, [s1.hypot(c1), s2.hypot(c2)], phases)
            }
        }
    }

    /// Stems of the parameters that a fit keeps: the period of a wave unless it was searched for.
    pub(crate) fn fixed_stems(&self) -> &'static [&'static str] {
        match self.mapping {
            ParameterMapping::Wave { .. } | ParameterMapping::Wobble { .. } => &["cycles"],
            ParameterMapping::Spring => &["L"],
            ParameterMapping::Mode(driven) => driven.fixed_stems(),
            ParameterMapping::Values
            | ParameterMapping::Change { .. }
            | ParameterMapping::Part
            | ParameterMapping::Masses => &[],
        }
    }

    /// Number of identifiable parameters that were selected from a list of trial values beforehand and are still to be fitted.
    pub(crate) fn trial_parameter_count(&self) -> usize {
        if matches!(self.mapping, ParameterMapping::Spring) { loads::SHAPE } else { 0 }
    }

    /// Whether it is a spring with a trial geometry.
    pub(crate) fn is_spring(&self) -> bool {
        matches!(self.mapping, ParameterMapping::Spring)
    }

    /// Whether its probes together form one mass.
    pub(crate) fn is_one_mass(&self) -> bool {
        matches!(self.mapping, ParameterMapping::Masses)
    }

    /// Whether a fit may change this parameter of its effect.
    pub(crate) fn may_fit(&self, value: usize) -> bool {
        !matches!(self.mapping, ParameterMapping::Part)
            || self.probes.iter().any(|p| p.value == value)
    }

    /// Whether it excludes this effect of the model: same slot, or conflicting kinds.
    pub(crate) fn excludes_effect(&self, effect: &AnyEffect) -> bool {
        if self.changes().is_some() {
            return false;
        }
        let own_effect = self.probes.first().map(|probe| &probe.effect);
        self.slot == slot(effect)
            || own_effect.is_some_and(|own_effect| exclusions::are_incompatible(own_effect, effect))
    }

    /// Whether it excludes the effect that another candidate would add.
    pub(crate) fn excludes(&self, other: &Self) -> bool {
        let effect = |candidate: &Self| candidate.probes.first().map(|probe| probe.effect);
        let clash = || {
            let pair = effect(self).zip(effect(other));
            pair.is_some_and(|(one, other)| exclusions::are_incompatible(&one, &other))
        };
        self.changes().is_none() && (self.slot == other.slot || clash())
    }

    /// Several candidates as one, to compute their joint gain; no effect is built from it. `None` for an empty group.
    pub(crate) fn of_group(group: &[Self]) -> Option<Self> {
        let mut whole = group.first()?.clone();
        whole.probes = group.iter().flat_map(|one| one.probes.clone()).collect();
        Some(whole)
    }

    /// All parameters of an existing effect as probes.
    pub(crate) fn of_values(effect: &AnyEffect) -> Self {
        let probes =
            (0..effect.values().len()).map(|value| CandidateParameter { effect: *effect, value });
        Self {
            slot: slot(effect),
            joint: effect.joint(),
            probes: probes.collect(),
            settings: Vec::new(),
            mapping: ParameterMapping::Values,
        }
    }
}

/// A wave with this many cycles per revolution (prismatic joints: radians of phase per metre).
pub(crate) fn wave_candidate(arm: &Arm, joint: usize, cycles: f64) -> Option<Candidate> {
    let sine = wave(arm, joint, cycles, 1.0, 0.0)?;
    let cosine = wave(arm, joint, cycles, 1.0, FRAC_PI_2)?;
    let probes = [sine, cosine].map(|effect| CandidateParameter { effect, value: 0 }).to_vec();
    let slot = format!("wave {joint} {cycles}");
    let mapping = ParameterMapping::Wave { joint, cycles };
    Some(Candidate { slot, joint: Some(joint), probes, settings: Vec::new(), mapping })
}

fn wave(arm: &Arm, joint: usize, cycles: f64, amplitude: f64, phase: f64) -> Option<AnyEffect> {
    let given: &[(&str, &[f64])] =
        &[("amplitude", &[amplitude]), ("cycles", &[cycles]), ("phase", &[phase])];
    AnyEffect::build("transmission_error", arm, Some(joint), ParameterValues(given)).ok()
}

fn wobble(
    arm: &Arm,
    joint: usize,
    cycles: f64,
    amplitude: [f64; 2],
    phase: [f64; 2],
) -> Option<AnyEffect> {
    let given: &[(&str, &[f64])] =
        &[("amplitude", &amplitude), ("phase", &phase), ("cycles", &[cycles])];
    AnyEffect::build("axis_wobble", arm, Some(joint), ParameterValues(given)).ok()
}

/// Signals of the campaign besides joint positions.
#[derive(Clone, Copy, Debug, Default)]
struct AvailableSignals {
    masses: bool,
    wrench: bool,
    direction: bool,
    temperature: bool,
    longest_s: f64,
}

impl AvailableSignals {
    fn of(arm: &Arm, campaign: &Campaign) -> Self {
        let poses = &campaign.poses;
        let first = poses.first().map(|pose| pose.inputs.wrench_base);
        let celsius = |joint: usize| poses.iter().map(move |pose| pose.inputs.celsius(joint));
        let warms = |joint: usize| {
            let (low, high) = celsius(joint)
                .filter(|t| t.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
            high - low > 0.5
        };
        Self {
            masses: arm.bodies().next().is_some(),
            wrench: poses.iter().any(|pose| Some(pose.inputs.wrench_base) != first),
            direction: poses.iter().any(|pose| pose.inputs.direction.iter().any(|d| *d != 0.0)),
            temperature: (0..arm.count()).any(warms),
            longest_s: poses.iter().map(|pose| pose.inputs.time_s).fold(0.0, f64::max),
        }
    }

    fn has(&self, need: Need) -> bool {
        match need {
            Need::Direction => self.direction,
            Need::Masses => self.masses,
            Need::Wrench => self.wrench,
            Need::Temperature => self.temperature,
            Need::Time => self.longest_s > 0.0,
            Need::SpindleSpeed | Need::Velocity | Need::Acceleration => false,
        }
    }
}

/// Whether most poses are reached by a move of this joint shorter than the largest of [`REVERSALS`]: only such moves show a hysteresis that builds up
/// over a distance.
fn has_small_moves(campaign: &Campaign, joint: usize) -> bool {
    let is_small_move = |pose: &&crate::campaign::Pose| {
        let moved = (pose.inputs.q[joint] - pose.inputs.q_before[joint]).abs();
        pose.arrival == Arrival::FromPrevious && moved < REVERSALS[2]
    };
    campaign.poses.iter().filter(is_small_move).count() > campaign.poses.len() / 2
}

/// All effects that these data could show, except geometry, each at its trial values.
pub(crate) fn candidates(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let mut list = CandidateList::new(arm, campaign);
    for joint in 0..arm.count() {
        list.add_joint_effects(joint, campaign);
    }
    if list.signals.masses || list.signals.wrench {
        list.add_effect("base_compliance", None, &[("compliance", &[0.0])]);
    }
    if list.signals.masses {
        list.add_effect("gravity_tilt", None, &[("tilt", &[0.0; 2])]);
        list.candidates.extend(loads::payload(arm));
        list.candidates.extend(loads::springs(arm, campaign));
    }
    if list.signals.wrench {
        list.add_effect("tool_compliance", None, &[("compliance", &[0.0; 3])]);
    }
    list.candidates
}

pub(crate) struct CandidateList<'a> {
    arm: &'a Arm,
    signals: AvailableSignals,
    pub(crate) candidates: Vec<Candidate>,
}

impl<'a> CandidateList<'a> {
    pub(crate) fn new(arm: &'a Arm, campaign: &Campaign) -> Self {
        CandidateList { arm, signals: AvailableSignals::of(arm, campaign), candidates: Vec::new() }
    }

    fn add_joint_effects(&mut self, joint: usize, campaign: &Campaign) {
        let of_joint = Some(joint);
        self.add_effect("joint_ratio", of_joint, &[("ratio", &[0.0])]);
        for from in (0..joint).filter(|from| may_be_coupled(self.arm, *from, joint)) {
            let from = [(from + 1) as f64];
            self.add_effect(
                "joint_coupling",
                of_joint,
                &[("ratio", &[0.0]), ("from_joint", &from)],
            );
        }
        if self.signals.has(Need::Direction) {
            self.add_effect("backlash", of_joint, &[("width", &[0.0])]);
        }
        if has_small_moves(campaign, joint) && self.signals.has(Need::Direction) {
            for reversal in REVERSALS {
                self.add_effect(
                    "hysteresis",
                    of_joint,
                    &[("amplitude", &[0.0]), ("reversal", &[reversal])],
                );
            }
        }
        self.add_compliances(joint, campaign);
        self.add_waves(joint);
        self.add_thermal(joint);
    }

    /// Adds candidates for deflection under weight or external wrench.
    fn add_compliances(&mut self, joint: usize, campaign: &Campaign) {
        let of_joint = Some(joint);
        let sag = [0.0; 3 * JOINTS_MAX];
        let bodies = 3 * (self.arm.count() - joint);
        self.add_effect("gravity_sag", of_joint, &[("sag", &sag[..bodies])]);
        if !self.signals.masses {
            self.add_near_sags(joint, &sag[..bodies]);
        }
        if self.signals.wrench {
            self.add_effect("load_compliance", of_joint, &[("compliance", &[0.0])]);
        }
        if self.signals.wrench && self.signals.masses {
            // With only one of masses and wrench, it is equivalent to `joint_compliance`.
            self.add_effect("gravity_compliance", of_joint, &[("compliance", &[0.0])]);
        }
        if self.signals.masses || self.signals.wrench {
            self.add_effect("joint_compliance", of_joint, &[("compliance", &[0.0])]);
            self.add_effect("stiffness_hardening", of_joint, &[("cubic", &[0.0])]);
            self.add_effect("bearing_compliance", of_joint, &[("compliance", &[0.0])]);
        }
        if self.signals.masses {
            let most = loads::largest_load(self.arm, campaign, |loads| loads.torque(joint));
            for share in SOFT_ZONE_LOADS.iter().filter(|_| most > 0.0) {
                let torque = [share * most];
                self.add_effect("lost_motion", of_joint, &[("width", &[0.0]), ("torque", &torque)]);
            }
        }
    }

    /// Adds sags by the bodies next to the joint only: the light bodies farther out add parameters that few recordings determine. With known masses a
    /// compliance of the joint describes the same by one parameter.
    fn add_near_sags(&mut self, joint: usize, sag: &[f64]) {
        let given: &[(&str, &[f64])] = &[("sag", sag)];
        let built = AnyEffect::build("gravity_sag", self.arm, Some(joint), ParameterValues(given));
        let Ok(effect) = built else { return };
        for values in NEAR_BODIES.map(|bodies| 3 * bodies).into_iter().filter(|n| *n < sag.len()) {
            self.candidates.push(Candidate {
                slot: slot(&effect),
                joint: Some(joint),
                probes: (0..values).map(|value| CandidateParameter { effect, value }).collect(),
                settings: Vec::new(),
                mapping: ParameterMapping::Part,
            });
        }
    }

    fn add_waves(&mut self, joint: usize) {
        let unit = match self.arm.joints()[joint].kind {
            JointKind::Revolute => 1.0,
            JointKind::Prismatic => TAU,
        };
        for cycles in [unit, 2.0 * unit] {
            self.candidates.extend(wave_candidate(self.arm, joint, cycles));
            let wobble_at = |phase: f64| wobble(self.arm, joint, cycles, [1.0; 2], [phase; 2]);
            let (Some(sine), Some(cosine)) = (wobble_at(0.0), wobble_at(FRAC_PI_2)) else {
                continue;
            };
            let probes = [(sine, 0), (sine, 1), (cosine, 0), (cosine, 1)];
            self.candidates.push(Candidate {
                slot: format!("wobble {joint} {cycles}"),
                joint: Some(joint),
                probes: probes.map(|(effect, value)| CandidateParameter { effect, value }).to_vec(),
                settings: Vec::new(),
                mapping: ParameterMapping::Wobble { joint, cycles },
            });
        }
    }

    /// Adds an effect with all its linear parameters as probes; returns false if it cannot be built.
    pub(crate) fn add_effect(
        &mut self,
        kind: &str,
        joint: Option<usize>,
        given: &[(&str, &[f64])],
    ) -> bool {
        let Ok(effect) = AnyEffect::build(kind, self.arm, joint, ParameterValues(given)) else {
            return false;
        };
        let values = 0..effect.values().len();
        let linear = |value: &usize| {
            crate::hypothesis::parameter_key(&effect, *value)
                .is_some_and(|named| named.parameter.role == Role::Linear)
        };
        let probes =
            values.filter(linear).map(|value| CandidateParameter { effect, value }).collect();
        let entries = effect.spec().parameters.iter().filter(|p| p.role == Role::Setting);
        let number = |stem| given.iter().find(|(name, _)| *name == stem).map(|(_, x)| x.to_vec());
        let settings = entries.filter_map(|p| Some((p.stem, number(p.stem)?))).collect();
        let slot = slot(&effect);
        self.candidates.push(Candidate {
            slot,
            joint,
            probes,
            settings,
            mapping: ParameterMapping::Values,
        });
        true
    }
}

/// Whether the drive of `joint` may be routed through joint `from`: within the last three joints of an arm (gears of a wrist), and from the second
/// joint to the third (parallel rod).
pub(crate) fn may_be_coupled(arm: &Arm, from: usize, joint: usize) -> bool {
    (from + 3 >= arm.count() && from < joint) || (from == 1 && joint == 2)
}
