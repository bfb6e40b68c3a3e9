//! Tables of the page: findings, and their parameters with intervals.

use report::{Column, Table, significant};

use crate::drawings::{self, JointEffect};

use crate::result::{Alternative, Interval, Report, ReportedFinding, Value};

/// Shown where a value is not computed.
const NONE: &str = "–";

pub(crate) fn rms(rms: Option<f64>) -> String {
    rms.map_or(NONE.to_owned(), |rms| significant(rms, 3))
}

pub(crate) fn findings(report: &Report) -> Table {
    table(format!("Findings, {}", report.unit), &report.findings)
}

pub(crate) fn minor(report: &Report) -> Table {
    table(format!("Smaller effects, {}", report.unit), &report.minor)
}

pub(crate) fn candidates(report: &Report) -> Table {
    table(format!("Candidates, {}", report.unit), &report.candidates)
}

/// Effect of each finding on the measurement.
pub(crate) fn sizes(report: &Report) -> Vec<JointEffect> {
    let size = |reported: &ReportedFinding| {
        let size = reported.size.as_ref()?.rms;
        Some(JointEffect { effect: reported.effect.replace('_', " "), joint: reported.joint, size })
    };
    report.all_findings().filter_map(size).collect()
}

/// Effects of the findings, by effect and joint.
pub(crate) fn by_joint(report: &Report, joints: usize) -> Table {
    let caption = format!("Effect of each finding, RMS, {}", report.unit);
    drawings::effects_by_joint(&caption, joints, &sizes(report))
}

fn table(title: String, all: &[ReportedFinding]) -> Table {
    let heads = [
        "Effect",
        "Joint",
        "Confidence",
        "Size, rms",
        "largest",
        "Held-out error without it",
        "Alternatives",
    ];
    all.iter().fold(Table::new(title, heads.map(Column::new)), |table, reported| {
        let alternatives: Vec<String> =
            reported.alternatives.iter().map(Alternative::name).collect();
        table.row([
            reported.effect.replace('_', " ").into(),
            reported.joint.map_or("robot".to_owned(), |joint| joint.to_string()).into(),
            reported.confidence.map_or(NONE.to_owned(), |p| format!("{p:.2}")).into(),
            rms(reported.size.as_ref().map(|size| size.rms)).into(),
            rms(reported.size.as_ref().map(|size| size.max)).into(),
            rms(reported.heldout_rms_without).into(),
            alternatives.join(", ").into(),
        ])
    })
}

pub(crate) fn parameters(report: &Report) -> Table {
    let heads = ["Effect", "Joint", "Parameter", "Value", "95 % interval"];
    let mut table =
        Table::new("Parameters, in the units of the model file", heads.map(Column::new));
    for reported in report.all_findings() {
        for (key, value) in &reported.parameters {
            let row = |value: f64, ci: Interval, is_determined: bool| {
                let interval = match ci {
                    _ if !is_determined => "not determined".to_owned(),
                    Some([low, high]) => {
                        format!("{} to {}", significant(low, 4), significant(high, 4))
                    }
                    None => NONE.to_owned(),
                };
                (significant(value, 4), interval)
            };
            let all: Vec<(String, (String, String))> = match value {
                Value::One { value, ci95, determined } => {
                    vec![(key.clone(), row(*value, *ci95, *determined))]
                }
                Value::List { value, ci95, determined } => {
                    let rows = value.iter().zip(ci95).zip(determined);
                    let rows = rows.map(|((value, ci), determined)| row(*value, *ci, *determined));
                    (1..).map(|k| format!("{key} {k}")).zip(rows).collect()
                }
            };
            for (key, (value, interval)) in all {
                table = table.row([
                    reported.effect.replace('_', " ").into(),
                    reported.joint.map_or("robot".to_owned(), |joint| joint.to_string()).into(),
                    key.into(),
                    value.into(),
                    interval.into(),
                ]);
            }
        }
    }
    table
}
