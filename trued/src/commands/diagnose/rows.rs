//! A diagnosis as table rows, for batches: one row per domain, one per parameter of a finding.
//!
//! The numbers are those of `trued.diagnosis/1`, in the same units; no others are added.

use batch::{FindingParameter, Row, Subject};
use diagnosis_report::{Interval, Report, ReportedFinding, Value, summary};
use recording::series::{Channel, Recording};

/// Mean temperatures of recordings, °C.
pub(super) struct MeanTemperatures {
    ambient: Option<f64>,
    /// By joint.
    joints: Vec<Option<f64>>,
}

impl MeanTemperatures {
    /// Means over the recordings.
    pub(super) fn of(recordings: &[Recording]) -> Self {
        let joints = recordings.iter().map(Recording::joint_count).max().unwrap_or(0);
        Self {
            ambient: mean(recordings, Channel::Ambient),
            joints: (0..joints).map(|j| mean(recordings, Channel::JointTemperature(j))).collect(),
        }
    }

    /// Of a joint, from 1.
    fn of_joint(&self, joint: usize) -> Option<f64> {
        self.joints.get(joint.checked_sub(1)?).copied().flatten()
    }
}

/// The mean of a column over all rows with a value.
fn mean(recordings: &[Recording], channel: Channel) -> Option<f64> {
    let columns = recordings.iter().filter_map(|recording| recording.column(channel));
    let (sum, count) = columns
        .flatten()
        .filter(|value| !value.is_nan())
        .fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// The rows of each domain's report.
pub(super) fn of_reports(reports: &[Report], temperatures: &MeanTemperatures) -> Vec<Row> {
    reports.iter().flat_map(|report| of_report(report, temperatures)).collect()
}

fn of_report(report: &Report, temperatures: &MeanTemperatures) -> Vec<Row> {
    let domain = Row {
        subject: Subject::Recording,
        domain: Some(report.domain.to_owned()),
        verdict: Some(report.verdict.to_owned()),
        unit: Some(report.unit.to_owned()),
        samples: i64::try_from(report.samples).ok(),
        noise_rms: Some(report.noise_rms),
        error_before: report.heldout_rms_before,
        error_after: report.heldout_rms_after,
        ambient_c: temperatures.ambient,
        joint_c: None,
        finding: None,
        sentence: summary(report),
    };
    let claimed = report.all_findings().map(|reported| (reported, true));
    let all = claimed.chain(report.candidates.iter().map(|reported| (reported, false)));
    let findings = all.flat_map(|(reported, is_claimed)| parameters_of(reported, is_claimed));
    let finding = |(reported, fact): (&ReportedFinding, FindingParameter)| Row {
        subject: Subject::Finding,
        error_before: reported.heldout_rms_before,
        error_after: reported.heldout_rms_after,
        joint_c: reported.joint.and_then(|joint| temperatures.of_joint(joint)),
        finding: Some(fact),
        sentence: reported.says.clone(),
        ..domain.clone()
    };
    let findings: Vec<Row> = findings.map(finding).collect();
    std::iter::once(domain).chain(findings).collect()
}

/// One row per parameter of a finding; one row without a parameter if it has none.
fn parameters_of(
    reported: &ReportedFinding,
    is_claimed: bool,
) -> Vec<(&ReportedFinding, FindingParameter)> {
    let without_number = FindingParameter {
        effect: reported.effect.to_owned(),
        joint: reported.joint.and_then(|joint| i64::try_from(joint).ok()),
        change: reported.change.to_owned(),
        is_claimed,
        probability: reported.confidence,
        parameter: None,
        index: None,
        value: None,
        interval: None,
        size_rms: reported.size.as_ref().map(|size| size.rms),
        size_max: reported.size.as_ref().map(|size| size.max),
    };
    let number =
        |parameter: &str, index: Option<i64>, value: f64, interval: Interval| FindingParameter {
            parameter: Some(parameter.to_owned()),
            index,
            value: Some(value),
            interval,
            ..without_number.clone()
        };
    let of_parameter = |(name, value): (&String, &Value)| match value {
        Value::One { value, ci95, .. } => vec![number(name, None, *value, *ci95)],
        Value::List { value, ci95, .. } => (1..)
            .zip(value.iter().zip(ci95))
            .map(|(index, (value, interval))| number(name, Some(index), *value, *interval))
            .collect(),
    };
    let numbers: Vec<FindingParameter> =
        reported.parameters.iter().flat_map(of_parameter).collect();
    let all = if numbers.is_empty() { vec![without_number.clone()] } else { numbers };
    all.into_iter().map(|fact| (reported, fact)).collect()
}
