//! Torque domain of `trued diagnose`: unmodelled drive torques as effects of a model file.
//!
//! An effect found in one recording only (such as a payload) is reported, but not written into the model.

use std::borrow::Cow;

use diagnosis::progress::Listener;
use diagnosis::torque::{self, Diagnosis, DiagnosisError, Finding, RefittedParameter, StatedModel};
use recording::model::{EffectEntry, Numbers, Parameter, RobotModel, SiParameter};
use recording::series::{Channel, Recording};

use crate::error::Error;

/// Result of the torque diagnosis.
pub(crate) struct TorqueDiagnosis {
    pub(crate) result: Result<Diagnosis, DiagnosisError>,
    /// Names of the recordings, for findings of one of them.
    pub(crate) recordings: Vec<String>,
}

/// Whether any torque was recorded.
pub(crate) fn torques_are_recorded(recordings: &[Recording]) -> bool {
    torque::has_torque(recordings)
}

/// Whether any position of the tool or of a link was measured.
pub(crate) fn positions_are_recorded(recordings: &[Recording]) -> bool {
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

impl TorqueDiagnosis {
    /// Diagnoses the torques, if any were recorded. Recordings without positions are moved out of `recordings` to save memory, because no other
    /// domain needs them.
    pub(crate) fn diagnose_if_recorded(
        base: &RobotModel,
        recordings: &mut Vec<Recording>,
        band_hz: Option<f64>,
        seed: u64,
        listener: Listener<'_>,
    ) -> Result<Option<Self>, Error> {
        if !torques_are_recorded(recordings) {
            return Ok(None);
        }
        let recordings = if positions_are_recorded(recordings) {
            Cow::Borrowed(recordings.as_slice())
        } else {
            Cow::Owned(std::mem::take(recordings))
        };
        Self::diagnose(base, recordings, band_hz, seed, listener).map(Some)
    }

    fn diagnose(
        base: &RobotModel,
        recordings: Cow<'_, [Recording]>,
        band_hz: Option<f64>,
        seed: u64,
        listener: Listener<'_>,
    ) -> Result<Self, Error> {
        let name = |recording: &Recording| {
            recording.file.file_name().map_or(String::new(), |n| n.to_string_lossy().into_owned())
        };
        let model = base.with_drives().map_err(Error::input)?;
        let sigma: Vec<Vec<f64>> = base.sigma.iter().chain(&base.drives_sigma).cloned().collect();
        let stated = StatedModel { model: &model, sigma: &sigma, delay_s: delay_s(base) };
        let names = recordings.iter().map(name).collect();
        let result = torque::diagnose(&stated, recordings, band_hz, seed, listener);
        Ok(Self { result, recordings: names })
    }

    /// The model's effects with the findings, and its own refitted parameters.
    pub(crate) fn effects_with_findings(
        &self,
        base: &RobotModel,
        effects: &[EffectEntry],
    ) -> Vec<EffectEntry> {
        let refits = self.result.iter().flat_map(|diagnosis| &diagnosis.refits);
        let result = self.result.iter();
        let findings = result.flat_map(|one| one.findings.iter().chain(&one.candidates));
        with_findings(base, effects, refits, findings.filter(|finding| finding.recording.is_none()))
    }
}

/// A model's effects with the findings, and its own refitted parameters.
pub(crate) fn with_findings<'a>(
    base: &RobotModel,
    effects: &[EffectEntry],
    refits: impl Iterator<Item = &'a RefittedParameter>,
    findings: impl Iterator<Item = &'a Finding>,
) -> Vec<EffectEntry> {
    let mut all = effects.to_vec();
    refits.for_each(|refit| apply_refit(base, &mut all, refit));
    for finding in findings {
        let Some(entry) = file_entry(base, finding) else { continue };
        let same = |known: &&mut EffectEntry| {
            finding.is_change
                && known.kind == entry.kind
                && known.joint == entry.joint
                && known.parameters.iter().any(|p| entry.parameters.iter().any(|q| q.key == p.key))
        };
        match all.iter_mut().find(same) {
            Some(known) => add_differences(known, &entry),
            None => all.push(entry),
        }
    }
    all
}

/// Replaces a parameter of stated uncertainty by its fitted value.
fn apply_refit(base: &RobotModel, effects: &mut [EffectEntry], refit: &RefittedParameter) {
    let number = &refit.parameter;
    let one = SiParameter { stem: number.stem, values: &number.values, sigma: Some(&number.sigma) };
    let Some(change) = EffectEntry::from_si(&base.physics.arm, refit.kind, refit.joint, &[one])
    else {
        return;
    };
    let is_it = |known: &&mut EffectEntry| {
        let same = |p: &Parameter| change.parameters.iter().any(|q| q.key == p.key);
        known.kind == change.kind
            && known.joint == change.joint
            && known.parameters.iter().any(|p| p.sigma.is_some() && same(p))
    };
    if let Some(known) = effects.iter_mut().find(is_it) {
        add_differences(known, &change);
    }
}

/// Adds the fitted differences to the existing values. A difference of another shape than the parameter does not say to which of its numbers it belongs:
/// that parameter keeps its value and uncertainty, so that the file stays readable.
fn add_differences(known: &mut EffectEntry, found: &EffectEntry) {
    for parameter in &mut known.parameters {
        let has_shape_of_it = |p: &&Parameter| {
            let numbers = parameter.value.as_slice().len();
            let is_shaped = |list: &Numbers| list.as_slice().len() == numbers;
            is_shaped(&p.value) && p.sigma.as_ref().is_none_or(is_shaped)
        };
        let found = found.parameters.iter().find(|p| p.key == parameter.key);
        let Some(difference) = found.filter(has_shape_of_it) else {
            continue;
        };
        let sigma = difference.sigma.clone();
        let difference = difference.value.as_slice();
        let sum = |(k, value): (usize, &f64)| value + difference.get(k).copied().unwrap_or(0.0);
        parameter.value = match &parameter.value {
            Numbers::One(value) => Numbers::One(sum((0, value))),
            Numbers::List(list) => Numbers::List(list.iter().enumerate().map(sum).collect()),
        };
        parameter.sigma = sigma;
    }
}

/// A finding as an entry of a model file: keys with units, and standard uncertainties.
pub(crate) fn file_entry(base: &RobotModel, finding: &Finding) -> Option<EffectEntry> {
    let parameters: Vec<SiParameter<'_>> = finding
        .parameters
        .iter()
        .map(|number| SiParameter {
            stem: number.stem,
            values: &number.values,
            sigma: Some(&number.sigma),
        })
        .collect();
    EffectEntry::from_si(&base.physics.arm, finding.kind, finding.joint, &parameters)
}

/// Delay of recorded torques according to the model, s.
fn delay_s(base: &RobotModel) -> f64 {
    let delays = base.file.effects.iter().filter(|entry| entry.kind == "torque_delay");
    let values = delays.filter_map(|entry| entry.to_si(&base.physics.arm));
    values.flatten().flat_map(|(_, values)| values).sum()
}

#[cfg(test)]
mod tests {
    use diagnosis::torque::FittedParameter;
    use physics::effects::{CUTTING, DRIVES, SPECS};
    use physics::spec::Count;
    use recording::model::presets::preset;

    use super::*;

    fn refit(kind: &'static str, joint: Option<usize>, stem: &'static str) -> RefittedParameter {
        let parameter = FittedParameter { stem, values: vec![0.5], sigma: vec![0.25] };
        RefittedParameter { kind, joint, parameter }
    }

    /// A parameter of that many numbers, each with an uncertainty.
    fn stated(key: String, numbers: usize) -> Parameter {
        let list = |value: f64| Numbers::List(vec![value; numbers]);
        Parameter { key, value: list(2.0), sigma: Some(list(1.0)) }
    }

    #[test]
    fn no_refit_of_one_number_changes_the_shape_of_any_vector_parameter() {
        let base = preset("kuka-kr240").expect("a preset").model().expect("a model");
        let arm = &base.physics.arm;
        let mut vectors = 0;
        for spec in SPECS.iter().chain(DRIVES).chain(CUTTING) {
            for one in spec.parameters.iter().filter(|one| one.count != Count::One) {
                for joint in [None, Some(1)] {
                    let si = SiParameter { stem: one.stem, values: &[1.0; 3], sigma: None };
                    let Some(entry) = EffectEntry::from_si(arm, spec.kind, joint, &[si]) else {
                        continue;
                    };
                    let key = entry.parameters[0].key.clone();
                    let known = EffectEntry { parameters: vec![stated(key, 3)], ..entry };
                    let mut effects = vec![known];
                    apply_refit(&base, &mut effects, &refit(spec.kind, joint, one.stem));
                    let after = &effects[0].parameters[0];
                    let sigma = after.sigma.as_ref().map_or(0, |sigma| sigma.as_slice().len());
                    assert_eq!((after.value.as_slice().len(), sigma), (3, 3), "{}", spec.kind);
                    vectors += 1;
                }
            }
        }
        assert!(vectors > 20, "{vectors} vector parameters were tried");
    }

    #[test]
    fn a_diagnosed_moment_of_three_numbers_can_be_diagnosed_again() {
        let base = preset("kuka-kr240").expect("a preset").model().expect("a model");
        let arm = &base.physics.arm;
        let moment = SiParameter {
            stem: "first_moment",
            values: &[43.7, 1.5, -2.8],
            sigma: Some(&[3.5, 1.2, 1.5]),
        };
        let mut file = base.file.clone();
        file.effects.extend(EffectEntry::from_si(arm, "gravity_torque", Some(5), &[moment]));
        let first = RobotModel::parse("the first diagnosis", &file.to_toml()).expect("readable");
        let refit = refit("gravity_torque", Some(5), "first_moment");
        file.effects =
            with_findings(&first, &first.file.effects, std::iter::once(&refit), std::iter::empty());
        let second = RobotModel::parse("the second diagnosis", &file.to_toml());
        let second = second.map_err(|faults| faults.to_string()).expect("readable");
        assert_eq!(second.file.effects, first.file.effects, "a number without a place was added");
    }
}
