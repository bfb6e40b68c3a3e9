//! The torque side of `trued diagnose`: what the drives feel and the model does not know, as effects that a model file can hold.
//!
//! Promises: what acts in one recording alone (a payload of that day) is told and not written into the model. Never: a fit of its own.

use diagnosis::torque::{self, Diagnosis, Doubt, Finding, Stated};
use recording::model::{EffectEntry, Numbers, RobotModel, SiParameter};
use recording::series::{Channel, Recording};

/// What was found in the torques.
pub(super) struct Drives {
    pub(super) result: Result<Diagnosis, Doubt>,
    /// Names of the recordings, for findings of one of them.
    pub(super) recordings: Vec<String>,
}

/// Whether torque was recorded.
pub(super) fn are_recorded(recordings: &[Recording]) -> bool {
    torque::has_torque(recordings)
}

/// Whether anything was measured of where the tool or a link is.
pub(super) fn positions_are_recorded(recordings: &[Recording]) -> bool {
    recordings.iter().any(|recording| {
        recording.channels().any(|channel| {
            matches!(
                channel,
                Channel::Position(_)
                    | Channel::Target(..)
                    | Channel::Orientation(_)
                    | Channel::Link(_)
                    | Channel::Distance(_)
                    | Channel::TouchPlane
                    | Channel::TouchSphere
            )
        })
    })
}

impl Drives {
    pub(super) fn of(
        base: &RobotModel,
        recordings: &[Recording],
        band_hz: Option<f64>,
        seed: u64,
    ) -> Self {
        let stated: Vec<Stated> =
            base.file.effects.iter().filter_map(|entry| stated(base, entry)).collect();
        let arm = &base.physics.arm;
        let name = |recording: &Recording| {
            recording.file.file_name().map_or(String::new(), |n| n.to_string_lossy().into_owned())
        };
        Self {
            result: torque::diagnose(arm, &stated, recordings, band_hz, seed),
            recordings: recordings.iter().map(name).collect(),
        }
    }

    /// The model's effects with what was found.
    pub(super) fn written(&self, base: &RobotModel, effects: &[EffectEntry]) -> Vec<EffectEntry> {
        let mut all = effects.to_vec();
        let findings = self.result.iter().flat_map(|diagnosis| &diagnosis.findings);
        for finding in findings.filter(|finding| finding.recording.is_none()) {
            let Some(entry) = entry(base, finding) else { continue };
            let same = |known: &&mut EffectEntry| {
                finding.is_change
                    && known.kind == entry.kind
                    && known.joint == entry.joint
                    && known
                        .parameters
                        .iter()
                        .any(|p| entry.parameters.iter().any(|q| q.key == p.key))
            };
            match all.iter_mut().find(same) {
                Some(known) => add(known, &entry),
                None => all.push(entry),
            }
        }
        all
    }
}

/// Adds the difference that was found to the numbers that stand there.
fn add(known: &mut EffectEntry, found: &EffectEntry) {
    for parameter in &mut known.parameters {
        let Some(off) = found.parameters.iter().find(|p| p.key == parameter.key) else { continue };
        let off = off.value.as_slice();
        let sum = |(k, value): (usize, &f64)| value + off.get(k).copied().unwrap_or(0.0);
        parameter.value = match &parameter.value {
            Numbers::One(value) => Numbers::One(sum((0, value))),
            Numbers::List(list) => Numbers::List(list.iter().enumerate().map(sum).collect()),
        };
        parameter.sigma.clone_from(
            &found.parameters.iter().find(|p| p.key == parameter.key).and_then(|p| p.sigma.clone()),
        );
    }
}

/// A finding as an entry of a model file: keys with units, and standard uncertainties.
pub(super) fn entry(base: &RobotModel, finding: &Finding) -> Option<EffectEntry> {
    let parameters: Vec<SiParameter<'_>> = finding
        .numbers
        .iter()
        .map(|number| SiParameter {
            stem: number.stem,
            values: &number.values,
            sigma: Some(&number.sigma),
        })
        .collect();
    EffectEntry::from_si(&base.physics.arm, finding.kind, finding.joint, &parameters)
}

/// An effect of the model in SI, by stems.
fn stated(base: &RobotModel, entry: &EffectEntry) -> Option<Stated> {
    let numbers = entry.to_si(&base.physics.arm)?;
    let number = |(stem, values): &(&'static str, Vec<f64>)| {
        let value = values.first().copied()?;
        let given = entry.parameters.iter().find(|p| p.key.starts_with(stem))?;
        let own = given.value.as_slice().first().copied().filter(|own| *own != 0.0);
        let sigma = given.sigma.as_ref().and_then(|sigma| sigma.as_slice().first().copied());
        let si = own.map_or(1.0, |own| value / own);
        Some(((*stem).to_owned(), value, (sigma.unwrap_or(0.0) * si).abs()))
    };
    Some(Stated {
        kind: entry.kind.clone(),
        joint: entry.joint.map(|joint| joint - 1),
        numbers: numbers.iter().filter_map(number).collect(),
    })
}
