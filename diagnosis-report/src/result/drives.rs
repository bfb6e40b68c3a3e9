//! Output of a torque diagnosis: the same keys as for positions, in N m or N, with validation joint by joint.
//!
//! Sentences state cause and size. Only fitted values are reported.

use std::collections::BTreeMap;

use diagnosis::torque::{AlternativeEffect, Diagnosis, Finding};
use physics::JointKind;
use recording::model::{EffectEntry, Numbers, RobotModel};
use report::significant;

use super::{
    Alternative, FindingLocation, JointErrors, NINETY_FIVE, Report, ReportedFinding, Size,
    Unexplained, UntestedEffect, Value,
};
use crate::drives::{TorqueDiagnosis, file_entry};

impl Report {
    /// The report of the drive torques of `base`.
    pub(crate) fn of_drives(
        base: &RobotModel,
        drives: &TorqueDiagnosis,
        notes: &[String],
        seed: u64,
    ) -> Self {
        let empty = Self { notes: notes.to_vec(), ..Self::empty("torque", "Nm", seed) };
        let diagnosis = match &drives.result {
            Ok(diagnosis) => diagnosis,
            Err(doubt) => return empty.with_reason(doubt.to_string()),
        };
        let unit = if diagnosis.all_prismatic { "N" } else { "Nm" };
        let (findings, candidates) = (diagnosis.findings.iter(), diagnosis.candidates.iter());
        Self {
            verdict: diagnosis.verdict.name(),
            unit,
            samples: diagnosis.rows,
            signal_rms: diagnosis.signal,
            band_Hz: Some([0.0, diagnosis.band_hz]),
            noise_rms: diagnosis.noise,
            heldout_rms_before: Some(diagnosis.heldout[0]),
            heldout_rms_after: Some(diagnosis.heldout[1]),
            heldout: diagnosis.heldout_description.clone(),
            findings: findings.map(|one| reported_finding(base, drives, one)).collect(),
            candidates: candidates.map(|one| reported_finding(base, drives, one)).collect(),
            next_experiment: next_experiment(diagnosis),
            not_tested: diagnosis
                .not_tested
                .iter()
                .map(|(effect, joint, why)| UntestedEffect {
                    effect,
                    joint: joint.map(|joint| joint + 1),
                    why: (*why).to_owned(),
                })
                .collect(),
            unexplained: unexplained(diagnosis),
            joints: diagnosis.by_joint.iter().map(JointErrors::of).collect(),
            notes: notes.iter().chain(&diagnosis.notes).cloned().collect(),
            ..empty
        }
    }
}

fn unexplained(diagnosis: &Diagnosis) -> Option<Unexplained> {
    let law = diagnosis.unexplained.as_ref()?;
    let joint = diagnosis.by_joint.iter().find(|one| one.joint == law.joint)?;
    let left = (law.heldout_squares[1] / law.heldout_squares[0].max(f64::MIN_POSITIVE)).sqrt();
    Some(Unexplained {
        rms: joint.after,
        depends_on: law.depends_on.clone(),
        heldout_rms_after: joint.after * left,
        says: format!(
            "An unmodelled torque of joint {}, depending on {}, remains.",
            law.joint + 1,
            law.depends_on.join(" and ")
        ),
    })
}

fn reported_finding(
    base: &RobotModel,
    drives: &TorqueDiagnosis,
    finding: &Finding,
) -> ReportedFinding {
    let joint = finding.joint.map(|joint| joint + 1);
    let entry = file_entry(base, finding);
    let channels = match finding.joint {
        Some(joint) => vec![format!("tau{}", joint + 1)],
        None => (1..=base.physics.arm.count()).map(|joint| format!("tau{joint}")).collect(),
    };
    let mut condition = condition(finding.kind).to_owned();
    if let Some(name) = finding.recording.and_then(|k| drives.recordings.get(k)) {
        condition = format!("{condition}, in {name} only");
    }
    ReportedFinding {
        effect: finding.kind,
        joint,
        change: if finding.is_change { "revised" } else { "new" },
        confidence: Some(finding.confidence),
        parameters: entry.as_ref().map_or(BTreeMap::new(), parameters),
        heldout_rms_before: Some(finding.heldout[0]),
        heldout_rms_after: Some(finding.heldout[1]),
        heldout_rms_without: Some(finding.heldout_without),
        size: Some(Size::of(finding.size, 1.0)),
        group: None,
        location: FindingLocation {
            joint,
            channels,
            condition,
            intervals_s: Vec::new(),
            frequency_Hz: None,
        },
        alternatives: alternatives(finding),
        says: sentence(base, drives, finding, entry.as_ref()),
    }
}

/// The alternatives to a finding in torques or forces.
pub(crate) fn alternatives(finding: &Finding) -> Vec<Alternative> {
    let alternative = |rival: &AlternativeEffect| Alternative {
        effect: rival.kind,
        joint: rival.joint.map(|joint| joint + 1),
        confidence: Some(rival.confidence),
        is_indistinguishable: rival.is_indistinguishable,
    };
    Alternative::with_remainder(
        finding.confidence,
        finding.alternatives.iter().map(alternative).collect(),
    )
}

pub(crate) fn parameters(entry: &EffectEntry) -> BTreeMap<String, Value> {
    let ci = |value: f64, sigma: Option<f64>| {
        sigma.map(|sigma| [value - NINETY_FIVE * sigma, value + NINETY_FIVE * sigma])
    };
    let one = |parameter: &recording::model::Parameter| {
        let sigma = parameter.sigma.as_ref().map_or(&[][..], Numbers::as_slice);
        let sigma_of = |k: usize| sigma.get(k).copied();
        let value = match &parameter.value {
            Numbers::One(value) => Value::one(*value, ci(*value, sigma_of(0))),
            Numbers::List(list) => {
                let ci95 = list.iter().enumerate().map(|(k, value)| ci(*value, sigma_of(k)));
                Value::list(list.clone(), ci95.collect())
            }
        };
        (parameter.key.clone(), value)
    };
    entry.parameters.iter().map(one).collect()
}

/// Condition under which an effect's torque occurs, for users.
fn condition(kind: &str) -> &'static str {
    match kind {
        "coulomb_friction" => "changes sign with the direction of motion",
        "viscous_friction" => "increases with speed",
        "stribeck_friction" => "occurs at low speed after each reversal",
        "friction_asymmetry" => "differs by direction",
        "load_friction" => "increases with the load, opposing the motion",
        "friction_temperature" => "increases with speed, less when warm",
        "inertia" => "increases with acceleration",
        "gravity_torque" | "payload" => "follows gravity and acceleration of the payload",
        "torque_ripple" => "periodic in the joint angle",
        "spring" | "spring_hardening" => "increases with distance from a rest position",
        "hysteresis" => "builds up over a distance after each reversal",
        "drive_gain" => "proportional to the torque itself",
        "torque_delay" => "follows the torque's rate of change",
        _ => "over the whole recording",
    }
}

/// A finding with the parts of its sentence.
struct Sentence<'a> {
    finding: &'a Finding,
    entry: Option<&'a EffectEntry>,
    joint: String,
    slides: bool,
}

impl Sentence<'_> {
    /// A value in file units, to three digits.
    fn value_text(&self, stem: &str) -> String {
        let number = || {
            let parameter = self.entry?.parameters.iter().find(|p| p.key.starts_with(stem))?;
            parameter.value.as_slice().first().copied()
        };
        number().map_or("some".to_owned(), |value| significant(value, 3))
    }

    /// A value in SI.
    fn si_value(&self, stem: &str) -> f64 {
        let found = self.finding.parameters.iter().find(|number| number.stem == stem);
        found.and_then(|number| number.values.first()).copied().unwrap_or(0.0)
    }

    fn unit(&self) -> &'static str {
        if self.slides { "N" } else { "Nm" }
    }

    /// Sentence for friction effects; `None` for other effects.
    fn friction_sentence(&self) -> Option<String> {
        let (joint, unit) = (&self.joint, self.unit());
        Some(match self.finding.kind {
            "coulomb_friction" => {
                format!(
                    "{joint} has Coulomb friction of {} {unit} that is missing in the model.",
                    self.value_text("level")
                )
            }
            "viscous_friction" => format!(
                "{joint} has viscous friction of {} {unit} s per {}.",
                self.value_text("coefficient"),
                if self.slides { "m" } else { "rad" }
            ),
            "stribeck_friction" => format!(
                "{joint} has {} {unit} of additional friction at low speed (Stribeck effect), vanishing above {} {}.",
                self.value_text("level"),
                self.value_text("stribeck_speed"),
                if self.slides { "m/s" } else { "rad/s" }
            ),
            "friction_asymmetry" => {
                let has = |stem| self.finding.parameters.iter().any(|number| number.stem == stem);
                let level = format!("by {} {unit}", self.value_text("offset"));
                let slope =
                    format!("by {} {unit} per unit of speed", self.value_text("coefficient"));
                let form = match (has("offset"), has("coefficient")) {
                    (true, true) => format!("{level} and {slope}"),
                    (true, false) => level,
                    _ => slope,
                };
                format!("{joint}'s friction differs by direction, {form}.")
            }
            "load_friction" => {
                let share = significant(100.0 * self.si_value("coefficient"), 3);
                format!("{joint}'s friction increases with its load: {share} % of it.")
            }
            "hysteresis" => format!(
                "{joint}'s friction has a hysteresis loop of {} {unit} after each reversal.",
                self.value_text("amplitude")
            ),
            _ => return None,
        })
    }

    /// Sentence for masses, drives and springs. `only`: the recording in which the effect acts, if only one.
    fn other_sentence(&self, only: Option<&String>) -> String {
        let (joint, unit) = (&self.joint, self.unit());
        match self.finding.kind {
            "inertia" => {
                let (stem, unit) = if self.slides { ("mass", "kg") } else { ("inertia", "kg m²") };
                format!(
                    "{joint} has an additional inertia of {} {unit} that is missing in the model.",
                    self.value_text(stem)
                )
            }
            "payload" => {
                let only = only.map_or(String::new(), |name| format!(" in {name}"));
                format!(
                    "The arm carries a mass of {} kg that is missing in the model{only}.",
                    self.value_text("mass")
                )
            }
            "torque_ripple" => format!(
                "{joint} has a torque ripple of {} {unit}, {} cycles per {}.",
                self.value_text("amplitude"),
                self.value_text("cycles"),
                if self.slides { "m" } else { "revolution" }
            ),
            "spring" => format!(
                "A spring of {} {unit} per {} acts on {}.",
                self.value_text("stiffness"),
                if self.slides { "m" } else { "rad" },
                joint.to_lowercase()
            ),
            "drive_gain" => format!(
                "{joint}'s drive torque is {} % {} than stated.",
                significant(100.0 * self.si_value("gain").abs(), 2),
                if self.si_value("gain") > 0.0 { "less" } else { "more" }
            ),
            "torque_delay" => {
                let late_ms = 1e3 * self.si_value("delay");
                let which = if late_ms >= 0.0 {
                    "Torque is recorded later than motion"
                } else {
                    "Motion is recorded later than torque"
                };
                format!("{which}, by {} ms.", significant(late_ms.abs(), 2))
            }
            other => format!("{joint}: {}.", other.replace('_', " ")),
        }
    }
}

/// Cause and size of a finding as a sentence.
fn sentence(
    base: &RobotModel,
    drives: &TorqueDiagnosis,
    finding: &Finding,
    entry: Option<&EffectEntry>,
) -> String {
    let kind = |joint: usize| base.physics.arm.joints()[joint].kind;
    let joint = finding.joint.map_or("The arm".to_owned(), |joint| format!("Joint {}", joint + 1));
    let slides = finding.joint.is_some_and(|joint| kind(joint) == JointKind::Prismatic);
    let sentence = Sentence { finding, entry, joint, slides };
    let only = finding.recording.and_then(|k| drives.recordings.get(k));
    sentence.friction_sentence().unwrap_or_else(|| sentence.other_sentence(only))
}

/// The experiment that would resolve open questions.
fn next_experiment(diagnosis: &Diagnosis) -> Option<String> {
    let open = diagnosis
        .findings
        .iter()
        .find(|one| one.alternatives.iter().any(|rival| rival.is_indistinguishable));
    if let Some(one) = open {
        let part = one.joint.map_or("the arm".to_owned(), |joint| format!("joint {}", joint + 1));
        return Some(match one.kind {
            "friction_asymmetry" | "viscous_friction" => format!(
                "Move {part} back and forth at five constant speeds from 10 % to 100 % of its maximum speed, equal in both directions."
            ),
            "coulomb_friction" | "stribeck_friction" | "hysteresis" | "load_friction" => format!(
                "Move {part} slowly through twenty reversals of a degree to ten degrees, in two poses of different load."
            ),
            "payload" | "drive_gain" | "gravity_torque" | "inertia" => {
                "Weigh the payload, or repeat the motion with a known mass at the flange."
                    .to_owned()
            }
            _ => format!("Repeat the motion of {part} at half and at double the speed."),
        });
    }
    let weighed = diagnosis.findings.iter().any(|one| one.kind == "payload");
    weighed.then(|| "Weigh the payload: torques determine a mass only as accurately as the motor constants are known.".to_owned())
}
